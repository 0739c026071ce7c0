"""Which side of the faces is outside, by whoever knows: the sensor, the cloud's own normals, or the whole surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel._faces import Faces
from edgel._kernels.parallel import kernel
from edgel._neighbors.kdtree import NeighborIndex, bounds
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.normals import SENSOR, UNKNOWN
from edgel._neighbors.orientation import outward_normals
from edgel._neighbors.queries import at_points
from edgel._neighbors.spacing import disc_spacing
from edgel._range_image.view import View
from edgel._surface import Surface

AROUND = 16  # neighbours whose normals are asked
NEAR = 0.7  # spacings from a face within which a neighbour belongs to it
ALONG = 32  # neighbours among which edge points with the same faces have to bend the same way
TOLD = 0.3  # of the votes, by which one side has to be ahead


def viewer_of(view: View, viewpoint: np.ndarray | None, xyz: np.ndarray) -> np.ndarray | None:
    """Return from where a cloud (N, 3) is seen, (3,): the viewpoint, or its view's; None: from nowhere or above."""
    image = view.image
    if viewpoint is not None or image is None:
        return viewpoint
    if image.viewpoint is not None or (image.direction == (0.0, 0.0, -1.0)).all():
        return image.viewpoint
    low, high = bounds(xyz)
    return (low + high) / 2 - 1e6 * float((high - low).max()) * image.direction


def orient_faces(
    faces: Faces,
    orientation: str,
    edge: np.ndarray,
    sure: np.ndarray,
    surface: Surface,
    own: np.ndarray | None,
) -> Faces:
    """Turn the faces at edge points (E,), ascending, to the outside by whoever knows it (`edgel.Edges.orientation`).

    `sure` (E,) bool are those more likely edge points than not, whichever were asked for; `own` (N, 3) are the normals
    that came with the cloud. Where nobody knows, and where the edge points along the same edge do not agree, nothing is
    convex or concave.
    """
    if orientation == SENSOR or not len(edge):
        return faces
    if orientation == UNKNOWN:
        return replace(faces, convex=np.zeros_like(faces.convex))
    index = surface.index
    normals = outward_normals(index) if own is None else own
    return turn_faces(faces, index, edge, sure, normals[index.order])


def turn_faces(faces: Faces, index: NeighborIndex, edge: np.ndarray, sure: np.ndarray, normals: np.ndarray) -> Faces:
    """Turn the faces at edge points (E,), ascending, by the normals (N, 3) by place: see `orient_faces`."""
    votes, pooled = np.zeros(len(edge)), np.zeros(len(edge))
    queries, row = at_points(index, edge), np.full(len(index), -1)
    row[edge[sure]] = np.flatnonzero(sure)
    arguments = (faces.position, faces.normals, normals, votes)
    visit_neighbors(_ask, queries, index, min(AROUND, len(index)), *arguments)
    bends = faces.convex * votes
    arguments = (faces.normals, row[index.order], bends, pooled)
    visit_neighbors(_pool, queries, index, min(ALONG, len(index)), *arguments)
    return replace(
        faces,
        normals=faces.normals * np.where(votes < 0, -1.0, 1.0)[:, None, None],
        convex=np.where((np.abs(pooled) > TOLD) & (pooled * bends > 0), np.sign(bends), 0).astype(np.int8),
    )


@kernel
def _ask(first, places, squared, queries, targets, xyz, positions, faces, normals, votes):
    """Write on which side of an edge's faces (E, 2, 3) the neighbours' normals (N, 3) lie: 1 to -1, if all agree."""
    for q in range(places.shape[0]):
        row, near = targets[first + q], NEAR * disc_spacing(squared[q])
        total, cast = 0.0, 0.0
        for i in range(places.shape[1]):
            place, nearest, vote = places[q, i], np.inf, 0.0
            for face in range(2):
                off, cosine = 0.0, 0.0
                for axis in range(3):
                    off += (xyz[axis, place] - positions[row, axis]) * faces[row, face, axis]
                    cosine += normals[place, axis] * faces[row, face, axis]
                if abs(off) < nearest and np.isfinite(cosine):  # of one face the second is NaN
                    nearest, vote = abs(off), cosine
            if nearest <= near:
                total, cast = total + vote, cast + abs(vote)
        votes[row] = total / cast if cast > 0.0 else 0.0


@kernel
def _pool(first, places, squared, queries, targets, xyz, faces, rows, bends, pooled):
    """Write the mean bend of the edge points around each, as far as they have the same two faces.

    `rows` (N,) are their rows by place, -1 of all other points.
    """
    for q in range(places.shape[0]):
        row, total, weight = targets[first + q], 0.0, 0.0
        for i in range(places.shape[1]):
            other = rows[places[q, i]]
            if other < 0 or bends[other] == 0.0:
                continue
            cosines = np.zeros((2, 2))
            for face in range(2):
                for theirs in range(2):
                    for axis in range(3):
                        cosines[face, theirs] += faces[row, face, axis] * faces[other, theirs, axis]
            same = max(abs(cosines[0, 0] * cosines[1, 1]), abs(cosines[0, 1] * cosines[1, 0])) ** 2
            if np.isfinite(same):
                total, weight = total + same * bends[other], weight + same
        pooled[row] = total / weight if weight > 0.0 else 0.0
