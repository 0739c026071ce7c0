import struct
import warnings
from contextlib import suppress

import laspy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_io_support import assert_same, clouds, rich_cloud

from edgel import Cloud
from edgel.io import FormatError, FormatWarning, read, write

SUFFIXES = [".las", ".laz"]


@pytest.fixture
def airborne(shared_data):
    return shared_data / "airborne"


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("name", ["autzen_trim.laz", "simple.copc.laz", "interesting.las", "sample_c.las"])
def test_read_take_write_keeps_everything(airborne, tmp_path, name, suffix):
    cloud, theirs = read(airborne / name), laspy.read(airborne / name)
    np.testing.assert_array_equal(cloud.xyz, theirs.xyz)
    assert [*"XYZ", *cloud.attributes] == list(theirs.point_format.dimension_names)
    for dimension, values in cloud.attributes.items():
        np.testing.assert_array_equal(values, theirs[dimension])
    part = cloud.take(np.arange(0, len(cloud), 3))
    write(tmp_path / f"a{suffix}", part)
    found = read(tmp_path / f"a{suffix}")
    assert_same(found, part)
    assert list(found.attributes) == list(part.attributes)
    assert found.crs == cloud.crs
    with laspy.open(tmp_path / f"a{suffix}") as reader:
        header = reader.header
    assert header.are_points_compressed == (suffix == ".laz")
    assert (header.version, header.point_format.id) == (theirs.header.version, theirs.header.point_format.id)
    np.testing.assert_array_equal(header.scales, theirs.header.scales)
    np.testing.assert_array_equal(header.offsets, theirs.header.offsets)
    kept = [(vlr.user_id, vlr.record_id) for vlr in theirs.header.vlrs if vlr.user_id != "copc"]
    assert [(vlr.user_id, vlr.record_id) for vlr in header.vlrs if vlr.user_id != "laszip encoded"] == kept


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_extra_dimensions_are_kept_as_declared(tmp_path, suffix):
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.add_extra_dim(laspy.ExtraBytesParams("height", "i4", "above ground", np.array([5.0]), np.array([0.01])))
    header.add_extra_dim(laspy.ExtraBytesParams("normal", "3f4"))
    header.add_extra_dim(laspy.ExtraBytesParams("two words", "u8"))
    header.scales, header.offsets = np.array([0.001] * 3), np.array([100.0, 200, 0])
    las = laspy.LasData(header)
    las.xyz = np.array([[100.123, 200.456, 3], [101, 202, 4]])
    las["height"], las["normal"], las["two words"] = [5.25, 7.5], [[1, 0, 0], [0, 0.5, 0]], [1, 2**63]
    las.write(str(tmp_path / f"a{suffix}"))
    cloud = read(tmp_path / f"a{suffix}")
    assert cloud.attributes["height"].tolist() == [5.25, 7.5]
    write(tmp_path / f"b{suffix}", cloud)
    found = read(tmp_path / f"b{suffix}")
    assert_same(found, cloud, names={name: name for name in cloud.attributes})
    with laspy.open(tmp_path / f"b{suffix}") as reader:
        kept = {extra.name: extra for extra in reader.header.point_format.extra_dimensions}
    assert list(kept) == ["height", "normal", "two words"]
    assert kept["height"].scales == np.array([0.01])
    assert kept["height"].description == "above ground"
    assert kept["normal"].num_elements == 3


@settings(max_examples=40)
@given(clouds(finite=True), st.sampled_from(SUFFIXES))
def test_any_cloud_round_trips(tmp_path_factory, cloud, suffix):
    file = tmp_path_factory.mktemp("las") / f"a{suffix}"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        write(file, cloud)
    found = read(file)
    said = getattr(caught[0].message, "said", {}) if caught else {}
    assert set(said) == {name for name in ("intensity",) if f"{name}_exact" in found.attributes}
    extent = np.ptp(cloud.xyz, axis=0)
    # The finest power of ten for which the extent fits 31 bits: half a step is lost at most.
    allowed = np.maximum(extent * 1e-8, np.spacing(np.abs(cloud.xyz).max(axis=0)) * 8) + 1e-15
    assert (np.abs(found.xyz - cloud.xyz) <= allowed).all()
    for name, values in cloud.attributes.items():
        word = "_".join(name.split())
        got = found.attributes[f"{word}_exact" if f"{word}_exact" in found.attributes else word]
        np.testing.assert_array_equal(got, values)


@pytest.mark.parametrize("crs", ["EPSG:25832", 'PROJCS["x",GEOGCS["y"]]', None])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_crs_and_attributes_of_another_format(tmp_path, crs, suffix):
    cloud = rich_cloud(60)
    cloud = Cloud(
        cloud.xyz + [4e5, 5.8e6, 0], {**cloud.attributes, "intensity": np.linspace(0, 1, 60)}, None, None, crs
    )
    with pytest.warns(FormatWarning, match="intensity: renamed intensity_exact"):
        write(tmp_path / f"a{suffix}", cloud)
    found = read(tmp_path / f"a{suffix}")
    assert found.crs == crs
    assert np.abs(found.xyz - cloud.xyz).max() < 1e-6
    np.testing.assert_array_equal(found.attributes["intensity_exact"], cloud.attributes["intensity"])
    np.testing.assert_array_equal(found.attributes["red"], cloud.attributes["red"])
    np.testing.assert_array_equal(found.attributes["normal_2"], cloud.attributes["normal"][:, 2])
    write(tmp_path / f"b{suffix}", Cloud(found.xyz, found.attributes, None, None, "EPSG:4326", found.metadata))
    assert read(tmp_path / f"b{suffix}").crs == "EPSG:4326"


def test_moved_points_get_a_grid_of_their_own(airborne, tmp_path):
    cloud = read(airborne / "simple.copc.laz")
    for xyz in (cloud.xyz / 1000, cloud.xyz + 0.00512345, cloud.xyz + 1e9):
        write(tmp_path / "a.las", Cloud(xyz, cloud.attributes, None, None, cloud.crs, cloud.metadata))
        extent = np.ptp(xyz, axis=0).max()
        assert np.abs(read(tmp_path / "a.las").xyz - xyz).max() < max(1e-8 * extent, 2e-7 if xyz.max() > 1e8 else 0)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_empty_cloud(tmp_path, suffix):
    write(tmp_path / f"a{suffix}", Cloud(np.empty((0, 3)), {"label": np.empty(0, np.int32)}))
    found = read(tmp_path / f"a{suffix}")
    assert len(found) == 0
    assert found.attributes["label"].dtype == np.int32


def test_holes_are_refused_with_the_remedy(tmp_path):
    with pytest.raises(FormatError, match=r"9 of 42 points are NaN.*take"):
        write(tmp_path / "a.las", rich_cloud(holes=True))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "name",
    [
        "a" * 33,
        "a" * 31 + "\u00e4" * 9,
        "X",
        "z",
        "nor:normalX",
        *("bit_fields", "classification_flags", "flag_byte", "num_returns", "pt_src_id"),
    ],
)
def test_names_that_las_cannot_have_are_renamed_and_said(tmp_path, name):
    cloud = Cloud(np.eye(3), {name: np.array([7, 2**60 + 1, 9]), name[:1] * 32: np.arange(3)})
    with pytest.warns(FormatWarning) as caught:
        write(tmp_path / "a.las", cloud)
    found = read(tmp_path / "a.las")
    (new,) = [key for key, values in found.attributes.items() if values.tolist() == [7, 2**60 + 1, 9]]
    assert getattr(caught[0].message, "said", {})[name].startswith(f"renamed {new}")
    np.testing.assert_array_equal(found.attributes[name[:1] * 32], np.arange(3))
    assert len(new.encode()) <= 32


def test_a_panic_of_the_decoder_is_a_format_error(airborne, monkeypatch):
    class PanicException(BaseException):
        pass

    def panic(*_):
        raise PanicException("called `Option::unwrap()` on a `None` value")

    monkeypatch.setattr(laspy.LasReader, "chunk_iterator", panic)
    with pytest.raises(FormatError, match="compression is of an old or unknown kind"):
        read(airborne / "autzen_trim.laz")

    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(laspy.LasReader, "chunk_iterator", interrupt)
    with pytest.raises(KeyboardInterrupt):
        read(airborne / "autzen_trim.laz")


@pytest.mark.parametrize("compressor", [0, 1, 9])
def test_other_compressors(airborne, tmp_path, compressor):
    raw = bytearray((airborne / "autzen_trim.laz").read_bytes())
    struct.pack_into("<H", raw, raw.find(b"laszip encoded") - 2 + 54, compressor)
    (tmp_path / "a.laz").write_bytes(raw)
    with pytest.raises(FormatError, match="reading LAS failed"):
        read(tmp_path / "a.laz")


@pytest.mark.parametrize("name", ["sample_c.las", "autzen_trim.laz"])
def test_promise_of_too_many_points_is_not_believed(airborne, tmp_path, name):
    raw = bytearray((airborne / name).read_bytes())
    struct.pack_into("<I", raw, 107, 2**32 - 1)
    (tmp_path / name).write_bytes(raw)
    with pytest.raises(FormatError, match=r"declared 4294967295 points, found|reading LAS failed"):
        read(tmp_path / name)


@pytest.mark.parametrize("position", [100, 243])
def test_promise_of_too_many_records_is_not_believed(tmp_path, position):
    write(tmp_path / "a.las", Cloud(np.eye(3)))
    raw = bytearray((tmp_path / "a.las").read_bytes())
    struct.pack_into("<I", raw, position, 2**32 - 1)
    (tmp_path / "a.las").write_bytes(raw)
    with pytest.raises(FormatError, match="declared 4294967295 header records"):
        read(tmp_path / "a.las")


def test_truncated(airborne, tmp_path):
    (tmp_path / "a.las").write_bytes((airborne / "sample_c.las").read_bytes()[:-1000])
    with pytest.raises(FormatError, match="declared 14408 points, found 14378"):
        read(tmp_path / "a.las")


@settings(max_examples=120)
@given(st.data())
def test_cut_or_damaged_anywhere(tmp_path_factory, data):
    file = tmp_path_factory.mktemp("las") / f"a{data.draw(st.sampled_from(SUFFIXES))}"
    write(file, Cloud(rich_cloud(30).xyz, {"intensity": np.arange(30)}, crs="EPSG:25832"))
    raw = bytearray(file.read_bytes())
    if data.draw(st.booleans()):
        raw = raw[: data.draw(st.integers(0, len(raw)))]
    else:
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    file.write_bytes(bytes(raw))
    with suppress(FormatError):
        read(file)
