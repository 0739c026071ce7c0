"""Half-edges: the borders of faces, each a place with a whole frame, so that one matching pair fixes the rotation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._kernels.parallel import kernel, run_slices
from edgel.edges import EdgeKind, Edges
from edgel.matching._grid import build_grid, find_cell

MIN_TURN = np.radians(18.0)
"""Creases that turn by less are too often noise."""
MIN_FACING = 0.25
"""Least cosine to the line of sight: where the surface turns away from a sensor its outline moves with the sensor."""
_ALIKE = 0.97  # cosine between frames that count as the same direction
_INSIDE = (
    0.25  # spacings by which a view's outlines lie inside the end of the surface: measured, .15 to .33 on five parts
)
_BESIDE = 4.0  # spacings within which the surface lies beside an outline
_FRAME_STEPS = 1.2  # cells of a frame's vectors, in which half-edges at one place are told apart


@dataclass(frozen=True, eq=False)
class HalfEdges:
    """Borders of faces: a crease has two, where a surface ends there is one.

    Attributes
    ----------
    places : (M, 3) float64
        On the edge.
    frames : (M, 3, 3) float64
        Rows: into the face, the face's normal on the outside of the wedge, along the edge; right-handed units.
    turn : (M,) float64
        How far the surface turns there, radians; NaN at outlines.
    bend : (M,) int64
        1 convex, -1 concave, 0 not known.
    """

    places: np.ndarray
    frames: np.ndarray
    turn: np.ndarray
    bend: np.ndarray

    def __len__(self) -> int:
        return len(self.places)

    @staticmethod
    def none() -> HalfEdges:
        """Return no half-edges."""
        return HalfEdges(np.empty((0, 3)), np.empty((0, 3, 3)), np.empty(0), np.empty(0, np.int64))

    def take(self, rows: np.ndarray) -> HalfEdges:
        """Return some of them, (K,) int or (M,) bool."""
        return HalfEdges(self.places[rows], self.frames[rows], self.turn[rows], self.bend[rows])

    @property
    def is_crease(self) -> np.ndarray:
        """Which belong to a crease, (M,) bool; the others to an outline."""
        return np.isfinite(self.turn)

    def thinned(self, apart: float, most: int) -> HalfEdges:
        """Return at most so many, at least about so far apart where they look alike; the same for any order."""
        rows, steps = np.arange(len(self)), _FRAME_STEPS
        while True:
            cell = np.floor(self.places[rows] / apart)
            looks = np.round(steps * self.frames[rows, :2].reshape(-1, 6))
            away = ((self.places[rows] / apart - cell - 0.5) ** 2).sum(axis=1)
            keys = np.concatenate([cell, looks], axis=1).T
            order = np.lexsort((*self.places[rows].T, away, *keys))
            sorted_keys = keys[:, order]
            first = np.append(True, (np.diff(sorted_keys, axis=1) != 0).any(axis=0))[: len(rows)]
            rows = np.sort(rows[order[first]])
            if len(rows) <= most:
                return self.take(rows)
            apart, steps = apart * max((len(rows) / most) ** 0.5, 1.1), 0.9 * steps


def join(parts: list[HalfEdges]) -> HalfEdges:
    """Put half-edges one after another."""
    return HalfEdges(*(np.concatenate([getattr(p, n) for p in parts]) for n in HalfEdges.__dataclass_fields__))


def frames_of(into: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """Make frames (M, 3, 3) of the directions into the faces and of their normals, both (M, 3)."""
    outside = outside / np.linalg.norm(outside, axis=1, keepdims=True)
    into = into - (into * outside).sum(axis=1, keepdims=True) * outside
    into = into / np.linalg.norm(into, axis=1, keepdims=True)
    return np.stack([into, outside, np.cross(into, outside)], axis=1)


def of_creases(
    places: np.ndarray, tangents: np.ndarray, outside: np.ndarray, turn: np.ndarray, bend: np.ndarray
) -> HalfEdges:
    """Make the two half-edges of each crease.

    Parameters
    ----------
    places, tangents : (E, 3) float64
    outside : (E, 2, 3) float64
        Normals of the two faces on the outside of the wedge: those of the surface times `edgel.Edges.convex`.
    turn, bend : (E,) float64, int
    """
    halves = []
    for face, other in ((0, 1), (1, 0)):
        into = np.cross(tangents, outside[:, face])
        into *= -np.sign((into * outside[:, other]).sum(axis=1, keepdims=True))  # away from where the other face looks
        halves.append(HalfEdges(places, frames_of(into, outside[:, face]), turn, bend.astype(np.int64)))
    both = join(halves)
    return both.take(np.flatnonzero(np.isfinite(both.frames).all(axis=(1, 2))))


def of_edges(
    edges: Edges, surface: np.ndarray, normals: np.ndarray, spacing: float, eye: np.ndarray | None
) -> HalfEdges:
    """Make the half-edges of what a detector found.

    Outlines count where the surface does not turn away from the sensor, and not the far sides of depth steps.

    Parameters
    ----------
    edges : Edges
    surface, normals : (S, 3) float64
        A thinned surface and its normals, which say on which side of an outline the surface lies.
    spacing : float
    eye : (3,) float64 or None
        The sensor's place, if it is known.
    """
    known = np.isfinite(edges.direction).all(axis=1) & np.isfinite(edges.position).all(axis=1)
    is_crease = known & ((edges.kind & EdgeKind.CREASE) > 0) & (edges.angle >= MIN_TURN) & (edges.convex != 0)
    crease = edges.take(is_crease)
    outside = crease.normals * crease.convex[:, None, None]
    found = [of_creases(crease.position, crease.direction, outside, crease.angle, crease.convex)]
    ends = (edges.kind & (EdgeKind.BOUNDARY | EdgeKind.OCCLUDING)) > 0
    rim = edges.take(np.flatnonzero(known & ends & ~is_crease & np.isfinite(edges.normals[:, 0]).all(axis=1)))
    if len(rim) and len(surface):
        normal, into = rim.normals[:, 0], np.cross(rim.normals[:, 0], rim.direction)
        beside = np.zeros(len(rim))
        run_slices(
            _lean,
            len(rim),
            rim.position,
            normal,
            into,
            surface,
            normals,
            build_grid(surface, _BESIDE * spacing),
            beside,
        )
        facing = np.ones(len(rim)) if eye is None else _facing(rim.position, normal, eye)
        kept = (np.abs(beside) > 0.2 * spacing) & (facing > MIN_FACING)
        frames = frames_of(into[kept] * np.sign(beside[kept])[:, None], normal[kept])
        places = rim.position[kept] - (0.0 if eye is None else _INSIDE * spacing) * frames[:, 0]
        found.append(HalfEdges(places, frames, np.full(kept.sum(), np.nan), np.ones(kept.sum(), np.int64)))
    return join(found)


def _facing(places: np.ndarray, normals: np.ndarray, eye: np.ndarray) -> np.ndarray:
    sight = eye - places
    return (sight * normals).sum(axis=1) / np.linalg.norm(sight, axis=1)


@kernel
def _lean(start, stop, places, normals, into, surface, surface_normals, grid, beside):
    """Write how far the middle of the surface near each place lies into the face, in the cloud's unit."""
    for e in range(start, stop):
        slot = find_cell(grid, places[e, 0], places[e, 1], places[e, 2])
        total, count = 0.0, 0
        for m in range(grid.first[slot], grid.last[slot]):
            s = grid.members[m]
            squared, same, side = 0.0, 0.0, 0.0
            for axis in range(3):
                off = surface[s, axis] - places[e, axis]
                squared += off * off
                same += surface_normals[s, axis] * normals[e, axis]
                side += off * into[e, axis]
            if squared <= grid.cell * grid.cell and same > 0.7:
                total, count = total + side, count + 1
        beside[e] = total / count if count else 0.0


@kernel
def _count_alike(start, stop, directions, cosine, count):
    """Count the rows of directions (M, D, 3) all of whose vectors lie near those of each."""
    for i in range(start, stop):
        total = 0
        for j in range(directions.shape[0]):
            alike = True
            for d in range(directions.shape[1]):
                dot = 0.0
                for axis in range(3):
                    dot += directions[i, d, axis] * directions[j, d, axis]
                alike &= dot > cosine
            total += alike
        count[i] = total


def rareness(directions: np.ndarray) -> np.ndarray:
    """Weigh rows of directions (M, D, 3) by how rare they are, (M,), 1 on average: what is common tells little."""
    count = np.empty(len(directions), np.int64)
    run_slices(_count_alike, len(directions), np.ascontiguousarray(directions), _ALIKE, count, size=256)
    weight = 1 / np.sqrt(count)
    return weight / weight.mean() if len(weight) else weight
