"""The fittings: their meshes end and bend where their edges say, which are drawn exactly."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from exact_fittings import BEND, BOUNDS, END, PARTS, R, distance_to_surface, height, lengths

from edgel import synth


def test_part_extents():
    for name, part in PARTS.items():
        low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
        np.testing.assert_allclose([low[:2], high[:2]], BOUNDS[name], atol=1e-12)
        np.testing.assert_allclose([low[2], high[2]], [0, R], atol=1e-12)


def test_bad_parts_are_refused():
    with pytest.raises(ValueError, match="centre_to_end"):
        synth.tee(centre_to_end=50.0)
    with pytest.raises(ValueError, match="bend_radius"):
        synth.elbow(bend_radius=50.0)
    with pytest.raises(ValueError, match="outside_diameter"):
        synth.tee(outside_diameter=-1.0)
    with pytest.raises(FrozenInstanceError):
        PARTS["tee"].name = "other"  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize("part", PARTS.values(), ids=PARTS)
def test_edges_are_finely_sampled_and_lie_on_the_part(part):
    for edge in part.edges:
        assert np.linalg.norm(np.diff(edge.points, axis=0), axis=1).max() <= 0.05 + 1e-12
        np.testing.assert_allclose(distance_to_surface(part.name, edge.points), 0, atol=1e-9)
        assert edge.points[:, 2].min() > -1e-9


@pytest.mark.parametrize("part", PARTS.values(), ids=PARTS)
def test_edges_are_those_of_the_mesh(part):
    """What is drawn exactly is what the triangles say but for their chords, and the seam's faint beginning."""
    found = synth.make_solid(part.name, part.corners, part.face, part.normals, spacing=part.spacing)
    assert sum(edge.length for edge in found.boundaries) == pytest.approx(
        sum(edge.length for edge in part.boundaries), abs=0.05
    )
    for own in part.creases:
        mesh = min(found.creases, key=lambda edge, own=own: np.linalg.norm(edge.points.mean(0) - own.points.mean(0)))
        assert 0 <= own.length - mesh.length < 1.0
        away = synth.nearest_edge(mesh.points, [own])
        np.testing.assert_allclose(away.distance, 0, atol=1e-5)
        np.testing.assert_allclose(away.dihedral, mesh.dihedral, atol=1e-4)
        heading = [edge.points[-1, 2] - edge.points[0, 2] for edge in (own, mesh)]
        left = 0 if heading[0] * heading[1] > 0 else 1  # the left face comes first, whichever way the curve runs
        assert mesh.normals is not None
        assert own.normals is not None
        highest = [edge.points[:, 2].argmax() for edge in (own, mesh)]
        first = own.normals[highest[0], left] - mesh.normals[highest[1], 0]
        assert np.linalg.norm(first) < 0.02


def test_edges_of_the_tee():
    part = PARTS["tee"]
    np.testing.assert_allclose(lengths(part, "rim"), [np.pi * R] * 3, rtol=1e-6)
    np.testing.assert_allclose(lengths(part, "outline"), [END - R] * 4 + [2 * END], rtol=1e-9)
    assert len(lengths(part, "seam")) == len(part.creases) == 2
    for edge in part.boundaries:
        if edge.name == "outline":
            assert np.all(edge.points[:, 2] == 0)
        else:
            assert edge.name == "rim"
            at_mouth = np.column_stack([np.abs(edge.points[:, 0]), edge.points[:, 1]])
            assert np.any(np.all(np.abs(at_mouth - END) < 1e-9, axis=0))


def test_edges_of_the_elbow():
    part = PARTS["elbow"]
    np.testing.assert_allclose(lengths(part, "rim"), [np.pi * R] * 2, rtol=1e-6)
    np.testing.assert_allclose(lengths(part, "outline"), [np.pi / 2 * (BEND - R), np.pi / 2 * (BEND + R)], rtol=1e-6)
    assert part.creases == ()


@pytest.mark.parametrize("part", PARTS.values(), ids=PARTS)
def test_the_surface_lies_left_of_its_boundaries(part):
    found = synth.make_solid(part.name, part.corners, part.face, part.normals, spacing=part.spacing)
    ways = np.concatenate([edge.points[1:] - edge.points[:-1] for edge in found.boundaries])
    middles = np.concatenate([(edge.points[1:] + edge.points[:-1]) / 2 for edge in found.boundaries])
    for edge in part.boundaries:
        step = edge.points[len(edge.points) // 2 + 1] - edge.points[len(edge.points) // 2]
        near = np.linalg.norm(middles - edge.points[len(edge.points) // 2], axis=1).argmin()
        assert step @ ways[near] > 0


def test_the_seam_of_the_tee_and_its_dihedral():
    part = PARTS["tee"]
    for seam in part.creases:
        x, y, z = seam.points.T
        np.testing.assert_allclose(y, np.abs(x), atol=1e-12)
        np.testing.assert_allclose(z, np.sqrt(np.maximum(R**2 - x**2, 0)), atol=1e-5)
        np.testing.assert_allclose(seam.dihedral, np.arccos(np.clip(1 - x**2 / R**2, -1, 1)), atol=1e-7)
        np.testing.assert_allclose(seam.dihedral[[0, -1]], [0, np.pi / 2], atol=1e-12)
        assert np.all(np.diff(seam.dihedral) > 0)
        assert seam.normals is not None
        run, branch = seam.points * (0, 1, 1) / R, seam.points * (1, 0, 1) / R
        left_first = (run, branch) if x[-1] < 0 else (branch, run)
        np.testing.assert_allclose(seam.normals, np.stack(left_first, axis=1), atol=1e-12)
        inner = slice(100, -100)
        for side, normals in ((-1e-6, run), (1e-6, branch)):
            px, py = seam.points[inner, 0], seam.points[inner, 1] + side
            slopes = [
                (height("tee", px + dx, py + dy) - height("tee", px - dx, py - dy)) / 2e-7
                for dx, dy in ((1e-7, 0), (0, 1e-7))
            ]
            measured = np.column_stack([-slopes[0], -slopes[1], np.ones(len(px))])
            measured /= np.linalg.norm(measured, axis=1)[:, None]
            np.testing.assert_allclose(normals[inner], measured, atol=1e-5)
    assert all(np.isnan(edge.dihedral).all() for edge in part.boundaries)


def test_bad_edges_are_refused():
    two = np.zeros((2, 3))
    with pytest.raises(ValueError, match="kind"):
        synth.EdgeCurve("fold", two)
    with pytest.raises(ValueError, match="points"):
        synth.EdgeCurve("boundary", np.zeros((1, 3)))
    with pytest.raises(ValueError, match="normals"):
        synth.EdgeCurve("crease", two)
    with pytest.raises(ValueError, match="normals"):
        synth.EdgeCurve("crease", two, np.zeros((2, 3)))
    with pytest.raises(ValueError, match="curves"):
        synth.nearest_edge(two, [])
    with pytest.raises(ValueError, match="finite"):
        synth.nearest_edge([[np.nan, 0, 0]], [synth.EdgeCurve("boundary", two)])
