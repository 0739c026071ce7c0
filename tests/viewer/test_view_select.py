"""The filters of the viewer: strength, kinds, angle and crop show what detecting with them finds."""

from dataclasses import replace

import numpy as np
import pytest
from hall import TIMEOUT, hall, same

import edgel
from edgel import EdgeKind
from edgel._viewer.runs import LEAST_STRENGTH
from edgel._viewer.select import select
from edgel._viewer.settings import Settings
from edgel.cloud import in_box


@pytest.mark.parametrize("strength", [LEAST_STRENGTH, 0.35, 0.5, 0.7, 0.93, 1.0])
def test_filtering_by_strength_equals_detecting(strength):
    cloud = edgel.Cloud(hall())
    settings = Settings(strength=strength)
    found = edgel.detect(cloud, min_strength=LEAST_STRENGTH)
    same(select(found, cloud.xyz, settings, np.zeros((2, 3))), edgel.detect(cloud, min_strength=strength))


def test_filtering_by_kind_equals_detecting():
    cloud = edgel.Cloud(hall())
    settings = Settings(kinds=EdgeKind.CREASE)
    shown = select(edgel.detect(cloud), cloud.xyz, settings, np.zeros((2, 3)))
    same(shown, edgel.detect(cloud, kinds="crease"))
    assert 0 < len(shown) < len(edgel.detect(cloud))


def test_no_kind_shows_nothing():
    cloud = edgel.Cloud(hall())
    settings = Settings(kinds=EdgeKind(0))
    assert len(select(edgel.detect(cloud), cloud.xyz, settings, np.zeros((2, 3)))) == 0


def test_blunt_creases_disappear_unless_they_are_something_else():
    edges = edgel.detect(hall())
    angle = np.radians(70)
    crease, other = (edges.kind & EdgeKind.CREASE) > 0, (edges.kind & ~np.uint8(EdgeKind.CREASE)) > 0
    blunt = crease & (edges.angle < angle)
    assert (blunt & ~other).any()
    kept = edges.drop_blunt(angle)
    np.testing.assert_array_equal(kept.index, edges.index[~blunt | other])
    np.testing.assert_array_equal(kept.kind[np.isin(kept.index, edges.index[blunt & other])] & EdgeKind.CREASE, 0)
    assert (edges.drop_blunt(0.0).kind == edges.kind).all()


def test_blunt_crease_that_ends_the_surface_keeps_that():
    edges = edgel.detect(hall())
    both = replace(edges, kind=np.full(len(edges), 9, np.uint8), angle=np.full(len(edges), 0.1))
    kept = both.drop_blunt(0.2)
    assert len(kept) == len(edges)
    assert (kept.kind == EdgeKind.BOUNDARY).all()
    assert len(replace(both, angle=np.full(len(edges), np.nan)).drop_blunt(0.2)) == len(edges)


def test_crop_shows_what_lies_inside(open_session, hall_file):
    session = open_session([hall_file])
    session.settings = Settings(crop=((0.0, 0.4), (0.25, 1.0), (0.0, 1.0)))
    assert session.wait_idle(TIMEOUT)
    (pane,) = session.panes()
    assert pane.edges is not None
    shown = pane.cloud.xyz[pane.edges.index]
    low, high = pane.source.low, pane.source.high
    assert shown[:, 0].max() <= low[0] + 0.4 * (high[0] - low[0])
    assert shown[:, 1].min() >= low[1] + 0.25 * (high[1] - low[1])
    assert np.isinf(pane.box[0, 0])
    everything = edgel.detect(pane.cloud)
    assert len(pane.edges) == in_box(pane.cloud.xyz, pane.box)[everything.index].sum()
