"""Where an edge runs and how its faces lie: the signs of normals and convexity, from every side."""

import numpy as np
import pytest
from alone import alone

import edgel
from edgel import synth
from edgel._surface import curved_faces, hinge
from edgel._surface.faces import crease_faces

HALF = np.sqrt(0.5)


def wedge(up, swapped=False, flipped=(1, 1)):
    """The edge of a right-angled ridge (up 1) or groove (up -1) along y, its line half a unit above the point."""
    fit = np.zeros((1, hinge.HINGE), np.float32)
    sides = [((HALF, 0, HALF), (1, 0, -up)), ((-HALF, 0, HALF), (-1, 0, -up))]
    sides = [((normal[0] * up, 0, normal[2]), centroid) for normal, centroid in sides]
    for (normal, centroid), sign, at, middle in zip(
        sides[::-1] if swapped else sides,
        flipped,
        (hinge.FIRST_NORMAL, hinge.SECOND_NORMAL),
        (hinge.FIRST_CENTROID, hinge.SECOND_CENTROID),
        strict=True,
    ):
        fit[0, at : at + 3] = sign * np.array(normal)
        fit[0, middle : middle + 3] = np.array(centroid) + [0, 0, 0.5]
    fit[0, hinge.LINE : hinge.LINE + 3] = 0, 1, 0
    fit[0, hinge.FOOT : hinge.FOOT + 3] = 0, 0, 0.5
    edge = np.empty((1, curved_faces.EDGE))
    alone(curved_faces.outside)(fit[0].astype(np.float64), 1.0, edge[0])
    return edge


@pytest.mark.parametrize("flipped", [(1, 1), (1, -1), (-1, 1), (-1, -1)])
@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(
    ("up", "viewpoint", "convex"),
    [
        (1, None, 1),
        (-1, None, -1),
        (1, (0.3, 0, 9), 1),
        (-1, (0.3, 0, 9), -1),
        (1, (0.3, 0, -9), -1),  # a ridge from below is a groove
        (-1, (0.3, 0, -9), 1),
    ],
)
def test_a_ridge_is_convex_and_a_groove_is_not_seen_from_the_side_of_the_normals(
    up, viewpoint, convex, swapped, flipped
):
    """Which plane the fit calls the first, and which way its normals point, must not matter."""
    at = np.array([[10.0, 20, 30]])
    eye = None if viewpoint is None else at[0] + viewpoint
    faces = crease_faces(wedge(up, swapped, flipped), at, eye)
    assert faces.convex.tolist() == [convex]
    assert faces.angle == pytest.approx(np.pi / 2)
    np.testing.assert_allclose(faces.position, at + [0, 0, 0.5])
    seen = 1.0 if viewpoint is None or viewpoint[2] > 0 else -1.0
    normals = sorted(faces.normals[0].tolist())
    np.testing.assert_allclose(normals, sorted([[-HALF, 0, seen * HALF], [HALF, 0, seen * HALF]]), atol=1e-7)
    if eye is not None:  # the face that the viewer sees better comes first
        sight = (eye - at[0]) @ faces.normals[0].T
        assert sight[0] >= sight[1]


def test_planes_that_hardly_turn_are_no_edge():
    edge = wedge(1)
    edge[0, curved_faces.SECOND : curved_faces.SECOND + 3] = edge[0, curved_faces.FIRST : curved_faces.FIRST + 3]
    faces = crease_faces(edge, np.zeros((1, 3)), None)
    assert faces.convex.tolist() == [0]
    assert np.isnan(faces.position).all()
    assert np.isnan(faces.normals).all()


def plate_with_hole(radius):
    """Points are to be 1 apart; the rims of the hole lie at z = 0 and 12."""
    return synth.lathe([(radius, 0), (radius + 14, 0), (radius + 14, 12), (radius, 12)], spacing=1.0)


@pytest.mark.parametrize(("noise", "bias", "off"), [(0, 0.05, 0.05), (0.3, 0.15, 0.5)])
@pytest.mark.parametrize("radius", [3.6, 14])
def test_rims_of_holes_are_placed_without_bias_and_say_how_sure_that_is(radius, noise, bias, off):
    errors, stated = [], []
    for seed in range(4 if radius < 5 else 1):
        scene = synth.sample(plate_with_hole(radius), pattern="blue_noise", spacing=1.0, noise=noise, seed=seed)
        found = edgel.detect(scene.cloud, kinds="crease")
        away = np.hypot(*found.position[:, :2].T) - radius
        height = np.minimum(np.abs(found.position[:, 2]), np.abs(found.position[:, 2] - 12))
        rim = np.abs(away) < 1.5
        errors.append(np.stack([away, height], axis=1)[rim])
        stated.append(found.position_std[rim])
    error, std = np.concatenate(errors), np.concatenate(stated)
    assert abs(error[:, 0].mean()) <= bias
    assert np.median(np.linalg.norm(error, axis=1)) <= off
    known = np.isfinite(std)
    assert known.mean() > 0.8
    if noise:  # without, what is stated is a floor; of a normal error in two directions the median is 0.83
        assert 0.5 < np.median(np.linalg.norm(error[known], axis=1) / std[known]) < 1.3


@pytest.mark.parametrize("pattern", ["uniform", "blue_noise", "vertices"])
def test_ends_of_a_surface_have_a_place_a_tangent_and_a_deviation(pattern):
    scene = synth.sample(synth.plane(side=60.0), pattern=pattern, spacing=1.0, seed=1)
    found = edgel.detect(scene.cloud, kinds="boundary", method="surface")

    def inside(places):
        return np.minimum(places[:, :2], 60 - places[:, :2]).min(axis=1)

    before, after = inside(scene.cloud.xyz[found.index]), inside(found.position)
    assert np.isfinite(found.position_std).mean() > 0.98
    assert abs(after.mean()) <= max(0.4 * before.mean(), 0.06)
    assert np.nanmedian(np.abs(after) / found.position_std) < 1.2
    along = np.abs(found.direction[:, :2]).max(axis=1)
    assert np.nanmedian(np.degrees(np.arccos(np.clip(along, 0, 1)))) < 4
    np.testing.assert_allclose(found.position[:, 2], 0, atol=1e-9)
