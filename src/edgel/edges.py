"""Edges: what every detector answers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, Self

import numpy as np

from edgel._columns import make_room
from edgel._faces import Faces
from edgel._kinds import ASKABLE as ASKABLE
from edgel._kinds import NAMES
from edgel._kinds import OUTLINES as OUTLINES
from edgel._kinds import EdgeKind as EdgeKind
from edgel._kinds import as_kinds as as_kinds
from edgel._kinds import kind_names as kind_names
from edgel.cloud import Cloud, as_cloud, in_box

FIRST_COLUMNS = ("edge_kind", "edge_strength", "edge_angle", "edge_convex", "nx", "ny", "nz")
"""What `Edges.label` adds to a cloud, and `Edges.to_cloud` before its own."""
_FACE_COLUMNS, _TANGENT_COLUMNS = ("nx2", "ny2", "nz2"), ("tx", "ty", "tz")
_PLACE_COLUMNS = ("edge_x", "edge_y", "edge_z")
_STD_COLUMN, _SCALE_COLUMN = "edge_std", "edge_scale"
ALL_COLUMNS = (*FIRST_COLUMNS, *_FACE_COLUMNS, *_TANGENT_COLUMNS, *_PLACE_COLUMNS, _STD_COLUMN, _SCALE_COLUMN)
"""What `Edges.to_cloud` adds."""

_PER_POINT = ("index", "kind", "strength", *Faces.__dataclass_fields__)


@dataclass(frozen=True, eq=False)
class Edges:
    """The edge points of a cloud, each once, in the order of the cloud.

    Attributes
    ----------
    index : (E,) int64
        Rows of the input, flat where it is organized, ascending.
    kind : (E,) uint8
        `EdgeKind` flags.
    strength : (E,) float64
        How marked the edge is, in (0, 1].
    position : (E, 3) float64
        The nearest place on the edge itself, in the cloud's unit; the point where the edge could not be placed better.
    position_std : (E,) float64
        How sure the position is: standard deviation of its distance from the edge (root mean square), in the cloud's
        unit; NaN where that is not known, as where the edge could not be placed better than the point.
    scale : (E,) float64
        Radius, in the cloud's unit, of the smallest neighbourhood that shows most of the edge: one or two spacings
        where it is sharp, about as much as its rounding where it is soft; NaN where only a view's windows show it.
    direction : (E, 3) float64
        Unit tangent of the edge, of either sign; NaN where unknown.
    normals : (E, 2, 3) float64
        Unit normals of the faces on the two sides; the second NaN where there is one face only, both where the
        neighbours span no plane.
    angle : (E,) float64
        How far the surface turns from one face to the other, in radians: 0 where it is smooth, pi/2 at the edge of a
        cube, up to pi; NaN where only one face is known.
    convex : (E,) int8
        1 where the faces meet like the edge of a cube, -1 where like the edge of a hole, 0 where that is not known.
    orientation : str
        Who says which side is outside, that of the normals: "sensor" (they look towards it), "normals" (those that came
        with the cloud), "outward" (the whole surface, see `edgel.detect`), or "unknown": then they look upwards (+Z)
        and `convex` is 0.
    num_points : int
        Number of points of the input, finite or not.
    num_dropped : int
        How many of them were left out because a coordinate was NaN or infinite.
    method : str
        The way they were found: "surface", "organized", "orthographic", "pinhole", "spherical", or "paper".
    reason : str
        Why it went that way, one line; empty where there was no choice.
    parameters : mapping
        Its parameters, those it chose itself included.
    seconds : mapping of str to float
        Time by stage, in seconds.
    """

    index: np.ndarray
    kind: np.ndarray
    strength: np.ndarray
    position: np.ndarray
    position_std: np.ndarray
    scale: np.ndarray
    direction: np.ndarray
    normals: np.ndarray
    angle: np.ndarray
    convex: np.ndarray
    orientation: str
    num_points: int
    num_dropped: int
    method: str
    reason: str
    parameters: Mapping[str, Any]
    seconds: Mapping[str, float]

    def __len__(self) -> int:
        return len(self.index)

    def __repr__(self) -> str:
        dropped = f", {self.num_dropped:,} not finite" if self.num_dropped else ""
        return f"Edges({len(self):,} of {self.num_points:,} points, {self.share:.1%}{dropped}; method {self.method})"

    @property
    def share(self) -> float:
        """Edge points among the finite points of the input, 0 to 1."""
        return len(self) / (self.num_points - self.num_dropped)

    @property
    def num_without_normal(self) -> int:
        """Number of edge points whose neighbours span no plane, so that not even one normal is known."""
        return int(np.isnan(self.normals[:, 0, 0]).sum())

    @property
    def median_crease_angle(self) -> float:
        """Median of `angle` over the creases where it is known, in radians; NaN where there are none."""
        known = self.angle[((self.kind & EdgeKind.CREASE) > 0) & ~np.isnan(self.angle)]
        return float(np.median(known)) if len(known) else float("nan")

    def count_kinds(self) -> dict[str, int]:
        """Count the edge points by the kinds that occur, by lower-case name; one of two kinds counts in both."""
        counts = {name: int(((self.kind & kind) > 0).sum()) for name, kind in NAMES.items()}
        return {name: number for name, number in counts.items() if number}

    def take(self, rows: np.ndarray) -> Self:
        """Return some of the edge points (int, ascending, or bool (E,)); times and parameters stay those of all."""
        return replace(self, **{name: getattr(self, name)[rows] for name in _PER_POINT})

    def join(self, other: Self) -> Self:
        """Return the edge points of both, found in the same input, by row; what is not said by point stays as it is."""
        columns = {name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in _PER_POINT}
        order = np.argsort(columns["index"], kind="stable")
        kept = order[np.diff(columns["index"][order], prepend=-1) > 0]
        return replace(self, **{name: column[kept] for name, column in columns.items()})

    def of_kinds(self, kinds: EdgeKind | str | Iterable[str]) -> Self:
        """Return the edge points that are of some kinds (see `as_kinds`), without their flags of other kinds.

        The strength stays, that of the most marked of a point's kinds.
        """
        wanted = np.uint8(as_kinds(kinds))
        if not (self.kind & ~wanted).any():
            return self
        kept = self.take((self.kind & wanted) > 0)
        return replace(kept, kind=kept.kind & wanted)

    def drop_blunt(self, angle: float) -> Self:
        """Take the flag of a crease from edge points whose faces turn less than an angle, in radians.

        Those that are nothing else disappear. Where the angle is not known the crease stays.
        """
        blunt = self.angle < angle
        kind = np.where(blunt, self.kind & ~np.uint8(EdgeKind.CREASE), self.kind)
        return replace(self, kind=kind).take(kind > 0)

    def of_scale(self, low: float = 0.0, high: float = float("inf")) -> Self:
        """Return the edge points whose `scale` lies in [low, high], in the cloud's unit; where it is NaN they stay.

        Low scales are sharp edges, high ones fillets, worn edges and soft folds; `max_scale` of `edgel.detect` looks
        for those that are too soft to be seen otherwise.

        Raises
        ------
        ValueError
            If low is above high, or either is no number.
        """
        if not low <= high:
            raise ValueError(f"low, high: expected two lengths, the first at most the second, got {low} and {high}")
        return self.take(~((self.scale < low) | (self.scale > high)))

    def crop(self, points: Any, box: Any) -> Self:
        """Return the edge points of the input that lie in a box: its lower and its upper corner (2, 3), maybe infinite.

        Raises
        ------
        ValueError
            If the box is none.
        """
        corners = np.asarray(box, dtype=np.float64)
        if corners.shape != (2, 3) or not (corners[0] <= corners[1]).all():
            raise ValueError(f"box: expected a lower and an upper corner of three numbers each, got {box!r}")
        return self.take(in_box(as_cloud(points).xyz[self.index], corners))

    def to_cloud(self, points: Any) -> Cloud:
        """Return the edge points of the input as a cloud: all its attributes, and what is known of the edge.

        That is ``edge_kind`` (uint8), ``edge_strength``, ``edge_angle`` (radians), ``edge_convex`` (int8), the normals
        ``nx ny nz`` and ``nx2 ny2 nz2`` of the two faces, the tangent ``tx ty tz``, and the refined position ``edge_x
        edge_y edge_z`` (float64) with its standard deviation ``edge_std`` and the edge's ``edge_scale``; float32 but
        for those named otherwise, NaN where unknown. Attributes of the input that have one of these names are kept as
        ``input_nx`` and so on, ``input_nx_2`` where that is there too, as after a second run.
        """
        cloud = make_room(as_cloud(points).take(self.index), ALL_COLUMNS)
        columns = self._describe(len(self), np.arange(len(self)))
        columns |= _columns(self.normals[:, 1], _FACE_COLUMNS, np.float32)
        columns |= _columns(self.direction, _TANGENT_COLUMNS, np.float32)
        columns |= _columns(self.position, _PLACE_COLUMNS, np.float64)
        columns |= {_STD_COLUMN: self.position_std.astype(np.float32), _SCALE_COLUMN: self.scale.astype(np.float32)}
        return cloud.with_attributes(**columns)

    def label(self, points: Any) -> Cloud:
        """Return the whole input with the first columns of `to_cloud`: what is known of the edge, and ``nx ny nz``.

        Where there is no edge the first two and ``edge_convex`` are 0, the others NaN. Attributes of the input that
        have one of these names are kept as ``input_nx`` and so on, ``input_nx_2``
        where that is there too, as after a second run.
        """
        cloud = as_cloud(points)
        return make_room(cloud, FIRST_COLUMNS).with_attributes(**self._describe(len(cloud), self.index))

    def plot(
        self,
        axes: Any = None,
        *,
        points: Any = None,
        backend: Literal["auto", "matplotlib", "pyvista", "viser"] = "auto",
    ) -> Any:
        """Draw the edge points by kind, in 3D unless `axes` say otherwise.

        Parameters
        ----------
        axes : matplotlib axes, optional
            Where to draw; in 2D axes x and y are drawn.
        points : (N, 3) or (H, W, 3) array_like, Cloud, or an object that carries points, optional
            Drawn in grey behind, at most 20,000 of them; `edgel.plot.picture` hides what they hide.
        backend : {"auto", "matplotlib", "pyvista", "viser"}
            What draws. "auto" is viser in a notebook where it is installed, to be turned with the mouse, and Matplotlib
            elsewhere.

        Returns
        -------
        matplotlib.axes.Axes, pyvista.Plotter, or what a notebook shows
            As the backend says. A plotter waits for its ``show()``.

        Raises
        ------
        ImportError
            If the backend is not installed.
        ValueError
            If there is no such backend, or axes are given to another than Matplotlib.
        """
        from edgel import export  # it lies above: drawing knows edges, finding them knows no drawing

        return export.draw(self, axes, points, backend)

    def to_open3d(self) -> Any:
        """Return an Open3D point cloud of `position`, with the first normal and the color of the kind."""
        from edgel import export

        return export.to_open3d(self)

    def to_pyvista(self) -> Any:
        """Return a PyVista mesh of `position`, with ``index``, ``rgb`` of the kind, and the columns of `to_cloud`."""
        from edgel import export

        return export.to_pyvista(self)

    def to_dataframe(self) -> Any:
        """Return a pandas table, one row an edge point: its ``index`` and the columns of `to_cloud`."""
        from edgel import export

        return export.to_dataframe(self)

    def _repr_html_(self) -> str:
        """Return what notebooks show."""
        from edgel import export

        return export.as_html(self)

    def _describe(self, num: int, rows: np.ndarray) -> dict[str, np.ndarray]:
        kind, convex = np.zeros(num, np.uint8), np.zeros(num, np.int8)
        strength, angle = np.zeros(num, np.float32), np.full(num, np.nan, np.float32)
        normals = np.full((num, 3), np.nan, np.float32)
        kind[rows], strength[rows], angle[rows], convex[rows] = self.kind, self.strength, self.angle, self.convex
        normals[rows] = self.normals[:, 0]
        described = dict(zip(FIRST_COLUMNS, (kind, strength, angle, convex), strict=False))
        return described | _columns(normals, FIRST_COLUMNS[4:], np.float32)


def _columns(table: np.ndarray, names: tuple[str, ...], dtype: type) -> dict[str, np.ndarray]:
    return {name: np.ascontiguousarray(table[:, i], dtype) for i, name in enumerate(names)}
