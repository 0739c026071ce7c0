"""The words of the page, as HTML; whatever comes from files is escaped."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from edgel._viewer.colors import KIND_MEANINGS
from edgel._viewer.session import Pane, Session
from edgel._viewer.settings import Settings
from edgel.edges import EdgeKind, Edges, kind_names
from edgel.plot.palette import KIND_COLORS, as_hex, ramp_colors

_BOX = "font-size:0.85em;line-height:1.4;padding:0.1em 0.8em 0.4em 0.8em;overflow-wrap:anywhere"
_ALARM = "color:#a00;background:#fff0f0;border-left:3px solid #c00;padding:0.3em 0.6em;margin:0.3em 0"
_NOTE = "color:#666"
_NUMBER = "text-align:right;padding-left:0.8em"
_PRE = "margin:0;padding:0.4em;background:#f4f4f4;white-space:pre-wrap;font-size:0.9em"
_COPY = (
    "const b=this,p=b.nextElementSibling;getSelection().selectAllChildren(p);document.execCommand('copy');"
    "getSelection().removeAllRanges();b.innerText='Copied';setTimeout(()=>b.innerText=b.dataset.name,1500)"
)

HELP = (
    f"<div style='{_BOX}'><b>Drag</b> turns, <b>wheel</b> zooms, <b>right-drag</b> moves. "
    "<b>Click an edge point</b> for its numbers, another for the distance.</div>"
)


def status(session: Session, panes: Sequence[Pane], settings: Settings) -> str:
    """Say what is shown, what runs, and what went wrong."""
    lines = []
    if session.doing:
        lines.append(f"<div><b style='color:#b60'>&#9679; {escape(session.doing)} ...</b></div>")
    lines += [
        f"<div style='{_ALARM}'><b>Cannot read {escape(source.name)}</b><br>{escape(source.error)}</div>"
        for source in session.sources
        if source.error
    ]
    lines += [_pane_status(pane, settings) for pane in panes]
    return f"<div class='edgel-status' style='{_BOX}'>{''.join(lines)}</div>"


def legend(panes: Sequence[Pane], settings: Settings) -> str:
    """Say which color means what, with the number of edge points shown of each kind, one column a pane."""
    found = [pane for pane in panes if pane.edges is not None]
    if settings.by_strength:
        stops = ", ".join(as_hex(tuple(color)) for color in ramp_colors(np.linspace(1.0, 0.0, 7)).tolist())
        bar = f"<div style='height:0.8em;background:linear-gradient(to right, {stops})'></div>"
        return f"<div style='{_BOX}'>{bar}<span>weak</span><span style='float:right'>strong</span></div>"
    rows = []
    if len(found) > 1:
        style = f"{_NUMBER};{_NOTE};overflow-wrap:normal"
        names = "".join(f"<td style='{style}'>{escape(pane.name)}</td>" for pane in found)
        rows.append(f"<tr><td></td><td></td>{names}</tr>")
    for kind, color in KIND_COLORS.items():
        counts = [_count(pane, kind) for pane in found]
        if any(counts):
            cells = "".join(f"<td style='{_NUMBER}'>{number:,}</td>" for number in counts)
            meaning = f"<span style='{_NOTE}'>{KIND_MEANINGS[kind]}</span>"
            rows.append(
                f"<tr><td style='color:{as_hex(color)};font-size:1.3em'>&#9632;</td>"
                f"<td><b>{kind_names(kind)[0]}</b> {meaning}</td>{cells}</tr>"
            )
    return f"<div class='edgel-legend' style='{_BOX}'><table style='width:100%'>{''.join(rows)}</table></div>"


def numbers(values: Mapping[str, str] | None) -> str:
    """List what is known of the edge point that was clicked."""
    if values is None:
        return f"<div style='{_BOX}'><span style='{_NOTE}'>Click an edge point in the picture.</span></div>"
    rows = "".join(
        f"<tr><td style='{_NOTE};white-space:nowrap;padding-right:0.8em;vertical-align:top'>{escape(name)}</td>"
        f"<td>{escape(value)}</td></tr>"
        for name, value in values.items()
    )
    return f"<div class='edgel-point' style='{_BOX}'><table>{rows}</table></div>"


def pictures(images: Mapping[str, bytes]) -> str:
    """Show PNG images under their names; inside the page, since viser's own fail when they change too soon."""
    parts = [
        f"<div>{escape(name)}</div>"
        f"<img alt='{escape(name)}' style='width:100%' src='data:image/png;base64,{b64encode(content).decode()}'>"
        for name, content in images.items()
    ]
    return f"<div style='{_BOX}'>{''.join(parts)}</div>"


def code(blocks: Mapping[str, str]) -> str:
    """Show lines to copy, each block under a button that copies it."""
    parts = [
        f'<button data-name="{escape(name)}" onclick="{escape(_COPY)}" style="margin:0.4em 0 0.2em 0;cursor:pointer">'
        f"{escape(name)}</button>"
        f"<pre style='{_PRE}'>{escape(text)}</pre>"
        for name, text in blocks.items()
    ]
    return f"<div class='edgel-code' style='{_BOX}'>{''.join(parts)}</div>"


def _pane_status(pane: Pane, settings: Settings) -> str:
    cloud, answer = pane.cloud, pane.answer
    lines = [f"<b>{escape(pane.name)}</b>: {len(cloud):,} points"]
    dropped = int(np.count_nonzero(~np.isfinite(cloud.xyz).all(axis=1))) if answer is None else 0
    if answer is not None and answer.edges is not None:
        dropped = answer.edges.num_dropped
    if dropped:
        lines[0] += f", {dropped:,} not finite"
    drawn = pane.source.drawn(settings)
    if not drawn.whole:
        lines.append(f"only {len(drawn.at):,} points are drawn; the detector runs on all")
    if answer is None:
        lines.append("no edges yet")
    elif answer.edges is None:
        lines.append(f"<div style='{_ALARM}'>No edges: {escape(answer.error)}</div>")
    elif pane.edges is not None:
        shown, found = len(pane.edges), len(answer.edges)
        lines.append(f"<b>{shown:,} edge points</b> shown" + (f", of {found:,} candidates" if shown != found else ""))
        scale = "" if pane.run is None or pane.run.scale == 1 else f" at scale {pane.run.scale:g}"
        lines.append(f"<span style='{_NOTE}'>found in {answer.seconds:.2f} s{scale}, {_how(answer.edges)}</span>")
    if not pane.is_current and answer is not None:
        lines.append("<i>these are the edges of before; the new ones are on their way</i>")
    return f"<div class='edgel-pane' style='margin-top:0.4em'>{'<br>'.join(lines)}</div>"


def _how(edges: Edges) -> str:
    """Say in which way the detector looked, what to pass as --method for it, and why."""
    ways = {
        "surface": "on the surface itself",
        "paper": "in the projected image",
        "organized": "along rows and columns",
    }
    way = ways.get(edges.method, f"in a {edges.method} view")
    return escape(f"{way} (--method {edges.method}): {edges.reason}")


def _count(pane: Pane, kind: EdgeKind) -> int:
    return 0 if pane.edges is None else int(np.count_nonzero(pane.edges.kind & kind))
