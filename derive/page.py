"""Pieces of one self-contained HTML page: chapters, tables, figures, the style. Nothing is loaded from elsewhere."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape


@dataclass(frozen=True, slots=True, kw_only=True)
class Chapter:
    """A chapter of the page: its anchor, its title, its HTML."""

    identifier: str
    title: str
    body: str


@dataclass(frozen=True, slots=True)
class Markup:
    """HTML that is not to be escaped in a cell of a table."""

    html: str


def cell(value: object) -> str:
    """Return the content of a cell."""
    return value.html if isinstance(value, Markup) else escape(str(value))


def verdict(agrees: bool, text: str = "") -> Markup:
    """Return a verdict that is told by a sign and a word, not by colour alone."""
    return Markup(f'<span class="{"good" if agrees else "bad"}">{"&#10003;" if agrees else "&#10007;"} {escape(text or ("agrees" if agrees else "disagrees"))}</span>')


def number(text: str) -> Markup:
    """Return a number in figures of equal width that may break every 20 digits."""
    text = re.sub(r"([0-9]{20})(?=[0-9]{4})", r"\1<wbr>", escape(text.replace("-", chr(0x2212))))
    return Markup(f'<span class="number">{text}</span>')


def table(caption: str, head: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    """Return a table, the first column its row headers, that scrolls in its own box."""
    columns = "".join(f'<th scope="col">{cell(one)}</th>' for one in head)
    lines = "".join('<tr><th scope="row">' + cell(row[0]) + "</th>" + "".join(f"<td>{cell(one)}</td>" for one in row[1:]) + "</tr>\n" for row in rows)
    return (f'<div class="scroll" role="region" tabindex="0" aria-label="{escape(caption)}"><table class="data{" wide" if len(head) > 3 else ""}"><caption>{escape(caption)}</caption>'
            f"<thead><tr>{columns}</tr></thead>\n<tbody>{lines}</tbody></table></div>\n")


def paragraph(text: str) -> str:
    """Return a paragraph of plain text."""
    return f"<p>{escape(text)}</p>\n"


def left_out(reason: str) -> str:
    """Return the line that says why a part is not there."""
    return f'<p class="note">Left out: {escape(reason)}</p>\n'


def folded(summary: str, body: str) -> str:
    """Return a part that opens on demand."""
    return f"<details><summary>{escape(summary)}</summary>{body}</details>\n"


def figure(name: str, svg: str, caption: str) -> str:
    """Return a figure: an SVG document with identifiers of its own, scaled to the page."""
    body = svg[svg.index("<svg"):]
    body = re.sub(r"<metadata>.*?</metadata>\s*|<style[^>]*>.*?</style>\s*|<!--.*?-->\s*", "", body, flags=re.DOTALL)
    body = re.sub(r'\bid="([^"]*)"', rf'id="{name}-\1"', body)
    body = re.sub(r'(xlink:href="#|url\(#)', rf"\g<1>{name}-", body)
    body = re.sub(r'(<svg[^>]*?) width="([0-9.]+)pt" height="[0-9.]+pt"',
                  rf'\1 class="drawing" role="img" aria-label="{escape(caption)}" style="stroke-linejoin:round;stroke-linecap:butt;width:\2pt;min-width:min(34rem,\2pt)"', body, count=1)
    return f'<figure id="figure-{name}"><div class="paper" tabindex="0" role="group" aria-label="{escape(name)}">{body}</div><figcaption>{escape(caption)}</figcaption></figure>\n'


def page(title: str, lead: str, chapters: Sequence[Chapter]) -> str:
    """Return the page."""
    contents = "".join(f'<li><a href="#{one.identifier}">{escape(one.title)}</a></li>' for one in chapters)
    body = "".join(f'<section id="{one.identifier}" aria-labelledby="{one.identifier}-title"><h2 id="{one.identifier}-title">{escape(one.title)}</h2>\n{one.body}</section>\n' for one in chapters)
    return PAGE.replace("@STYLE@", STYLE).replace("@TITLE@", escape(title)).replace("@LEAD@", lead).replace("@CONTENTS@", contents).replace("@BODY@", body)


STYLE = """
:root { color-scheme: light dark; --ink: #1a1c1f; --soft: #565d66; --back: #fff; --panel: #f5f6f8; --line: #d5d9df; --link: #0b57a4; --good: #0a6b3d; --bad: #a8230f; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e7eb; --soft: #a3abb6; --back: #15171a; --panel: #1f2226; --line: #3a3f46; --link: #7db8f5; --good: #5cc98e; --bad: #ff8f7a; }
}
* { box-sizing: border-box; }
html { scroll-behavior: smooth; scroll-padding-top: 1rem; }
@media (prefers-reduced-motion: reduce) { html { scroll-behavior: auto; } }
body { margin: 0; color: var(--ink); background: var(--back); font: 1rem/1.55 system-ui, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; overflow-wrap: break-word; }
a { color: var(--link); }
:focus-visible { outline: 3px solid var(--link); outline-offset: 2px; border-radius: 3px; }
.skip { position: absolute; left: -999rem; }
.skip:focus { left: 1rem; top: 1rem; padding: .5rem 1rem; background: var(--back); z-index: 1; }
.frame { max-width: 86rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: .5rem 0; }
h2 { font-size: 1.35rem; margin: 2.4rem 0 .6rem; padding-top: .6rem; border-top: 1px solid var(--line); }
h3 { font-size: 1.08rem; margin: 1.6rem 0 .4rem; }
p { max-width: 46rem; margin: .6rem 0; }
nav ol { margin: 0; padding-left: 2rem; }
nav li { margin: .15rem 0; }
.display, .scroll, .paper { overflow-x: auto; max-width: 100%; }
.display { margin: .7rem 0; padding: .5rem .8rem; background: var(--panel); border-radius: 6px; }
.display td { padding: .16rem 0; vertical-align: baseline; white-space: nowrap; }
.display td.left { text-align: right; }
.display math { display: inline math; math-style: normal; }
.display td.words { white-space: normal; min-width: min(44rem, 80vw); max-width: 46rem; padding: .4rem 0; }
.line { display: block; white-space: nowrap; }
math { font-size: 1.08em; }
table.data { border-collapse: collapse; margin: .7rem 0; font-size: .94rem; }
table.data caption { text-align: left; color: var(--soft); padding-bottom: .3rem; }
table.data th, table.data td { text-align: left; vertical-align: top; padding: .3rem .9rem .3rem 0; border-bottom: 1px solid var(--line); }
table.wide td:last-child { min-width: 12rem; }
table.data tbody th { font-weight: 600; }
.number { font-variant-numeric: tabular-nums; font-family: ui-monospace, "SF Mono", Menlo, Consolas, monospace; font-size: .92em; white-space: nowrap; }
.good { color: var(--good); white-space: nowrap; }
.bad { color: var(--bad); font-weight: 700; white-space: nowrap; }
.note { color: var(--soft); border-left: 3px solid var(--line); padding-left: .8rem; }
.where { color: var(--soft); font-size: .92rem; }
.where a { margin-right: .7rem; white-space: nowrap; }
figure { margin: 1.2rem 0 1.8rem; max-width: 100%; }
figcaption { color: var(--soft); font-size: .92rem; margin-top: .4rem; max-width: 46rem; }
.paper { width: fit-content; background: #fff; padding: .6rem; border-radius: 6px; border: 1px solid var(--line); }
svg.drawing { display: block; max-width: 100%; height: auto; }
figure.approach canvas { width: 100%; max-width: 34rem; height: auto; touch-action: none; background: var(--panel); border-radius: 6px; }
figure.approach input { vertical-align: middle; max-width: 50%; }
pre { overflow-x: auto; padding: .8rem; background: var(--panel); border-radius: 6px; font-size: .82rem; line-height: 1.4; }
summary { cursor: pointer; color: var(--link); }
@media (min-width: 75rem) {
  .frame { display: grid; grid-template-columns: 15rem minmax(0, 1fr); column-gap: 2.5rem; }
  header { grid-column: 1 / -1; }
  nav { position: sticky; top: 1rem; align-self: start; max-height: calc(100vh - 2rem); overflow-y: auto; font-size: .92rem; }
}
@media (max-width: 40rem) { .frame { padding: .7rem; } h1 { font-size: 1.4rem; } math { font-size: 1em; } .display { padding: .4rem .5rem; } }
@media print {
  :root { --ink: #000; --soft: #444; --back: #fff; --panel: #fff; --line: #bbb; --link: #000; --good: #000; --bad: #000; }
  .skip, nav, figure.approach div { display: none; }
  .frame { display: block; max-width: none; padding: 0; }
  body { font-size: 9pt; }
  .display, .scroll, .paper { overflow: visible; border: 0; }
  .display { padding: 0; font-size: 7pt; }
  h2, h3 { break-after: avoid; }
  figure, tr { break-inside: avoid; }
  svg.drawing { min-width: 0 !important; }
  details::details-content { display: block; content-visibility: visible; }
}
"""

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>@TITLE@</title>
<link rel="icon" href="data:,">
<style>@STYLE@</style>
</head>
<body>
<a class="skip" href="#content">Skip to the content</a>
<div class="frame">
<header><h1>@TITLE@</h1>
@LEAD@</header>
<nav aria-label="Contents"><ol>@CONTENTS@</ol></nav>
<main id="content" tabindex="-1">
@BODY@</main>
</div>
</body>
</html>
"""

__all__ = ["Chapter", "Markup", "figure", "folded", "left_out", "number", "page", "paragraph", "table", "verdict"]
