"""`edgel.Model`: exact edges of meshes and STEP, symmetries, and every instance in a scene."""

import numpy as np
import pytest

import edgel
from edgel import Cloud, Model, synth
from edgel.matching._half_edges import of_edges
from edgel.matching._mesh import creases_of, triangles_of
from edgel.matching._symmetry import TURNS

SPACING = 1.6


def solid_mesh(solid):
    return solid.vertices, solid.triangles


@pytest.fixture(scope="module")
def block():
    return Model(solid_mesh(synth.stepped_block()))


def test_a_cube_has_twelve_edges_with_two_faces_each():
    solid = synth.blocks("cube", np.ones((1, 1, 1), bool), [0, 10], [0, 10], [0, 10], spacing=1.0)
    half = creases_of(*triangles_of(*solid_mesh(solid)))
    assert np.allclose(half.turn, np.pi / 2)
    assert (half.bend == 1).all()
    into, outside, along = half.frames.transpose(1, 0, 2)
    assert np.allclose(np.cross(into, outside), along)
    middle = half.places - 5
    assert ((outside * middle).sum(axis=1) > 4.9).all()
    assert ((into * middle).sum(axis=1) < 0).all()
    on = np.isclose(np.abs(middle), 5).sum(axis=1)
    assert (on >= 2).all()
    lengths = 10 * 24 / len(half)
    assert lengths < 10 * np.sqrt(3) / 200


def test_the_edge_of_a_hole_is_concave(block):
    half = block.prepared.half
    assert set(np.unique(half.bend)) == {-1, 1}
    at_recess = (np.abs(half.places[:, 2] - 22) < 1e-9) & (half.bend < 0)
    assert at_recess.any()


def test_half_edges_of_a_scan_are_those_of_its_part(block):
    """Those that are found lie where the part has one with the same frame."""
    cloud = synth.sample(synth.stepped_block(), pattern="blue_noise", spacing=SPACING, noise=0.1).cloud
    edges = edgel.detect(cloud, orient="outward")
    half = of_edges(edges, cloud.xyz[:0], cloud.xyz[:0], SPACING, None)
    near = np.linalg.norm(half.places[:, None] - block.prepared.half.places[None, ::3], axis=2)
    alike = (half.frames[:, None, 0] * block.prepared.half.frames[None, ::3, 0]).sum(axis=2) > 0.9
    alike &= (half.frames[:, None, 1] * block.prepared.half.frames[None, ::3, 1]).sum(axis=2) > 0.9
    assert np.mean(((near < SPACING) & alike).any(axis=1)) > 0.85


def test_a_part_is_found_in_a_view(block):
    scene = synth.view(synth.stepped_block(), projection="pinhole", spacing=SPACING, noise=0.3)
    (one,) = block.find(scene.cloud)
    moved = block.to_cloud().xyz
    there = moved @ one.T_target_source[:3, :3].T + one.T_target_source[:3, 3]
    true = moved @ scene.pose[:3, :3].T + scene.pose[:3, 3]
    assert np.linalg.norm(there - true, axis=1).max() < 0.3 * SPACING
    assert edgel.register(block, scene.cloud).margin == one.margin


def test_every_instance_is_found_once(block):
    scene = synth.sample(synth.stepped_block(), pattern="blue_noise", spacing=SPACING, noise=0.1).cloud.xyz
    second = scene @ np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]).T + [300, 0, 0]
    found = block.find(np.concatenate([scene, second]), most=4)
    assert len(found) == 2
    shifts = sorted(one.T_target_source[0, 3] for one in found)
    assert np.allclose(shifts, [0, 300], atol=SPACING)


@pytest.mark.parametrize(("solid", "count"), [(synth.frustum(), 6), (synth.stepped_block(), 1), (synth.gear(), 32)])
def test_symmetries_are_named(solid, count):
    symmetries = Model(solid_mesh(solid)).symmetries
    assert len(symmetries) == count
    assert np.allclose(symmetries[0], np.eye(4))
    corners = solid.vertices
    for move in symmetries:  # every corner comes to lie on a corner
        moved = corners @ move[:3, :3].T + move[:3, 3]
        assert np.linalg.norm(moved[:, None] - corners[None], axis=2).min(axis=1).max() < 0.02 * solid.size


def test_a_cylinder_may_turn_by_any_angle_and_over():
    symmetries = Model(solid_mesh(synth.cylinder())).symmetries
    assert len(symmetries) == 2 * TURNS
    assert np.allclose(np.abs(symmetries[:, 2, 2]), 1, atol=1e-3)


def test_symmetries_that_are_given_are_taken():
    half = np.diag([-1.0, -1, 1, 1])
    model = Model(solid_mesh(synth.frustum()), symmetries=[half])
    assert np.array_equal(model.symmetries, [np.eye(4), half])


def test_a_symmetric_part_is_no_doubt():
    """The six poses of a frustum are one answer."""
    solid = synth.frustum()
    scene = synth.view(solid, projection="pinhole", spacing=SPACING, noise=0.2)
    (one,) = Model(solid_mesh(solid)).find(scene.cloud)
    assert len(one.symmetries) == 6
    assert one.margin > edgel.matching.SURE


def test_a_file_in_another_unit(tmp_path):
    trimesh = pytest.importorskip("trimesh", reason="the extra mesh is not installed")
    solid = synth.stepped_block()
    path = tmp_path / "block.stl"
    trimesh.Trimesh(*solid_mesh(solid), process=False).export(path)
    model = Model(path, scale=0.001)
    assert "block" in repr(model)
    assert np.isclose(model.prepared.size, solid.size / 1000, rtol=1e-3)
    assert len(model.prepared.half) == len(Model(solid_mesh(solid)).prepared.half)


def test_a_step_file_has_exact_normals(tmp_path):
    cad = pytest.importorskip("build123d", reason="the extra step is not installed")
    path = tmp_path / "part.step"
    cad.export_step(cad.Box(40, 30, 20) - cad.Pos(0, 0, 5) * cad.Cylinder(8, 40), str(path))
    model = Model(path)
    half = model.prepared.half
    assert np.allclose(half.turn, np.pi / 2, atol=1e-3)
    radius = np.hypot(*half.places[:, :2].T)
    rim = np.abs(radius - 8) < 0.1
    assert 0 < rim.sum() < len(half)
    assert np.abs(np.abs(half.frames[rim, 1, 2]) - (np.abs(half.frames[rim, 1, 2]) > 0.5)).max() < 1e-3


@pytest.mark.parametrize(
    ("arguments", "options", "error", "message"),
    [
        ((np.eye(3), [[0, 1, 5]]), {}, ValueError, "rows of the vertices"),
        ((np.eye(3), [[0, 0, 0]]), {}, ValueError, "no triangle has an area"),
        ((np.full((3, 3), np.nan), [[0, 1, 2]]), {}, ValueError, "not finite"),
        ((np.eye(3), [[0, 1]]), {}, ValueError, "expected vertices"),
        (7, {}, TypeError, "expected a file"),
        ((np.eye(3), [[0, 1, 2]]), {"scale": 0}, ValueError, "scale"),
        ((np.eye(3), [[0, 1, 2]]), {"symmetries": np.eye(4)}, ValueError, "symmetries"),
        ("part.txt", {}, edgel.FormatError, "a part is a mesh"),
        ("none.step", {}, edgel.FormatError, "no such file"),
    ],
)
def test_what_is_no_part_is_refused(arguments, options, error, message):
    with pytest.raises(error, match=message):
        Model(arguments, **options)


def test_an_empty_scene_is_refused(block):
    with pytest.raises(ValueError, match="needs at least 3 points"):
        block.find(np.empty((0, 3)))
    with pytest.raises(ValueError, match="most"):
        block.find(Cloud(np.eye(3)), most=0)


def test_nothing_is_found_where_it_is_not(block):
    assert block.find(synth.sample(synth.sphere(), pattern="blue_noise", spacing=1.5).cloud) == []
