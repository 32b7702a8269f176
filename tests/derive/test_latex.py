"""The LaTeX says what was derived: displays of section V typed from the paper, and every forcing inserted again by another route."""

import random
import shutil
import subprocess
from math import comb

import pytest
from conftest import PROBLEMS, derivation_of
from sympy import I, Integer, Matrix, Rational, Symbol, exp, expand, eye, factorial, prod, simplify, sin, symbols

from derive import Problem, derive_amplitude_equation, epsilon, field
from derive.harmonics import Harmonics
from derive.latex import Writer, document, latex
from derive.notation import Notation
from derive.response import Orders, right_hand_sides
from derive.restricted import conjugate, restricted_problem
from derive.statement import ProblemError
from derive.two_times import equations_of, stated_terms
from derive.vectors import cross, dot, scalar_forms, vector, vector_forms

s, t = symbols("s t", real=True)

# The paper's eqs, eqs 1/2, eqs 1, eqs 3/2 with constraint and boundary conditions, everything on one side; n is the wall normal.
PAPER = {
    "stated": [
        "d_s r - t", "d_s F - d_t r + 1/2 (d_t r . t) t", "d_s M + t x F", "M - t x d_s t", "t . t - 1", "r", "t - n", "F t + F", "M",
    ],
    1: [
        "d_s r_1/2 - t_1/2", "d_s F_1/2 - d_tau r_1/2 + 1/2 (n . d_tau r_1/2) n", "d_s M_1/2 + Fc n x t_1/2 + n x F_1/2",
        "- n x d_s t_1/2 + M_1/2", "2 n . t_1/2", "r_1/2", "t_1/2", "Fc t_1/2 + F_1/2", "M_1/2",
    ],
    2: [
        "d_s r_1 - t_1", "d_s F_1 - d_tau r_1 + 1/2 (n . d_tau r_1) n + 1/2 (n . d_tau r_1/2) t_1/2 + 1/2 (d_tau r_1/2 . t_1/2) n",
        "d_s M_1 + Fc n x t_1 + n x F_1 + t_1/2 x F_1/2", "- n x d_s t_1 + M_1 - t_1/2 x d_s t_1/2", "2 n . t_1 + t_1/2 . t_1/2",
        "r_1", "t_1", "Fc t_1 + F_1 + chi n", "M_1",
    ],
    3: [
        "d_s r_3/2 - t_3/2",
        "d_s F_3/2 - d_tau r_3/2 + 1/2 (n . d_tau r_3/2) n - d_T r_1/2 + 1/2 (n . d_T r_1/2) n + 1/2 (n . d_tau r_1/2) t_1 + 1/2 (d_tau r_1/2 . t_1) n "
        "+ 1/2 (n . d_tau r_1) t_1/2 + 1/2 (d_tau r_1 . t_1/2) n + 1/2 (d_tau r_1/2 . t_1/2) t_1/2",
        "d_s M_3/2 + Fc n x t_3/2 + n x F_3/2 + t_1/2 x F_1 + t_1 x F_1/2", "- n x d_s t_3/2 + M_3/2 - t_1/2 x d_s t_1 - t_1 x d_s t_1/2",
        "2 n . t_3/2 + 2 t_1/2 . t_1", "r_3/2", "t_3/2", "Fc t_3/2 + F_3/2 + chi t_1/2", "M_3/2",
    ],
}


def plain(text):
    """LaTeX of the notation in the letters of `PAPER`."""
    for old, new in ((r"\hat{\mathbf{n}}", "n"), (r"\partial_{s}", "d_s"), (r"\partial_{t}", "d_t"), (r"\partial_{\tau}", "d_tau"), (r"\partial_{T}", "d_T"),
                     (r"\cdot", "."), (r"\times", "x"), (r"\left", ""), (r"\right", ""), (r"\frac{1}{2}", "1/2"), (r"\chi", "chi"), ("{F}_{c}", "Fc")):
        text = text.replace(old, new)
    for name in "rtFM":
        text = text.replace(rf"\mathbf{{{name}}}", name)
    return text.replace("_{", "_").replace("}", "")


@pytest.mark.parametrize("which", list(PAPER))
def test_the_equations_of_every_order_are_those_of_the_paper(which):
    derivation = derivation_of("follower_force")
    notation = Notation(derivation)
    found = []
    for equation in equations_of(derivation.problem.formulation):
        terms = stated_terms(equation) if which == "stated" else equation.at_order(which)
        found.append(plain(" ".join(notation.form(terms, threshold=which != "stated"))))
    assert found == PAPER[which]


def test_the_operators_of_the_restricted_problem_are_those_of_the_paper():
    """(matrix operators), the adjoint operators below (product after integration by parts), (adjoint solutions), (adjoint eq), (adjoint bcs)."""
    text = latex(derivation_of("follower_force"), "adjoint")
    d, F, n = r"\frac{\mathrm{d}}{\mathrm{d} s}", "{F}_{c}", r"\hat{\mathbf{n}} \times"
    for name, rows in (
        (r"\mathsf{L}", [[d, "- 1", "0", "0"], [r"- i \omega", "0", d, "0"], ["0", f"{F} {n}", n, d], ["0", f"- {n} {d}", "0", "1"]]),
        (r"\mathsf{S}", [["1", "0", "0", "0"], ["0", "1", "0", "0"]]),
        (r"\mathsf{T}", [["0", F, "1", "0"], ["0", "0", "0", "1"]]),
        (r"\mathsf{L}^{\dagger}", [[f"- {d}", r"i \omega", "0", "0"], ["- 1", "0", f"- {F} {n}", f"- {n} {d}"], ["0", f"- {d}", f"- {n}", "0"], ["0", "0", f"- {d}", "1"]]),
        (r"\mathsf{S}^{\dagger}", [["0", "1", "0", "0"], ["0", "0", "1", "0"]]),
        (r"\mathsf{T}^{\dagger}", [["1", "0", "0", "0"], ["0", F, "0", f"- {n}"]]),  # the second row with the opposite sign
    ):
        assert rf"{name} &= \left(\begin{{array}}{{cccc}} " + r" \\ ".join(" & ".join(row) for row in rows) + r" \end{array}\right)" in text
    assert (r"\vec{\zeta} &= \left[\phi \mathbf{b},\, \frac{1}{i \omega} \phi^{\prime} \mathbf{b},\, \frac{1}{i \omega} \phi^{\prime\prime} \hat{\mathbf{n}} \times \mathbf{b},\, "
            r"\frac{1}{i \omega} \phi^{\prime\prime\prime} \hat{\mathbf{n}} \times \mathbf{b}\right]^{T}") in text
    assert r"\phi^{(4)} &= i \omega \phi - {F}_{c} \phi^{\prime\prime}" in text
    for condition in (r"\phi^{\prime} &= 0 \quad \text{at} \quad s = 0", r"\phi^{\prime\prime} &= 0 \quad \text{at} \quad s = 0", r"\phi &= 0 \quad \text{at} \quad s = 1",
                      r"{F}_{c} \phi^{\prime} + \phi^{\prime\prime\prime} &= 0 \quad \text{at} \quad s = 1"):
        assert condition in text
    assert (r"\left[\vec{\psi}^{(2)}_{1} \cdot \mathbf{r}^{(1)*} + \hat{\mathbf{n}} \times \vec{\psi}^{(2)}_{4} \cdot \mathbf{t}^{(1)*} + \vec{\psi}^{(2)}_{2} \cdot \mathbf{F}^{(1)*} "
            r"+ \vec{\psi}^{(2)}_{3} \cdot \mathbf{M}^{(1)*}\right]_{0}^{1}") in text


def test_the_general_solvability_condition_is_the_conjugate_of_the_papers():
    text = latex(derivation_of("follower_force"), "solvability")
    assert (r"\phi^{*} \mathbf{f}_{(1)} - \frac{\phi^{*\prime}}{i \omega} \mathbf{f}_{(2)} + \frac{\phi^{*\prime\prime}}{i \omega} \hat{\mathbf{n}} \times \mathbf{f}_{(3)} "
            r"+ \frac{\phi^{*\prime\prime\prime}}{i \omega} \hat{\mathbf{n}} \times \mathbf{f}_{(4)}") in text
    assert (r"- \left[\phi^{*} \mathbf{g}_{(1)}\right]_{s = 0} - \left[\frac{\phi^{*\prime\prime\prime}}{i \omega} \mathbf{g}_{(2)}\right]_{s = 0} "
            r"- \left[\frac{\phi^{*\prime}}{i \omega} \mathbf{h}_{(1)}\right]_{s = 1}") in text
    assert r"+ \left[\frac{\phi^{*\prime\prime}}{i \omega} \hat{\mathbf{n}} \times \mathbf{h}_{(2)}\right]_{s = 1}" in text


NAMES = ["follower_force", "follower_force_planar", "swift_hohenberg", "van_der_pol",
         *(str(PROBLEMS / f"{name}.py") for name in ("ff_weakbc", "brus_pde", "lorenz_hopf", "basedep", "tipmass")),
         pytest.param(str(PROBLEMS / "buckle3d.py"), marks=pytest.mark.slow)]


@pytest.mark.parametrize("name", NAMES)
def test_every_forcing_that_is_written_is_the_one_that_is_integrated(name):
    """Rows differentiated anew about the threshold's base state, solutions inserted, against the Taylor rows of the derivation."""
    derivation = derivation_of(name)
    expansion, reduction = derivation.expansion, derivation.reduction
    harmonics, notation = Harmonics(expansion, reduction), Notation(derivation)
    orders = Orders(expansion, reduction.amplitudes, reduction.functions, reduction.mode.growth, reduction.mode.contributions)
    components = [(equation, c) for equation in equations_of(derivation.problem.formulation) for c in equation.components]
    rows = {kind: [one for one in components if one[0].side == kind] for kind in ("row", "left", "right")}

    def same(one, other):
        return derivation.problem.formulation.probe.is_zero(notation.inlined(one) - notation.inlined(other))

    compared = 0
    for response in reduction.responses:
        given = right_hand_sides(orders, response.monomial, orders.weight(response.monomial))
        for (kind, number), value in given.items():
            equation, c = rows[kind][number]
            assert same(harmonics.forcing(equation, c, 2)[(0, 0, *response.monomial)], value)
            compared += 1
    marks = {"dA/dt": harmonics.slow(0), "mu*A": harmonics.shifted(0), "epsilon*A": harmonics.weak(0), "A**2*conj(A)": (0, 0, 2, 1), "A**3": (0, 0, 3)}
    for one in (reduction.xi, *reduction.coefficients):
        for (kind, number), value in one.forcing.items():
            equation, c = rows[kind][number]
            found = harmonics.forcing(equation, c, 3)
            if one.monomial in marks:
                written = found[marks[one.monomial]]
            elif one.monomial == "dot(A,A)*A":
                written = found[0, 0, 2, 1]
            else:
                x, y = found.get((0, 0, 2, 0, 0, 1), Integer(0)), found.get((0, 0, 1, 1, 1, 0), Integer(0))
                written = y - x if one.monomial == "dot(A,A)*conj(A)" else 2 * x
            assert same(written, -value)
            compared += 1
    assert compared


def tapered():
    """A cantilever with varying stiffness and a dashpot at its tip, loaded by a follower force: complex boundary rows, slopes of the stiffness in J."""
    F, u = Symbol("F"), field("u", s, t)
    stiffness = 1 + s / 3 + s**2
    return derive_amplitude_equation(Problem(
        name="tapered", space=s, interval=(0, 1), time=t, control=F, control_range=(0, 120), fields=(u,),
        equations=(u.diff(t, 2) + u.diff(t) / 5 + (stiffness * u.diff(s, 2)).diff(s, 2) + F * u.diff(s, 2) * (1 + u.diff(s) ** 2),),
        boundary={0: (u, u.diff(s)), 1: (u.diff(s, 2) + u.diff(s, t) / 7, u.diff(s, 3) - u.diff(t) / 9)}, base_state={u: 0}, normalisation=(u, 1)))


def restricted_of(name):
    """The derivation and its restricted problem, with numbers for its symbols."""
    derivation = tapered() if name == "tapered" else derivation_of(name)
    problem = restricted_problem(derivation.expansion, 1 if derivation.reduction.vector else 0, derivation.reduction.mode.growth)
    chooser = random.Random(7)
    formulation = derivation.problem.formulation
    values = {symbol: Rational(chooser.randint(1, 9), 7) for symbol in (formulation.control, Symbol("omega", real=True), *formulation.parameters)}
    return derivation, problem, values


RESTRICTED = ["follower_force", "follower_force_planar", *(str(PROBLEMS / f"{name}.py") for name in ("pipe", "varcoef", "brus_pde", "buckle_pinned_tw")), "tapered"]


@pytest.mark.parametrize("name", RESTRICTED)
def test_adjoint_rows_make_the_boundary_form_vanish(name):
    """J = 0 at each end for every psi1 that meets the direct rows and every psi2 that meets the adjoint rows, and the rows are as many as needed."""
    derivation, problem, values = restricted_of(name)
    for side, place in zip(("left", "right"), derivation.problem.formulation.interval, strict=True):
        form = {key: value.subs(problem.space, place).subs(values) for key, value in problem.boundary_form().items()}
        jets, duals = sorted({one for one, _ in form}), sorted({other for _, other in form})
        direct = [[row.get(jet, Integer(0)).subs(values) for jet in jets] for row in getattr(problem, side)]
        dual = [[row.get(jet, Integer(0)).subs(values) for jet in duals] for row, _ in problem.adjoint_rows(side, place)]
        table = Matrix([[form.get((jet, other), Integer(0)) for other in duals] for jet in jets])
        allowed, tested = Matrix(direct).nullspace() if direct else list(eye(len(jets)).T.columnspace()), Matrix(dual).nullspace() if dual else list(eye(len(duals)).columnspace())
        assert all(simplify((one.H * table * other)[0]) == 0 for one in allowed for other in tested)
        assert len(direct) + len(dual) == table.rank() == len(jets)


@pytest.mark.parametrize("name", RESTRICTED)
def test_lagranges_identity_holds_for_random_fields(name):
    """(L psi1)^* . psi2 - psi1^* . L^dagger psi2 = dJ/ds for polynomials psi with random complex coefficients."""
    derivation, problem, values = restricted_of(name)
    formulation = derivation.problem.formulation
    chooser = random.Random(7)
    s, size = formulation.space, len(problem.fields)

    def polynomial():
        return sum((Rational(chooser.randint(-5, 5)) + I * chooser.randint(-5, 5)) * s**k for k in range(5))

    one, other = [polynomial() for _ in range(size)], [polynomial() for _ in range(size)]

    def applied(operator, fields):
        return [sum((c.subs(values) * fields[j].diff(s, k) for j, entry in enumerate(line) for k, c in entry.items()), Integer(0)) for line in operator]

    def product(a, b):
        return sum(conjugate(expand(x)) * y for x, y in zip(a, b, strict=True))

    form = sum((c.subs(values) * conjugate(expand(one[j].diff(s, k))) * other[i].diff(s, m) for ((j, k), (i, m)), c in problem.boundary_form().items()), Integer(0))
    difference = product(applied(problem.operator, one), other) - product(one, applied(problem.adjoint(), other))
    assert formulation.probe.is_zero(difference - form.diff(s))
    assert not formulation.probe.is_zero(difference)


@pytest.mark.parametrize("numbers", [(0,), (0, 1), (0, 0, 1), (0, 1, 2)])
def test_forms_in_circular_components_are_those_in_cartesian_ones(numbers):
    """n = e_z: the text of every form, evaluated on random vectors, against its components."""
    chooser = random.Random(3)
    count = max(numbers) + 1
    values = [[chooser.randint(-9, 9) for _ in range(3)] for _ in range(count)]

    def circular(v):
        return {"p": v[0] + I * v[1], "m": v[0] - I * v[1], "n": Integer(v[2])}

    def value(polynomial):
        return expand(sum(c * product_of(key) for key, c in polynomial.items()))

    def product_of(key):
        total = Integer(1)
        for number, component in key:
            total *= circular(values[number])[component]
        return total

    def straight(text):
        vectors = [values[number] for number in numbers]

        def read(body):
            parts = [[0, 0, 1] if part == "n" else vectors[int(part)] for part in body.replace("\\times", "x").replace("{", "").replace("}", "").split(" x ")]
            return parts[0] if len(parts) == 1 else [parts[0][1] * parts[1][2] - parts[0][2] * parts[1][1], parts[0][2] * parts[1][0] - parts[0][0] * parts[1][2],
                                                     parts[0][0] * parts[1][1] - parts[0][1] * parts[1][0]]

        return read(text)

    for form in (*vector_forms(numbers, tuple(range(len(numbers)))), *scalar_forms(numbers, tuple(range(len(numbers))))):
        factor = Integer(1)
        for scalar in form.scalars:
            a, b = scalar.split(" \\cdot ")
            factor *= sum(x * y for x, y in zip(straight(a), straight(b), strict=True))
        if form.body:
            whole = circular(straight(form.body))
            assert all(value(form.components[c]) == expand(factor * whole[c]) for c in "pmn")
        else:
            assert value(form.components[""]) == factor
    assert dot(vector(0, 0), cross(vector(0, 0), vector(1, 1))).components[""] == {}


@pytest.mark.parametrize("name", ["follower_force", "van_der_pol", pytest.param(str(PROBLEMS / "ff_components.py"), marks=pytest.mark.slow), str(PROBLEMS / "weak_iso.py"), str(PROBLEMS / "clash.py"),
                                  str(PROBLEMS / "vec_pitch.py")])
def test_the_document_is_balanced_and_compiles_where_latex_is_installed(name, tmp_path):
    text = document(derivation_of(name))
    assert text.count("\\left") == text.count("\\right") and text.count("{") == text.count("}")
    if shutil.which("pdflatex") and name in ("follower_force", str(PROBLEMS / "clash.py")):
        (tmp_path / "case.tex").write_text(text, encoding="utf-8")
        done = subprocess.run(["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "case.tex"], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout[-600:]


def test_symbols_can_be_set():
    derivation = derivation_of("follower_force")
    text = latex(derivation, "orders", "3/2", {"F": r"\mathcal{F}", "amplitude": "B", "axis": r"\mathbf{e}_z"})
    assert r"{\mathcal{F}}_{c}" in text and r"\mathbf{B}" in text and r"\mathbf{e}_z" in text and r"\hat{\mathbf{n}}" not in text
    with pytest.raises(ProblemError, match="symbol: found 'nothing'"):
        Writer(derivation, {"nothing": "x"})


def test_terms_of_every_order_are_those_of_a_series():
    """x = sum e^k x_k, d_t = d_tau + e^2 d_T, c = c0 + e^2 chi, epsilon = e^2: powers of e of the whole equation, multiplied out by SymPy's series."""
    c, e, chi, x = Symbol("c", real=True), Symbol("e"), Symbol("chi"), field("x", t)
    problem = Problem(name="orders", time=t, control=c, control_range=(-Rational(1, 2), 1), fields=(x,), base_state={x: 0}, normalisation=(x, None),
                      equations=(x.diff(t, 2) - (c + c**2) * x.diff(t) + x * exp(c) + epsilon * x.diff(t, 2) * x + x.diff(t, 2) ** 2 * x + x**4 / 5 + sin(c) * x**2,))
    formulation = derive_amplitude_equation(problem).problem.formulation
    (equation,) = equations_of(formulation)
    highest = 5

    def part(order, fast, slow):
        return Symbol(f"x_{order}_{fast}_{slow}")

    def inserted(jet):
        dt = jet[2]
        return sum(comb(dt, b) * e ** (k + 2 * b) * part(k, dt - b, b) for b in range(dt + 1) for k in range(1, highest + 1))

    whole = equation.components[""].xreplace({symbol: inserted(jet) for symbol, jet in equation.jets.items()} | {formulation.weak: e**2})
    whole = whole.xreplace({formulation.control: Symbol("c0") + e**2 * chi})
    for order in range(1, highest + 1):
        written = sum(value * chi**p * prod(part(f.half_order, f.fast, f.slow) for f in factors) for (p, _, factors), value in equation.at_order(order)[""].items())
        expected = whole.diff(e, order).subs(e, 0) / factorial(order)
        assert expand(written.xreplace({formulation.control: Symbol("c0")}) - expected) == 0


@pytest.mark.parametrize("order", ["1/3", "0", "17", "two"])
def test_an_order_that_is_no_half_integer_is_refused(order):
    with pytest.raises(ProblemError, match="expected 1/2, 1, 3/2"):
        latex(derivation_of("van_der_pol"), "orders", order)
