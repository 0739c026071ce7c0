"""The published method: its steps against the naive oracle, its result on the paper's parts, and bad input."""

from dataclasses import replace

import naive
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

import edgel
from edgel import paper, synth
from edgel._neighbors.normals import by_offset
from edgel.paper.projection import PixelGrid, back_project, grey_image, pixel_coordinates, project

SEEDS = st.integers(0, 2**32 - 1)
SIZES = st.integers(1, 12)


def _random_cloud(seed):
    """A cloud with repeats, points on pixel borders, and large offsets now and then."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 60))
    points = rng.integers(0, 9, (n, 3)) / 4.0 if rng.random() < 0.5 else rng.normal(size=(n, 3))
    points = np.r_[points, [[0, 0, 0], [2, 2, 2]]]
    return points + (rng.random() < 0.3) * np.array([5e5, 5e6, 300])


def _grid(points, width, height):
    return PixelGrid(width, height, points.min(axis=0), points.max(axis=0))


@given(SEEDS, SIZES, SIZES, st.sampled_from([0.0, 100.0]))
def test_projection_is_that_of_the_equations(seed, width, height, gray_min):
    points = _random_cloud(seed)
    grid = _grid(points, width, height)
    image = grey_image(project(points, grid), grid, gray_min)
    np.testing.assert_allclose(image, naive.project(points.tolist(), width, height, gray_min), rtol=1e-12)


@given(SEEDS, SIZES, SIZES)
def test_pixels_are_those_of_the_equations(seed, width, height):
    points = _random_cloud(seed)
    lower, upper = points.min(axis=0), points.max(axis=0)
    pixels = pixel_coordinates(points, _grid(points, width, height))
    for (x, y, _), pixel in zip(points, pixels, strict=True):
        i, j = naive.pixel_coordinates(x, y, lower[0], upper[0], lower[1], upper[1], width, height)
        assert pixel == (j - 1) * width + (i - 1)


@given(SEEDS, SIZES, SIZES, st.sampled_from([0, 1, 3]), st.sampled_from([1e-3, 0.1, 0.25, 0.5, 1.0, 10.0]))
def test_back_projection_is_that_of_code_1(seed, width, height, frame, tolerance):
    points = _random_cloud(seed)
    rng = np.random.default_rng(seed)
    edges = rng.random((height + 2 * frame, width + 2 * frame)) < 0.3
    magnitude = rng.uniform(50, 1000, edges.shape)
    grid = PixelGrid(width, height, points.min(axis=0), points.max(axis=0), frame)
    found = back_project(points, grid, edges, magnitude, tolerance)
    assert set(found.rows.tolist()) == naive.code_1(points, edges, tolerance, frame)
    assert (np.diff(found.rows) > 0).all()
    if len(found.rows):
        assert found.strength.min() > magnitude[edges].min() * 0.999999
        assert found.strength.max() < magnitude[edges].max() * 1.000001


@settings(max_examples=30)
@given(SEEDS, st.integers(3, 14), st.integers(3, 14))
def test_the_whole_method_is_that_of_the_equations(seed, width, height):
    points = _random_cloud(seed)
    found = paper.detect(points, width=width, height=height, low=30.0, high=90.0, tolerance=0.3)
    frame = 5  # the image stands among empty pixels, of which one all round belongs to the answer
    kept = slice(frame - 1, 1 - frame)
    image = np.pad(naive.project(points.tolist(), width, height, 100), frame)
    edge_map = naive.canny(image, 2, 1.4, 30.0, 90.0)[kept, kept]
    # Where two magnitudes are equal but for rounding, the thinning may go either way: compare such images no further.
    gx, gy = naive.gradient(naive.convolve(image, naive.gaussian_kernel(2, 1.4)))
    jitter = np.random.default_rng(0).normal(0, 1e-9, image.shape)
    moved = naive.hysteresis(naive.non_maximum_suppression(gx + jitter, gy - jitter), 30.0, 90.0)
    assume((moved[kept, kept] == edge_map).all())
    np.testing.assert_array_equal(found.edge_map, edge_map)
    assert set(found.index.tolist()) == naive.code_1(points, edge_map, 0.3, frame=1)


SCANS = {}


@pytest.fixture(params=["tee", "elbow"])
def scan(request):
    """Scans of the paper's parts, each made once."""
    if request.param not in SCANS:
        num_points = {"tee": 647_984, "elbow": 520_915}[request.param]
        SCANS[request.param] = synth.scan(getattr(synth, request.param)(), num_points=num_points)
    return SCANS[request.param]


def test_one_set_of_defaults_gives_about_ten_percent_of_both_parts(scan):
    found = paper.detect(scan.cloud)
    assert 0.08 <= found.share <= 0.12
    # They lie along true edges: outlines and rims, seen from above.
    edges = getattr(synth, scan.name.split("/")[0])().edges
    flat = [replace(edge, points=edge.points * (1, 1, 0)) for edge in edges]
    away = synth.nearest_edge(scan.cloud.xyz[found.index] * (1, 1, 0), flat).distance
    assert np.mean(away <= found.parameters["tolerance"] * np.sqrt(2)) > 0.9
    outline = np.concatenate([edge.points for edge in edges if edge.kind != "crease"])[:, :2]
    reached, _ = KDTree(scan.cloud.xyz[found.index, :2]).query(outline)
    assert np.mean(reached < 1.0) > 0.97


@pytest.mark.parametrize("share", [0.25, 0.0625])
def test_the_share_does_not_depend_on_the_density(scan, share):
    kept = np.random.default_rng(0).random(len(scan.cloud)) < share
    assert 0.08 <= paper.detect(scan.cloud.xyz[kept]).share <= 0.12


def test_normals_of_the_edges_are_those_of_the_surface(scan):
    found = paper.detect(scan.cloud)
    everywhere = by_offset(edgel.estimate_normals(scan.cloud))
    # The same neighbours, added up in another order.
    np.testing.assert_allclose(found.normals[:, 0], everywhere.normals[found.index], rtol=0, atol=1e-11)
    np.testing.assert_array_equal(found.planes.normals, found.normals[:, 0])
    assert np.isnan(found.normals[:, 1]).all()
    np.testing.assert_array_equal(found.position, scan.cloud.xyz[found.index])
    np.testing.assert_allclose(found.planes.offset, everywhere.offset[found.index], rtol=1e-11)
    assert (found.planes.offset > 0).all()
    error = np.degrees(np.arccos(np.clip(np.abs((found.planes.normals * scan.normals[found.index]).sum(axis=1)), 0, 1)))
    assert np.median(error) < 5


def test_order_of_the_points_and_threads_change_nothing(scan, monkeypatch):
    points = scan.cloud.xyz[::7]
    expected = paper.detect(points)
    order = np.random.default_rng(0).permutation(len(points))
    monkeypatch.setenv("EDGEL_NUM_THREADS", "1")
    shuffled = paper.detect(points[order])
    back = np.argsort(order[shuffled.index])
    np.testing.assert_array_equal(order[shuffled.index][back], expected.index)
    np.testing.assert_array_equal(shuffled.normals[back], expected.normals)
    np.testing.assert_array_equal(shuffled.strength[back], expected.strength)


def test_the_image_of_every_step_is_kept():
    x, y = np.meshgrid(np.linspace(0, 10, 150), np.linspace(0, 10, 150))
    points = np.c_[x.ravel(), y.ravel(), (x.ravel() > 6) * 3.0]
    found = paper.detect(points, low=30.0, high=90.0)
    steps = (found.projection, found.image, found.smoothed, found.gradient, found.thinned, found.edge_map)
    assert {step.shape for step in steps} == {(found.grid.height + 2, found.grid.width + 2)}
    np.testing.assert_array_equal(np.isnan(found.projection), found.image == 0)
    assert np.nanmax(found.projection) == 3.0
    kept = found.thinned > 0
    np.testing.assert_array_equal(found.thinned[kept], found.gradient[kept])
    assert found.thinned[found.edge_map].min() > 30.0
    assert found.edge_map[found.thinned > 90.0].all()
    assert found.smoothed.max() <= found.image.max()


def test_an_edge_map_of_the_users_own_takes_the_place_of_cannys():
    x, y = np.meshgrid(np.linspace(0, 10, 150), np.linspace(0, 10, 150))
    points = np.c_[x.ravel(), y.ravel(), (x.ravel() > 6) * 3.0]
    ours = paper.detect(points)
    again = paper.detect(points, edge_map=ours.edge_map.astype(np.uint8))
    for name in ("index", "strength", "normals", "edge_map", "thinned"):
        np.testing.assert_array_equal(getattr(again, name), getattr(ours, name))
    assert "given" in again.reason
    assert "low" not in again.parameters
    own = np.zeros_like(ours.edge_map)
    own[10, 20] = True
    (left, _, low, _), (wide, high) = ours.grid.extent, ours.grid.pixel
    few = paper.detect(points, edge_map=own, tolerance=0.6)
    corner = left + 20 * wide, low + 10 * high
    expected = (abs(points[:, 0] - corner[0]) < 0.6) & (abs(points[:, 1] - corner[1]) < 0.6)
    np.testing.assert_array_equal(few.index, np.flatnonzero(expected))
    assert len(paper.detect(points, edge_map=np.zeros_like(own))) == 0
    for wrong in (own[1:], own.astype(float), "map"):
        with pytest.raises(ValueError, match="edge_map: expected bool of shape"):
            paper.detect(points, edge_map=wrong)


def test_a_step_is_found_where_it_is():
    x, y = np.meshgrid(np.linspace(0, 10, 300), np.linspace(0, 10, 300))
    points = np.c_[x.ravel(), y.ravel(), (x.ravel() > 6) * 3.0]
    found = paper.detect(points)
    inner = points[found.index][(np.abs(points[found.index] - 5) < 3.9)[:, :2].all(axis=1)]
    assert len(inner) > 0
    assert np.abs(inner[:, 0] - 6).max() < 2 * found.parameters["tolerance"]


def test_width_and_height_may_be_given():
    points = _plane(2000)
    assert paper.detect(points, width=30).image.shape == (62, 32)
    assert paper.detect(points, height=30).image.shape == (32, 17)
    assert paper.detect(points, width=31, height=17).image.shape == (19, 33)


def _plane(n):
    return np.random.default_rng(0).random((n, 3)) * [10, 20, 1]


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int32, np.uint16])
def test_any_real_dtype_gives_the_same(dtype):
    points = np.round(_plane(3000) * 100)
    expected = paper.detect(points)
    found = paper.detect(points.astype(dtype))
    np.testing.assert_array_equal(found.index, expected.index)
    np.testing.assert_array_equal(found.normals, expected.normals)


def test_read_only_strided_and_organized_input():
    points = _plane(3000)
    expected = paper.detect(points)
    read_only = points.copy()
    read_only.flags.writeable = False
    strided = np.full((6000, 7), np.nan)
    strided[::2, 1:4] = points
    for same in (read_only, strided[::2, 1:4], np.asfortranarray(points), points.tolist()):
        np.testing.assert_array_equal(paper.detect(same).index, expected.index)
    organized = paper.detect(points.reshape(50, 60, 3))
    np.testing.assert_array_equal(organized.index, expected.index)


def test_points_that_are_not_finite_are_dropped_and_counted():
    points = _plane(3000)
    expected = paper.detect(points)
    holes = np.insert(points, [5, 1000, 3000], [[np.nan, 0, 0], [np.inf, 1, 1], [0, 0, -np.inf]], axis=0)
    found = paper.detect(holes)
    assert (found.num_points, found.num_dropped) == (3003, 3)
    assert "3 not finite" in repr(found)
    np.testing.assert_array_equal(holes[found.index], points[expected.index])


def test_utm_coordinates_keep_their_millimetres():
    x, y = np.meshgrid(np.arange(0, 2, 0.01), np.arange(0, 2, 0.01))
    local = np.c_[x.ravel(), y.ravel(), 0.2 * (np.hypot(x.ravel() - 1, y.ravel() - 1) < 0.5)]
    local += np.random.default_rng(0).normal(0, 0.001, local.shape)
    local = np.round(local * 1024) / 1024  # so that the shift itself rounds nothing
    expected = paper.detect(local, width=100)
    found = paper.detect(local + [500_000, 5_000_000, 300], width=100)
    assert len(np.setxor1d(expected.index, found.index)) < 0.01 * len(expected)
    both, a, b = np.intersect1d(expected.index, found.index, return_indices=True)
    turn = np.abs((expected.planes.normals[a] * found.planes.normals[b]).sum(axis=1))
    assert len(both) > 100
    assert turn.min() > 1 - 1e-9


BAD = {
    "empty": (np.empty((0, 3)), ValueError, "at least 3 points"),
    "one point": (np.zeros((1, 3)), ValueError, "at least 3 points"),
    "two points": (np.eye(3)[:2], ValueError, "at least 3 points"),
    "all NaN": (np.full((10, 3), np.nan), ValueError, "0 finite points of 10"),
    "all equal": (np.ones((10, 3)), ValueError, "all have x = 1"),
    "on a line along x": (np.c_[np.arange(10.0), np.zeros((10, 2))], ValueError, "all have y = 0"),
    "parallel to Z": (np.c_[np.ones(100), np.random.default_rng(0).random((100, 2))], ValueError, "all have x = 1"),
    "(N, 2)": (np.zeros((10, 2)), ValueError, "z is missing"),
    "(3, N)": (np.zeros((3, 10)), ValueError, "points.T"),
    "(N, 4)": (np.zeros((10, 4)), ValueError, r"points\[:, :3\]"),
    "(3,)": (np.zeros(3), ValueError, "points"),
    "text": ("cloud.ply", TypeError, "numbers"),
    "objects": (np.array([[None, 1, 2]]), TypeError, "numbers"),
    "complex": (np.zeros((10, 3), complex), TypeError, "numbers"),
    "flags": (np.zeros((10, 3), bool), TypeError, "numbers"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_named_with_its_remedy(case):
    points, error, message = BAD[case]
    with pytest.raises(error, match=message):
        paper.detect(points)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"width": 0}, "width"),
        ({"height": -3}, "height"),
        ({"width": 2.5}, "width"),
        ({"width": 10**6, "height": 10**6}, "smaller size"),
        ({"tolerance": 0}, "tolerance"),
        ({"tolerance": np.nan}, "tolerance"),
        ({"gray_min": 300}, "gray_min"),
        ({"kernel_size": 4}, "kernel_size"),
        ({"sigma": -1}, "sigma"),
        ({"low": 9, "high": 3}, "low"),
        ({"num_neighbors": 1}, "num_neighbors"),
    ],
)
def test_wrong_options_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        paper.detect(_plane(100), **options)


def test_a_diagonal_line_has_edges_but_no_normals():
    t = np.linspace(0, 1, 500)
    found = paper.detect(np.c_[t, t, t])
    assert len(found) > 0
    assert found.num_without_normal == found.planes.num_undefined == len(found)


def test_stages_are_timed_and_told():
    told = []
    found = paper.detect(_plane(1000), progress=told.append)
    assert told == list(found.seconds) == ["projection", "canny", "back-projection", "normals"]
    assert all(seconds >= 0 for seconds in found.seconds.values())


def test_edge_points_keep_every_attribute():
    points = _plane(3000)
    cloud = edgel.Cloud(points, {"intensity": np.arange(3000, dtype=np.uint16)}, crs="EPSG:25832")
    found = paper.detect(cloud)
    only = found.to_cloud(cloud)
    np.testing.assert_array_equal(only.xyz, points[found.index])
    np.testing.assert_array_equal(only.attributes["intensity"], found.index)
    assert only.crs == "EPSG:25832"
    assert (only.attributes["edge_kind"] == edgel.EdgeKind.IMAGE).all()
    assert ((only.attributes["edge_strength"] > 0) & (only.attributes["edge_strength"] <= 1)).all()
    labelled = found.label(cloud)
    np.testing.assert_array_equal(np.flatnonzero(labelled.attributes["edge_kind"]), found.index)
    np.testing.assert_allclose(labelled.attributes["nx"][found.index], found.normals[:, 0, 0], atol=1e-7)
    assert np.isnan(np.delete(labelled.attributes["nx"], found.index)).all()


@pytest.mark.parametrize("size", [{}, {"width": 64, "height": 64}])
@pytest.mark.parametrize(
    "extents", [(2.8e29, 1.5e-19), (1e-120, 1e-153), (6e-154, 1e-320), (1e-320, 1.0), (1e30, 1e30)]
)
def test_extents_of_any_size_are_answered_or_refused(extents, size):
    """The cast of what lies beyond int64 is anything: it must not become an index."""
    points = np.random.default_rng(0).random((40, 3)) * [*extents, 1.0]
    if not size and extents[0] != extents[1]:
        with pytest.raises(ValueError, match="smaller size"):
            paper.detect(points)
        return
    found = paper.detect(points, **size)
    assert ((found.index >= 0) & (found.index < 40)).all()
