"""Solids: closed where they should be, of the right size, and their creases where and as sharp as geometry says."""

from collections import Counter

import numpy as np
import pytest

from edgel import synth
from edgel.metrics import line_angles
from edgel.synth.rays import build_ray_tree, cast
from edgel.synth.solid import MIN_TURN, flat_normals, is_convex, make_solid

CLOSED = ("frustum", "stepped_block", "cube_fractal", "wedge_fan", "thin_plate", "gear", "sphere", "torus", "cylinder")
OPEN = ("plane", "wavy_sheet", "bezier_ridge")
SMOOTH = ("sphere", "torus", "wavy_sheet", "plane")
SOLIDS = {name: getattr(synth, name)() for name in (*CLOSED, *OPEN)}
EULER = {"torus": 0, "gear": 0}


def edges_of(solid):
    sides = np.concatenate([solid.triangles[:, [0, 1]], solid.triangles[:, [1, 2]], solid.triangles[:, [2, 0]]])
    return np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)


@pytest.mark.parametrize("name", CLOSED)
def test_closed_solids_are_watertight_and_of_the_right_genus(name):
    solid = SOLIDS[name]
    edges, count = edges_of(solid)
    assert (count == 2).all()
    assert solid.boundaries == ()
    used = len(np.unique(solid.triangles))
    assert used - len(edges) + len(solid.triangles) == EULER.get(name, 2)
    assert solid.volume > 0


@pytest.mark.parametrize("name", OPEN)
def test_open_ones_end_in_their_boundaries(name):
    solid = SOLIDS[name]
    edges, count = edges_of(solid)
    rim = edges[count == 1]
    assert set(count) <= {1, 2}
    length = np.linalg.norm(solid.vertices[rim[:, 0]] - solid.vertices[rim[:, 1]], axis=1).sum()
    assert sum(curve.length for curve in solid.boundaries) == pytest.approx(length)
    assert len(np.unique(solid.triangles)) - len(edges) + len(solid.triangles) == 1  # a disc


def test_areas_and_volumes():
    side = {n: SOLIDS[n] for n in SOLIDS}
    hexagon = 3 * np.sqrt(3) / 2
    low, high = hexagon * 40**2, hexagon * 24**2
    assert side["frustum"].volume == pytest.approx(45 / 3 * (low + high + np.sqrt(low * high)))
    assert side["plane"].area == pytest.approx(120**2)
    assert side["sphere"].area == pytest.approx(4 * np.pi * 25**2, rel=1e-3)
    assert side["sphere"].volume == pytest.approx(4 / 3 * np.pi * 25**3, rel=1e-3)
    assert side["torus"].area == pytest.approx(4 * np.pi**2 * 30 * 12, rel=1e-3)
    assert side["torus"].volume == pytest.approx(2 * np.pi**2 * 30 * 12**2, rel=1e-3)
    assert side["cylinder"].volume == pytest.approx(np.pi * 20**2 * 50, rel=1e-3)
    assert side["thin_plate"].volume == pytest.approx(140 * 80 * 2.2)
    # The cube, and on its 6 faces a cube of a third, and on each of those 5 more.
    a = 40.5
    assert side["cube_fractal"].volume == pytest.approx(a**3 + 6 * (a / 3) ** 3 + 30 * (a / 9) ** 3)
    assert side["cube_fractal"].area == pytest.approx(6 * a**2 + 6 * 4 * (a / 3) ** 2 + 30 * 4 * (a / 9) ** 2)
    wanted = 90 * 60 * 15 + 60 * 60 * 15 + 30 * 60 * 15 - 30 * 32 * 8 - 14 * 32 * 7
    assert side["stepped_block"].volume == pytest.approx(wanted)


@pytest.mark.parametrize("name", SOLIDS)
def test_normals_and_chords_are_those_of_a_fine_mesh(name):
    solid = SOLIDS[name]
    np.testing.assert_allclose(np.linalg.norm(solid.normals, axis=2), 1, atol=1e-12)
    assert (solid.normals * flat_normals(solid.corners)).sum(axis=2).min() > np.cos(np.radians(5))
    # Over a chord d whose ends' normals differ by dn, the surface is off by about d . dn / 8.
    for i in range(3):
        chord = solid.corners[:, i] - solid.corners[:, i - 1]
        turn = solid.normals[:, i] - solid.normals[:, i - 1]
        assert (np.abs((chord * turn).sum(axis=1)) / 8).max() < 0.008 * solid.spacing  # views are finer by a fifth


@pytest.mark.parametrize("name", SMOOTH)
def test_negatives_have_no_crease(name):
    assert SOLIDS[name].creases == ()


def test_frustum_has_18_creases_with_the_known_angles():
    solid = SOLIDS["frustum"]
    assert len(solid.creases) == 18
    inset = (40 - 24) * np.cos(np.pi / 6)  # of a wall, over the height
    tilt = np.arctan2(inset, 45)
    wall = np.array([np.cos(tilt), 0, np.sin(tilt)])
    c, s = np.cos(np.pi / 3), np.sin(np.pi / 3)
    between = np.arccos(wall @ [c * wall[0], s * wall[0], wall[2]])
    found = Counter(round(float(np.degrees(crease.dihedral[0])), 6) for crease in solid.creases)
    wanted = [90 - np.degrees(tilt), 90 + np.degrees(tilt), np.degrees(between)]
    assert found == {round(float(angle), 6): 6 for angle in wanted}


def test_wedge_fan_has_every_angle_and_its_foot():
    solid = SOLIDS["wedge_fan"]
    convex, concave = Counter(), Counter()
    for crease in solid.creases:
        along = crease.points[-1] - crease.points[0]
        if abs(along[1]) > 39 and crease.points[:, 2].min() > -1e-9:  # across the top
            bent = is_convex(crease.normals[:1], along[None] / np.linalg.norm(along))[0]
            (convex if bent else concave)[round(float(np.degrees(crease.dihedral[0])))] += 1
    assert convex == Counter({180 - angle: 1 for angle in range(10, 180, 10)}) + Counter({90: 2})  # and both ends
    assert concave == Counter(2 * [90 - angle // 2 for angle in range(10, 180, 10)])


def test_bezier_ridge_turns_more_and_more():
    (crease,) = SOLIDS["bezier_ridge"].creases
    turn = np.sort(np.degrees(crease.dihedral[[0, -1]]))
    np.testing.assert_allclose(turn, [2 * np.degrees(np.arctan(0.18)), 90], atol=2)


@pytest.mark.parametrize("name", SOLIDS)
def test_crease_normals_are_square_to_the_curve_and_left_comes_first(name):
    solid = SOLIDS[name]
    for crease in solid.creases:
        tangent = np.diff(crease.points, axis=0)
        tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
        middle = (crease.normals[:-1] + crease.normals[1:]) / 2
        np.testing.assert_allclose(np.einsum("ijk,ik->ij", middle, tangent), 0, atol=5e-3)
        assert crease.dihedral.max() > MIN_TURN
    if name in ("frustum", "thin_plate", "cylinder"):  # convex bodies
        for crease in solid.creases:
            tangent = crease.points[1] - crease.points[0]
            assert is_convex(crease.normals[:1], tangent[None]).all()


def test_stepped_block_has_both_signs():
    edges = synth.sample(SOLIDS["stepped_block"], spacing=2.0).edges
    assert set(edges.convex) == {-1, 1}
    foot = (np.abs(edges.positions[:, 0] - 60) < 1e-9) & (np.abs(edges.positions[:, 2] - 15) < 1e-9)
    assert (edges.convex[foot] == -1).all()
    assert foot.any()


def test_dihedral_fades_below_a_degree_is_no_crease():
    def roof(turn):
        half = np.tan(np.radians(turn) / 2)
        corners = np.array(
            [
                [[-1, 0, -half], [0, 0, 0], [0, 1, 0]],
                [[0, 0, 0], [1, 0, -half], [0, 1, 0]],
            ]
        )
        return make_solid("roof", corners, np.arange(2), flat_normals(corners), spacing=1.0)

    assert len(roof(0.9).creases) == 0
    assert len(roof(1.1).creases) == 1


def test_broken_meshes_are_refused():
    flat = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [1, 0, 0], [0, -1, 0]]])
    with pytest.raises(ValueError, match="outside"):
        make_solid("x", flat, np.arange(2), flat_normals(flat), spacing=1.0)
    fan = np.concatenate([flat, [[[1.0, 0, 0], [0, 0, 0], [0, 0, 1]]]])
    with pytest.raises(ValueError, match="more than two"):
        make_solid("x", fan, np.arange(3), flat_normals(fan), spacing=1.0)


@pytest.mark.parametrize("name", ["stepped_block", "gear", "frustum"])
def test_rays_meet_what_brute_force_meets(name):
    solid = SOLIDS[name]
    rng = np.random.default_rng(3)
    origins = rng.normal(size=(200, 3)) * 80 + solid.vertices.mean(axis=0)
    targets = solid.vertices[rng.integers(len(solid.vertices), size=200)] + rng.normal(size=(200, 3)) * 8
    targets[:20] = solid.vertices[solid.triangles[:20]].mean(axis=1)
    directions = targets - origins
    directions[20:30, 0] = 0  # parallel to the sides of the boxes
    found = cast(build_ray_tree(solid), origins, directions)
    a, b, c = np.moveaxis(solid.corners, 1, 0)
    for i in range(len(origins)):
        matrix = np.stack([b - a, c - a, np.broadcast_to(-directions[i], a.shape)], axis=-1)
        solvable = np.abs(np.linalg.det(matrix)) > 1e-9
        u, v, t = np.linalg.solve(matrix[solvable], (origins[i] - a[solvable])[..., None])[..., 0].T
        inside = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        wanted = t[inside].min() if inside.any() else np.inf
        assert found.distance[i] == pytest.approx(wanted, rel=1e-9)
    hit = found.triangle >= 0
    assert 0.1 < hit.mean() < 1
    places = np.einsum("ij,ijk->ik", found.weights[hit], solid.corners[found.triangle[hit]])
    np.testing.assert_allclose(places, origins[hit] + found.distance[hit, None] * directions[hit], atol=1e-9)
    assert np.isnan(found.weights[~hit]).all()


def test_line_angles_of_curve_samples_match_the_circle():
    edges = synth.sample(SOLIDS["cylinder"], spacing=0.6).edges
    ring = np.stack([-edges.positions[:, 1], edges.positions[:, 0], np.zeros(len(edges))], axis=1)
    assert np.degrees(line_angles(edges.tangents, ring / np.linalg.norm(ring, axis=1, keepdims=True)).max()) < 1
