"""`fredholm simulate`: what the file holds, and a mistake in one line."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from conftest import PROBLEMS
from scipy.io import netcdf_file

from derive.cli import main


def simulate(target, out, *arguments, initial="0.03,0.005i", mu="0.5", until="6"):
    return CliRunner().invoke(main, ["simulate", str(target), "--initial", initial, "--mu", mu, "--until", until, "--out", str(out), *arguments])


def test_npz_and_netcdf_hold_the_same_named_arrays(tmp_path):
    for name in ("a.npz", "a.nc"):
        assert simulate("follower_force", tmp_path / name, "--points", "41", "--places", "9").exit_code == 0
    with np.load(tmp_path / "a.npz") as file:
        arrays = {name: file[name] for name in file}
    attributes, axes = (json.loads(arrays.pop(name).item()) for name in ("attributes", "axes"))
    assert axes["field_M"] == ["time", "place", "component"] and arrays["field_M"].shape == (41, 9, 3)
    assert attributes["problem"] == "follower_force" and attributes["control"] == pytest.approx(38.19543084031858, abs=1e-12)
    with netcdf_file(tmp_path / "a.nc", mmap=False) as file:
        assert set(file.variables) == set(arrays)
        for name, values in arrays.items():
            assert np.array_equal(file.variables[name][:], values) and list(file.variables[name].dimensions) == axes[name]
        assert float(file.mu) == 0.5 and file.frequency.decode().startswith("191.2586357")
    assert {path.name for path in tmp_path.iterdir()} == {"a.npz", "a.nc"}


def test_the_fields_meet_what_the_statement_says(tmp_path):
    """To order 1 the tangent has unit length up to mu^(3/2), the clamped end stays, and the tip carries the follower force."""
    assert simulate("follower_force", tmp_path / "a.npz", "--points", "31", mu="0.01", initial="0.003,0.001i", until="0.1").exit_code == 0
    with np.load(tmp_path / "a.npz") as file:
        t, r, force, control = file["field_t"], file["field_r"], file["field_F"], json.loads(file["attributes"].item())["control"]
    assert np.abs((t**2).sum(-1) - 1).max() < 3e-7
    assert np.abs(r[:, 0]).max() < 1e-14
    assert np.abs(force[:, -1] + control * t[:, -1]).max() < 3e-4
    assert np.abs(r[:, -1, :2] - 2 * np.array([0.003, 0])).min() < 1e-3


@pytest.mark.parametrize(("target", "initial", "shape"), [
    ("van_der_pol", "0.1+0.05i", (11,)), ("swift_hohenberg", "-0.1", (11, 5)), (PROBLEMS / "vec_pitch.py", "0.1,0.2", (11, 3)), (PROBLEMS / "fisher.py", "0.1", (11, 5)),
])
def test_every_kind_is_simulated(tmp_path, target, initial, shape):
    done = simulate(target, tmp_path / "a.npz", "--points", "11", "--places", "5", "--spacing", "log", initial=initial, until="3", mu="0.1")
    assert done.exit_code == 0
    with np.load(tmp_path / "a.npz") as file:
        assert next(file[name].shape for name in file if name.startswith("field_")) == shape


def test_no_motion_stays_at_the_base_state_for_ever(tmp_path):
    assert simulate("van_der_pol", tmp_path / "a.npz", initial="0", until="1e9").exit_code == 0
    with np.load(tmp_path / "a.npz") as file:
        assert not file["field_x"].any()


@pytest.mark.parametrize(("changes", "says"), [
    ({"initial": "0.03"}, "expected two"), ({"initial": "0.03,x"}, "found 'x'"), ({"initial": ""}, "found ''"), ({"initial": "nan,0"}, "not finite"), ({"mu": "inf"}, "mu"),
    ({"mu": "a"}, "--mu"), ({"until": "-1"}, "until"), ({"until": "nan"}, "until"), ({"out": "a.txt"}, ".npz or .nc"), ({"extra": ("--points", "1")}, "points"),
    ({"extra": ("--places", "900000000")}, "points"), ({"extra": ("--order", "2")}, "--order"), ({"target": "swift_hohenberg", "initial": "0.1i"}, "real"),
    ({"target": PROBLEMS / "fisher.py", "initial": "-0.1", "until": "100"}, "grows without bound"),
])
def test_a_mistake_is_one_line_and_nothing_is_written(tmp_path, changes, says):
    values = {"target": PROBLEMS / "isotropic_vdp.py", "initial": "0.03,0", "mu": "0.5", "until": "6", "out": "a.npz", "extra": (), **changes}
    done = simulate(values["target"], tmp_path / values["out"], *values["extra"], initial=values["initial"], mu=values["mu"], until=values["until"])
    assert done.exit_code == 2 and done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1 and done.stderr.startswith("fredholm: ") and says in done.stderr
    assert not list(tmp_path.iterdir())
