"""A coarser look: means of cells, edges carried back, and what they add under noise."""

import numpy as np
import pytest

import edgel
from edgel import metrics, synth
from edgel._faces import Faces
from edgel._neighbors.kdtree import build_index
from edgel._surface.coarser import apart, carry, means_of_cells
from edgel._surface.line import Strengths


def test_means_of_cells_are_those_of_a_loop_and_do_not_depend_on_the_order():
    rng = np.random.default_rng(0)
    xyz = rng.normal(scale=3.0, size=(2000, 3)) + [500_000.0, -3.0, 0.0]
    means, corners = means_of_cells(xyz, 0.7)
    cells = {}
    for point in xyz:
        cells.setdefault(tuple(np.floor(point / 0.7)), []).append(point)
    wanted = np.array([np.mean(points, axis=0) for points in cells.values()])
    near = metrics.nearest(wanted, means)
    assert len(means) == len(cells)
    assert near.distances.max() < 1e-6
    again, _ = means_of_cells(xyz[rng.permutation(len(xyz))], 0.7)
    assert np.array_equal(means, again)
    assert [*map(tuple, corners)] == sorted(cells)


def one_edge(direction):
    faces = Faces.of_points(np.array([[5.0, 5.0, 0.2]]), np.array([[0.0, 0.0, 1.0]]))
    faces.direction[:] = direction
    return Strengths(np.array([7]), np.array([0.8]), np.array([0.0])), faces


@pytest.mark.parametrize(
    ("direction", "wanted"), [((1.0, 0.0, 0.0), {(4, 5), (5, 5), (6, 5)}), ((np.nan,) * 3, {(5, 5)})]
)
def test_an_edge_marks_the_points_along_it(direction, wanted):
    x, y = np.meshgrid(np.arange(11.0), np.arange(11.0))
    xyz = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    carried = carry(build_index(xyz), 2.0, *one_edge(direction))
    assert {tuple(at) for at in xyz[carried.strengths.points, :2]} == wanted
    assert (carried.sources == 7).all()
    assert (carried.strengths.crease == 0.8).all()


def test_what_a_closer_look_shows_nearby_is_not_carried():
    x, y = np.meshgrid(np.arange(11.0), np.arange(11.0))
    xyz = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    index = build_index(xyz)
    carried = carry(index, 2.0, *one_edge((1.0, 0.0, 0.0)))
    beside, faint = (
        Strengths(np.array([5 * 11 + 8]), np.array([0.6]), np.zeros(1)),
        Strengths(np.array([5 * 11 + 8]), np.array([0.4]), np.zeros(1)),
    )
    assert set(xyz[apart(index, 2.0, beside, carried).strengths.points, 0]) == {4.0}
    assert len(apart(index, 2.0, faint, carried).sources) == 3


def test_obtuse_edges_are_found_under_noise_of_a_spacing():
    solid = synth.frustum(sides=6, bottom=40.0, top=30.0, height=40.0)
    scene = synth.sample(solid, pattern="blue_noise", spacing=1.0, noise=1.0, seed=3)
    found = edgel.detect(scene.cloud, kinds="crease")
    true = scene.edges.positions
    back = metrics.nearest(true, found.position).distances[:, 0]
    there = metrics.nearest(found.position, true).distances[:, 0]
    assert np.mean(back < 2.5) > 0.65  # .53 without the coarser look
    assert np.mean(there < 2.5) > 0.9
    placed = np.isfinite(found.position_std)
    assert placed.mean() > 0.8
