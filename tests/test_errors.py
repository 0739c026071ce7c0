"""Values that no one means: an error that names the argument and the remedy, at once."""

import numpy as np
import pytest

import edgel
from edgel import Cloud, Intrinsics
from edgel.io import FormatError, read, write

POINTS = np.random.default_rng(0).random((300, 3))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"kernel_size": 4001}, "kernel_size: expected an odd number of pixels from 1 to 999, got 4001"),
        ({"kernel_size": 10**5000 + 1}, "kernel_size: .* got a number of thousands of digits"),
        ({"kernel_size": 5.0}, "kernel_size: .* got 5.0"),
        ({"kernel_size": 4}, "kernel_size: .* odd"),
        ({"sigma": 1e300}, "sigma: expected a number of pixels above 0, at most 999"),
        ({"sigma": np.inf}, "sigma: "),
        ({"sigma": np.nan}, "sigma: "),
        ({"sigma": 0}, "sigma: "),
        ({"width": 10**400}, "width: expected a number of pixels"),
        ({"height": 2.5}, "height: expected a number of pixels"),
        ({"scale": 4, "kernel_size": 4001}, "kernel_size: "),
    ],
)
def test_the_published_method(options, message):
    with pytest.raises(ValueError, match=message):
        edgel.paper.detect(POINTS, **options)


def test_a_gaussian_of_next_to_nothing_smooths_nothing():
    sharp = edgel.paper.detect(POINTS, sigma=1e-300)
    np.testing.assert_array_equal(sharp.index, edgel.paper.detect(POINTS, kernel_size=1).index)


@pytest.mark.parametrize("name", ["a\0b.ply", "\ud800.ply", "\0.json"])
def test_names_that_no_file_has(tmp_path, name):
    for function in (read, edgel.io.read_intrinsics, lambda path: write(path, Cloud(POINTS))):
        if function is not edgel.io.read_intrinsics and name.endswith("json"):
            continue
        with pytest.raises(FormatError, match="is no name that a file can have"):
            function(str(tmp_path) + "/" + name)


def test_characters_that_do_not_exist(tmp_path):
    beyond = np.frombuffer(b"\xff\xff\xff\x7f" * 3, "<U1")
    arrays = {"name": beyond, "crs": beyond[0:1].reshape(())}
    for name, array in arrays.items():
        np.savez(tmp_path / "a.npz", xyz=POINTS[:3], **{name: array})
        with pytest.raises(FormatError, match="characters that do not exist"):
            read(tmp_path / "a.npz")
    records = np.zeros(3, [("x", "f4"), ("y", "f4"), ("z", "f4"), ("name", ">U1")])
    records["name"] = beyond
    np.save(tmp_path / "a.npy", records)
    with pytest.raises(FormatError, match="characters that do not exist"):
        read(tmp_path / "a.npy")


@pytest.mark.parametrize("scale", [np.nan, np.inf, -1, 0])
def test_scales(scale):
    with pytest.raises(ValueError, match="depth_scale: expected a"):
        Intrinsics(1, 1, 1, 1, depth_scale=scale)
    with pytest.raises(ValueError, match="scale: expected"):
        edgel.detect(POINTS, scale=scale)
