"""`edgel.register`: known poses come back, what is open is said, and what cannot be answered is not."""

from functools import cache
from typing import Any

import numpy as np
import pytest

import edgel
from edgel import Cloud, synth
from edgel.matching._prepare import prepare
from edgel.matching._search import Match
from edgel.matching._verify import NOTHING, confirm

SPACING = 1.6


def turn(axis, degrees):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    across = np.cross(np.eye(3), -axis)
    return np.eye(3) + np.sin(np.radians(degrees)) * across + (1 - np.cos(np.radians(degrees))) * across @ across


def pose(rotation, shift):
    moved = np.eye(4)
    moved[:3, :3], moved[:3, 3] = rotation, shift
    return moved


MOVED = pose(turn((1, 2, 3), 130), (300, -40, 25))


def apply(move, xyz):
    return xyz @ move[:3, :3].T + move[:3, 3]


@cache
def part(seed=0, noise=0.2):
    return synth.sample(synth.stepped_block(), pattern="blue_noise", spacing=SPACING, noise=noise, seed=seed).cloud.xyz


@cache
def view(direction, seed=0):
    return synth.view(
        synth.stepped_block(), projection="pinhole", spacing=SPACING, noise=0.3, direction=direction, seed=seed
    )


@cache
def found():
    return edgel.register(part(0), apply(MOVED, part(1)))


def off(found, true, xyz):
    """The largest distance of moved points from where they belong, in spacings."""
    return np.linalg.norm(apply(found, xyz) - apply(true, xyz), axis=1).max() / SPACING


def test_a_part_is_found_wherever_it_lies():
    answer = found()
    assert answer.found
    assert answer.reason == ""
    assert answer.method == "edges"
    assert off(answer.T_target_source, MOVED, part()) < 0.2
    assert answer.fitness > 0.9
    assert answer.edge_fitness > 0.5
    assert answer.rmse < 0.2 * SPACING
    assert answer.margin > edgel.matching.SURE
    assert (answer.alternatives.scores <= answer.score).all()
    assert len(answer.free_directions) == 0
    assert "Registration(fitness" in repr(answer)


def test_the_covariance_is_as_large_as_the_errors():
    """Of six numbers that are as uncertain as said, the sum of squares over variances is 6 on average."""
    answer = found()
    moved, true = (
        apply(T, apply(np.linalg.inv(MOVED), answer.center[None]))[0] for T in (answer.T_target_source, MOVED)
    )
    error = np.concatenate([np.zeros(3), moved - true])
    rotation = answer.T_target_source[:3, :3] @ MOVED[:3, :3].T
    error[:3] = (
        np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
        / 2
    )
    assert error @ np.linalg.solve(answer.covariance, error) < 200
    assert answer.position_std < 0.1 * SPACING


def test_the_other_way_round_is_the_inverse():
    other = edgel.register(apply(MOVED, part(1)), part(0))
    assert off(np.linalg.inv(other.T_target_source), found().T_target_source, part()) < 0.1


def test_the_order_of_points_does_not_matter():
    rng = np.random.default_rng(3)
    other = edgel.register(rng.permutation(part(0)), rng.permutation(apply(MOVED, part(1))))
    assert np.allclose(other.T_target_source, found().T_target_source, atol=1e-6)
    assert np.allclose(other.alternatives.scores, found().alternatives.scores)


def test_two_views_of_a_part():
    first, second = view((-0.48, 0.66, -0.58)), view((0.3, 0.75, -0.6), 1)
    true = second.pose @ np.linalg.inv(first.pose)
    answer = edgel.register(first.cloud, second.cloud)
    seen = first.cloud.xyz[np.isfinite(first.cloud.xyz[:, 0])]
    assert answer.found
    assert off(answer.T_target_source, true, seen) < 0.5


def test_what_sticks_out_of_what_a_camera_saw_speaks_against_a_pose():
    """Slid along the face of the block that both see, one view sticks out of the other's silhouette."""
    first, second = view((-0.48, 0.66, -0.58)), view((0.3, 0.75, -0.6), 1)
    true = second.pose @ np.linalg.inv(first.pose)
    slid = true @ pose(np.eye(3), 12 * SPACING * first.pose[:3, 0])
    source, frame = prepare(first.cloud, None, "source"), prepare(second.cloud, None, "target")
    assert second.cloud.shape is not None
    assert len(second.cloud.shape) == 2
    seen = np.isfinite(second.cloud.xyz).all(axis=1)
    points = prepare(Cloud(second.cloud.xyz[seen], viewpoint=second.cloud.viewpoint), None, "target")
    nothing = {}
    for name, target in (("frame", frame), ("points", points)):
        match = Match.of(source, target)
        nothing[name] = confirm(np.stack([true, slid]), match.few, match.fine, match.tight)[:, NOTHING]
    assert nothing["frame"][0] < 0.005
    assert nothing["frame"][1] > 0.05
    assert (nothing["points"] == 0).all()  # a list does not say where its sensor looked


def test_a_pose_nearby_is_refined():
    near = pose(turn((1, 0, 1), 4), (0, 0, 0)) @ MOVED
    middle = apply(MOVED, part().mean(axis=0)[None])[0]
    near[:3, 3] += middle - apply(near, part().mean(axis=0)[None])[0] + 3 * SPACING * np.array([0.6, 0.0, 0.8])
    answer = edgel.register(part(0), apply(MOVED, part(1)), initial=near)
    assert answer.method == "initial"
    assert off(answer.T_target_source, MOVED, part()) < 0.2


def test_a_pose_nearby_does_not_slide_to_the_next_wedge():
    """From 7 degrees and 7 spacings off; what is refined from there alone ends four spacings off."""
    solid = synth.wedge_fan()
    spacing = 1.3 * solid.spacing
    clouds = [synth.sample(solid, pattern="blue_noise", spacing=spacing, noise=0.3, seed=k).cloud.xyz for k in (0, 1)]
    way, axis = np.random.default_rng(5).normal(size=(2, 3))
    middle = clouds[0].mean(axis=0)
    start = pose(turn(axis, 7), 7 * spacing * way / np.linalg.norm(way))
    start[:3, 3] += middle - start[:3, :3] @ middle
    answer = edgel.register(*clouds, initial=start)
    assert off(answer.T_target_source, np.eye(4), clouds[0]) < 0.3


def test_one_plane_is_refined_where_it_may_not_be_searched():
    """It fits anywhere on another; from a pose nearby its outline tells the rest."""

    def sheet(seed):
        rng = np.random.default_rng(seed)
        plan = rng.uniform(0, 1, (6000, 2)) * [60, 40]
        plan = plan[synth.poisson_disc(np.c_[plan, np.zeros(len(plan))], 0.75)]
        return Cloud(np.c_[plan, rng.normal(0, 0.2, len(plan))], viewpoint=np.array([30.0, 20, 200]))

    near = pose(turn((0, 0, 1), 3), (2, 1.5, 1))
    anywhere = edgel.register(sheet(0), sheet(1))
    assert not anywhere.found
    assert "one plane" in anywhere.reason
    answer = edgel.register(sheet(0), sheet(1), initial=near)
    assert off(answer.T_target_source, np.eye(4), sheet(0).xyz) * SPACING < 0.5


def test_edges_that_were_found_before_are_taken():
    source, target = part(0), apply(MOVED, part(1))
    edges = [edgel.detect(points, orient="outward") for points in (source, target)]
    answer = edgel.register(source, target, source_edges=edges[0], target_edges=edges[1])
    assert np.allclose(answer.T_target_source, found().T_target_source)


def ridge():
    x, y = np.meshgrid(np.arange(60.0), np.arange(60.0))
    return np.stack([x, y, -abs(x - 30)], axis=2)


@pytest.mark.parametrize("points", [part(), ridge()], ids=["all round", "grid"])
def test_sides_are_those_of_the_whole_surface(points):
    """Also of a grid, in which the detector alone would take its view's side for the outside."""
    asked = prepare(points, None, "part")
    given = prepare(points, edgel.detect(points, orient="outward"), "part")
    planes = edgel.estimate_normals(points, orient="outward", num_neighbors=24).normals
    xyz = points.reshape(-1, 3)
    nearest = [np.argmin(((xyz - place) ** 2).sum(axis=1)) for place in asked.surface[::20]]
    np.testing.assert_array_equal(asked.half.frames, given.half.frames)
    assert len(asked.half)
    assert ((planes[nearest] * asked.normals[::20]).sum(axis=1) > 0).all()


def test_a_slide_along_an_edge_is_said():
    """Of a long roof a piece without its ends can lie anywhere along it."""
    rng = np.random.default_rng(0)

    def roof(length, count):
        x, y = rng.uniform(-20, 20, count), rng.uniform(-length / 2, length / 2, count)
        return np.c_[x, y, -np.abs(x)] + 0.05 * rng.standard_normal((count, 3))

    answer = edgel.register(roof(40, 3000), apply(MOVED, roof(160, 12000)))
    assert answer.found
    (slide,) = answer.free_directions
    assert abs(slide[3:] @ MOVED[:3, 1]) > 0.95 * np.linalg.norm(slide)
    across = MOVED[:3, [0, 2]].T
    assert np.abs(across @ (answer.T_target_source[:3, 3] - MOVED[:3, 3])).max() < 0.5


def test_noise_of_normals_settles_no_slide():
    """Where a roof lies along itself its ends tell, not what noise tilts its planes."""

    def roof(seed):
        rng = np.random.default_rng(seed)
        x, y = rng.uniform(-8, 8, 2500), rng.uniform(-40, 40, 2500)
        return np.c_[x, y, -np.abs(x)] + 0.3 * rng.standard_normal((2500, 3))

    slides = []
    for seed in range(0, 6, 2):
        start = pose(np.eye(3), (0, 2.5, 0))
        slides.append(edgel.register(roof(seed), roof(seed + 1), initial=start).T_target_source[1, 3])
    assert np.mean(np.abs(slides)) < 0.4 * 0.85  # spacings


def test_what_shares_nothing_is_not_found():
    ball = synth.sample(synth.sphere(), pattern="blue_noise", spacing=1.5).cloud.xyz
    wavy = synth.sample(synth.gear(), pattern="blue_noise", spacing=1.6).cloud.xyz
    for other in (ball, wavy):
        answer = edgel.register(other, part())
        assert not answer.found
        assert answer.reason
        assert np.isnan(answer.T_target_source).all()
        assert "not found" in repr(answer)


def test_units_that_differ_are_named():
    for source, target in ((part(), 1000 * part(1)), (1000 * part(), part(1))):
        answer = edgel.register(source, target)
        assert not answer.found
        assert "unit" in answer.reason


def test_a_plane_has_too_few_edges():
    x, y = (values.ravel() for values in np.meshgrid(np.arange(30.0), np.arange(30.0)))
    answer = edgel.register(np.c_[x, y, 0 * x], part())
    assert not answer.found
    assert answer.reason


def test_points_without_coordinates_are_left_out():
    holes = np.concatenate([part(0), np.full((50, 3), np.nan)])
    answer = edgel.register(holes, apply(MOVED, part(1)))
    assert np.allclose(answer.T_target_source, found().T_target_source, atol=1e-6)


@pytest.mark.parametrize("empty", [np.empty((0, 3)), np.full((9, 3), np.nan)])
def test_an_empty_cloud_is_refused(empty):
    with pytest.raises(ValueError, match="needs at least 3 points"):
        edgel.register(empty, part())
    with pytest.raises(ValueError, match="needs at least 3 points"):
        edgel.register(part(), empty)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"initial": np.eye(3)}, "initial: expected a finite"),
        ({"initial": 2 * np.eye(4)}, "initial: expected a rotation"),
        ({"initial": np.diag([1.0, 1, -1, 1])}, "initial: expected a rotation"),
        ({"max_correspondence_distance": 0}, "max_correspondence_distance"),
        ({"source_edges": "other"}, "source_edges: found in 2,000 points"),
        ({"target_edges": "sideless"}, "nobody knows which side"),
    ],
)
def test_wrong_options_are_refused(options: Any, message):
    if options.get("source_edges") == "other":
        options = {"source_edges": edgel.detect(part()[:2000])}
    if options.get("target_edges") == "sideless":
        options = {"target_edges": edgel.detect(part())}
    with pytest.raises(ValueError, match=message):
        edgel.register(part(), part(), **options)


def test_a_cloud_far_from_the_origin():
    far = np.array([6.4e5, 5.1e6, 200.0])
    answer = edgel.register(part(0) + far, apply(MOVED, part(1)) + far)
    true = pose(np.eye(3), far) @ MOVED @ pose(np.eye(3), -far)
    assert off(answer.T_target_source, true, part() + far) < 0.2


def test_a_cloud_object_with_a_viewpoint_is_looked_through():
    """What stands in front of all that the sensor measured cannot be there."""
    from edgel.matching._sight import build_sight, look

    scene = view((-0.48, 0.66, -0.58)).cloud
    seen = scene.xyz[np.isfinite(scene.xyz[:, 0])]
    assert scene.viewpoint is not None
    sight = build_sight(seen, scene.viewpoint)
    near = 0.1 * SPACING + 0.5
    said = [[look(sight, x, y, z, near) for x, y, z in share * seen[::50]] for share in (0.9, 1.0, 1.1)]
    assert np.mean(np.array(said[0]) == -1) > 0.95
    assert np.mean(np.array(said[1]) == 0) > 0.95
    assert np.mean(np.array(said[2]) == 1) > 0.9
    assert look(sight, 1e3, 1e3, 10.0, 1.0) == 2
    assert isinstance(scene, Cloud)


def blob(seed, count=7000):
    """A smooth body with bumps of its own, points all over it."""
    rng = np.random.default_rng(seed)
    way = rng.standard_normal((count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    x, y, z = way.T
    return (25 + 6 * x * y + 5 * z**3 + 4 * np.sin(3 * y) * x + 3 * y * z)[:, None] * way


def test_a_smooth_body_is_found_by_its_surface():
    answer = edgel.register(blob(0), apply(MOVED, blob(1)))
    assert answer.found
    assert answer.method == "surface"
    assert np.linalg.norm(apply(answer.T_target_source, blob(0)) - apply(MOVED, blob(0)), axis=1).max() < 0.5


def test_a_ball_may_turn():
    way = blob(2) / np.linalg.norm(blob(2), axis=1, keepdims=True)
    other = blob(3) / np.linalg.norm(blob(3), axis=1, keepdims=True)
    answer = edgel.register(30 * way, 30 * other + [100.0, 0, 0])
    assert answer.found
    assert len(answer.free_directions) == 3
    assert np.abs(answer.free_directions[:, 3:]).max() < 0.1
    assert np.allclose(apply(answer.T_target_source, np.zeros((1, 3))), [100, 0, 0], atol=0.1)
