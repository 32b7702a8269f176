"""The command: contract, exit status, one line for a mistake."""

import json
import os
import subprocess
import sys

import pytest
from click.testing import CliRunner

from derive.cli import main


def run(*arguments):
    return CliRunner().invoke(main, list(arguments))


def test_coefficients_as_json():
    done = run("coefficients", "follower_force", "--digits", "20", "--json")
    assert done.exit_code == 0
    data = json.loads(done.stdout)
    assert data["problem"] == "follower_force" and data["digits"] == 20 and data["certified"] is False
    assert data["threshold"]["kind"] == "hopf" and data["threshold"]["multiplicity"] == 2
    assert data["threshold"]["control"].startswith("37.695430840318577883")
    assert [one["name"] for one in data["coefficients"]] == ["alpha", "beta", "gamma"]
    assert set(data["coefficients"][0]) == {"name", "monomial", "re", "im", "error"}
    assert set(data["seconds"]) == {"derive", "threshold", "coefficients"}


@pytest.mark.parametrize("arguments", [
    ("coefficients", "no_such_model"), ("coefficients", "van_der_pol", "--digits", "0"), ("coefficients", "van_der_pol", "--digits", "many"),
    ("coefficients", "van_der_pol", "--rout", "closed"), ("derive",), ("latex", "van_der_pol", "--order", "7"), ("coefficients", "swift_hohenberg", "--route", "closed"),
    ("coefficients", "van_der_pol", "--certify", "--route", "quadrature"),
])
def test_a_mistake_is_one_line_and_status_2(arguments):
    done = run(*arguments)
    assert done.exit_code == 2
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1 and done.stderr.startswith("fredholm: ")


@pytest.mark.parametrize(("folder", "expected"), [("taken", "found a file where a folder was expected"), ("/proc/no_such", "No such file or directory")])
def test_a_folder_that_cannot_be_written_is_named(tmp_path, folder, expected):
    (tmp_path / "taken").write_text("mine")
    done = run("derive", "van_der_pol", "--out", str(tmp_path / folder))
    assert done.exit_code == 2 and done.stdout == "" and len(done.stderr.splitlines()) == 1 and expected in done.stderr
    assert (tmp_path / "taken").read_text() == "mine" and [path.name for path in tmp_path.iterdir()] == ["taken"]


@pytest.mark.parametrize("cause", ["an interruption", "a folder in the way"])
def test_files_are_written_all_or_none(tmp_path, monkeypatch, cause):
    folder = tmp_path / "there"
    folder.mkdir()
    (folder / "van_der_pol.py").write_text("before")
    written = []

    def interrupted(handle, content, asked):
        os.close(handle)
        written.append(asked)
        if asked.suffix == ".tex":
            raise KeyboardInterrupt

    if cause == "an interruption":
        monkeypatch.setattr("derive.files.write_whole", interrupted)
    else:
        (folder / "van_der_pol.tex").mkdir()
    done = run("derive", "van_der_pol", "--out", str(folder))
    assert done.exit_code == (130 if written else 2) and done.stdout == "" and len(done.stderr.strip().splitlines()) == 1
    assert "nothing that was there before is changed" in done.stderr if written else f"{folder / 'van_der_pol.tex'}: found a folder" in done.stderr
    assert (folder / "van_der_pol.py").read_text() == "before" and len(list(folder.iterdir())) == (1 if written else 2)


def test_a_name_too_long_for_a_file_is_refused_as_any_other():
    done = run("coefficients", "x" * 5000)
    assert done.exit_code == 2 and "found no such file and no such model" in done.stderr


def test_a_closed_standard_output_is_a_mistake_in_one_line():
    command = [sys.executable, "-c", "import sys; sys.stdout = None; from derive.cli import main; main(['list'])"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and done.stdout == "" and done.stderr.startswith("fredholm: found standard output closed")


@pytest.mark.parametrize("arguments", [("list",), ("latex", "van_der_pol"), ("coefficients", "van_der_pol", "--json"), ("derive", "van_der_pol", "--check")])
def test_a_closed_pipe_ends_the_command_quietly(arguments):
    read, write = os.pipe()
    os.close(read)
    with open(write, "wb") as pipe:
        done = subprocess.run([sys.executable, "-m", "derive.cli", *arguments], stdout=pipe, stderr=subprocess.PIPE, text=True, check=False)
    assert done.stderr == "" and done.returncode == (0 if arguments[0] == "derive" else 1)  # a check without a difference prints nothing


NOISY = """import os, sys
print("by print")
os.system("echo by a program")
os.write(1, b"by a file descriptor\\n")
sys.__stdout__.write("by the stream\\n")
"""


@pytest.mark.parametrize("ending", ["from derive.models.van_der_pol import problem", "raise SystemExit(3)"])
def test_what_a_problem_file_writes_leaves_standard_output_alone(tmp_path, ending):
    path = tmp_path / "noisy.py"
    path.write_text(NOISY + ending + "\n")
    done = subprocess.run([sys.executable, "-m", "derive.cli", "coefficients", str(path), "--json"], capture_output=True, text=True, check=False)
    if ending.startswith("raise"):
        assert done.returncode == 2 and done.stdout == "" and done.stderr.splitlines()[-1].startswith(f"fredholm: {path}, line 6: SystemExit")
    else:
        assert done.returncode == 0 and json.loads(done.stdout)["problem"] == "van_der_pol"
        assert sorted(done.stderr.splitlines()) == ["by a file descriptor", "by a program", "by print", "by the stream"]


def test_check_and_list():
    assert run("check", "follower_force").exit_code == 0
    assert [line.split()[0] for line in run("list").stdout.splitlines()] == ["follower_force", "follower_force_planar", "heavy_column", "swift_hohenberg", "van_der_pol"]


def test_derive_writes_and_check_shows_a_difference(tmp_path):
    folder = str(tmp_path / "out")
    assert run("derive", "van_der_pol", "--out", folder).exit_code == 0
    assert run("derive", "van_der_pol", "--out", folder, "--check").exit_code == 0
    path = tmp_path / "out" / "van_der_pol.py"
    path.write_text(path.read_text().replace("mu*A", "mu*B"))
    done = run("derive", "van_der_pol", "--out", folder, "--check")
    assert done.exit_code == 1 and "mu*B" in done.stdout


@pytest.mark.parametrize("part", ["statement", "orders", "adjoint", "solvability", "amplitude", "all"])
def test_latex_of_every_part(part):
    for target in ("follower_force", "van_der_pol"):
        done = run("latex", target, "--part", part)
        assert done.exit_code == 0
        assert done.stdout.count("\\begin{aligned}") == done.stdout.count("\\end{aligned}") > 0
        assert done.stdout.count("\\left") == done.stdout.count("\\right") - done.stdout.count("\\rightarrow")
