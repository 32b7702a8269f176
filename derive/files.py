"""Files are written beside and renamed into place, so that a full disk or an interruption loses nothing."""

from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path


def check_writable(path: Path) -> None:
    """Say before long work what would keep a file from being written after it; nothing is made."""
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "found a folder where a file was expected", str(path))
    folder = next(parent for parent in path.absolute().parents if parent.exists())
    if not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "found a file where a folder was expected", str(folder))
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole, or leave what was there; an OSError names the file that was asked for."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=".")
    except FileExistsError as mistake:
        raise NotADirectoryError(mistake.errno, "found a file where a folder was expected", mistake.filename) from None
    except OSError as mistake:
        raise OSError(mistake.errno, mistake.strerror, str(path)) from None
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(name, 0o666 & ~mask)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def write_text(path: Path, content: str) -> None:
    """Write a text file whole, or leave what was there."""
    write_bytes(path, content.encode("utf-8"))
