"""What is not of the class is refused: exit status 2, one line that says why, no standard output, no traceback."""

import tomllib

import pytest
from click.testing import CliRunner
from conftest import ROOT

from derive.cli import main

CASES = tomllib.loads((ROOT / "tests" / "refused.toml").read_text(encoding="utf-8"))
PRELUDE = CASES.pop("prelude")


@pytest.mark.parametrize("name", sorted(CASES))
def test_refused_with_one_clear_line(name, write_problem):
    path = write_problem(PRELUDE + CASES[name]["text"])
    done = CliRunner().invoke(main, ["coefficients", path, "--digits", "20", "--json"])
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1
    assert CASES[name]["says"] in done.stderr
