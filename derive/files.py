"""Files are written beside and renamed into place, all or none, so that a full disk or an interruption loses nothing."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path


def write_files(contents: Mapping[Path, str | bytes]) -> None:
    """Write all files whole, or leave all that was there; an OSError names the file that was asked for."""
    made: list[tuple[str, Path]] = []
    try:
        for path, content in contents.items():
            handle, name = new_file(path.parent, path)
            made.append((name, path))
            write_whole(handle, content.encode("utf-8") if isinstance(content, str) else content, path)
        for path in contents:
            refuse_folder(path)
        for name, path in made:
            os.replace(name, path)
    except BaseException:
        for name, _ in made:
            Path(name).unlink(missing_ok=True)
        raise


def refuse_folder(path: Path) -> None:
    """Refuse a folder that stands where a file is to be written."""
    if path.is_dir():
        raise IsADirectoryError(None, "found a folder where a file was expected", str(path))


def check_file(path: Path) -> None:
    """Refuse a file that cannot be written, before any work is done for it."""
    refuse_folder(path)
    check_folder(path.parent)


def check_folder(folder: Path) -> None:
    """Refuse a folder that cannot be made or written to, before any work is done for it; nothing is left there."""
    there = next(one for one in (folder.absolute(), *folder.absolute().parents) if one.exists())
    if not there.is_dir():
        raise NotADirectoryError(None, "found a file where a folder was expected", str(there))
    handle, name = new_file(there, folder)
    os.close(handle)
    os.unlink(name)


def new_file(folder: Path, asked: Path) -> tuple[int, str]:
    """Return handle and name of a new file in a folder, which is made; an OSError names what was asked for."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return tempfile.mkstemp(dir=folder, prefix=".")
    except FileExistsError as mistake:
        raise NotADirectoryError(mistake.errno, "found a file where a folder was expected", mistake.filename) from None
    except OSError as mistake:
        raise OSError(mistake.errno, mistake.strerror, str(asked)) from None


def write_whole(handle: int, content: bytes, asked: Path) -> None:
    """Write a new file to the disk, with the permissions of any other new file."""
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(handle)
            mask = os.umask(0)
            os.umask(mask)
            os.fchmod(handle, 0o666 & ~mask)
    except OSError as mistake:
        raise OSError(mistake.errno, mistake.strerror, str(asked)) from None
