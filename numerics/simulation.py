"""A motion and its fields as named arrays, and as the bytes of an NPZ or NetCDF file."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import netcdf_file

from numerics.coefficients import evaluate
from numerics.ellipse import ellipse_of
from numerics.motion import Scene, Shapes, fast_phase, motion_of, shapes_of
from numerics.precision import EvaluationError

FORMATS = ("npz", "nc")
LARGEST_ARRAY = 2**27
"""Numbers in one array; more is refused."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """Where the fields are wanted: times, equally spaced from 0 or in the logarithm, and places along s."""

    times: int = 401
    places: int = 51
    logarithmic: bool = False
    order: str = "1"

    def __post_init__(self) -> None:
        for name, value in (("points", self.times), ("places", self.places)):
            if value < 2:
                raise EvaluationError(f"{name}: found {value}; expected at least 2")
        if 3 * self.times * self.places > LARGEST_ARRAY:
            raise EvaluationError(f"points: found {self.times} times and {self.places} places; expected fewer than {LARGEST_ARRAY // 3} values a field")


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """An array with the names of its axes."""

    axes: tuple[str, ...]
    values: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Dataset:
    """Named arrays with named axes and attributes."""

    variables: Mapping[str, Variable]
    attributes: Mapping[str, Any]

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.variables[name].values

    def __repr__(self) -> str:
        lines = [f"{self.attributes['problem']} at mu = {self.attributes['mu']:g}"]
        return "\n".join([*lines, *(f"  {name}({', '.join(one.axes)}) {one.values.shape}" for name, one in self.variables.items())])

    def as_bytes(self, form: str) -> bytes:
        """Return the content of a file: `npz` or `nc`."""
        return {"npz": self.npz, "nc": self.netcdf}[form]()

    def npz(self) -> bytes:
        """Return an NPZ archive: the arrays, and `attributes` and `axes` as JSON text."""
        memory = io.BytesIO()
        texts = {"attributes": json.dumps(dict(self.attributes)), "axes": json.dumps({name: one.axes for name, one in self.variables.items()})}
        arrays: dict[str, Any] = {**{name: one.values for name, one in self.variables.items()}, **{name: np.array(text) for name, text in texts.items()}}
        np.savez_compressed(memory, **arrays)
        return memory.getvalue()

    def netcdf(self) -> bytes:
        """Return a NetCDF file (classic format, 64-bit offsets)."""
        memory = io.BytesIO()
        file = netcdf_file(memory, "w", version=2)
        for name, one in self.variables.items():
            for axis, length in zip(one.axes, one.values.shape, strict=True):
                if axis not in file.dimensions:
                    file.createDimension(axis, length)
            file.createVariable(name, "d", one.axes)[...] = one.values
        for name, value in self.attributes.items():
            setattr(file, name, np.array([value]) if isinstance(value, float) else value if isinstance(value, int) else str(value))
        file.flush()
        content = memory.getvalue()
        file.fp = io.BytesIO()  # the variables hold no reference to the file: close what is left quietly
        file.close()
        return content


def times_of(until: float, sampling: Sampling) -> NDArray[np.float64]:
    """Return the times: from 0 to `until`; logarithmic ones start at 0 and then at a millionth of a millionth of it, or at 1 for long times."""
    if not sampling.logarithmic:
        return np.linspace(0, until, sampling.times)
    return np.concatenate([[0.0], np.geomspace(min(1.0, until) * 1e-3, until, sampling.times - 1)])


def simulate(emitted: str | Path | Mapping[str, Any], scene: Scene, sampling: Sampling | None = None) -> Dataset:
    """Return the motion from an initial amplitude and the fields of the statement along it.

    Parameters
    ----------
    scene
        Initial amplitude A, mu and final time, in the original variables: dA/dt = gamma mu A + ...

    Returns
    -------
    Dataset
        `time`, `place`, `amplitude_re`, `amplitude_im`, and `field_NAME` for each field, Cartesian; the ellipse of a complex vector.

    Raises
    ------
    EvaluationError
        The scene does not fit the problem, or the motion is not bounded.
    """
    sampling = sampling or Sampling()
    motion, _ = motion_of(emitted, scene)
    result = evaluate(emitted, digits=30)
    times = times_of(scene.until, sampling)
    amplitude = motion.amplitude(times)
    shapes = shapes_of(emitted, result, scene.mu, sampling.order, sampling.places)
    fields = shapes.at(amplitude, fast_phase(result.threshold.frequency, times))
    vector = ("across",) if shapes.vector else ()
    threshold = result.threshold
    variables = {
        "time": Variable(axes=("time",), values=times),
        **({"place": Variable(axes=("place",), values=shapes.places)} if shapes.spatial else {}),
        "amplitude_re": Variable(axes=("time", *vector), values=amplitude.real),
        "amplitude_im": Variable(axes=("time", *vector), values=amplitude.imag),
        **(ellipse_variables(amplitude) if shapes.vector and threshold.frequency else {}),
        **({"frame": Variable(axes=("frame_vector", "component"), values=shapes.frame)} if shapes.vector else {}),
    }
    variables.update(field_variables(shapes, fields))
    attributes = {
        "problem": result.problem, "kind": threshold.kind, "multiplicity": threshold.multiplicity, "threshold": threshold.control, "mu": scene.mu,
        "control": float(threshold.control) + scene.mu, "frequency": threshold.frequency or "0", "order": sampling.order,
        "amplitude": "u = base + A(t) phi exp(i omega t) + c.c." if threshold.frequency else "u = base + A(t) phi, A real",
        "coefficients": json.dumps({one.monomial: [one.value.re, one.value.im] for one in result.coefficients}),
        "phase_error": 4e-15 * (1 + scene.until * abs(complex(result["mu*A"].value) * scene.mu)),  # of the slow phases at the end, in radians
    }
    return Dataset(variables=variables, attributes=attributes)


def field_variables(shapes: Shapes, fields: Mapping[str, NDArray[np.float64]]) -> dict[str, Variable]:
    """Return fields against time and place under the names that they have in a file."""
    variables: dict[str, Variable] = {}
    for name, values in fields.items():
        values = values if shapes.spatial else values[:, 0]
        axes = ("time", *(("place",) if shapes.spatial else ()), *(("component",) if any(one == name and kind for one, kind in shapes.unknowns) else ()))
        title = f"field_{re.sub(r'[^0-9A-Za-z_]', '_', name)}"
        while title in variables:
            title += "_"
        variables[title] = Variable(axes=axes, values=values)
    return variables


def ellipse_variables(amplitude: NDArray[np.complex128]) -> dict[str, Variable]:
    """Return the ellipse of the normalised field at its place, to leading order, against time."""
    ellipse = ellipse_of(amplitude)
    return {f"ellipse_{name}": Variable(axes=("time",), values=np.asarray(getattr(ellipse, name), dtype=float)) for name in ("semi_major", "semi_minor", "orientation", "sense")}


def parse_amplitude(text: str) -> tuple[complex, ...]:
    """Return the components of an amplitude written as 0.03,0.005i or 0.03+0.01i.

    Examples
    --------
    >>> parse_amplitude("0.03, 5e-3i")
    ((0.03+0j), 0.005j)
    """
    components = []
    for part in text.split(","):
        written = part.replace(" ", "").replace("i", "j")
        try:
            components.append(complex(written))
        except ValueError:
            raise EvaluationError(f"initial: found {part.strip()!r}; expected numbers such as 0.03 or 0.01-0.005i, separated by commas") from None
    return tuple(components)
