"""Which side of the faces is outside, by whoever knows: the sensor, normals that came with the cloud, or the whole surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edgel._faces import Faces
from edgel._kernels.parallel import kernel
from edgel._neighbors.knn import visit_neighbors
from edgel._neighbors.orientation import OUTWARD, SENSOR, UNKNOWN, outward_normals
from edgel._neighbors.queries import at_points
from edgel._neighbors.spacing import disc_spacing
from edgel._range_image.view import View
from edgel._surface import Surface

AROUND = 16  # neighbours whose normals are asked
NEAR = 0.7  # spacings from a face within which a neighbour belongs to it
TOLD = 0.3  # of the votes, by which one side has to be ahead


def viewer_of(view: View, viewpoint: np.ndarray | None, xyz: np.ndarray) -> np.ndarray | None:
    """Return from where a cloud (N, 3) is seen, (3,): the viewpoint, or that of its view; None: from nowhere or above."""
    if viewpoint is not None or view.image is None or view.image.viewpoint is not None:
        return viewpoint if view.image is None or viewpoint is not None else view.image.viewpoint
    if (view.image.direction == (0.0, 0.0, -1.0)).all():
        return None
    far = 1e6 * float(np.ptp(xyz, axis=0).max())
    return (xyz.min(axis=0) + xyz.max(axis=0)) / 2 - far * view.image.direction


def orient_faces(
    faces: Faces, orientation: str, edge: np.ndarray, surface: Surface, own: np.ndarray | None
) -> Faces:
    """Turn the faces at edge points (E,), ascending, to the outside by whoever knows it (`edgel.Edges.orientation`).

    `own` (N, 3) are the normals that came with the cloud. Where the neighbours' do not say it clearly, and where nobody
    knows, nothing is convex or concave.
    """
    if orientation == SENSOR or not len(edge):
        return faces
    if orientation == UNKNOWN:
        return replace(faces, convex=np.zeros_like(faces.convex))
    index, side = surface.index, np.zeros(len(edge))
    normals = outward_normals(index) if own is None or orientation == OUTWARD else own
    arguments = (faces.position, faces.normals, normals[index.order], side)
    visit_neighbors(_ask, at_points(index, edge), index, min(AROUND, len(index)), *arguments)
    return replace(
        faces,
        normals=faces.normals * np.where(side < 0, -1.0, 1.0)[:, None, None],
        convex=(faces.convex * side).astype(np.int8),
    )


@kernel
def _ask(first, places, squared, queries, targets, xyz, positions, faces, normals, side):
    """Write 1 where the neighbours' normals (N, 3) lie on the side of an edge's faces (E, 2, 3), -1 where on the other."""
    for q in range(places.shape[0]):
        row, near = targets[first + q], NEAR * disc_spacing(squared[q])
        votes, cast = 0.0, 0.0
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
                votes, cast = votes + vote, cast + abs(vote)
        if abs(votes) > TOLD * cast:
            side[row] = 1.0 if votes > 0.0 else -1.0
