"""Which edge point was clicked, and what is known of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from edgel._viewer.session import Pane
from edgel.curves import Curves, measures
from edgel.edges import EdgeKind, kind_names

_SAME_DEPTH = 0.03  # scene units: edge points that near behind the nearest one may be meant as well


@dataclass(frozen=True)
class Picked:
    """An edge point.

    Attributes
    ----------
    pane : int
        Number of its pane.
    edge : int
        Its number among the edges shown there.
    """

    pane: int
    edge: int


@dataclass(frozen=True)
class Row:
    """An edge point wherever it is shown: the name of its pane, and its row in the file."""

    pane: str
    row: int


def pick(
    shown: Sequence[np.ndarray], origin: np.ndarray, direction: np.ndarray, *, max_angle: float, radius: float = 0.0
) -> Picked | None:
    """Find the edge point that a click meant.

    Parameters
    ----------
    shown : sequence of (E, 3) float
        Edge points of each pane, in the scene.
    origin, direction : (3,) array_like
        The ray of the click.
    max_angle : float
        How far from the ray a point may lie, in radians.
    radius : float
        How far it may lie anyway, in scene units: about its size.

    Returns
    -------
    Picked or None
        The nearest to the ray among the foremost; None if there is none near it.

    Examples
    --------
    >>> points = np.array([[0.0, 5, 0], [0.01, 2, 0], [1, 2, 0]])
    >>> pick([points], np.zeros(3), np.array([0.0, 1, 0]), max_angle=0.02)
    Picked(pane=0, edge=1)
    """
    direction = np.asarray(direction, float) / np.linalg.norm(direction)
    number = np.repeat(np.arange(len(shown)), [len(points) for points in shown])
    rays = np.concatenate([np.empty((0, 3)), *shown]) - np.asarray(origin, float)
    along = rays @ direction
    off = np.linalg.norm(rays - along[:, None] * direction, axis=1)
    near = np.flatnonzero((along > 0) & (off <= np.maximum(np.tan(max_angle) * along, radius)))
    if len(near) == 0:
        return None
    front = near[along[near] <= along[near].min() + _SAME_DEPTH]
    best = int(front[np.argmin(off[front] / along[front])])
    pane = int(number[best])
    return Picked(pane, best - int(np.searchsorted(number, pane)))


def row_of(panes: Sequence[Pane], picked: Picked) -> Row:
    """Return what stays the same of an edge point when others are shown beside it."""
    edges = panes[picked.pane].edges
    assert edges is not None
    return Row(panes[picked.pane].name, int(edges.index[picked.edge]))


def find(panes: Sequence[Pane], row: Row) -> Picked | None:
    """Find an edge point again, or None where it is not shown any more."""
    for number, pane in enumerate(panes):
        if pane.name == row.pane and pane.edges is not None:
            found = np.flatnonzero(pane.edges.index == row.row)
            return Picked(number, int(found[0])) if len(found) else None
    return None


def curve_places(curves: Curves, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return places along curves (P, 3), no farther than a step from each other, and the curve of each (P,)."""
    inner = np.ones(len(curves.vertices), bool)
    inner[curves.start[1:] - 1] = False
    first = np.flatnonzero(inner)
    way = curves.vertices[first + 1] - curves.vertices[first]
    number = np.maximum(np.ceil(np.linalg.norm(way, axis=1) / step), 1).astype(np.int64)
    segment = np.repeat(np.arange(len(first)), number)
    at = (np.arange(len(segment)) - np.repeat(np.cumsum(number) - number, number) + 0.5) / number[segment]
    curve = np.repeat(np.arange(len(curves)), np.diff(curves.start))[first]
    return curves.vertices[first[segment]] + at[:, None] * way[segment], curve[segment]


def curve_of(pane: Pane, edge: int) -> int | None:
    """Return the curve on which an edge point of a pane lies, None where there is none."""
    if pane.curves is None or pane.edges is None or pane.answer is None or pane.answer.edges is None:
        return None
    at = np.flatnonzero(pane.answer.edges.index[pane.curves.rows] == pane.edges.index[edge])
    return None if not len(at) else int(np.searchsorted(pane.curves.row_start, at[0], side="right")) - 1


def describe_curve(curves: Curves, curve: int) -> dict[str, str]:
    """Put into words what is measured of a curve."""
    table = {name: column[curve] for name, column in measures(curves).items()}
    words = {"curve": str(table["name"])}
    for name, unit in (("length", ""), ("diameter", ""), ("angle", "°")):
        if np.isfinite(table[name]):
            std = table[f"{name}_std"]
            words[f"its {name}"] = f"{table[name]:.5g}{unit}" + (f" ± {std:.2g}{unit}" if np.isfinite(std) else "")
    if np.isfinite(table["position_std"]):
        words["its place"] = f"± {table['position_std']:.2g} across"
    return words


def describe(pane: Pane, edge: int) -> dict[str, str]:
    """Put into words what is known of an edge point of a pane, by its number among those shown."""
    assert pane.edges is not None
    edges = pane.edges
    row = int(edges.index[edge])
    curve = curve_of(pane, edge)
    on = {} if curve is None or pane.curves is None else describe_curve(pane.curves, curve)
    bend = {1: "convex, like the edge of a cube", -1: "concave, like the edge of a hole"}
    return on | {
        "file": pane.source.name,
        "row": f"{row:,} (counted from 0)",
        "kind": ", ".join(kind_names(EdgeKind(int(edges.kind[edge])))),
        "strength": f"{edges.strength[edge]:.3f}",
        "angle": _degrees(edges.angle[edge]),
        "bend": bend.get(int(edges.convex[edge]), "unknown"),
        "point": _vector(pane.cloud.xyz[row]),
        "place on the edge": _vector(edges.position[edge]),
        "tangent": _vector(edges.direction[edge], 3),
        "normal": _vector(edges.normals[edge, 0], 3),
        "other face's normal": _vector(edges.normals[edge, 1], 3),
    }


def summary(pane: Pane, edge: int) -> str:
    """Put what matters most of an edge point into a few short lines, to stand beside it."""
    numbers = describe(pane, edge)
    lines = [
        f"{numbers['kind']}, strength {numbers['strength']}",
        numbers["place on the edge"],
        f"row {numbers['row']}",
    ]
    if numbers["angle"] != "unknown":
        lines.insert(1, f"angle {numbers['angle']}")
    return "\n".join(lines)


def describe_distance(first: Pane, first_edge: int, last: Pane, last_edge: int) -> dict[str, str]:
    """Put into words how far an edge point lies from another of the same file, each by its number among those shown."""
    assert first.edges is not None
    assert last.edges is not None
    way = last.edges.position[last_edge] - first.edges.position[first_edge]
    return {"distance": f"{np.linalg.norm(way):.6g}", "from the one before": _vector(way)}


def _degrees(angle: float) -> str:
    return "unknown" if np.isnan(angle) else f"{np.degrees(angle):.1f}°"


def _vector(values: np.ndarray, digits: int = 6) -> str:
    """Write coordinates with enough digits for those of maps, directions with few."""
    if np.isnan(values).any():
        return "unknown"
    # "z": no -0.000, a direction that rounds to an axis lies along it
    return " ".join(f"{value:z.{digits}f}" if digits < 6 else f"{value:z.9g}" for value in values)
