"""What `detect` says of organized clouds: kinds, where edges run, and how the surface lies beside them."""

import numpy as np
import pytest
from range_images import FAR, grid, smoothed, white
from test_range_image import camera

import edgel
from edgel import EdgeKind, synth
from edgel._range_image.facet_fits import fit_facets
from edgel._range_image.range_image import organized
from edgel._range_image.seen_edges import see_edges
from edgel._range_image.steps import find_steps, find_voids

SHAPE = (90, 120)
ROW, COL = grid(*SHAPE)
STEPS = EdgeKind.OCCLUDING | EdgeKind.OCCLUDED


def frame(height, noise=None):
    """What a camera at the origin that looks along z sees of heights (H, W) at 100 from it."""
    row, col = grid(*height.shape)
    ray = np.stack([col / FAR, row / FAR, np.ones_like(row)], axis=-1)
    depth = FAR - height + (0.0 if noise is None else noise)
    return ray * depth[..., None]


def roof(sign):
    """Two planes that meet at x = 0, 100 away, where they are nearest (1) or farthest (-1)."""
    return FAR - FAR / (1 - sign * 0.8 * np.abs(COL) / FAR)


def alike():
    """The noise of a sensor that matches windows."""
    return 0.4 * smoothed(SHAPE, 5, 1)


def kind_of(found, shape=SHAPE):
    kind = np.zeros(shape, np.uint8)
    kind.ravel()[found.index] = found.kind
    return kind


def test_correlated_noise_alone_is_seen_as_such():
    image = frame(np.zeros(SHAPE), alike()).reshape(-1, 3)
    seen = see_edges(organized(image, np.arange(len(image)), SHAPE), image, EdgeKind.CREASE)
    assert not seen.facets.white
    assert not seen.is_fine(EdgeKind.CREASE)
    flat = frame(np.zeros(SHAPE), 0.4 * white(SHAPE)).reshape(-1, 3)
    seen = see_edges(organized(flat, np.arange(len(flat)), SHAPE), flat, EdgeKind.CREASE)
    assert seen.is_fine(EdgeKind.CREASE)
    assert not seen.is_fine(EdgeKind.BOUNDARY)
    assert seen.facets.median_noise == pytest.approx(0.4, rel=0.15)


@pytest.mark.parametrize("slope", [0.0, 0.8])
def test_a_noisy_plane_has_no_edge_in_it(slope):
    height = FAR - FAR / (1 + slope * COL / FAR)
    found = edgel.detect(frame(height, alike()))
    assert found.method == "organized"
    assert len(found) == 0


def test_a_stair_has_a_near_and_a_far_side():
    up = COL < 0
    xyz = frame(12.0 * up, alike())
    found = edgel.detect(xyz, viewpoint=(0, 0, 0))
    kind = kind_of(found)
    inner = np.abs(ROW) < 40
    for flag, side in ((EdgeKind.OCCLUDING, up), (EdgeKind.OCCLUDED, ~up)):
        flagged = (kind & flag) > 0
        assert side[flagged].all()
        assert np.abs(COL[flagged]).max() < 2
        assert (flagged.any(axis=1) | ~inner[:, 0]).mean() > 0.97
    assert not (found.kind & ~np.uint8(STEPS)).any()
    # Outlines are where their points are, and have the face of their own side.
    assert np.array_equal(found.position, xyz.reshape(-1, 3)[found.index])
    assert (found.convex == 0).all()
    assert np.isnan(found.normals[:, 1]).all()
    assert np.isnan(found.angle).all()


def test_normals_beside_a_step_are_those_of_its_sides():
    """Least squares in any 6 x 6 pixels of this noise tilts by 6 degrees in the median, 1 in 10 by more than 11."""
    tilt = []
    for seed in range(6):
        xyz = frame(12.0 * (COL < 0), 0.4 * smoothed(SHAPE, 5, seed))
        found = edgel.detect(xyz, viewpoint=(0, 0, 0))
        tilt.append(np.degrees(np.arccos(-found.normals[:, 0, 2])))
    assert np.median(np.concatenate(tilt)) < 8
    assert np.quantile(np.concatenate(tilt), 0.9) < 13


@pytest.mark.parametrize("sign", [1, -1], ids=["convex", "concave"])
def test_a_roof_has_a_crease_with_both_faces(sign):
    xyz = frame(roof(sign), alike())
    found = edgel.detect(xyz, viewpoint=(0, 0, 0))
    kind = kind_of(found)
    crease = (kind & EdgeKind.CREASE) > 0
    assert (found.kind == EdgeKind.CREASE).all()
    assert np.abs(COL[crease]).max() < 2.5
    assert crease[8:-8].any(axis=1).mean() > 0.95
    # The line x = 0, z = 100, along y; the faces' slopes are 0.8 both ways.
    assert np.quantile(np.abs(found.position[:, 0]), 0.95) < 0.5
    assert np.quantile(np.abs(found.position[:, 2] - FAR), 0.95) < 0.5
    assert np.quantile(np.abs(found.direction[:, 1]), 0.05) > np.cos(np.radians(5))
    turn = 2 * np.arctan(0.8)
    assert np.degrees(np.abs(np.median(found.angle) - turn)) < 2
    assert np.degrees(np.quantile(np.abs(found.angle - turn), 0.9)) < 6
    assert (found.convex == sign).all()
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=2), 1, atol=1e-9)
    towards = (-found.position[:, None] * found.normals).sum(axis=2)
    assert (towards > 0).all()
    sides = np.sort(found.normals[:, :, 0], axis=1)
    np.testing.assert_allclose(np.median(sides, axis=0), np.array([-1, 1]) * np.sin(turn / 2), atol=0.03)


def test_a_hole_has_a_rim_and_that_only():
    height = np.zeros(SHAPE)
    hole = (np.abs(ROW) < 10) & (np.abs(COL) < 15)
    height[hole] = np.nan
    kind = kind_of(edgel.detect(frame(height, alike())))
    around = ~hole & (((np.abs(ROW) < 11) & (np.abs(COL) < 15)) | ((np.abs(ROW) < 10) & (np.abs(COL) < 16)))
    assert np.array_equal(kind == EdgeKind.BOUNDARY, around)
    assert not kind[~around].any()


def test_a_faint_step_does_not_ride_on_a_rim():
    """A kind less likely than not counts only where no other is more likely: a rim is no step for being sure."""
    height = np.where(COL > 0, -3.6, 0.0) + white(SHAPE, 2)
    height[:20] = np.nan
    xyz = frame(height).reshape(-1, 3)
    rows = np.flatnonzero(np.isfinite(xyz[:, 2]))
    seen = see_edges(organized(xyz[rows], rows, SHAPE), xyz[rows], EdgeKind.CREASE)
    level, _ = find_steps(seen.rays, seen.facets, find_voids(seen.rays))
    assert level[20].max() > 0
    assert level.max() < 1  # nowhere is the step as likely as not
    found = edgel.detect(frame(height), kinds=STEPS | EdgeKind.BOUNDARY)
    assert len(found) == SHAPE[1]
    assert (found.kind == EdgeKind.BOUNDARY).all()


@pytest.mark.parametrize("name", synth.SENSORS)
def test_a_block_seen_by_a_sensor(name):
    scene = synth.sense(synth.stepped_block(), synth.SENSORS[name], spacing=1.0)
    found = edgel.detect(scene.cloud)
    assert len(found) > 50
    rows = np.flatnonzero(np.isfinite(scene.cloud.xyz).all(axis=1))
    assert np.isin(found.index, rows).all()
    assert (np.diff(found.index) > 0).all()
    assert ((found.strength >= 0.5) & (found.strength <= 1)).all()
    kind = np.zeros(len(scene.cloud.xyz), np.uint8)
    kind[found.index] = found.kind
    shape = scene.cloud.shape
    for flags in (STEPS | EdgeKind.BOUNDARY, EdgeKind.CREASE):
        true = ((scene.point_kind & int(flags)) > 0).reshape(shape)
        mine = ((kind & int(flags)) > 0).reshape(shape)
        assert (mine & wider(true)).sum() > 0.6 * mine.sum()
        # A kinect's windows of 9 pixels round off short creases.
        assert (true & wider(mine)).sum() > (0.3 if name == "kinect" and flags == EdgeKind.CREASE else 0.5) * true.sum()
    crease = (found.kind & int(EdgeKind.CREASE)) > 0
    known = crease & (found.convex != 0)
    eyes = -found.position[known]
    assert ((eyes[:, None] * found.normals[known]).sum(axis=2) > 0).mean() > 0.9


def wider(mask, reach=3):
    """What lies within some pixels."""
    padded = np.pad(mask, reach)
    out = np.zeros_like(mask)
    for down in range(2 * reach + 1):
        for right in range(2 * reach + 1):
            out |= padded[down : down + mask.shape[0], right : right + mask.shape[1]]
    return out


@pytest.mark.parametrize("name", synth.SENSORS)
def test_threads_do_not_matter(name, monkeypatch):
    cloud = synth.sense(synth.stepped_block(), synth.SENSORS[name], spacing=1.0).cloud
    answers = []
    for threads in ("1", "2"):
        monkeypatch.setenv("EDGEL_NUM_THREADS", threads)
        answers.append(edgel.detect(cloud))
    for field in ("index", "kind", "strength", "position", "direction", "normals", "angle", "convex"):
        assert getattr(answers[0], field).tobytes() == getattr(answers[1], field).tobytes()


@pytest.mark.parametrize("shape", [(3, 3), (5, 40), (40, 5), (2, 50), (50, 2), (2, 2)])
def test_small_flat_frames_have_no_edge(shape):
    for height in (np.zeros(shape), 0.3 * white(shape)):
        found = edgel.detect(frame(height))
        assert not (found.kind & int(STEPS | EdgeKind.BOUNDARY)).any()


def test_a_flat_frame_has_no_edge():
    assert len(edgel.detect(frame(np.zeros(SHAPE)))) == 0


@pytest.mark.parametrize("shape", [(1, 40), (40, 1)])
def test_one_row_or_column_of_a_plane_is_a_line(shape):
    with pytest.raises(ValueError, match="line"):
        edgel.detect(frame(np.zeros(shape)))


@pytest.mark.parametrize("shape", [(1, 40), (40, 1)])
def test_one_row_or_column_that_bends_is_no_error(shape):
    row, col = grid(*shape)
    found = edgel.detect(frame(-np.abs(row + col)))
    assert found.num_points == 40


def test_all_but_three_points_invalid():
    xyz = np.full((*SHAPE, 3), np.nan)
    for place in ((20, 30), (50, 70), (10, 90)):
        xyz[place] = frame(np.zeros(SHAPE))[place]
    found = edgel.detect(xyz)
    assert found.num_dropped == SHAPE[0] * SHAPE[1] - 3


def test_one_pixel_and_none_are_errors():
    for shape in ((1, 1), (1, 2), (2, 1)):
        with pytest.raises(ValueError, match="3"):
            edgel.detect(frame(np.zeros(shape)))
    with pytest.raises(ValueError, match="finite"):
        edgel.detect(np.full((*SHAPE, 3), np.nan))


def test_a_hole_in_a_frame_without_noise_divides_by_nothing():
    """Cells in which nothing is seen have no noise to divide by."""
    xyz = camera(rows=50, cols=60)
    xyz[20:30, 15:40] = np.nan
    xyz[:, 45:] += (0, 0, 60)
    rows = np.flatnonzero(np.isfinite(xyz[..., 2]))
    points = xyz.reshape(-1, 3)[rows]
    seen = see_edges(organized(points, rows, xyz.shape[:2]), points, EdgeKind.CREASE)
    assert np.isfinite(seen.facets.noise).all()
    assert fit_facets(seen.rays).noise.shape == (25, 30)
