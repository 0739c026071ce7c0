"""Normals in pictures: arrows along them, evenly, and none where no normal is known."""

from typing import Any

import numpy as np
import pytest
from by_hand import edges_at, grid

from edgel import EdgeKind, plot
from edgel.plot import palette

LOOK: dict[str, Any] = {"direction": "top", "size": (480, 360)}


def edge_points(picture):
    return (picture == palette.KIND_COLORS[EdgeKind.CREASE]).all(axis=2)


def arrows(picture, background="light"):
    """Where a picture has the color of arrows, (H, W) bool; blended borders count."""
    return np.abs(picture.astype(int) - palette.THEMES[background].ink).max(axis=2) < 30


@pytest.mark.parametrize("background", palette.THEMES)
def test_arrows_point_along_the_normals(background):
    xyz = grid()
    edges = edges_at(xyz, xyz[:, 0] == 59, normals=(1.0, 0.0, 0.0))
    picture = plot.picture(xyz, edges, **LOOK, normals=True, legend=False, background=background)
    right_of_cloud = np.nonzero(edge_points(picture))[1].max()
    assert np.nonzero(arrows(picture, background))[1].max() > right_of_cloud + 8


def test_arrows_fit_into_the_picture():
    xyz = grid()
    edges = edges_at(xyz, xyz[:, 1] == 39, normals=(0.0, 1.0, 0.0))
    picture = plot.picture(xyz, edges, **LOOK, normals=True, crop=True, legend=False)
    assert not arrows(picture)[0].any()
    assert arrows(picture)[:10].any()


def test_arrows_are_thinned_and_skip_missing_normals():
    xyz = grid()
    picture = plot.picture(xyz, edges_at(xyz, np.arange(len(xyz))), **LOOK, normals=True, legend=False)
    assert 0 < arrows(picture).mean() < 0.2
    none = plot.picture(
        xyz, edges_at(xyz, np.arange(len(xyz)), normals=np.full(3, np.nan)), **LOOK, normals=True, legend=False
    )
    assert edge_points(none).any()
    assert not arrows(none).any()


def test_no_edge_points_have_no_arrows():
    xyz = grid()
    for edges in (None, edges_at(xyz, [])):
        picture = plot.picture(xyz, edges, **LOOK, normals=True, legend=False)
        assert not edge_points(picture).any()
        assert not arrows(picture).any()


def test_the_legend_tells_what_the_arrows_are():
    xyz = grid()
    with_normals = plot.picture(xyz, edges_at(xyz, [5]), **LOOK, normals=True)
    without = plot.picture(xyz, edges_at(xyz, [5]), **LOOK)
    assert arrows(with_normals)[-30:].sum() > arrows(without)[-30:].sum() + 30
    np.testing.assert_array_equal(plot.picture(xyz, **LOOK, normals=True), plot.picture(xyz, **LOOK))
