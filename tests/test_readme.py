"""The README is true: its commands run, its problem derives."""

import re

from click.testing import CliRunner
from conftest import ROOT

from derive.cli import main

README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.S)


def test_the_problem_of_the_readme_derives(tmp_path):
    path = tmp_path / "problem.py"
    path.write_text(blocks("python")[0], encoding="utf-8")
    done = CliRunner().invoke(main, ["coefficients", str(path)])
    assert done.exit_code == 0 and "A**3 = -0.75000" in done.stdout


def test_the_python_of_the_readme_runs(capsys):
    exec(compile(blocks("python")[1], "README", "exec"), {})
    assert capsys.readouterr().out.startswith("-451.037653968103567")


def test_the_main_job_of_the_readme_runs(tmp_path):
    command = next(block for block in blocks("sh") if "reproduce" in block)
    words = command.split("&&")[1].split()
    assert words[0] == "fredholm"
    assert CliRunner().invoke(main, [*words[1:], "--out", str(tmp_path / "out"), "--quick"]).exit_code == 0  # in full: tests/test_report.py, slow


def test_every_command_of_the_readme_exists_with_its_options():
    table = re.findall(r"^\| `fredholm (\w+)([^`]*)`", README, flags=re.M)
    assert {name for name, _ in table} == set(main.commands)
    for name, arguments in table:
        known = {option for parameter in main.commands[name].params for option in parameter.opts}
        assert set(re.findall(r"--[\w-]+", arguments)) <= known, name
