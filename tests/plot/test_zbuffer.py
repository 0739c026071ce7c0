"""The z-buffer: the nearest disc shows, and a selection of what is seen is even."""

import naive
import numpy as np
from by_hand import grid
from hypothesis import given
from hypothesis import strategies as st

from edgel.plot.camera import Viewport
from edgel.plot.zbuffer import ZBuffer


@given(
    places=st.lists(st.tuples(*[st.integers(0, 12)] * 3), min_size=1, max_size=40),
    radius=st.sampled_from([0.0, 0.5, 1.0, 1.6]),
)
def test_the_nearest_disc_shows(places, radius):
    xyz = np.array(places, float)
    buffer = ZBuffer(xyz, Viewport((16, 16), "top", margin=0.1, point_size=2 * radius))
    wanted = naive.discs(buffer.x, buffer.y, buffer.depth, buffer.width, buffer.height, buffer.radius)
    np.testing.assert_array_equal(buffer.nearest, wanted)


def test_the_nearest_point_covers_those_behind():
    xyz = np.array([[0, 0, 0], [1, 1, 0], [0.5, 0.5, 1.0], [0.5, 0.5, 0.0]], float)
    buffer = ZBuffer(xyz, Viewport((240, 180), "top", margin=0.1, point_size=4))
    assert set(np.unique(buffer.nearest)) == {-1, 0, 1, 2}


def test_an_even_selection_has_one_point_a_cell_and_none_that_is_hidden():
    front = grid()
    xyz = np.vstack([front, front - (0, 0, 30)])
    xyz[7] = np.nan
    buffer = ZBuffer(xyz, Viewport((240, 180), "top"))
    rows = np.arange(0, len(xyz), 3)
    chosen, at = buffer.sample_evenly(rows, 40.0)
    cells = np.floor(at / 40.0)
    assert len(np.unique(cells, axis=0)) == len(chosen) > 60
    assert rows[chosen].max() < len(front)
    in_subpixels = 2 * np.column_stack(buffer.frame.to_pixels(buffer.camera.project(xyz[rows[chosen]])))
    np.testing.assert_allclose(at, in_subpixels)
