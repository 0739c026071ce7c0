"""Where an edge runs and how its faces lie: the signs of normals and convexity, from every side."""

import numpy as np
import pytest

from edgel._surface import hinge
from edgel._surface.classify import Classification
from edgel._surface.evidence import Evidence
from edgel._surface.faces import crease_faces, localize

HALF = np.sqrt(0.5)


def wedge(up, swapped=False, flipped=(1, 1)):
    """Evidence of a right-angled ridge (up 1) or groove (up -1) along y, its line half a unit above the point."""
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
    return Evidence(np.zeros((1, 0), np.float32), fit, np.ones(1, bool))


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


def test_where_no_fit_places_an_edge_nothing_is_known():
    evidence = wedge(1)
    none = Evidence(evidence.features, evidence.fit, np.zeros(1, bool))
    faces = crease_faces(none, np.zeros((1, 3)), None)
    assert faces.convex.tolist() == [0]
    assert np.isnan(faces.position).all()
    assert np.isnan(faces.normals).all()
    classified = Classification(np.array([7]), np.ones(1), np.zeros(1), none)
    whole = localize(classified, np.array([4, 7]), np.ones((9, 3)), np.tile([0.0, 0, 1], (2, 1)), None)
    np.testing.assert_array_equal(whole.position, np.ones((2, 3)))
    np.testing.assert_array_equal(whole.normals[:, 0], [[0, 0, 1], [0, 0, 1]])
    assert np.isnan(whole.normals[:, 1]).all()


def test_creases_are_put_among_the_other_edge_points():
    classified = Classification(np.array([7]), np.ones(1), np.zeros(1), wedge(1))
    whole = localize(classified, np.array([4, 7]), np.arange(30.0).reshape(10, 3), np.tile([1.0, 0, 0], (2, 1)), None)
    np.testing.assert_allclose(whole.position, [[12, 13, 14], [21, 22, 23.5]])
    assert whole.convex.tolist() == [0, 1]
    np.testing.assert_array_equal(whole.normals[0, 0], [1, 0, 0])
    assert np.isnan(whole.angle[0])
    assert whole.angle[1] == pytest.approx(np.pi / 2)
