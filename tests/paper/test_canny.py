import cv2
import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from edgel.paper.canny import canny, gaussian_kernel, gradient, hysteresis, non_maximum_suppression, smooth

IMAGES = st.integers(0, 2**32 - 1).map(lambda seed: _random_image(np.random.default_rng(seed)))


def _random_image(rng):
    height, width = rng.integers(1, 24, 2)
    kind = rng.integers(3)
    if kind == 0:
        return rng.integers(0, 256, (height, width)).astype(float)
    if kind == 1:  # blocks, with many equal gradients
        return np.kron(rng.integers(0, 4, (-(-height // 4), -(-width // 4))) * 80.0, np.ones((4, 4)))[:height, :width]
    return np.where(rng.random((height, width)) < 0.4, 0.0, rng.uniform(100, 255, (height, width)))


@settings(max_examples=60)
@given(IMAGES, st.sampled_from([(0, 1.0), (1, 1.4), (2, 1.4), (2, 2.0)]), st.floats(0, 300), st.floats(1, 3))
def test_every_step_is_that_of_the_equations(image, kernel, low, ratio):
    k, sigma = kernel
    result = canny(image, kernel_size=2 * k + 1, sigma=sigma, low=low, high=ratio * low)
    smoothed = naive.convolve(image, naive.gaussian_kernel(k, sigma))
    np.testing.assert_allclose(result.smooth, smoothed, atol=1e-9)
    # Rounding in the last digit may break ties either way: compare the later steps on the same smoothed image.
    gx, gy = gradient(result.smooth)
    naive_gx, naive_gy = naive.gradient(result.smooth)
    np.testing.assert_allclose(gx, naive_gx, atol=1e-9)
    np.testing.assert_allclose(gy, naive_gy, atol=1e-9)
    thinned = non_maximum_suppression(result.magnitude, gx, gy)
    np.testing.assert_array_equal(thinned, naive.non_maximum_suppression(gx, gy))
    np.testing.assert_array_equal(result.edges, naive.hysteresis(thinned, low, ratio * low))


@given(st.integers(0, 2**32 - 1), st.floats(0, 1), st.floats(0, 1))
def test_hysteresis_follows_chains(seed, low, high):
    low, high = sorted((low, high))
    thinned = np.random.default_rng(seed).random((20, 20)) * (np.random.default_rng(seed + 1).random((20, 20)) < 0.5)
    np.testing.assert_array_equal(hysteresis(thinned, low, high), naive.hysteresis(thinned, low, high))


def test_gaussian_is_that_of_the_paper():
    eq_8 = np.array([[0.0924, 0.1192, 0.0924], [0.1192, 0.1538, 0.1192], [0.0924, 0.1192, 0.0924]])
    np.testing.assert_allclose(gaussian_kernel(3, 1.4), eq_8, atol=5e-5)
    eq_10 = np.array([[0.0310, 0.0351, 0.0310], [0.0351, 0.0398, 0.0351], [0.0310, 0.0351, 0.0310]])
    np.testing.assert_allclose(gaussian_kernel(3, 2.0) / gaussian_kernel(3, 2.0)[1, 1] * 0.0398, eq_10, atol=7e-5)
    eq_11 = [  # its corners .0146, which the paper misprints .0416
        [0.0146, 0.0213, 0.0241, 0.0213, 0.0146],
        [0.0213, 0.0310, 0.0351, 0.0310, 0.0213],
        [0.0241, 0.0351, 0.0398, 0.0351, 0.0241],
        [0.0213, 0.0310, 0.0351, 0.0310, 0.0213],
        [0.0146, 0.0213, 0.0241, 0.0213, 0.0146],
    ]
    np.testing.assert_allclose(gaussian_kernel(5, 2.0) / gaussian_kernel(5, 2.0)[2, 2] * 0.0398, eq_11, atol=7e-5)
    for size, sigma in ((1, 1.0), (3, 1.4), (5, 1.4), (9, 3.0)):
        assert gaussian_kernel(size, sigma).sum() == pytest.approx(1)


@pytest.mark.parametrize("kernel_size", [3, 5, 9])
def test_smoothing_is_that_of_opencv(kernel_size):
    image = np.random.default_rng(0).uniform(0, 255, (60, 80))
    expected = cv2.GaussianBlur(image, (kernel_size, kernel_size), 1.4, borderType=cv2.BORDER_REPLICATE)
    np.testing.assert_allclose(smooth(image, kernel_size, 1.4), expected, atol=1e-9)


def _dense_images():
    rng = np.random.default_rng(5)
    y, x = np.mgrid[0:240, 0:320]
    shapes = np.full((240, 320), 60, np.uint8)
    cv2.circle(shapes, (110, 120), 70, 200, -1)
    cv2.rectangle(shapes, (190, 40), (290, 200), 140, -1)
    cv2.ellipse(shapes, (240, 120), (30, 60), 25, 0, 360, 250, 5)
    blobs = np.zeros((240, 320))
    for _ in range(60):
        cx, cy, s = rng.uniform(0, 320), rng.uniform(0, 240), rng.uniform(4, 40)
        blobs += rng.normal() * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * s * s))
    blobs = np.clip(128 + 50 * blobs, 0, 255)
    texture = cv2.GaussianBlur(rng.uniform(0, 255, (240, 320)), (0, 0), 2.5)
    texture = 255 * (texture - texture.min()) / np.ptp(texture)
    r = np.hypot(x - 160, y - 120)
    return {
        "shapes": shapes,
        "blobs": blobs,
        "texture": texture,
        "noise": rng.integers(0, 256, (240, 320)),
        "ramp": (x + 2 * y) % 256,
        "sphere": 100 + 155 * np.sqrt(np.clip(1 - (r / 110) ** 2, 0, 1)),
        "shapes with noise": np.clip(shapes + rng.normal(0, 12, shapes.shape), 0, 255),
    }


@pytest.mark.parametrize("kind", list(_dense_images()))
@pytest.mark.parametrize(("low", "high"), [(20, 60), (50, 150), (100, 300)])
def test_edges_are_those_of_opencv(kind, low, high):
    image = cv2.GaussianBlur(_dense_images()[kind].astype(np.uint8), (5, 5), 1.4, borderType=cv2.BORDER_REPLICATE)
    expected = cv2.Canny(image, low, high, L2gradient=True) > 0
    # A kernel of one pixel leaves the image as it is: both get the same smoothed 8-bit image.
    found = canny(image.astype(float), kernel_size=1, sigma=1.0, low=low, high=high).edges
    assert np.mean(found == expected) >= 0.999


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kernel_size": 4}, "kernel_size"),
        ({"kernel_size": -1}, "kernel_size"),
        ({"sigma": 0.0}, "sigma"),
        ({"sigma": np.nan}, "sigma"),
        ({"low": 5.0, "high": 4.0}, "low"),
        ({"low": -1.0}, "low"),
        ({"high": np.nan}, "high"),
    ],
)
def test_wrong_options_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        canny(np.zeros((5, 5)), **{"kernel_size": 3, "sigma": 1.0, "low": 1.0, "high": 2.0} | options)
