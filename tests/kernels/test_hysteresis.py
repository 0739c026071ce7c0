"""One number a pixel says what hysteresis keeps at any threshold."""

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from edgel._kernels.hysteresis import levels


def image_of_levels(values, weak, least):
    found = np.zeros(values.size)
    places, level = levels(values, weak, least, 0.1)
    assert (np.diff(places) > 0).all()
    found[places] = level
    return found.reshape(values.shape)


images = arrays.arrays(np.float64, (7, 9), elements=st.sampled_from([0.0, 0.3, 0.5, 0.7, 1.0, 1.4, 3.0]))


@settings(deadline=None, max_examples=60)
@given(images, st.sampled_from([0.4, 2 / 3, 1.0]), st.integers(1, 8))
def test_levels_are_hysteresis_at_every_threshold(values, weak, least):
    found = image_of_levels(values, weak, least)
    for threshold in (0.21, 0.36, 0.61, 0.81, 1.11, 1.61, 2.11, 3.5):
        expected = naive.chains_kept(values, weak, least, threshold)
        np.testing.assert_array_equal(found >= threshold, expected, err_msg=f"threshold {threshold}")


@pytest.mark.parametrize("seed", range(3))
def test_levels_of_random_images(seed):
    values = np.random.default_rng(seed).exponential(0.4, (40, 30))
    found = image_of_levels(values, 2 / 3, 5)
    for threshold in np.quantile(values, [0.5, 0.7, 0.9, 0.97, 0.999]):
        np.testing.assert_array_equal(found >= threshold, naive.chains_kept(values, 2 / 3, 5, threshold))
