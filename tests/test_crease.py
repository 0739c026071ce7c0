"""The three crease tests against their naive oracles, and what the vote of them must and must not find."""

import math

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from edgel.crease import crease_angles
from edgel.crease.hinge import hinge_angle
from edgel.crease.near import planes_near
from edgel.crease.through import planes_through
from edgel.kdtree import build_index

SEEDS = st.integers(0, 2**32 - 1)
ANGLE = math.radians(25.0)


def neighbourhood(seed, count):
    """Points about the origin, nearest first, on a roof of some angle, a bend, or nothing in particular."""
    rng = np.random.default_rng(seed)
    xy = np.r_[np.zeros((1, 2)), rng.uniform(-2.5, 2.5, (count - 1, 2))]
    kind = rng.integers(4)
    slope, shift = rng.uniform(0, 3), rng.choice([0.0, 0.0, rng.normal()])
    z = [-slope * np.abs(xy[:, 0] - shift), slope * xy[:, 0] ** 2 / 4, rng.normal(size=count), 0 * xy[:, 0]][kind]
    points = np.c_[xy, z] + rng.normal(0, rng.choice([0.0, 0.05]), (count, 3))
    points -= points[0]
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    points = points @ q
    return points[np.argsort((points**2).sum(axis=1), kind="stable")]


@given(SEEDS)
def test_planes_through_are_those_of_the_oracle(seed):
    points = neighbourhood(seed, 21)
    found = planes_through(points, 21, 1.0, math.cos(ANGLE))
    assert found == pytest.approx(naive.planes_through(points, 1.0, ANGLE), abs=1e-6)


@given(SEEDS)
def test_planes_near_are_those_of_the_oracle(seed):
    rng = np.random.default_rng(seed)
    points = neighbourhood(seed, 32)
    normals = rng.normal(size=(32, 3))
    normals = np.where(rng.random((32, 1)) < 0.5, normals, normals[:1] + 0.05 * normals)
    planes = np.c_[normals / np.linalg.norm(normals, axis=1, keepdims=True), rng.random(32)]
    squared = (points**2).sum(axis=1)
    found = planes_near(np.arange(32), squared, points, 32, 1.0, planes, math.cos(ANGLE))
    expected = naive.planes_near(planes[:, :3], planes[:, 3], points, np.sqrt(squared), 1.0, ANGLE)
    assert found == pytest.approx(expected, abs=1e-6)


@given(SEEDS)
def test_hinge_is_that_of_the_oracle(seed):
    points = neighbourhood(seed, 17)
    normal = naive.plane(points)[0]
    # Any frame in the plane would do, but the tried directions begin at u: the oracle gets the same.
    axis = np.eye(3)[0 if abs(normal[0]) < 0.9 else 1]
    u = axis - (axis @ normal) * normal
    u /= np.linalg.norm(u)
    found = hinge_angle(points, 17, 1.0, normal[0], normal[1], normal[2], np.empty((6, 7)))
    expected = naive.hinge(points, 1.0, u, np.cross(normal, u), normal)
    # Two lines that fit equally well may differ by rounding: then only the fact of a crease is compared.
    assert found == pytest.approx(expected, abs=1e-4) or (found > 0) == (expected > 0)


@pytest.mark.parametrize("turn", [35, 60, 85])
def test_a_roof_is_found_with_its_angle(turn):
    rng = np.random.default_rng(0)
    x, y = (g.ravel() for g in np.meshgrid(np.arange(-15.0, 16), np.arange(31.0)))
    half = math.radians(turn / 2)
    points = np.c_[x * math.cos(half), y, -np.abs(x) * math.sin(half)] + rng.uniform(-0.02, 0.02, (len(x), 3))
    angles = crease_angles(build_index(points), points, ANGLE)
    ridge = (x == 0) & (y > 2) & (y < 28)
    assert np.mean(angles[ridge] > 0) > 0.9
    assert np.degrees(np.median(angles[ridge & (angles > 0)])) == pytest.approx(turn, abs=6)
    assert not angles[(np.abs(x) > 1) & (np.abs(x) < 13) & (y > 2) & (y < 28)].any()


@pytest.mark.parametrize("radius", [5.0, 10.0, 40.0])
def test_a_cylinder_has_none(radius):
    rng = np.random.default_rng(0)
    turn, y = (g.ravel() for g in np.meshgrid(np.arange(0, 2 * np.pi, 1 / radius), np.arange(30.0)))
    points = np.c_[radius * np.cos(turn), y, radius * np.sin(turn)] + rng.uniform(-0.02, 0.02, (len(y), 3))
    inner = (y > 3) & (y < 26)
    assert not crease_angles(build_index(points), points, ANGLE)[inner].any()
