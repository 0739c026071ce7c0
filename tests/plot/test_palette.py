"""The colors of the kinds: told apart by every eye, from each other and from the surfaces they are drawn on."""

import itertools

import numpy as np
import pytest

from edgel import EdgeKind
from edgel.plot import palette

# What is left of linear RGB without one kind of cone: Machado, Oliveira, Fernandes 2009, severity 1.
VISION = {
    "normal": np.eye(3),
    "no red": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "no green": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "no blue": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
SURFACES = [(grey, grey, grey) for grey in (*range(105, 233, 8), 255, 24)]


def oklab(colors, seen):
    """Colors (N, 3), 0 to 255, in a space where equal distances look equal (Ottosson 2020)."""
    encoded = np.asarray(colors) / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    linear = np.clip(linear @ np.transpose(seen), 0, 1)
    cones = [[0.41222, 0.53633, 0.05145], [0.21190, 0.68070, 0.10740], [0.08830, 0.28172, 0.62998]]
    axes = [[0.21045, 0.79362, -0.00407], [1.97800, -2.42859, 0.45059], [0.02590, 0.78277, -0.80868]]
    return np.cbrt(linear @ np.transpose(cones)) @ np.transpose(axes)


@pytest.mark.parametrize("seen", VISION.values(), ids=VISION)
def test_every_eye_tells_the_kinds_apart(seen):
    colors = oklab(list(palette.KIND_COLORS.values()), seen)
    assert min(np.linalg.norm(a - b) for a, b in itertools.combinations(colors, 2)) > 0.15


@pytest.mark.parametrize("seen", VISION.values(), ids=VISION)
def test_every_eye_tells_edges_from_surfaces(seen):
    colors, surfaces = oklab(list(palette.KIND_COLORS.values()), seen), oklab(SURFACES, seen)
    assert np.linalg.norm(colors[:, None] - surfaces, axis=2).min() > 0.09


def test_every_kind_has_a_color():
    assert list(palette.KIND_COLORS) == list(EdgeKind)


def test_a_point_of_several_kinds_wears_the_first():
    kinds = [EdgeKind.IMAGE | EdgeKind.OCCLUDED, EdgeKind.COLOR | EdgeKind.CREASE, 0]
    wanted = [palette.KIND_COLORS[EdgeKind.OCCLUDED], palette.KIND_COLORS[EdgeKind.CREASE], palette.ANY_KIND]
    assert palette.kind_colors(kinds).tolist() == [list(color) for color in wanted]
    assert palette.kind_colors(np.empty(0, np.uint8)).shape == (0, 3)


@pytest.mark.parametrize("seen", VISION.values(), ids=VISION)
def test_the_ramp_grows_lighter(seen):
    lightness = oklab(palette.ramp_colors(np.linspace(0, 1, 50)), seen)[:, 0]
    assert (np.diff(lightness) > 0).all()
