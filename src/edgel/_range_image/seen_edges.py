"""The edges that a view shows, by point: creases from folds, outlines from steps and rims, and the faces beside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edgel._faces import Faces, facing, inside_of
from edgel._kernels.parallel import kernel, run_slices
from edgel._range_image.facet_fits import Facets, fit_facets
from edgel._range_image.folds import Folds, find_folds, no_folds
from edgel._range_image.range_image import RangeImage
from edgel._range_image.rays import Rays, trace_rays
from edgel._range_image.steps import find_rims, find_steps, find_voids, own_plane
from edgel._range_image.stray import without_stray
from edgel.edges import EdgeKind

NOISY = 0.5  # spacings of independent noise from which windows in the image help neighbourhoods


@dataclass(frozen=True, eq=False)
class SeenEdges:
    """The edges that a view shows.

    Attributes
    ----------
    points : (M,) int64
        Points, among those the image was made of, that are some kind of outline, each once.
    kind : (M,) uint8
        `EdgeKind` flags of outlines.
    strength : (M,) float64
        In (0, 1]; one half where a step is as likely as not.
    creases : (K,) int64
        Points on creases, ascending.
    crease_strength : (K,) float64
    fold : (K,) int64
        Row in `folds` of each.
    folds : Folds
    rays, facets, image : Rays, Facets, RangeImage
        What they were found in.
    """

    points: np.ndarray
    kind: np.ndarray
    strength: np.ndarray
    creases: np.ndarray
    crease_strength: np.ndarray
    fold: np.ndarray
    folds: Folds
    rays: Rays
    facets: Facets
    image: RangeImage

    @property
    def turn(self) -> np.ndarray:
        """Angle (K,) by which the surface turns at each crease, radians."""
        first, second = (self.rays.planes(planes[self.fold])[0] for planes in (self.folds.first, self.folds.second))
        return np.arccos(np.clip((first * second).sum(axis=1), -1, 1))

    def is_fine(self, kinds: EdgeKind) -> bool:
        """Whether creases are asked for and neighbourhoods tell more of them: in clean views and independent noise."""
        return self.facets.white and EdgeKind.CREASE in kinds

    def faces(
        self, edge: np.ndarray, xyz: np.ndarray, viewpoint: np.ndarray | None, known: Faces | None = None
    ) -> Faces:
        """Say where the edge runs at edge points (E,), ascending, and how the surface lies on either side.

        Parameters
        ----------
        edge : (E,) int64
        xyz : (N, 3) float64
            All points.
        viewpoint : (3,) float64 or None
            Normals are turned towards it, or upwards (+Z) without one.
        known : Faces, optional
            Of the same points, by their neighbourhoods: kept where they tell both sides.
        """
        faces = known or Faces.of_points(xyz[edge], self._own_normals(edge, viewpoint, xyz))
        if len(edge):
            at = np.minimum(np.searchsorted(edge, self.creases), len(edge) - 1)
            which = np.flatnonzero((edge[at] == self.creases) & (faces.convex[at] == 0))
            faces.put(at[which], self._crease_faces(which, xyz, viewpoint), np.arange(len(which)))
        return faces

    def _crease_faces(self, which: np.ndarray, xyz: np.ndarray, viewpoint: np.ndarray | None) -> Faces:
        fold = self.fold[which]
        points = xyz[self.creases[which]]
        a, offset_a = self.rays.planes(self.folds.first[fold])
        b, offset_b = self.rays.planes(self.folds.second[fold])
        cosine = (a * b).sum(axis=1)
        # The foot of the point on the line: along both normals, until it lies on both planes.
        off_a, off_b = (a * points).sum(axis=1) - offset_a, (b * points).sum(axis=1) - offset_b
        rest = 1 - cosine**2
        foot = points - (
            ((off_a - cosine * off_b) / rest)[:, None] * a + ((off_b - cosine * off_a) / rest)[:, None] * b
        )
        line = np.cross(a, b)
        # Both normals point to the viewer: to the outside of the wedge where it is convex.
        outside = np.where(self.folds.convex[fold], 1.0, -1.0)[:, None]
        normals, sign = facing(points, (a * outside, b * outside), viewpoint)
        return Faces(
            position=foot,
            position_std=np.full(len(foot), np.nan),
            scale=np.full(len(foot), np.nan),
            direction=line / np.linalg.norm(line, axis=1, keepdims=True),
            normals=normals,
            angle=np.arccos(np.clip(cosine, -1, 1)),
            convex=sign.astype(np.int8),
        )

    def _own_normals(self, edge: np.ndarray, viewpoint: np.ndarray | None, xyz: np.ndarray) -> np.ndarray:
        """Normals (E, 3) of the surface on the points' own side of whatever edge is near; NaN where none fits."""
        place = np.full(len(xyz), -1, np.int32)
        place[edge] = np.arange(len(edge))
        planes = np.full((len(edge), 3), np.nan)
        rays, facets, index = self.rays, self.facets, self.image.index
        run_slices(
            _own_planes, len(index), index, place, rays.near, rays.ray, facets.plane[0], facets.cell, planes, size=64
        )
        normals, _ = rays.planes(planes)
        return np.where(inside_of(normals, xyz[edge], viewpoint)[:, None], -normals, normals)


def see_edges(image: RangeImage, xyz: np.ndarray, kinds: EdgeKind) -> SeenEdges:
    """Find the edges of some kinds that a range image of points (N, 3) shows."""
    rays = without_stray(trace_rays(image, xyz))
    facets = fit_facets(rays)
    wants_folds = EdgeKind.CREASE in kinds and (not facets.white or facets.median_noise > NOISY)
    folds = find_folds(rays, facets) if wants_folds else no_folds()
    pixels, level, fold = _pixels_of(folds, facets, rays.near)
    creases = image.index.ravel()[pixels]
    ascending = np.argsort(creases)
    level = level[ascending]
    # Outlines are looked for whatever is wanted: a crease's strength is that of the most marked kind of its point.
    void = find_voids(rays)
    rim = find_rims(rays.near, void)
    step, side = find_steps(rays, facets, void)
    frame = np.zeros(image.shape, bool)
    if EdgeKind.FRAME in kinds and image.method == "organized":
        frame[[0, -1]], frame[:, [0, -1]] = True, True
        frame &= image.index >= 0
    outline = np.flatnonzero((step > 0) | rim | frame)
    step, side, rim, frame = (each.ravel()[outline] for each in (step, side, rim, frame))
    # A rim is sure: a step there counts only where it is likely by itself.
    kind = np.where((step >= 1) | ~rim, side, 0) | (rim * int(EdgeKind.BOUNDARY)) | (frame * int(EdgeKind.FRAME))
    return SeenEdges(
        image.index.ravel()[outline],
        kind.astype(np.uint8),
        np.where(rim | frame, 1.0, step / (1 + step)),
        creases[ascending],
        level / (1 + level),
        fold[ascending],
        folds,
        rays,
        facets,
        image,
    )


def _pixels_of(folds: Folds, facets: Facets, near: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw the lines of folds: the pixel where each runs and the next along it on either side.

    Returns pixels (K,) each once, the highest level (K,) there, and the fold (K,) that has it.
    """
    middle = folds.cell * facets.cell + (np.array(facets.cell) - 1) / 2
    middle = middle + folds.offset[:, None] * folds.across / (facets.stretch, 1.0)
    along = folds.across[:, ::-1] * (1, -1)
    along = along / np.abs(along).max(axis=1, keepdims=True)
    drawn = np.concatenate([np.floor(middle + shift * along + 0.5).astype(np.int64) for shift in (0, -1, 1)])
    fold = np.tile(np.arange(len(folds.level)), 3)
    inside = ((drawn >= 0) & (drawn < near.shape)).all(axis=1)
    drawn, fold = drawn[inside], fold[inside]
    seen = ~np.isnan(near[drawn[:, 0], drawn[:, 1]])
    pixels, fold = (drawn[:, 0] * near.shape[1] + drawn[:, 1])[seen], fold[seen]
    order = np.lexsort((fold, -folds.level[fold], pixels))
    pixels, fold = pixels[order], fold[order]
    first = np.flatnonzero(np.diff(pixels, prepend=-1))
    return pixels[first], folds.level[fold[first]], fold[first]


@kernel
def _own_planes(start, stop, index, place, near, ray, plane, cell, planes):
    for row in range(start, stop):
        for col in range(index.shape[1]):
            at = place[index[row, col]] if index[row, col] >= 0 else -1
            if at < 0:
                continue
            i, j, misfit = own_plane(row, col, near, ray, plane, cell)
            if misfit < np.inf:
                for k in range(3):
                    planes[at, k] = plane[k, i, j]
