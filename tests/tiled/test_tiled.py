"""Tiles give the answer of the whole cloud, to the bit, however they are cut, and go on where they were stopped."""

import json
import os
import socket
import subprocess
import sys
import time
from collections import namedtuple
from itertools import pairwise
from pathlib import Path

import laspy
import numpy as np
import pytest

import edgel
from edgel import synth, tiled
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.scan_lines import scan_line_stretch
from edgel.tiled import aside, classify, disk, engine, passes
from edgel.tiled.plan import Plan
from edgel.tiled.spool import BYTES_A_POINT

FIELDS = ("kind", "strength", "position", "position_std", "scale", "direction", "normals", "angle", "convex")


def check_same(found, whole, lengths):
    """The edges of all inputs, one after the other, are those of the whole, bit for bit."""
    parts = [found.edges(number) for number in range(len(lengths))]
    first = np.cumsum([0, *lengths])
    index = np.concatenate([part.index + begin for part, begin in zip(parts, first, strict=False)])
    np.testing.assert_array_equal(index, whole.index)
    for name in FIELDS:
        mine = np.concatenate([getattr(part, name) for part in parts])
        assert mine.tobytes() == getattr(whole, name).tobytes(), name


def lengths_of(files):
    return [len(np.load(file, mmap_mode="r")) for file in files]


@pytest.mark.parametrize("tile_points", [1_000, 3_500, 10**6])
def test_any_tiling_gives_the_answer_of_the_whole(files, strip, whole, tmp_path, tile_points):
    found = tiled.detect(files, tmp_path / "out", tile_points=tile_points)
    assert len(Plan.read(tmp_path / "out" / "work").tiles) == found.num_tiles >= len(strip) / tile_points
    check_same(found, whole, lengths_of(files))
    assert found.num_edges == len(whole) > 500
    assert {*np.unique(whole.kind)} >= {edgel.EdgeKind.CREASE, edgel.EdgeKind.OCCLUDING, edgel.EdgeKind.OCCLUDED}
    for number, (file, output) in enumerate(zip(files, found.outputs, strict=True)):
        assert edgel.read(output).xyz.tobytes() == np.load(file)[found.edges(number).index].tobytes()


def test_tiles_in_any_order_give_the_same(files, whole, tmp_path, monkeypatch):
    here = engine._here
    monkeypatch.setattr(engine, "_here", lambda task, jobs: here(task, dict(reversed(jobs.items()))))
    check_same(tiled.detect(files, tmp_path / "out", tile_points=3_500), whole, lengths_of(files))


def test_a_sensor_tells_the_outside_in_tiles_too(files, strip, tmp_path):
    above = strip.mean(axis=0) + [0, 0, 900.0]
    wanted = edgel.detect(strip, method="surface", viewpoint=above, kinds="crease", min_strength=0.3)
    found = tiled.detect(files, tmp_path / "out", tile_points=3_000, viewpoint=above, kinds="crease", min_strength=0.3)
    check_same(found, wanted, lengths_of(files))
    assert (wanted.convex == 1).any()


@pytest.mark.parametrize("tile_points", [2_000, 6_000])
def test_the_outside_of_a_whole_surface_is_told_in_tiles(tmp_path, tile_points):
    solid = synth.sample(synth.stepped_block(), pattern="blue_noise", spacing=0.9, noise=0.05, seed=3)
    xyz = np.concatenate([solid.cloud.xyz, solid.cloud.xyz + [90.0, 4.0, 0.0]])
    names = [str(tmp_path / f"{number}.npy") for number in range(2)]
    for name, part in zip(names, (xyz[::2], xyz[1::2]), strict=True):
        np.save(name, part)
    order = np.concatenate([np.arange(0, len(xyz), 2), np.arange(1, len(xyz), 2)])
    wanted = edgel.detect(xyz[order], method="surface", orient="outward")
    found = tiled.detect(names, tmp_path / "out", tile_points=tile_points, orient="outward")
    assert found.num_tiles > 1
    check_same(found, wanted, lengths_of(names))
    assert found.edges(0).orientation == "outward"
    assert (wanted.convex == 1).sum() > 100
    assert (wanted.convex == -1).sum() > 10


def test_normals_of_the_cloud_tell_the_outside_in_tiles(files, strip, tmp_path):
    up = np.tile([0.0, 0.1, -1.0], (len(strip), 1))
    names, first = [], 0
    for number, length in enumerate(lengths_of(files)):
        rows = slice(first, first + length)
        columns = {name: up[rows, axis] for axis, name in enumerate(("nx", "ny", "nz"))}
        names.append(str(tmp_path / f"with{number}.npz"))
        edgel.write(names[-1], edgel.Cloud(strip[rows], columns))
        first += length
    cloud = edgel.Cloud(strip, {name: up[:, axis] for axis, name in enumerate(("nx", "ny", "nz"))})
    wanted = edgel.detect(cloud, method="surface")
    assert wanted.orientation == "normals"
    found = tiled.detect(names, tmp_path / "out", tile_points=3_000)
    check_same(found, wanted, lengths_of(files))
    assert (wanted.convex != 0).sum() > 100
    with pytest.raises(ValueError, match=r"with0.npz: has normals of its own .*line1.npy has none"):
        tiled.detect([names[0], files[1]], tmp_path / "mixed")


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_four_workers_with_tiles_in_random_order_give_the_same(strip, tmp_path, monkeypatch, noise):
    pytest.importorskip("distributed", reason="the extra tiles is not installed")
    rng, by_dask = np.random.default_rng(3), engine.Engine._by_dask

    def shuffled(self, task, jobs):
        order = rng.permutation(list(jobs)).tolist()
        return by_dask(self, task, {number: jobs[number] for number in order})

    monkeypatch.setattr(engine.Engine, "_by_dask", shuffled)
    xyz = strip + rng.normal(0, noise, strip.shape)
    np.save(tmp_path / "a.npy", xyz)
    found = tiled.detect([tmp_path / "a.npy"], tmp_path / "out", tile_points=2_500, workers=4)
    check_same(found, edgel.detect(xyz, method="surface"), [len(xyz)])


STOPPED = """
import os, sys
from edgel import tiled
left = int(sys.argv[1])
def say(line):
    global left
    left -= 1
    if not left:
        os._exit(9)  # as by kill -9: nothing is tidied up
tiled.detect(sys.argv[3:], sys.argv[2], tile_points=3_500, progress=say)
"""


def test_a_run_that_was_killed_goes_on(files, whole, tmp_path):
    out = tmp_path / "out"
    killed = subprocess.run([sys.executable, "-c", STOPPED, "9", str(out), *files], check=False)
    assert killed.returncode == 9
    kept = {path: path.stat().st_mtime_ns for path in (out / "work").rglob("*.npz")}
    assert kept
    (out / "work" / "label").mkdir(exist_ok=True)
    dead = f"{socket.gethostname()}.{2**22 + 1}.part"  # what a kill may leave: no process has such a number
    (out / "work" / "label" / f"000000.npz.{dead}").write_bytes(b"half")
    (out / "work" / "spool" / f"000000.{dead}").mkdir()
    found = tiled.detect(files, out, tile_points=3_500)
    check_same(found, whole, lengths_of(files))
    assert not list(out.rglob("*.part"))
    assert {path: path.stat().st_mtime_ns for path in kept} == kept  # nothing was done twice
    again = {path: path.stat().st_mtime_ns for path in out.rglob("*.np[yz]")}
    tiled.detect(files, out, tile_points=3_500)
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*.np[yz]")} == again


def test_a_tile_that_fails_is_tried_alone_and_named(files, whole, tmp_path, monkeypatch):
    real, calls = classify.classify_tile, []

    def failing(plan, answer, tile):
        calls.append(tile)
        if tile == 1 and not (tmp_path / "mended").exists():
            raise OSError("no luck")
        real(plan, answer, tile)

    monkeypatch.setattr(passes, "classify_tile", failing)
    with pytest.raises(tiled.TileError, match=r"tile 1 \(x .*no luck.*all others are done"):
        tiled.detect(files, tmp_path / "out", tile_points=3_500)
    assert calls == [*range(max(calls) + 1), 1]  # all, and that one once more
    (tmp_path / "mended").touch()
    check_same(tiled.detect(files, tmp_path / "out", tile_points=3_500), whole, lengths_of(files))


def test_results_of_something_else_are_refused(files, tmp_path):
    out = tmp_path / "out"
    tiled.detect(files, out, tile_points=10**6)
    with pytest.raises(ValueError, match=r"other options \(min_strength 0.5, now 0.4\).*--overwrite"):
        tiled.detect(files, out, tile_points=10**6, min_strength=0.4)
    with pytest.raises(ValueError, match=r"other files.*--overwrite"):
        tiled.detect(files[:2], out, tile_points=10**6)
    points = np.load(files[1])
    os.utime(files[1], ns=(1, 1))  # touched, and the same
    tiled.detect(files, out, tile_points=10**6)
    points[5, 2] += 0.5
    np.save(files[1], points)
    with pytest.raises(ValueError, match=r"line1.npy: changed since"):
        tiled.detect(files, out, tile_points=10**6)
    found = tiled.detect(files, out, tile_points=10**6, overwrite=True)
    check_same(found, edgel.detect(np.concatenate([np.load(f) for f in files]), method="surface"), lengths_of(files))


def test_empty_files_are_no_harm_and_damaged_ones_are_named(files, whole, tmp_path):
    empty, damaged = str(tmp_path / "empty.npy"), tmp_path / "damaged.npy"
    np.save(empty, np.zeros((0, 3)))
    found = tiled.detect([*files, empty], tmp_path / "out", tile_points=10**6)
    check_same(found, whole, [*lengths_of(files), 0])
    damaged.write_bytes(Path(files[0]).read_bytes()[:5000])
    with pytest.raises(ValueError, match=r"damaged.npy.*mend it, or leave it out"):
        tiled.detect([*files, str(damaged)], tmp_path / "other")
    with pytest.raises(FileNotFoundError, match="nowhere"):
        tiled.detect([*files, "nowhere.npy"], tmp_path / "third")


def test_what_is_not_one_cloud_is_refused(strip, tmp_path):
    for name, crs in (("a", "EPSG:25832"), ("b", "EPSG:25833")):
        edgel.write(tmp_path / f"{name}.laz", edgel.Cloud(strip[:500], crs=crs))
    with pytest.raises(ValueError, match=r"b.laz: its CRS"):
        tiled.detect([tmp_path / "a.laz", tmp_path / "b.laz"], tmp_path / "out")
    with pytest.raises(ValueError, match="named twice"):
        tiled.detect([tmp_path / "a.laz", tmp_path / "a.laz"], tmp_path / "out")


def test_scan_lines_are_stretched_in_tiles_too(tmp_path):
    rng = np.random.default_rng(5)
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(0, 160.0, 0.2), np.arange(0, 36.0, 1.5)))
    x, y = x + rng.uniform(-0.05, 0.05, len(x)), y + 0.005 * rng.standard_normal(len(x))
    roof = (np.abs(x % 40 - 20) < 11) & (np.abs(y - 17) < 9)
    z = np.where(roof, 9 + 0.6 * (9 - np.abs(y - 17)), 0) + 0.005 * rng.standard_normal(len(x))
    xyz = np.column_stack([x, y, z])
    wanted = edgel.detect(xyz, method="surface")
    assert scan_line_stretch(build_index(xyz)) is not None
    np.save(tmp_path / "lines.npy", xyz)
    found = tiled.detect([tmp_path / "lines.npy"], tmp_path / "out", tile_points=5_000)
    assert found.num_tiles > 2
    check_same(found, wanted, [len(xyz)])
    assert len(wanted) > 200


def test_scans_of_one_file_are_points_of_the_cloud(strip, whole, tmp_path):
    scans = np.repeat([0, 1], [10_000, len(strip) - 10_000]).astype(np.uint8)
    edgel.write(tmp_path / "a.npz", edgel.Cloud(strip, {"scan_index": scans}))
    check_same(tiled.detect([tmp_path / "a.npz"], tmp_path / "out", tile_points=5_000), whole, [len(strip)])


@pytest.fixture(scope="module")
def noisy(strip):
    """The street under noise of a spacing, with a few points far off."""
    rng = np.random.default_rng(0)
    noisy = strip + rng.normal(0, 1.0, strip.shape)
    return np.concatenate([noisy, noisy[rng.integers(0, len(noisy), 40)] + rng.normal(0, 12.0, (40, 3))])


@pytest.fixture
def noisy_files(noisy, tmp_path):
    names = [str(tmp_path / f"{number}.npy") for number in range(2)]
    for name, part in zip(names, np.array_split(noisy, 2), strict=True):
        np.save(name, part)
    return names


def stored(out, step):
    """The results of a step at all tiles."""
    return [np.load(path) for path in sorted((out / "work" / step).glob("*.npz"))]


@pytest.mark.parametrize("tile_points", [1_000, 4_000, 10**6])
def test_noise_is_smoothed_and_looked_at_more_coarsely_in_tiles_too(noisy, noisy_files, tmp_path, tile_points):
    found = tiled.detect(noisy_files, tmp_path / "out", tile_points=tile_points)
    check_same(found, edgel.detect(noisy, method="surface"), lengths_of(noisy_files))
    carried = sum(len(tile["key"]) for tile in stored(tmp_path / "out", "carry"))
    assert carried > 50
    moved = [np.linalg.norm(tile["seen"] - tile["xyz"], axis=1) for tile in stored(tmp_path / "out", "classify")]
    assert np.concatenate(moved).max() > 5.0  # farther than to the next tile's points


def test_faces_of_a_coarser_look_are_those_that_are_asked_for(noisy, noisy_files, tmp_path):
    asked = {"viewpoint": noisy.mean(axis=0) + [0, 0, 900.0], "num_neighbors": 30, "min_strength": 0.3}
    found = tiled.detect(noisy_files, tmp_path / "out", tile_points=4_000, **asked)
    check_same(found, edgel.detect(noisy, method="surface", **asked), lengths_of(noisy_files))


def test_a_noisy_solid_is_told_its_outside_in_tiles(tmp_path):
    xyz = synth.sample(synth.stepped_block(), pattern="blue_noise", spacing=1.8, noise=1.0, seed=3).cloud.xyz
    np.save(tmp_path / "block.npy", xyz)
    found = tiled.detect([tmp_path / "block.npy"], tmp_path / "out", tile_points=2_000, orient="outward")
    assert found.num_tiles > 2
    wanted = edgel.detect(xyz, method="surface", orient="outward")
    check_same(found, wanted, [len(xyz)])
    assert (wanted.convex != 0).sum() > 100


def test_lines_under_noise_are_smoothed_and_stretched_in_tiles(tmp_path):
    rng = np.random.default_rng(5)
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(0, 120.0, 0.2), np.arange(0, 36.0, 1.5)))
    z = np.where(np.abs(x % 40 - 20) < 11, 9 + 0.6 * (9 - np.abs(y - 17)), 0)
    xyz = np.column_stack([x, y, z]) + [0.02, 0.005, 0.8] * rng.standard_normal((len(x), 3))
    np.save(tmp_path / "lines.npy", xyz)
    found = tiled.detect([tmp_path / "lines.npy"], tmp_path / "out", tile_points=4_000)
    check_same(found, edgel.detect(xyz, method="surface"), [len(xyz)])
    assert list((tmp_path / "out" / "work" / "smoothed").iterdir())


def test_cells_that_cannot_be_numbered_are_refused(noisy, tmp_path):
    np.save(tmp_path / "a.npy", np.concatenate([noisy, [[1e12, 1e12, 1e12]]]))
    with pytest.raises(ValueError, match="more than can be told apart; leave out points that lie far"):
        tiled.detect([tmp_path / "a.npy"], tmp_path / "out", tile_points=10**6, viewpoint=[0, 0, 1e4])


def test_a_disk_that_is_too_small_is_told_before(files, tmp_path, monkeypatch):
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr("shutil.disk_usage", lambda path: usage(10, 9, 1))
    with pytest.raises(OSError, match="larger disk"):
        tiled.detect(files, tmp_path / "out")


def test_a_disk_that_fills_up_is_told_by_what_the_first_tiles_took(files, whole, tmp_path, monkeypatch):
    usage, took = namedtuple("usage", "total used free"), (BYTES_A_POINT + disk.RESULTS) * sum(lengths_of(files))
    monkeypatch.setattr("shutil.disk_usage", lambda path: usage(10**12, 0, int(took * 1.01)))
    with pytest.raises(OSError, match="go on with the same call"):
        tiled.detect(files, tmp_path / "out", tile_points=3_500)
    work = tmp_path / "out" / "work"
    assert len(list((work / "classify").iterdir())) < len(Plan.read(work).tiles)
    monkeypatch.undo()
    check_same(tiled.detect(files, tmp_path / "out", tile_points=3_500), whole, lengths_of(files))


def test_a_disk_that_is_too_small_for_what_noise_adds_is_told_before_it_is_written(noisy_files, tmp_path, monkeypatch):
    usage, free = namedtuple("usage", "total used free"), (BYTES_A_POINT + disk.RESULTS) * sum(lengths_of(noisy_files))
    monkeypatch.setattr("shutil.disk_usage", lambda path: usage(10**12, 0, free))
    with pytest.raises(OSError, match="go on with the same call"):
        tiled.detect(noisy_files, tmp_path / "out", tile_points=3_500)
    assert not (tmp_path / "out" / "work" / "smoothed").exists()


def test_what_others_are_writing_is_left_alone(tmp_path):
    for name in ("a.npz.elsewhere.12.part", f"b.npz.{socket.gethostname()}.{os.getpid()}.part"):
        (tmp_path / name).touch()
    aside.clear_stale(tmp_path)
    assert len(list(tmp_path.iterdir())) == 2
    os.utime(tmp_path / "a.npz.elsewhere.12.part", (1, 1))
    aside.clear_stale(tmp_path)
    assert [path.name[0] for path in tmp_path.iterdir()] == ["b"]


@pytest.mark.parametrize("suffix", [".npy", ".laz", ".las"])
def test_files_are_read_a_stretch_at_a_time(strip, tmp_path, monkeypatch, suffix):
    rounded = strip.round(2)
    edgel.write(tmp_path / f"a{suffix}", edgel.Cloud(rounded))
    xyz = edgel.read(tmp_path / f"a{suffix}").xyz
    monkeypatch.setattr("edgel.io.chunks.ROWS", 2_345)
    found = tiled.detect([tmp_path / f"a{suffix}"], tmp_path / "out", tile_points=5_000)
    check_same(found, edgel.detect(xyz, method="surface"), [len(strip)])
    assert edgel.read(found.outputs[0]).xyz.tobytes() == xyz[found.edges(0).index].tobytes()


def test_copc_comes_out(strip, tmp_path):
    edgel.write(tmp_path / "a.laz", edgel.Cloud(strip, {"intensity": np.arange(len(strip), dtype=np.uint16)}))
    found = tiled.detect([tmp_path / "a.laz"], tmp_path / "out", extension=".copc.laz")
    assert found.outputs == [str(tmp_path / "out" / "a.copc.laz")]
    with laspy.CopcReader.open(found.outputs[0]) as reader:
        points = reader.query()
    assert sorted(np.asarray(points["intensity"])) == found.edges(0).index.tolist()  # COPC has an order of its own
    (item,) = json.loads((tmp_path / "out" / "edges.vpc").read_text())["features"]
    assert (item["id"], item["properties"]["pc:encoding"]) == ("a", "copc")
    assert item["properties"]["pc:count"] == found.num_edges > 0


def test_an_index_lists_the_files(strip, tmp_path):
    files = [tmp_path / "west.laz", tmp_path / "east.las"]
    for file, part in zip(files, np.array_split(strip, 2), strict=True):
        edgel.write(file, edgel.Cloud(part, {"intensity": np.arange(len(part), dtype=np.uint16)}, crs="EPSG:25832"))
    found = tiled.detect(files, tmp_path / "out", extension=".laz")
    index = json.loads((tmp_path / "out" / "edges.vpc").read_text())
    assert [each["assets"]["data"]["href"] for each in index["features"]] == ["./west.laz", "./east.laz"]
    assert sum(each["properties"]["pc:count"] for each in index["features"]) == found.num_edges > 0
    assert "25832" in index["features"][0]["properties"]["proj:wkt2"]
    assert {"intensity", "edge_kind"} <= set(edgel.read(found.outputs[1]).attributes)


def test_tiles_share_no_point_and_leave_none_out(files, strip, tmp_path):
    tiled.detect(files, tmp_path / "out", tile_points=1_000)
    plan = Plan.read(tmp_path / "out" / "work")
    held = np.sum([tile.holds(strip) for tile in plan.tiles], axis=0)
    assert (held == 1).all()
    loaded = [plan.spool.load(tile) for tile in plan.tiles]
    assert len(np.unique(np.concatenate([keys for _, keys in loaded]))) == len(strip)
    assert sorted(map(tuple, np.concatenate([xyz for xyz, _ in loaded]))) == sorted(map(tuple, strip))
    assert all(a.high != b.high or a.low != b.low for a, b in pairwise(plan.tiles))


def test_a_scheduler_that_is_gone_is_told():
    distributed = pytest.importorskip("distributed", reason="the extra tiles is not installed")

    def lose(line):
        client.cancel([distributed.Future(key, client) for key in list(client.futures)], force=True)

    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0") as cluster,
        distributed.Client(cluster) as client,
        pytest.raises(ConnectionError, match="of 5 tasks not known to be done; start one and go on"),
    ):
        engine.Engine(client, lose).run("waiting", time.sleep, [(0.2,)] * 5)


def test_several_workers_need_dask(monkeypatch):
    monkeypatch.setitem(sys.modules, "dask", None)
    with (
        pytest.raises(ModuleNotFoundError, match=r"edgel\[tiles\]"),
        engine.start(2, None, lambda line: None),
    ):
        pass
