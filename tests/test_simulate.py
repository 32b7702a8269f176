"""`fredholm simulate`: what the file holds, and a mistake in one line."""

import io
import json
import tempfile

import numpy as np
import pytest
from click.testing import CliRunner
from conftest import PROBLEMS, ROOT
from scipy.io import netcdf_file

from derive.cli import main
from numerics.motion import Scene
from numerics.simulation import Sampling
from numerics.simulation import simulate as run

FILAMENT = ROOT / "generated" / "follower_force.py"


def simulate(target, out, *arguments, initial="0.03,0.005i", mu="0.5", until="6"):
    return CliRunner().invoke(main, ["simulate", str(target), "--initial", initial, "--mu", mu, "--until", until, "--out", str(out), *arguments])


def test_npz_and_netcdf_hold_the_same_named_arrays():
    data = run(FILAMENT, Scene(initial=(0.03, 0.005j), mu=0.5, until=6.0), Sampling(times=41, places=9))
    with np.load(io.BytesIO(data.as_bytes("npz"))) as file:
        arrays = {name: file[name] for name in file}
    attributes, axes = (json.loads(arrays.pop(name).item()) for name in ("attributes", "axes"))
    assert axes["field_M"] == ["time", "place", "component"] and arrays["field_M"].shape == (41, 9, 3)
    assert attributes["problem"] == "follower_force" and attributes["control"] == pytest.approx(38.19543084031858, abs=1e-12)
    with netcdf_file(io.BytesIO(data.as_bytes("nc")), mmap=False) as file:
        assert set(file.variables) == set(arrays)
        for name, values in arrays.items():
            assert np.array_equal(file.variables[name][:], values) and list(file.variables[name].dimensions) == axes[name]
        assert float(file.mu) == 0.5 and file.frequency.decode().startswith("191.2586357")


def test_the_fields_meet_what_the_statement_says():
    """To order 1 the tangent has unit length up to mu^(3/2), the clamped end stays, and the tip carries the follower force."""
    data = run(FILAMENT, Scene(initial=(0.003, 0.001j), mu=0.01, until=0.1), Sampling(times=31))
    t, r, force = data["field_t"], data["field_r"], data["field_F"]
    assert np.abs((t**2).sum(-1) - 1).max() < 3e-7
    assert np.abs(r[:, 0]).max() < 1e-14
    assert np.abs(force[:, -1] + data.attributes["control"] * t[:, -1]).max() < 3e-4
    assert r[0, -1, :2] == pytest.approx([0.006, 0], abs=1e-12)  # A is half the peak


@pytest.mark.parametrize(("target", "initial", "shape"), [
    ("van_der_pol", "0.1+0.05i", (11,)), (PROBLEMS / "vec_pitch.py", "0.1,0.2", (11, 3)), (PROBLEMS / "fisher.py", "0.1", (11, 5)),
])
def test_every_kind_is_simulated(tmp_path, target, initial, shape):
    done = simulate(target, tmp_path / "a.npz", "--points", "11", "--places", "5", "--spacing", "log", initial=initial, until="3", mu="0.1")
    assert done.exit_code == 0
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]
    with np.load(tmp_path / "a.npz") as file:
        assert next(file[name].shape for name in file if name.startswith("field_")) == shape


def test_no_motion_stays_at_the_base_state_for_ever(tmp_path):
    assert simulate("van_der_pol", tmp_path / "a.npz", initial="0", until="1e9").exit_code == 0
    with np.load(tmp_path / "a.npz") as file:
        assert not file["field_x"].any()


@pytest.mark.parametrize(("changes", "says"), [
    ({"initial": "0.03"}, "expected two"), ({"initial": "0.03,x"}, "found 'x'"), ({"initial": ""}, "found ''"), ({"initial": "nan,0"}, "not finite"), ({"mu": "inf"}, "mu"),
    ({"mu": "a"}, "--mu"), ({"until": "-1"}, "until"), ({"until": "nan"}, "until"), ({"out": "a.txt"}, ".npz or .nc"), ({"extra": ("--points", "1")}, "points"),
    ({"extra": ("--places", "900000000")}, "points"), ({"extra": ("--order", "2")}, "--order"), ({"target": PROBLEMS / "fisher.py", "initial": "0.1i"}, "real"),
    ({"target": PROBLEMS / "fisher.py", "initial": "-0.1", "until": "100"}, "grows without bound"),
])
def test_a_mistake_is_one_line_and_nothing_is_written(tmp_path, changes, says):
    values = {"target": PROBLEMS / "isotropic_vdp.py", "initial": "0.03,0", "mu": "0.5", "until": "6", "out": "a.npz", "extra": (), **changes}
    done = simulate(values["target"], tmp_path / values["out"], *values["extra"], initial=values["initial"], mu=values["mu"], until=values["until"])
    assert done.exit_code == 2 and done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1 and done.stderr.startswith("fredholm: ") and says in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_user_may_call_his_symbols_as_the_emitted_functions_are_called(write_problem, tmp_path):
    target = write_problem("""
from sympy import symbols
from derive import Problem, field
t = symbols("t", real=True)
mode, base, frame = symbols("mode base frame")
x = field("phi~'", t)
problem = Problem(name="names", time=t, control=base, control_range=(-1, 1), fields=(x,), parameters={mode: 2, frame: 3},
    equations=(x.diff(t, 2) - (base - mode * x**2) * x.diff(t) + frame * x,), base_state={x: 0}, normalisation=(x, None))
""")
    assert simulate(target, tmp_path / "a.nc", initial="0.1").exit_code == 0


def refused_in(name, make=tempfile.mkstemp):
    """Permissions do not bind the superuser: refuse new files in one folder."""
    def mkstemp(dir, prefix):
        if dir.name == name:
            raise PermissionError(13, "Permission denied", str(dir))
        return make(dir=dir, prefix=prefix)

    return mkstemp


@pytest.mark.parametrize("extra", [(), ("--full",)])
@pytest.mark.parametrize("out", ["taken/a.npz", "folder.npz", "locked/a.npz"])
def test_what_cannot_be_written_is_said_before_the_work(tmp_path, monkeypatch, extra, out):
    (tmp_path / "taken").write_text("mine")
    (tmp_path / "folder.npz").mkdir()
    (tmp_path / "locked").mkdir()
    monkeypatch.setattr("derive.files.tempfile.mkstemp", refused_in("locked"))
    monkeypatch.setattr("derive.cli.derived", None)  # no work
    monkeypatch.setattr("derive.cli.coefficients_of", None)
    done = simulate("van_der_pol", tmp_path / out, *extra)
    assert done.exit_code == 2 and done.stdout == "" and len(done.stderr.splitlines()) == 1 and str(tmp_path) in done.stderr
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["folder.npz", "locked", "taken"] and (tmp_path / "taken").read_text() == "mine"


@pytest.mark.parametrize(("extra", "where"), [((), "numerics.simulation.simulate"), (("--full",), "numerics.full_simulation.simulate_fields")])
def test_an_interruption_leaves_what_was_there(tmp_path, monkeypatch, extra, where):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    (tmp_path / "a.npz").write_text("mine")
    monkeypatch.setattr(where, interrupted)
    done = simulate("van_der_pol", tmp_path / "a.npz", *extra, initial="0.1")
    assert done.exit_code == 130 and done.stdout == "" and len(done.stderr.strip().splitlines()) == 1 and "interrupted" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"] and (tmp_path / "a.npz").read_text() == "mine"
