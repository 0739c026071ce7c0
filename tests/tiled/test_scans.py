"""Organized scans among the inputs of a run in tiles: each is seen from its own sensor."""

import numpy as np
import pytest

import edgel
from edgel import Cloud, synth, tiled
from edgel.io.scans import organized_scans

FIELDS = ("index", "kind", "strength", "position", "normals", "angle", "convex")


@pytest.fixture(scope="module")
def stations():
    """A block as two scanners see it, organized."""
    views = [{"seed": 7, "direction": (0.3, 0.4, -1.0)}, {"seed": 8, "direction": (-0.5, 0.2, -1.0)}]
    return [synth.view(synth.stepped_block(), projection="pinhole", spacing=3.0, **view).cloud for view in views]


def write_ptx(path, scans):
    """Each scan in its scanner's frame, with its place; no return is 0 0 0."""
    with open(path, "w") as file:
        for scan in scans:
            x, y, z = place = scan.viewpoint.tolist()
            turn = "1 0 0", "0 1 0", "0 0 1"
            lines = [*map(str, scan.shape), f"{x} {y} {z}", *turn, *(f"{row} 0" for row in turn), f"{x} {y} {z} 1"]
            rows = np.nan_to_num(scan.xyz - place)
            file.write("\n".join([*lines, *(f"{a!r} {b!r} {c!r} 0.5" for a, b, c in rows.tolist())]) + "\n")


def check_same(found, wanted, index):
    for name in FIELDS[1:]:
        assert getattr(found, name)[index].tobytes() == getattr(wanted, name).tobytes(), name


def test_scans_of_one_file_are_each_seen_from_their_own_sensor(stations, tmp_path):
    write_ptx(tmp_path / "both.ptx", stations)
    wanted = []
    for number, station in enumerate(stations):
        write_ptx(tmp_path / f"{number}.ptx", [station])
        wanted.append(edgel.detect(edgel.read(tmp_path / f"{number}.ptx")))
    found = tiled.detect([tmp_path / "both.ptx"], tmp_path / "out")
    edges = found.edges(0)
    first = len(stations[0])
    np.testing.assert_array_equal(edges.index, np.concatenate([wanted[0].index, first + wanted[1].index]))
    check_same(edges, wanted[0], edges.index < first)
    check_same(edges, wanted[1], edges.index >= first)
    assert edges.orientation == "sensor"
    assert {*np.unique(edges.kind)} >= {edgel.EdgeKind.CREASE, edgel.EdgeKind.OCCLUDING}
    finite = sum(np.isfinite(scan.xyz).all(axis=1).sum() for scan in stations)
    assert (found.num_tiles, found.num_points, edges.num_points - edges.num_dropped) == (0, finite, finite)
    assert found.num_edges == len(edges) == len(edgel.read(found.outputs[0])) > 100
    assert found.outputs == [str(tmp_path / "out" / "both.ply")]
    assert "both.ptx: 2 organized scans, each seen from its own sensor" in found.notices[0]


def test_scans_lie_beside_a_cloud_in_tiles(files, whole, stations, tmp_path):
    np.save(tmp_path / "grid.npy", stations[0].xyz.reshape(*stations[0].shape, 3))
    found = tiled.detect([files[0], tmp_path / "grid.npy", *files[1:]], tmp_path / "out", tile_points=5_000)
    lengths = [len(np.load(file)) for file in files]
    parts = [found.edges(number) for number in (0, 2, 3)]
    first = np.cumsum([0, *lengths])[:3]
    np.testing.assert_array_equal(
        np.concatenate([part.index + begin for part, begin in zip(parts, first, strict=True)]), whole.index
    )
    wanted = edgel.detect(edgel.read(tmp_path / "grid.npy"))
    np.testing.assert_array_equal(found.edges(1).index, wanted.index)
    check_same(found.edges(1), wanted, slice(None))
    kept = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*.np[yz]")}
    tiled.detect([files[0], tmp_path / "grid.npy", *files[1:]], tmp_path / "out", tile_points=5_000)
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    cloud, edges = tiled.surroundings(tmp_path / "out")
    assert len(edges) == found.num_edges
    assert edges.num_points == len(cloud)


def test_scans_of_e57_are_taken_apart_by_their_cells(stations, tmp_path):
    pye57 = pytest.importorskip("pye57", reason="the extra e57 is not installed")
    with pye57.E57(str(tmp_path / "a.e57"), mode="w") as file:
        for scan in stations:
            valid = np.flatnonzero(np.isfinite(scan.xyz).all(axis=1))
            xyz, (row, column) = scan.xyz[valid] - scan.viewpoint, np.divmod(valid, scan.shape[1])
            data = {f"cartesian{axis}": xyz[:, i].copy() for i, axis in enumerate("XYZ")}
            indices = {"rowIndex": row, "columnIndex": column}
            file.write_scan_raw(data | indices, rotation=np.array([1.0, 0, 0, 0]), translation=scan.viewpoint)
    cloud = edgel.read(tmp_path / "a.e57")
    scans = organized_scans(cloud)
    for scan, station in zip(scans, stations, strict=True):
        seen = scan.rows >= 0
        np.testing.assert_array_equal(cloud.xyz[scan.rows[seen]], scan.cloud.xyz[seen])
        assert scan.cloud.viewpoint is not None
        np.testing.assert_allclose(scan.cloud.viewpoint, station.viewpoint)
        assert scan.cloud.is_organized
    found = tiled.detect([tmp_path / "a.e57"], tmp_path / "out", extension=".ply")
    wanted = [scan.rows[edgel.detect(scan.cloud).index] for scan in scans]
    np.testing.assert_array_equal(found.edges(0).index, np.sort(np.concatenate(wanted)))
    assert len(edgel.read(found.outputs[0])) == found.num_edges > 100


def test_scans_without_points_and_lists_of_points(stations, tmp_path):
    grid = np.full((3, 4, 3), np.nan)
    np.save(tmp_path / "empty.npy", grid)
    found = tiled.detect([tmp_path / "empty.npy"], tmp_path / "out")
    assert (found.num_edges, len(edgel.read(found.outputs[0]))) == (0, 0)
    listed = Cloud(np.eye(3), {"scan_index": np.array([0, 0, 1])}, metadata={"scan_positions": (None, None)})
    assert organized_scans(listed) == []
