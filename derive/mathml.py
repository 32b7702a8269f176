r"""Rows of LaTeX displays as tables of MathML: cut at the alignment, long lines broken at a sum.

A row is what `derive.latex.Writer` returns: ``left &= right``, with continuations ``\\ &\quad more``.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from html import escape

from latex2mathml import converter, exceptions

REFUSED: tuple[type[Exception], ...] = (*(one for one in vars(exceptions).values() if isinstance(one, type) and issubclass(one, Exception)), IndexError, KeyError)
TOKEN = re.compile(r"\\(?:begin|end)\{[a-z*]+\}|\\[A-Za-z]+|\\.|\s+|.", re.DOTALL)
REPLACED = (
    (' xmlns="http://www.w3.org/1998/Math/MathML"', ""), ("<mover>", '<mover accent="true">'), ("<mi>&#x0007E;</mi>", "<mo>&#x0223C;</mo>"), ("&#x0007E;", "&#x002DC;"),
    ("<mo>&#x0002F;</mo>", '<mo lspace="0" rspace="0">/</mo>'), ('<mo stretchy="false">&#x0007C;</mo>', '<mo stretchy="false" lspace="0" rspace="0">&#x0007C;</mo>'),
)
"""What browsers want otherwise: accents over letters, relations, no space about a slash and a bar."""
WHOLE, SHORTEST, WIDEST_LEFT = 98, 48, 36
"""Symbols on a line, on the shortest line that is broken, and left of the alignment."""


def math(latex: str, block: bool = False) -> str:
    """Return one formula as MathML; what cannot be rendered is shown as it is written."""
    upright = re.sub(r"\\(?:mathrm|operatorname)\{([A-Za-z]+)\}", r"\\text{\1}", latex)
    try:
        text = converter.convert(upright, display="block" if block else "inline")
    except REFUSED:
        return f"<code>{escape(latex)}</code>"
    text = re.sub(r'<mn mathvariant="bold">(\d)</mn>', lambda found: f"<mn>{chr(0x1D7CE + int(found[1]))}</mn>", text)
    text = re.sub(r"(<mi>(?:sin|cos|tan|sinh|cosh|tanh|exp|log|ln)</mi>)(?=<m[in]>)", r'\1<mspace width="0.167em" />', text)
    for plain, right in REPLACED:
        text = text.replace(plain, right)
    return text


def tokens(latex: str) -> Iterator[tuple[str, int]]:
    """Yield tokens with the depth of braces and environments outside of them."""
    depth = 0
    for token in TOKEN.findall(latex):
        if token == "}" or token.startswith(r"\end{"):
            depth -= 1
        yield token, depth
        if token == "{" or token.startswith(r"\begin{"):
            depth += 1


def cells(row: str) -> list[tuple[str, str]]:
    r"""Return the lines of a row, each cut at its alignment; a \left ... \right that goes on is closed and opened again."""
    lines: list[list[str]] = [["", ""]]
    column = open_pairs = 0
    for token, depth in tokens(row):
        if depth == 0 and token == r"\\":
            lines[-1][column] += r" \right." * open_pairs
            lines.append(["", r"\left. " * open_pairs])
            column = 0
        elif depth == 0 and token == "&":
            column = 1
        else:
            open_pairs += (token == r"\left") - (token == r"\right")
            lines[-1][column] += token
    return [(left.strip(), right.strip()) for left, right in lines]


def width(latex: str) -> int:
    """Return about how many symbols wide a formula is: of a fraction the wider part counts."""
    latex = re.sub(r"\\(?:left|right|,|quad|mathbf|mathsf|mathrm|hat|bar|vec|tilde|begin\{[a-z]+\}(?:\{c+\})?|end\{[a-z]+\})", "", latex)
    latex = re.sub(r"\\frac\{([^{}]*)\}\{([^{}]*)\}", lambda found: max(found[1], found[2], key=len), latex)
    if "&" in latex:  # a matrix: its widest row
        return max(map(width, latex.replace("&", " ").split(r"\\")))
    return len(re.findall(r"\\[A-Za-z]+|[^\s{}^_]", latex))


def broken(latex: str, longest: int = WHOLE) -> list[str]:
    r"""Return a formula in lines, broken before + and - outside of braces; a \left ... \right that is cut is closed and opened again."""
    if width(latex) <= longest:
        return [latex]
    lines, line, open_pairs, after = [], "", 0, ""
    for token, depth in tokens(latex):
        if after:
            after, line = "", line + token
            continue
        if token in (r"\left", r"\right"):
            open_pairs += 1 if token == r"\left" else -1
            after = token
        elif depth == 0 and token in "+-" and line and not re.search(r"(^|[(\[{=]|\\left\S|\\quad)\s*$", line) and width(line) > (0.45 + 0.15 * open_pairs) * longest:
            lines.append(line.rstrip() + r" \right." * open_pairs)
            line = r"\quad " + r"\left. " * open_pairs
        line += token
    return [*lines, line]


def display(rows: Sequence[str], label: str) -> str:
    """Return rows as a table that scrolls in its own box."""
    lines = [one for row in rows for one in cells(row)]
    widest = max((width(left) for left, _ in lines if width(left) <= WIDEST_LEFT), default=0)
    body = "".join(table_row(left, right, max(SHORTEST, WHOLE - widest)) for left, right in lines)
    return f'<div class="display" role="group" tabindex="0" aria-label="{escape(label)}"><table role="presentation">{body}</table></div>\n'


def words(latex: str) -> str:
    """Return a sentence with formulas in it, which breaks like one."""
    parts = re.split(r"\\text\{([^{}]*)\}", latex)
    return "".join(escape(part) if k % 2 else math(part.strip()) if part.strip() else " " for k, part in enumerate(parts))


def table_row(left: str, right: str, longest: int) -> str:
    """Return one line of a display as table rows."""
    if not left and right.startswith(r"\text"):
        return f'<tr><td colspan="2" class="words">{words(right)}</td></tr>'
    if width(left) > WIDEST_LEFT:
        whole, lines = ([f"{left} {right}"], []) if width(left) + width(right) <= WHOLE else (broken(left), broken(right, longest))
        rows = "".join(f'<tr><td colspan="2">{math(line, True)}</td></tr>' for line in whole)
        return rows + "".join(f"<tr><td></td><td>{math(line, True)}</td></tr>" for line in lines)
    first, *rest = broken(right, longest)
    rows = "".join(f"<tr><td></td><td>{math(line, True)}</td></tr>" for line in rest)
    return f'<tr><td class="left">{math(left, True) if left else ""}</td><td>{math(first, True)}</td></tr>{rows}'


__all__ = ["display", "math"]
