"""Computed values beside published ones, with the digits that agree."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from html import escape
from importlib import resources
from typing import Any

from numerics.coefficients import Result
from numerics.spectrum import first_complex_pair
from numerics.states import evaluate_states


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One published number beside the computed one; it agrees within half a unit of its last printed digit."""

    name: str
    printed: str
    computed: str
    label: str
    agrees: bool
    digits: int
    caveat: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """All published numbers of a problem, and the misprints found in its source."""

    problem: str
    lines: tuple[Line, ...]
    misprints: tuple[Mapping[str, str], ...]

    @property
    def agrees(self) -> bool:
        """Tell whether every number agrees."""
        return all(line.agrees for line in self.lines)

    def text(self) -> str:
        """Return the comparison as lines of text."""
        out = [f"{self.problem}: {sum(line.agrees for line in self.lines)} of {len(self.lines)} published values agree"]
        for line in self.lines:
            verdict = f"agrees, {line.digits} digits" if line.agrees else "DISAGREES"
            out.append(f"  {line.name:32} printed {line.printed:14} computed {line.computed:24} {verdict}  [{line.label}]" + (f"  ({line.caveat})" if line.caveat else ""))
        for misprint in self.misprints:
            out.append(f"  misprint in {misprint['label']}: printed {misprint['printed']}; right is {misprint['right']}: {misprint['why']}")
        return "\n".join(out)

    def __repr__(self) -> str:
        return self.text()

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr><th>{escape(line.name)}</th><td>{line.printed}</td><td>{line.computed}</td><td>{'agrees' if line.agrees else 'DISAGREES'}</td><td>{escape(line.label)}</td></tr>" for line in self.lines)
        return f"<table><tr><th></th><th>printed</th><th>computed</th><th></th><th>source</th></tr>{rows}</table>"

    def as_dict(self) -> dict[str, Any]:
        """Return the comparison as plain data."""
        return {"problem": self.problem, "agrees": self.agrees,
                "values": [{name: getattr(line, name) for name in ("name", "printed", "computed", "label", "agrees", "digits")} for line in self.lines],
                "misprints": [dict(one) for one in self.misprints]}


def reference_of(name: str) -> dict[str, Any] | None:
    """Return the published values of a problem, or None."""
    path = resources.files("numerics") / "references" / f"{name}.toml"
    return tomllib.loads(path.read_text(encoding="utf-8")) if path.is_file() else None


def further_values(reference: Mapping[str, Any], emitted: str, states: str) -> dict[str, str]:
    """Return what is computed of the published numbers of states (at mu = 1) and of the spectrum, by name.

    Parameters
    ----------
    emitted, states
        The texts that `Derivation.emit` and `States.emit` return.
    """
    names = {entry["name"] for entry in reference.get("state", ())}
    found: dict[str, str] = {}
    if "first_complex_pair.control" in names:
        found["first_complex_pair.control"] = first_complex_pair(emitted).control
    if any(not name.startswith("first_complex_pair") for name in names):
        for state in evaluate_states(emitted, states).states:
            found |= {f"{state.name}.{key}": value for key, value in state.as_dict().items() if isinstance(value, str)}
    return found


def compare(result: Result, reference: Mapping[str, Any], further: Mapping[str, str] | None = None) -> Comparison:
    """Return the comparison of a result with its published values; with `further_values` also of states and spectrum."""
    found: dict[str, tuple[str, str]] = {"threshold.control": (result.threshold.control, "0")}
    if result.threshold.frequency is not None:
        found["threshold.frequency"] = (result.threshold.frequency, "0")
    for one in result.coefficients:
        found[one.name] = (one.value.re, one.value.im)
    lines = []
    for entry in reference.get("value", ()):
        computed = found.get(entry["name"])
        for part, key in ((0, "printed_re"), (1, "printed_im")):
            if key in entry:
                label = entry["name"] if "printed_im" not in entry else f"{entry['name']} ({'real' if part == 0 else 'imaginary'} part)"
                lines.append(line_of(label, entry[key], computed[part] if computed else "not computed", entry["label"], entry.get("caveat", "")))
    for entry in reference.get("state", ()) if further is not None else ():
        lines.append(line_of(entry["name"], entry["printed"], (further or {}).get(entry["name"], "not computed"), entry["label"], entry.get("caveat", "")))
    return Comparison(problem=result.problem, lines=tuple(lines), misprints=tuple(reference.get("misprint", ())))


def line_of(name: str, printed: str, computed: str, label: str, caveat: str) -> Line:
    """Return one line of a comparison."""
    agrees, digits = False, 0
    if computed != "not computed":
        value, there = Decimal(printed), Decimal(computed)
        exponent = value.as_tuple().exponent
        unit = Decimal(1).scaleb(int(exponent))
        exact = bool(caveat) and "exact" in caveat
        agrees = abs(value - there) <= (unit / 2 if not exact else Decimal("1e-12"))
        digits = len(value.as_tuple().digits)
    return Line(name=name, printed=printed, computed=computed[:24], label=label, agrees=agrees, digits=digits, caveat=caveat)
