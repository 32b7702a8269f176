r"""The linear problem with its adjoint, the solvability condition and the amplitude equation in LaTeX."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

from sympy import Add, Expr, I, Integer, Symbol, fraction, lcm, together
from sympy import latex as sympy_latex

from derive.amplitude import Coefficient
from derive.expand import expand
from derive.notation import Notation, added, array, joined, monomial_text, primes
from derive.operator import FirstOrderOperator
from derive.restricted import RestrictedProblem, ScalarAdjoint, conjugate, restricted_problem, scalar_adjoint
from derive.statement import DerivationError

if TYPE_CHECKING:
    from derive.derivation import Derivation

COMMA = r",\, "


class SolvabilityWriter:
    """Writes the linear problem, its adjoint, the solvability condition and the amplitude equation, each as the rows of a display."""

    def __init__(self, derivation: Derivation, notation: Notation) -> None:
        self.derivation = derivation
        self.notation = notation
        self.formulation = derivation.expansion.formulation
        self.reduction = derivation.reduction
        self.ends = tuple(sympy_latex(end) for end in self.formulation.interval or ())

    @cached_property
    def restricted(self) -> RestrictedProblem | None:
        """L, S and T in the fields of the statement, where the rows are as many as the fields."""
        if self.formulation.interval is None:
            return None
        try:
            return restricted_problem(self.derivation.expansion, 1 if self.notation.vector else 0, self.reduction.mode.growth)
        except DerivationError:
            return None

    @cached_property
    def scalar(self) -> ScalarAdjoint | None:
        """The adjoint solution by one scalar function, where there is one."""
        operator = self.reduction.mode.operator
        if not isinstance(operator, FirstOrderOperator):
            return None
        rows = self.restricted.rows if self.restricted is not None else tuple(self.reduction.solvability.interior)
        return scalar_adjoint(operator, self.reduction.solvability, self.reduction.functions, rows)

    def adjoint(self) -> list[str]:
        """Return L, S, T, their adjoints, the boundary form, and the homogeneous solutions (labels ``matrix operators`` to ``adjoint bcs``)."""
        notation, reduction = self.notation, self.reduction
        operator = reduction.mode.operator
        if not isinstance(operator, FirstOrderOperator):
            matrix = notation.matrix(operator.matrix)
            phi, zeta = (COMMA.join(notation.text(symbol) for symbol in group) for group in (reduction.mode.phi, reduction.solvability.zeta))
            return [rf"\mathsf{{M}} &= {matrix}, \quad \mathsf{{M}} \left[{phi}\right]^{{T}} = \vec{{0}}", rf"\left[{zeta}\right] \mathsf{{M}} &= \vec{{0}}"]
        restricted = self.restricted
        rows = self.restricted_rows(restricted) if restricted is not None else []
        rows += self.mode_rows(operator)
        scalar = self.scalar
        if scalar is not None:
            return rows + self.scalar_rows(scalar, restricted)
        adj = reduction.solvability.adjoint
        assert adj is not None
        zeta = COMMA.join(notation.text(symbol) for symbol in reduction.solvability.zeta)
        rows.append(rf"\frac{{\mathrm{{d}} \vec{{z}}}}{{\mathrm{{d}} {notation.space}}} &= {notation.matrix(adj.matrix)} \vec{{z}}, \quad \vec{{z}} = \left[{zeta}\right]^{{T}}")
        for end, lines in zip(self.ends, (adj.left, adj.right), strict=True):
            rows.append(rf"{notation.matrix(lines)} \vec{{z}} &= \vec{{0}}{notation.at(end)}")
        return rows

    def mode_rows(self, operator: FirstOrderOperator) -> list[str]:
        """Return the equation of the critical mode and the fields in terms of it (labels ``ode``, ``ode bcs``, ``general linear``)."""
        notation, phi = self.notation, self.reduction.mode.phi
        n = operator.size
        rows = []
        s = notation.space
        if operator.scalar:
            value = expand(sum((operator.matrix[-1][j] * phi[j] for j in range(n)), Integer(0)))
            mode = self.notation.symbol["mode"]
            rows.append(f"{mode}{primes(n)} &= {joined(notation.sum(value), 6)}")
        else:
            names = COMMA.join(notation.text(symbol) for symbol in phi)
            rows.append(rf"\frac{{\mathrm{{d}} \vec{{y}}}}{{\mathrm{{d}} {s}}} &= {notation.matrix(operator.matrix)} \vec{{y}}, \quad \vec{{y}} = \left[{names}\right]^{{T}}")
        for end, boundary in zip(self.ends, (operator.left, operator.right), strict=True):
            for line in boundary.matrix:
                rows.append(f"{joined(notation.combination(line, phi), 6)} &= 0{notation.at(end)}")
        return rows

    def entry(self, coefficients: Mapping[int, Expr], parity: int) -> str:
        """Return an entry of L: a differential operator, with n x where it joins a true vector and a pseudovector."""
        s = self.notation.space
        turn = rf"{self.notation.axis} \times" if parity < 0 else ""
        terms = []
        for k, c in sorted(coefficients.items(), reverse=True):
            slope = rf"\frac{{\mathrm{{d}}{f'^{{{k}}}' if k > 1 else ''}}}{{\mathrm{{d}} {s}{f'^{{{k}}}' if k > 1 else ''}}}" if k else ""
            body = " ".join(part for part in (turn, slope) if part)
            value = expand(c / I) if parity < 0 else c
            terms += [self.notation.product(part, body) for part in (Add.make_args(value) if not body else (value,))]
        return " ".join(added(terms)) if terms else "0"

    def restricted_rows(self, problem: RestrictedProblem) -> list[str]:
        """Return L, S, T and their adjoints, and J."""
        notation = self.notation
        size = range(len(problem.fields))
        fields = [notation.field(index) if notation.vector else notation.component(index) for index in problem.fields]
        rows = [rf"\vec{{\psi}} &= \left[{COMMA.join(fields)}\right]^{{T}}, \quad \mathsf{{L}} \vec{{\psi}} = \vec{{f}}, \quad \mathsf{{S}} \vec{{\psi}} = \vec{{g}}, \quad \mathsf{{T}} \vec{{\psi}} = \vec{{h}}"]
        direct = [[self.entry(problem.operator[i][j], problem.row_parity[i] * problem.parity[j]) for j in size] for i in size]
        rows.append(rf"\mathsf{{L}} &= {array(direct)}")

        def boundary(name: str, lines: Sequence[tuple[Mapping[tuple[int, int], Expr], int]], parities: Sequence[int], place: str) -> str:
            table = []
            for line, parity in lines:
                table.append([self.entry({k: c for (j, k), c in line.items() if j == column}, parity * parities[column]) for column in size])
            return rf"\mathsf{{{name}}} &= {array(table)}{notation.at(place)}"

        rows.append(boundary("S", list(zip(problem.left, problem.left_parity, strict=True)), problem.parity, self.ends[0]))
        rows.append(boundary("T", list(zip(problem.right, problem.right_parity, strict=True)), problem.parity, self.ends[1]))
        dual = problem.adjoint()
        rows.append(rf"\mathsf{{L}}^{{\dagger}} &= {array([[self.entry(dual[i][j], problem.parity[i] * problem.row_parity[j]) for j in size] for i in size])}")
        left, right = self.formulation.interval or (Integer(0), Integer(0))
        try:
            rows.append(boundary(r"S}^{\dagger", self.cleared(problem.adjoint_rows("left", left)), problem.row_parity, self.ends[0]))
            rows.append(boundary(r"T}^{\dagger", self.cleared(problem.adjoint_rows("right", right)), problem.row_parity, self.ends[1]))
        except DerivationError:
            pass  # a boundary row beyond the boundary form: the adjoint rows below are those of the first-order system
        terms = []
        for ((j, k), (i, m)), c in problem.boundary_form().items():
            parity = problem.parity[j] * problem.row_parity[i]
            turn = rf"{notation.axis} \times " if parity < 0 else ""
            one = rf"{fields[j]}^{{(1)*}}" + (rf"{{}}{chr(39) * k}" if k else "")
            other = rf"{turn}\vec{{\psi}}^{{(2)}}_{{{i + 1}}}" + (rf"{{}}{chr(39) * m}" if m else "")
            terms.append(notation.product(expand(c / I) if parity < 0 else c, rf"{other} \cdot {one}" if notation.vector else f"{other} {one}"))
        rows.append(rf"J(\vec{{\psi}}^{{(1)}}, \vec{{\psi}}^{{(2)}}) &= \left[{joined(added(terms), 9)}\right]_{{{self.ends[0]}}}^{{{self.ends[1]}}}")
        return rows

    def cleared(self, lines: Sequence[tuple[dict[tuple[int, int], Expr], int]]) -> list[tuple[dict[tuple[int, int], Expr], int]]:
        """Return adjoint rows without denominators."""
        result = []
        for line, parity in lines:
            factor: Expr = Integer(1)
            for value in line.values():
                factor = lcm(factor, fraction(together(value))[1])
            result.append(({key: expand((value * factor).cancel()) for key, value in line.items()}, parity))
        return result

    def adjoint_function(self, order: int, star: bool = False) -> str:
        """Return the adjoint eigenfunction or a derivative."""
        return self.notation.symbol["adjoint"] + primes(order, star)

    def scalar_rows(self, scalar: ScalarAdjoint, restricted: RestrictedProblem | None) -> list[str]:
        """Return the adjoint solution by its scalar function, its equation and its boundary conditions."""
        notation = self.notation
        rows = []
        n = len(scalar.equation)

        def combination(line: Sequence[Expr]) -> list[str]:
            return added([notation.product(c, self.adjoint_function(k)) for k, c in enumerate(line) if c != 0])

        if restricted is not None:
            entries = []
            for row, parity in zip(restricted.rows, restricted.row_parity, strict=True):
                odd = parity < 0 and notation.vector
                line = [expand(c / I) if odd else c for c in scalar.multipliers.get(row, ())]
                body = (rf"{notation.axis} \times \mathbf{{b}}" if odd else r"\mathbf{b}") if notation.vector else ""
                terms = [notation.product(c, f"{self.adjoint_function(k)} {body}".strip()) for k, c in enumerate(line) if c != 0]
                entries.append(" ".join(added(terms)) or "0")
            rows.append(rf"\vec{{\zeta}} &= \left[{COMMA.join(entries)}\right]^{{T}}")
        rows.append(f"{self.adjoint_function(n)} &= {joined(combination(scalar.equation), 6)}")
        for end, lines in zip(self.ends, (scalar.left, scalar.right), strict=True):
            rows += [rf"{joined(combination(line), 6)} &= 0{notation.at(end)}" for line in lines]
        return rows

    def multiplier(self, expression: Expr, scalar: ScalarAdjoint | None) -> Expr:
        """Return a multiplier over the conjugate adjoint eigenfunction and its derivatives."""
        if scalar is None:
            return expression
        table = {}
        for symbol, line in scalar.substitution.items():
            table[symbol] = sum((c * self.star(k) for k, c in enumerate(line)), Integer(0))
        return expand(expression.xreplace(table))

    def reduced_at(self, expression: Expr, scalar: ScalarAdjoint, side: str) -> Expr:
        """Return a multiplier at an end with the adjoint boundary conditions used: highest derivatives are eliminated."""
        rows = scalar.left if side == "left" else scalar.right
        table = {}
        for line in rows:
            lead = max(k for k, c in enumerate(line) if c != 0)
            table[self.star(lead)] = sum((-conjugate(c) * self.star(k) for k, c in enumerate(line) if k != lead), Integer(0))
        return expand(expand(expression.xreplace(table)).xreplace(table))

    def star(self, order: int) -> Symbol:
        """Return a symbol for a derivative of the conjugate adjoint eigenfunction, known to the notation."""
        symbol = Symbol(f"adjoint_star_{order}")
        self.notation.names[symbol] = self.notation.at_threshold[symbol] = self.adjoint_function(order, star=True)
        return symbol

    def solvability(self) -> list[str]:
        """Return the condition for any forcing and any boundary data (label ``general solvability``, conjugated)."""
        notation, condition = self.notation, self.reduction.solvability
        expansion = self.derivation.expansion
        restricted = self.restricted
        scalar = self.scalar
        number = {("row", k): n for n, k in enumerate(restricted.rows, 1)} if restricted is not None else {("row", k): k + 1 for k in range(len(expansion.rows))}
        for side, kept, stated in zip(("left", "right"), (restricted.left_rows, restricted.right_rows) if restricted else ((), ()), expansion.ends, strict=False):
            number.update({(side, k): n for n, k in enumerate(kept or range(len(stated)), 1)})
        parity = {("row", k): p for k, p in zip(restricted.rows, restricted.row_parity, strict=True)} if restricted and notation.vector else {}
        if restricted and notation.vector:
            parity.update({("left", k): p for k, p in zip(restricted.left_rows, restricted.left_parity, strict=True)})
            parity.update({("right", k): p for k, p in zip(restricted.right_rows, restricted.right_parity, strict=True)})

        def term(kind: str, row: int, multiplier: Expr, marks: str = "", at: str = "") -> tuple[str, str]:
            letter = {"row": "f", "left": "g", "right": "h"}[kind]
            stem = rf"\mathbf{{{letter}}}" if notation.vector else letter
            odd = parity.get((kind, row), 1) < 0
            # a row of odd parity: f_+ = i (n x f)_+ / i^2
            value = expand(multiplier * I) if odd else multiplier
            body = rf"{notation.axis} \times {stem}" if odd else stem
            factor = self.multiplier(value, scalar)
            if scalar is not None and (kind != "row" or marks or at):
                factor = self.reduced_at(factor, scalar, at or kind)
            return notation.product(-factor if odd else factor, f"{body}_{{({number.get((kind, row), row + 1)})}}{marks}")

        inner = added([term("row", row, multiplier) for row, multiplier in condition.interior.items()])
        if not self.ends:
            return [f"{joined(inner, 4)} &= 0"]
        rows = [rf"\int_{{{self.ends[0]}}}^{{{self.ends[1]}}} \left\{{ {joined(inner, 9)} \right\}} \mathrm{{d}} {notation.space}"]
        outer = []
        ends = dict(zip(("left", "right"), self.ends, strict=True))
        for (end, row, order), multiplier in condition.boundary.items():
            sign, text = term("row", row, -multiplier, chr(39) * order, end)
            outer.append((sign, rf"\left[{text}\right]_{{{notation.space} = {ends[end]}}}"))
        for (end, row), multiplier in condition.data.items():
            sign, text = term(end, row, -multiplier)
            outer.append((sign, rf"\left[{text}\right]_{{{notation.space} = {ends[end]}}}"))
        return [f"{rows[0]} &= {joined(added(outer), 3)}"]

    def amplitude(self) -> list[str]:
        """Return the amplitude equation and its coefficients as quadratures (labels ``amplitude primitive``, ``coefficients integrals``)."""
        notation, reduction = self.notation, self.reduction
        listed = list(reduction.coefficients)
        symbols = coefficient_symbols(listed)
        a = notation.amplitude
        terms = added([("+", f"{symbols[one.identifier]} {monomial_text(one.monomial, a, notation.symbol['small'], notation.distance)}") for one in listed])
        rows = [rf"\frac{{\mathrm{{d}} {a}}}{{\mathrm{{d}} t}} &= {joined(terms, 5)}", rf"{notation.distance} &= {notation.control} - {{{notation.control}}}_{{c}}"]
        if reduction.weak:
            rows[0] += rf" + {notation.symbol['small']} \sum_{{i,j}} w_{{ij}} \left({a} \cdot \mathbf{{e}}_{{j}}\right) \mathbf{{e}}_{{i}}"
        xi = notation.symbol["xi"]
        rows.append(f"{xi} &= {self.integral(reduction.xi, 1)}")
        rows += [rf"{symbols[one.identifier]} &= \frac{{1}}{{{xi}}} \left\{{ {self.integral(one, -1)} \right\}}" for one in listed]
        if reduction.quadratic is not None:
            rows.append(rf"c_{{{notation.symbol['amplitude']}^{{2}}}} &= \frac{{1}}{{{xi}}} \left\{{ {self.integral(reduction.quadratic, -1)} \right\}}")
        return rows

    def integral(self, one: Coefficient, sign: int) -> str:
        """Return `sign` times a solvability integral: a multiplier times the forcing of its row in each term."""
        notation, condition = self.notation, self.reduction.solvability
        terms: list[tuple[str, str]] = []
        if not self.ends:
            return joined(notation.sum(notation.inlined(sign * one.integrand)), 99)  # it stands inside braces, which may not be cut
        restricted = self.restricted
        scalar = self.scalar
        odd = {row for row, parity in zip(restricted.rows, restricted.row_parity, strict=True) if parity < 0} if restricted is not None and notation.vector else set()
        inner: list[tuple[str, str]] = []
        for row, multiplier in condition.interior.items():
            value = one.forcing.get(("row", row), Integer(0))
            if value == 0:
                continue
            turn = I if row in odd else Integer(1)  # a row of odd parity carries i, as n x does
            factor, body = expand(turn * self.multiplier(multiplier, scalar)), notation.inlined(sign * value / turn)
            if factor.is_Add or body.is_Add:
                text = joined(notation.sum(body), 99)
                inner.append(notation.product(factor, rf"\left({text}\right)" if body.is_Add or text.startswith("-") else text))
            else:
                inner.append(notation.product(expand(factor * body), ""))
        if inner:
            terms.append(("+", rf"\int_{{{self.ends[0]}}}^{{{self.ends[1]}}} \left[{joined(added(inner), 99)}\right] \mathrm{{d}} {notation.space}"))
        for place, value in zip(self.ends, (one.left, one.right), strict=True):
            body = notation.inlined(self.multiplier(sign * value, scalar))
            if body != 0:
                terms.append(("+", rf"\left[{joined(notation.sum(body), 99)}\right]_{{{notation.space} = {place}}}"))
        return joined(added(terms), 2) if terms else "0"


def coefficient_symbols(listed: Sequence[Coefficient]) -> dict[str, str]:
    """Return the symbol of each coefficient: its name, or c with an index."""
    result = {}
    for k, one in enumerate(listed, 1):
        result[one.identifier] = sympy_latex(Symbol(one.name)) if one.name.isidentifier() else f"c_{{{k}}}"
    return result
