"""`generated/` is what the program emits now, byte for byte, for any PYTHONHASHSEED."""

import os
import subprocess
import sys

import pytest
from conftest import ROOT, derivation_of

from derive.latex import document
from derive.problem import bundled_names


@pytest.mark.parametrize("name", bundled_names())
def test_generated_files_are_what_is_emitted_now(name):
    derivation = derivation_of(name)
    assert (ROOT / "generated" / f"{name}.py").read_text() == derivation.emit()
    assert (ROOT / "generated" / f"{name}.tex").read_text() == document(derivation)


def test_the_text_does_not_depend_on_the_hash_seed():
    """This process has a seed of its own; another one has 4242."""
    environment = {**os.environ, "PYTHONHASHSEED": "4242"}
    command = [sys.executable, "-m", "derive.cli", "derive", "follower_force", "--check", "--out", str(ROOT / "generated")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=ROOT)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
