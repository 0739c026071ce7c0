"""Speed of the hot kernels and of whole methods, to compare two commits in under two minutes each.

    pytest benchmarks/test_speed.py --benchmark-autosave     (on one commit, then on the other)
    pytest-benchmark compare --group-by=name --columns=min,median

Needs pytest-benchmark (``pip install edgel[bench]``). Sizes are small; `bench.py`, `growth.py` and `roofline.py` measure
whole clouds.
"""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
import pytest

import edgel
from edgel import paper, synth
from edgel._neighbors.kdtree import bounds, build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.normals import fit_planes
from edgel._neighbors.queries import every_point
from edgel.io import ply
from edgel.paper.canny import canny
from edgel.paper.method import choose_grid
from edgel.paper.projection import back_project, project


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    return synth.scan(synth.tee(), num_points=100_000).cloud.xyz


@pytest.fixture(scope="module")
def lattice() -> np.ndarray:
    """Ties of distance at every point."""
    x, y = np.meshgrid(np.arange(200.0), np.arange(200.0))
    return np.c_[x.ravel(), y.ravel(), np.abs(x.ravel() - 100)]


def test_bounds(benchmark: Any, points: np.ndarray) -> None:
    lower, _ = benchmark(bounds, points)
    assert (lower == points.min(axis=0)).all()


def test_index(benchmark: Any, points: np.ndarray) -> None:
    assert len(benchmark(build_index, points)) == len(points)


@pytest.mark.parametrize("k", [8, 16, 32])
def test_knn(benchmark: Any, points: np.ndarray, k: int) -> None:
    index = build_index(points)
    assert benchmark(knn, index, points, k).points.shape == (len(points), k)


def test_plane_fits(benchmark: Any, points: np.ndarray) -> None:
    index = build_index(points)
    assert benchmark(fit_planes, index, every_point(index), 16).num_undefined == 0


def test_plane_fits_of_a_lattice(benchmark: Any, lattice: np.ndarray) -> None:
    index = build_index(lattice)
    assert benchmark(fit_planes, index, every_point(index), 16).num_undefined == 0


def test_normals(benchmark: Any, points: np.ndarray) -> None:
    assert len(benchmark(edgel.estimate_normals, points)) == len(points)


def test_projection(benchmark: Any, points: np.ndarray) -> None:
    grid = choose_grid(points, None, None)
    assert benchmark(project, points, grid).shape == (grid.height, grid.width)


def test_canny(benchmark: Any) -> None:
    image = np.random.default_rng(0).random((500, 500))
    assert benchmark(canny, image, kernel_size=5, sigma=1.4, low=0.2, high=0.5).edges.any()


def test_back_projection(benchmark: Any, points: np.ndarray) -> None:
    grid = choose_grid(points, None, None)
    edges = np.random.default_rng(0).random((grid.height + 2, grid.width + 2)) < 0.05
    assert len(benchmark(back_project, points, grid, edges, edges * 50.0, max(grid.pixel)).rows)


@pytest.mark.parametrize("detect", [paper.detect, edgel.detect], ids=["paper", "default"])
def test_method(benchmark: Any, points: np.ndarray, detect: Any) -> None:
    detect(points)
    assert len(benchmark.pedantic(detect, (points,), rounds=5))


@pytest.mark.parametrize("direction", ["read", "write"])
def test_ply(benchmark: Any, points: np.ndarray, direction: str) -> None:
    def write() -> bytes:
        file = BytesIO()
        ply.write(file, edgel.Cloud(points))
        return file.getvalue()

    if direction == "write":
        assert len(benchmark(write)) > 24 * len(points)
    else:
        data = write()
        assert len(benchmark(lambda: ply.read(BytesIO(data)))) == len(points)
