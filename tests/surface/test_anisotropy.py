"""Scan lines: what is said of a surface does not depend on how much closer its points lie along one direction."""

import numpy as np
import pytest

import edgel
from edgel import metrics, synth
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.scan_lines import scan_line_stretch
from edgel._surface import classify, cloud_statistics, screen
from edgel._surface.forest import Forest, load_forests
from edgel._surface.reach import evidence_reach
from edgel.edges import EdgeKind

ALL_LEAVES = Forest(np.zeros(1, np.int32), np.full(1, -1, np.int16), np.full(1, 9, np.float32), np.zeros(1, np.int32))
FORESTS = {**load_forests(), "leaf": ALL_LEAVES}


def test_a_compressed_cloud_whose_stretch_is_known_is_classified_as_it_was():
    scene = synth.sample(synth.wedge_fan(), pattern="uniform", spacing=3.0, noise=0.1, seed=4)
    direction, times = np.array([2.0, -1.0, 2.0]) / 3, 4.0
    xyz = scene.cloud.xyz
    compressed = xyz - (1 - 1 / times) * np.outer(xyz @ direction, direction)
    plain, squeezed = build_index(xyz), build_index(compressed)
    statistics = cloud_statistics(plain)
    expected = classify(plain, screen(plain, statistics, FORESTS))
    stretch = np.tile((times - 1) * direction[:, None], len(xyz))
    found = classify(squeezed, screen(squeezed, statistics, FORESTS, stretch))
    _, mine, theirs = np.intersect1d(found.points, expected.points, return_indices=True)
    assert len(mine) > 0.98 * len(expected.points)
    assert np.quantile(np.abs(found.crease[mine] - expected.crease[theirs]), 0.98) < 0.02
    sure = expected.evidence.placed[theirs] & found.evidence.placed[mine] & (expected.crease[theirs] > 0.5)
    there, here = expected.evidence.fit[theirs[sure], 6:12], found.evidence.fit[mine[sure], 6:12]
    line = there[:, :3] - (1 - 1 / times) * np.outer(there[:, :3] @ direction, direction)
    cosine = np.abs((line * here[:, :3]).sum(axis=1)) / np.linalg.norm(line, axis=1)
    assert np.quantile(cosine, 0.05) > 0.999
    foot = there[:, 3:] - (1 - 1 / times) * np.outer(there[:, 3:] @ direction, direction) - here[:, 3:]
    off = np.linalg.norm(np.cross(foot, here[:, :3]), axis=1)  # another point of the same line
    assert np.quantile(off, 0.95) < 0.01 * scene.spacing


def test_what_is_out_of_reach_changes_nothing_on_scan_lines():
    scene = synth.sample(synth.wedge_fan(), pattern="scan_lines", spacing=1.4, noise=0.1, seed=4)
    xyz = scene.cloud.xyz
    cut = np.quantile(xyz[:, 0], 0.9)
    tile = np.ascontiguousarray(xyz[xyz[:, 0] < cut])
    whole, part = build_index(xyz), build_index(tile)
    of_whole, of_part = scan_line_stretch(whole), scan_line_stretch(part)
    statistics, said = cloud_statistics(whole, of_whole), []
    for index, stretch in ((whole, of_whole), (part, of_part)):
        screening = screen(index, statistics, FORESTS, stretch)
        found = classify(index, screening)
        said.append(np.zeros((len(index), 2)))
        said[-1][found.points] = np.column_stack([found.crease, found.outline])
    reach = np.empty(len(tile))
    reach[part.order] = evidence_reach(part, screening.leaves, np.arange(len(part)), of_part)
    sure = reach < cut - tile[:, 0]
    assert sure.mean() > 0.1
    expected, told = said[0][xyz[:, 0] < cut], said[1]
    np.testing.assert_array_equal(told[sure], expected[sure])
    assert (told[sure] > 0.5).any()
    assert (told != expected).any()


def test_a_thin_plate_on_scan_lines():
    scene = synth.sample(synth.thin_plate(), pattern="scan_lines", spacing=1.0, noise=0.1, seed=2)
    found = edgel.detect(scene.cloud)
    near = 2.5 * scene.spacing
    away = metrics.nearest(scene.noise_free[found.index], scene.edges.positions).distances[:, 0]
    back = metrics.nearest(scene.edges.positions, scene.noise_free[found.index]).distances[:, 0]
    assert np.mean(away < near) > 0.97
    assert np.mean(back < near) > 0.97


def test_creases_on_scan_lines_bend_the_right_way():
    scene = synth.sample(synth.stepped_block(), pattern="scan_lines", spacing=1.6, noise=0.1, seed=2)
    found = edgel.detect(scene.cloud, kinds="crease", orient="outward")
    nearest = metrics.nearest(found.position, scene.edges.positions)
    here = nearest.distances[:, 0] < 1.5 * scene.spacing
    convex, wanted = found.convex[here], scene.edges.convex[nearest.points[here, 0]]
    told = convex != 0
    assert told.mean() > 0.9
    assert np.mean(convex[told] == wanted[told]) > 0.97


@pytest.mark.parametrize(("solid", "kind"), [(synth.frustum, EdgeKind.CREASE), (synth.wavy_sheet, EdgeKind.BOUNDARY)])
@pytest.mark.parametrize("noise", [0.1, 1.0])
def test_positions_are_as_sure_as_they_say(solid, kind, noise):
    body = solid()
    scene = synth.sample(body, pattern="uniform", spacing=2 * body.spacing, noise=noise, seed=3)
    found = edgel.detect(scene.cloud, kinds=kind, method="surface")
    edges = scene.edges.take((scene.edges.kind & int(kind)) > 0)
    nearest = metrics.nearest(found.position, edges.positions)
    way = found.position - edges.positions[nearest.points[:, 0]]
    way -= (way * found.direction).sum(axis=1, keepdims=True) * found.direction
    off = np.linalg.norm(way, axis=1) / found.position_std
    off = off[(nearest.distances[:, 0] < 1.5 * scene.spacing) & np.isfinite(off)]
    assert len(off) > 100
    assert 0.45 < np.mean(off < 1) < 0.85  # in two dimensions .63 are nearer than the root of the mean square
    assert np.mean(off < 2) > 0.85
    assert np.mean(off < 3) > 0.9
