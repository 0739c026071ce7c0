"""Neighbours in metrics of their own, and the scan lines that ask for them."""

import numpy as np
import pytest

from edgel import synth
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.normals import fit_planes
from edgel._neighbors.queries import Queries, every_place
from edgel._neighbors.scan_lines import FULL, scan_line_normals, scan_line_stretch


def stretched(vectors, stretch):
    """Vectors (N, 3) as they are in the space that a stretch (3,) makes."""
    length = np.linalg.norm(stretch)
    return vectors + np.outer(vectors @ stretch, stretch) / length if length else vectors


@pytest.mark.parametrize("lattice", [False, True])
def test_nearest_in_metrics_of_their_own_match_the_naive_ones(lattice):
    rng = np.random.default_rng(3)
    xyz = rng.integers(0, 5, (900, 3)).astype(float) if lattice else rng.random((900, 3)) * [1, 1, 0.1]
    index = build_index(xyz)
    stretch = rng.normal(size=(900, 3)) * rng.choice([0, 1, 20], 900)[:, None]
    if lattice:
        stretch = np.round(stretch) * [1, 0, 0]
    found = knn(index, Queries(np.concatenate([index.xyz, stretch.T]), index.order), 20)
    for place in range(0, 900, 7):
        point = index.order[place]
        squared = (stretched(xyz - xyz[point], stretch[place]) ** 2).sum(axis=1)
        expected = np.lexsort((np.arange(900), *xyz.T[::-1], squared.round(9)))[:20]
        assert found.distances[point] == pytest.approx(np.sqrt(squared[expected]))
        assert np.array_equal(xyz[found.points[point]], xyz[expected])


def lines_on_a_plane(apart, noise=0.0):
    """Points a unit apart on lines so far apart, on a tilted plane; with the direction of lines and the normal."""
    rng = np.random.default_rng(0)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    count = 40
    along = np.arange(count * apart)[None] + rng.random((count, 1))
    flat = np.stack(np.broadcast_arrays(along, apart * np.arange(count)[:, None], 0.0), axis=-1).reshape(-1, 3)
    flat += noise * rng.standard_normal(flat.shape)
    return flat @ frame.T, frame[:, 0], frame[:, 2]


@pytest.mark.parametrize("apart", [5, 10, 20])
def test_points_are_stretched_along_their_line_by_how_far_apart_lines_lie(apart):
    xyz, direction, normal = lines_on_a_plane(apart, noise=0.1)
    index = build_index(xyz)
    stretch = scan_line_stretch(index)
    assert stretch is not None
    length = np.linalg.norm(stretch, axis=0)
    assert np.mean(length > 0) > 0.99
    assert np.quantile(np.abs(direction @ stretch)[length > 0] / length[length > 0], 0.05) > 0.99
    assert np.median(1 + length) == pytest.approx(FULL * apart, rel=0.15)
    along_line = fit_planes(index, every_place(index), 8).normals @ normal
    all_round = fit_planes(index, every_place(index, stretch), 8).normals @ normal
    assert np.median(np.abs(along_line)) < 0.9
    assert np.median(np.abs(all_round)) > 0.98


@pytest.mark.parametrize("pattern", ["uniform", "blue_noise", "graded"])
def test_other_clouds_have_no_lines(pattern):
    sample = synth.sample(synth.stepped_block(), pattern=pattern, spacing=2.4, noise=0.1, seed=1)
    assert scan_line_stretch(build_index(sample.cloud.xyz)) is None


def test_lines_do_not_depend_on_the_order_of_the_points():
    xyz = synth.sample(synth.gear(), pattern="scan_lines", spacing=2.4, noise=0.1, seed=1).cloud.xyz
    shuffled = np.random.default_rng(0).permutation(len(xyz))
    by_point = []
    for rows in (np.arange(len(xyz)), shuffled):
        index = build_index(np.ascontiguousarray(xyz[rows]))
        found, stretch = scan_line_stretch(index), np.empty((len(xyz), 3))
        assert found is not None
        stretch[rows[index.order]] = found.T
        by_point.append(stretch)
    assert np.array_equal(*by_point)


def test_lines_beside_each_other_know_the_side_of_a_thin_plate():
    scene = synth.sample(synth.thin_plate(), pattern="scan_lines", spacing=1.0, noise=0.1, seed=1)
    index = build_index(scene.cloud.xyz)
    cosines = np.abs((scan_line_normals(index, np.arange(len(index))) * scene.normals[index.order]).sum(axis=1))
    known = np.isfinite(cosines)
    assert known.mean() > 0.7
    assert np.mean(cosines[known] > np.cos(np.radians(15))) > 0.9
