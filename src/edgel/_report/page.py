"""The page of a report as HTML: it loads nothing, links only to files beside it, and reads on paper and in the dark."""

from __future__ import annotations

import base64
import html
import posixpath
from collections.abc import Mapping, Sequence
from urllib.parse import quote

from edgel._report.figures import FigureImage
from edgel._report.histograms import Histogram, as_svg
from edgel._report.tables import Table, machine_table
from edgel.plot.palette import as_hex


def section(
    name: str,
    figures: Mapping[str, FigureImage],
    tables: Sequence[Table],
    histograms: Sequence[Histogram],
    files: Sequence[tuple[str, str]],
) -> str:
    """Set what is known of one cloud under its name.

    Parameters
    ----------
    name : str
    figures : mapping of str to FigureImage
        By the address of the file that holds it too; the first comes before the tables.
    tables : sequence of Table
    histograms : sequence of Histogram
    files : sequence of (str, str)
        What a file holds, and its address.
    """
    first, *others = (_figure(figure, address) for address, figure in figures.items())
    own, drawn = "".join(map(_table, tables)), "".join(map(_histogram, histograms))
    links = "".join(f"<li>{html.escape(what)}: {_link(address)}</li>" for what, address in files)
    listed = f'<ul class="files">{links}</ul>' if links else ""
    head = f"<section><h2>{html.escape(name)}</h2>{listed}{first}"
    return f'{head}<div class="tables">{own}</div><div class="plots">{drawn}</div>{"".join(others)}</section>'


def opening(title: str, findings: Sequence[str], tables: Sequence[Table]) -> str:
    """Set what comes first: the heading, the findings, and the tables of all clouds together."""
    items = "".join(f"<li>{html.escape(finding)}</li>" for finding in findings)
    listed = f'<ul class="findings">{items}</ul>' if items else ""
    own = "".join(map(_table, tables))
    return f'<h1>{html.escape(title)}</h1>{listed}<div class="tables">{own}</div>'


def _figure(figure: FigureImage, address: str) -> str:
    light, dark = (base64.b64encode(image).decode() for image in (figure.light, figure.dark))
    alt = html.escape(figure.caption, quote=True)
    # A page printed from a dark screen is printed on white.
    source = f'<source media="screen and (prefers-color-scheme: dark)" srcset="data:image/webp;base64,{dark}">'
    shown = f'<picture>{source}<img src="data:image/webp;base64,{light}" alt="{alt}"></picture>'
    return f"<figure>{shown}<figcaption>{html.escape(figure.caption)} {_link(address)}</figcaption></figure>"


def _link(address: str) -> str:
    """Link to a file beside the page."""
    return f'<a href="{html.escape(quote(address), quote=True)}">{html.escape(posixpath.basename(address))}</a>'


def _histogram(histogram: Histogram) -> str:
    names = "".join(
        f'<span><i style="background:{as_hex(stack.color)}"></i>{html.escape(stack.name)}</span>'
        for stack in histogram.stacks
    )
    note = f'<p class="note">{html.escape(histogram.note)}</p>' if histogram.note else ""
    title = html.escape(histogram.title)
    return f'<div class="plot"><h3>{title}</h3>{as_svg(histogram)}<p class="kinds">{names}</p>{note}</div>'


def _table(table: Table) -> str:
    numeric = {
        name
        for name in table.columns
        if any(isinstance(row[name], int | float) for row in table.rows)
        and not any(isinstance(row[name], str) for row in table.rows)
    }
    head = "".join(f"<th{_align(name, numeric)}>{html.escape(name)}</th>" for name in table.columns)
    body = "".join(
        "<tr>"
        + "".join(f"<td{_align(name, numeric)}>{html.escape(value)}</td>" for name, value in row.items())
        + "</tr>"
        for row in table.text()
    )
    note = f'<p class="note">{html.escape(table.note)}</p>' if table.note else ""
    grid = f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'
    return f'<div class="table"><h3>{html.escape(table.title)}</h3>{grid}{note}</div>'


def _align(name: str, numeric: set[str]) -> str:
    return ' class="number"' if name in numeric else ""


def page(title: str, parts: Sequence[str]) -> str:
    """Put the parts of a page together, and the table of the machine below them."""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f"<title>{html.escape(title)}</title><style>{_STYLE}</style></head>\n"
        f"<body><main>{''.join(parts)}\n{_table(machine_table())}</main></body></html>\n"
    )


_STYLE = """
:root { --ink: #1c1c1c; --soft: #5c5c5c; --rule: #d5d5d5; --paper: #ffffff; --tint: #f4f4f2; --link: #1f4fc4; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e8e8e6; --soft: #a9a9a6; --rule: #45454a; --paper: #17171a; --tint: #222226; --link: #9db8ff; }
}
body { margin: 0; background: var(--paper); color: var(--ink); font: 16px/1.5 system-ui, sans-serif; }
main { max-width: 66rem; margin: 0 auto; padding: 1.5rem 1.25rem 4rem; }
h1 { font-size: 1.7rem; line-height: 1.25; }
h2 { font-size: 1.35rem; margin-top: 3rem; padding-top: 1rem; border-top: 1px solid var(--rule); }
h3 { font-size: 1rem; margin: 1.5rem 0 .4rem; }
.findings { background: var(--tint); padding: .8rem 1rem .8rem 2.2rem; border-radius: 6px; }
.findings li { margin: .35rem 0; }
figure { margin: 1.5rem 0; }
figure img { display: block; width: 100%; height: auto; }
a { color: var(--link); }
.files { list-style: none; padding: 0; margin: .3rem 0; color: var(--soft); font-size: .92rem; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 22rem), 1fr)); gap: 0 2.5rem; }
.plot { max-width: 32rem; }
.plot .note { width: auto; }
.plot svg { display: block; width: 100%; height: auto; color: var(--soft); font-size: 12px; }
.plot text { fill: currentColor; }
.kinds { display: flex; flex-wrap: wrap; gap: 0 1.2rem; margin: .2rem 0 0; font-size: .88rem; color: var(--soft); }
.kinds i { display: inline-block; width: .75em; height: .75em; margin-right: .4em; print-color-adjust: exact; }
figcaption { color: var(--soft); font-size: .92rem; margin-top: .5rem; }
.tables { display: flex; flex-wrap: wrap; gap: 0 3rem; align-items: flex-start; }
.table { max-width: 100%; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .92rem; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: .25rem .9rem .25rem 0; border-bottom: 1px solid var(--rule); }
td { vertical-align: top; }
th { vertical-align: bottom; color: var(--soft); font-weight: 600; }
.number { text-align: right; }
/* A note is as wide as its table, so that tables stand side by side. */
.note { color: var(--soft); font-size: .88rem; width: 0; min-width: max(100%, 17rem); margin: .4rem 0 0; }
@media print {
  :root { --ink: #000000; --soft: #444444; --rule: #bbbbbb; --paper: #ffffff; --tint: #f4f4f2; --link: #000000; }
  body { font-size: 11pt; }
  main { max-width: none; padding: 0; }
  figure, .table, .plot { break-inside: avoid; }
  h2, h3 { break-after: avoid; }
}
"""
