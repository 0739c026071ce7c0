"""Histograms as drawings in the page itself: their ink is the page's, on white, in the dark and on paper."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from edgel.edges import EdgeKind, Edges, kind_names
from edgel.plot.legend import round_length
from edgel.plot.palette import ANY_KIND, KIND_COLORS, as_hex

_WIDTH, _HEIGHT = 460, 230  # of a drawing, in its own units
_LEFT, _RIGHT, _TOP, _BOTTOM = 58, 12, 10, 44
_NUMBERS = 5  # along the horizontal axis


@dataclass(frozen=True, eq=False)
class Stack:
    """One of the parts that the bars of a histogram are stacked of: its name, its color (RGB) and its counts (B,)."""

    name: str
    color: tuple[int, int, int]
    counts: np.ndarray


@dataclass(frozen=True, eq=False)
class Histogram:
    """Counts in bins of equal width, stacked by what they are counts of.

    Attributes
    ----------
    title : str
    axis : str
        What is counted along the horizontal axis, with its unit.
    edges : (B + 1,) float64
        Ends of the bins.
    stacks : sequence of Stack
        From below.
    note : str
        What has to be known to read it.
    """

    title: str
    axis: str
    edges: np.ndarray
    stacks: Sequence[Stack]
    note: str = ""


def strength_histogram(edges: Edges) -> Histogram:
    """How many edge points are how strong, by the first of their kinds."""
    bins = np.linspace(min(np.floor(10 * edges.strength.min()) / 10, 0.9), 1.0, 41)
    stacks, left = [], np.ones(len(edges), bool)
    for kind, color in KIND_COLORS.items():
        here = left & ((edges.kind & int(kind)) > 0)
        left &= ~here
        if here.any():
            stacks.append(Stack(kind_names(kind)[0], color, np.histogram(edges.strength[here], bins)[0]))
    note = "A point of several kinds counts with the first." if len(stacks) > 1 else ""
    return Histogram("Strength", "strength", bins, stacks, note)


def angle_histogram(edges: Edges) -> Histogram | None:
    """How far the surface turns at the creases, in degrees; None where no angle is known."""
    known = ((edges.kind & EdgeKind.CREASE) > 0) & ~np.isnan(edges.angle)
    if not known.any():
        return None
    degrees = np.degrees(edges.angle[known])
    bins = np.linspace(0.0, 180.0, 37)
    counts = np.histogram(degrees, bins)[0]
    note = (
        f"Of the {known.sum():,} creases with both faces known; half turn more than {np.median(degrees):.0f} degrees."
    )
    axis = "turn from face to face (degrees)"
    return Histogram("Angle between the faces", axis, bins, [Stack("crease", ANY_KIND, counts)], note)


def as_svg(histogram: Histogram) -> str:
    """Draw a histogram; lines and letters have the color of the text around it."""
    total = np.sum([stack.counts for stack in histogram.stacks], axis=0)
    scale = _Scale(histogram.edges[0], histogram.edges[-1], int(total.max()))
    parts, below = [_grid(scale)], np.zeros(len(total))
    for stack in histogram.stacks:
        bars = _bars(scale, histogram.edges, below, stack.counts)
        parts.append(f'<path d="{bars}" fill="{as_hex(stack.color)}"/>')
        below = below + stack.counts
    middle = (_LEFT + _WIDTH - _RIGHT) / 2
    parts.append(f'<text x="{middle}" y="{_HEIGHT - 8}" text-anchor="middle">{html.escape(histogram.axis)}</text>')
    label = html.escape(f"{histogram.title}: a histogram", quote=True)
    return f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{label}">{"".join(parts)}</svg>'


@dataclass(frozen=True)
class _Scale:
    """Where values from low to high, and counts up to the largest, lie in a drawing."""

    low: float
    high: float
    top: int

    def x(self, value: float) -> float:
        return _LEFT + (value - self.low) / (self.high - self.low) * (_WIDTH - _LEFT - _RIGHT)

    def y(self, count: float) -> float:
        return _HEIGHT - _BOTTOM - count / self.top * (_HEIGHT - _TOP - _BOTTOM)


def _grid(scale: _Scale) -> str:
    """Lines at round counts, and the numbers along both axes."""
    step = max(round(round_length(max(scale.top / 2, 1))), 1)
    lines = "".join(
        f'<path d="M{_LEFT} {scale.y(count):.1f}H{_WIDTH - _RIGHT}" stroke="currentColor" stroke-opacity=".25"/>'
        f'<text x="{_LEFT - 6}" y="{scale.y(count) + 4:.1f}" text-anchor="end">{count:,}</text>'
        for count in range(0, scale.top + 1, step)
    )
    return lines + "".join(
        f'<text x="{scale.x(value):.1f}" y="{_HEIGHT - _BOTTOM + 17}" text-anchor="middle">{value:.3g}</text>'
        for value in np.linspace(scale.low, scale.high, _NUMBERS)
    )


def _bars(scale: _Scale, ends: np.ndarray, below: np.ndarray, counts: np.ndarray) -> str:
    """The outlines of bars that stand on what is below them."""
    return "".join(
        f"M{scale.x(left) + 0.5:.1f} {scale.y(base):.1f}V{scale.y(base + count):.1f}"
        f"H{scale.x(right) - 0.5:.1f}V{scale.y(base):.1f}Z"
        for left, right, base, count in zip(ends[:-1], ends[1:], below, counts, strict=True)
        if count
    )
