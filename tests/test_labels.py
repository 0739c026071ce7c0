"""Which kinds a point is labelled with, where several are found."""

import numpy as np
import pytest

from edgel import EdgeKind
from edgel._kinds import LIKELY
from edgel._labels import COLOR, Labels, strength_of_contrast

CREASE, BOUNDARY, COLORED = EdgeKind.CREASE, EdgeKind.BOUNDARY, EdgeKind.COLOR


@pytest.mark.parametrize(
    ("crease", "boundary", "kinds"),
    [
        (0.9, 0.8, CREASE | BOUNDARY),  # both likely: both
        (0.5, 0.5, CREASE | BOUNDARY),
        (0.9, 0.4, CREASE),  # one likely: that one
        (0.4, 0.9, BOUNDARY),
        (0.4, 0.3, CREASE),  # none likely: the likelier
        (0.3, 0.4, BOUNDARY),
        (0.3, 0.3, CREASE),  # the first found, of equal ones
        (0.0, 0.2, BOUNDARY),
        (0.0, 0.0, EdgeKind(0)),
    ],
)
def test_precedence_of_kinds(crease, boundary, kinds):
    labels = Labels(3)
    labels.add(np.array([1]), CREASE, np.array([crease]))
    labels.add(np.array([1]), BOUNDARY, np.array([boundary]))
    assert labels.kind.tolist() == [0, int(kinds), 0]
    assert labels.strength.tolist() == [0, max(crease, boundary), 0]


def test_kinds_of_a_point_do_not_hang_on_how_faint_edges_are_asked_for():
    labels = Labels(4)
    labels.add(np.arange(4), CREASE, np.array([0.9, 0.6, 0.3, 0.0]))
    labels.add(np.arange(4), COLORED, np.array([0.7, 0.2, 0.4, 0.1]))
    every = CREASE | COLORED
    faint, plain = labels.of(every, 0.05), labels.of(every, LIKELY)
    assert faint.tolist() == [int(every), int(CREASE), int(COLORED), int(COLORED)]
    assert plain.tolist() == [int(every), int(CREASE), 0, 0]
    assert labels.of(COLORED, LIKELY).tolist() == [int(COLORED), 0, 0, 0]


def test_flags_can_differ_from_point_to_point():
    labels = Labels(2)
    labels.add(np.arange(2), np.array([int(EdgeKind.OCCLUDING), int(EdgeKind.OCCLUDED)]), np.array([0.6, 0.0]))
    assert labels.kind.tolist() == [int(EdgeKind.OCCLUDING), 0]


def test_contrast_at_the_threshold_is_as_likely_as_not():
    assert strength_of_contrast(np.array([0.0, COLOR / 2, COLOR, 1.0])).tolist() == [0, LIKELY, LIKELY, 1 / (1 + COLOR)]
