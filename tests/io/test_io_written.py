"""What is written: nothing is lost in silence, and it arrives in the programs that users open it with."""

import itertools
import shutil
import subprocess
import sys
import warnings

import laspy
import numpy as np
import pytest
from laspy.vlrs.vlrlist import VLRList

import edgel
from edgel import Cloud
from edgel.io import WRITERS, FormatError, FormatWarning, read, write
from edgel.io.columns import as_table

MOST_ROWS = 300


@pytest.fixture
def cases(shared_data):
    return shared_data.parent / "cases"


def write_and_ask(path, cloud):
    """Write, and return what was said of attributes and coordinates."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        write(path, cloud)
    assert all(isinstance(entry.message, FormatWarning) for entry in caught)
    return {name: what for entry in caught for name, what in getattr(entry.message, "said", {}).items()}


def check_equal_or_said(path, cloud):
    """Every attribute comes back by its name, or by its name of another spelling, or it was said."""
    said, found = write_and_ask(path, cloud), read(path)
    assert len(found) == len(cloud)
    if "coordinates" not in said:
        single = path.suffix == ".pcd"
        limits = {"atol": 1e-8 * np.nanmax(np.abs(cloud.xyz), initial=1), "rtol": 1.2e-7 if single else 0}
        np.testing.assert_allclose(found.xyz, cloud.xyz, **limits)
    for name, values in cloud.attributes.items():
        if f"{name}_0" in said:
            assert said[f"{name}_0"].startswith("left out")
            continue
        if name in said:
            assert said[name].startswith(("left out", "renamed")), said[name]
            if said[name].startswith("left out"):
                continue
            new = said[name].split(",")[0].removeprefix("renamed ")
        else:
            new = "_".join(name.split())
        columns = as_table(values) if values.ndim > 1 else values[:, None]
        parts = [f"{new}_{i}" for i in range(columns.shape[1])]
        parts = [new] if columns.shape[1] == 1 or parts[0] not in found.attributes else parts
        np.testing.assert_array_equal(np.column_stack([as_table(found.attributes[part]) for part in parts]), columns)


def real_files(folder):
    """Thirty files of all formats and kinds."""
    groups = [
        ["airborne/autzen_trim.laz", "airborne/simple.copc.laz", "airborne/sample_c.las", "airborne/interesting.las"],
        [f"airborne/pdal_pcd/{name}.pcd" for name in ("utm17_tab", "autzen-utm", "utm17_comma", "utm17_space")],
        ["kinect_objects/learn0.pcd", "kinect_organized/milk_cartoon_all_small_clorox.pcd"],
        [f"malformed/pypcd4_pcd/{name}.pcd" for name in ("ascii_multi_count", "binary", "binary_compressed")],
        ["lidar_sweeps/small_gicp_target.ply", "scan_vs_mesh/00011084_fddd53ce45f640f3ab922328_trimesh_019.xyz.npy"],
        [f"truth/{name}.ply" for name in ("abc_0134", "shrec_04", "abc_noise_0.04_7009", "default_CubeFractal2")],
        [f"roofs/Roof_{number}/points.xyz" for number in (1, 4, 6, 8)],
        [f"malformed/e57_cry-inc/{name}.e57" for name in E57],
    ]
    return [folder / name for group in groups for name in group]


E57 = ["bunnyFloat", "integer_intensity", "scaled_integer_intensity", "las2e57_no_images_tag", "tinyCartesianFloatRgb",
       "tiny_pc_with_extension", "tiny_spherical"]  # fmt: skip


@pytest.mark.parametrize("number", range(30))
def test_round_trips_of_real_files(shared_data, tmp_path, number):
    file = real_files(shared_data)[number]
    if file.suffix == ".e57":
        pytest.importorskip("pye57", reason="the extra e57 is not installed")
    cloud = read(file)
    finite = np.flatnonzero(np.isfinite(cloud.xyz).all(axis=1))
    cloud = cloud.take(finite[:: max(len(finite) // MOST_ROWS, 1)])
    assert len(cloud)
    for suffix in WRITERS:
        check_equal_or_said(tmp_path / f"a{suffix}", cloud)


@pytest.mark.parametrize("suffix", WRITERS)
@pytest.mark.parametrize(
    "name", ["las_inner_names.npy", "uint64.npy", "las_1_0.las", "evlr.las", "grid_with_gap.e57", "own_normals.ply"]
)
def test_cases_can_be_written_in_every_format(cases, tmp_path, name, suffix):
    pytest.importorskip("pye57", reason="the extra e57 is not installed")
    cloud = read(cases / name)
    if name == "grid_with_gap.e57" and suffix in (".las", ".laz"):
        with pytest.raises(FormatError, match="1 of 48 points are NaN"):
            write(tmp_path / f"a{suffix}", cloud)
        return
    check_equal_or_said(tmp_path / f"a{suffix}", cloud)


def test_the_case_of_names_that_las_uses_itself(cases, tmp_path):
    said = write_and_ask(tmp_path / "a.las", read(cases / "las_inner_names.npy"))
    assert said == {"bit_fields": "renamed bit_fields_2, to suit LAS"}
    assert read(tmp_path / "a.las").attributes["bit_fields_2"].tolist() == [4, 5, 6]


def test_the_case_of_las_1_0(cases, tmp_path):
    write(tmp_path / "a.las", read(cases / "las_1_0.las"))
    with laspy.open(tmp_path / "a.las") as reader:
        assert str(reader.header.version) == "1.2"


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_extended_records_are_kept(cases, tmp_path, suffix):
    write(tmp_path / f"a{suffix}", read(cases / "evlr.las"))
    theirs, ours = (list(laspy.read(file).evlrs or ()) for file in (cases / "evlr.las", tmp_path / f"a{suffix}"))
    assert [(evlr.user_id, evlr.record_id) for evlr in ours] == [("example", 42)]
    assert ours[0].record_data_bytes() == theirs[0].record_data_bytes()


def test_the_case_of_own_normals_and_no_edge_with_vectors(cases, tmp_path):
    cloud = read(cases / "own_normals.ply")
    for suffix in (".pcd", ".ply", ".las"):
        check_equal_or_said(tmp_path / f"a{suffix}", edgel.detect(cloud).to_cloud(cloud))
    cloud = read(cases / "no_edges_vector_attribute.npz")
    edges = edgel.detect(cloud, min_strength=0.999)
    for suffix in WRITERS:
        write_and_ask(tmp_path / f"a{suffix}", edges.to_cloud(cloud))
        assert len(read(tmp_path / f"a{suffix}")) == len(edges)


def waves(tmp_path, point_format, *, external=False):
    """A LAS file with waveforms, in an extended record or beside it, and the bytes of the record."""
    version = "1.4" if point_format > 5 else "1.3"
    header = laspy.LasHeader(version=version, point_format=point_format)
    las = laspy.LasData(header)
    las.xyz = np.eye(3)
    las["wavepacket_index"], las["wavepacket_offset"] = [1, 1, 1], [60, 2**63 + 1, 64]
    las["wavepacket_size"], las["return_point_wave_location"] = [2, 2, 2], [0.5, 1, 1.5]
    las.header.global_encoding.waveform_data_packets_external = external
    las.header.global_encoding.waveform_data_packets_internal = not external
    if point_format > 5 and not external:
        records = [laspy.VLR("example", 1, "", b"first"), laspy.VLR("LASF_Spec", 65535, "waves", b"wwwwww")]
        las.evlrs = VLRList(records)
    las.write(str(tmp_path / "waves.las"))
    return tmp_path / "waves.las"


@pytest.mark.parametrize("external", [False, True])
@pytest.mark.parametrize("point_format", [4, 5, 9, 10])
def test_waveforms_fail_no_result(tmp_path, point_format, external):
    cloud = read(waves(tmp_path, point_format, external=external))
    for suffix in WRITERS:
        check_equal_or_said(tmp_path / f"a{suffix}", cloud)
    said = write_and_ask(tmp_path / "a.laz", cloud)
    assert set(said) == {"waveforms", *laspy.point.dims.WAVEFORM_FIELDS_NAMES}
    said = write_and_ask(tmp_path / "a.las", cloud)
    if external or point_format < 6:
        assert "not in the file" in said["waveforms"]
        assert "waveforms" in cloud.metadata["left_out"][0]
        return
    assert said == {}
    with laspy.open(tmp_path / "a.las") as reader:
        place = reader.header.start_of_waveform_data_packet_record
    assert (tmp_path / "a.las").read_bytes()[place:][60:66] == b"wwwwww"


@pytest.mark.parametrize(("version", "point_format"), [((1, 0), 0), ((1, 0), 1), ((1, 1), 3), ((1, 2), 6)])
def test_versions_that_have_no_such_points(tmp_path, version, point_format):
    header = laspy.LasHeader(point_format=point_format)
    header._version = laspy.header.Version(*version)  # as found in files, though laspy makes none
    write(tmp_path / "a.las", Cloud(np.eye(3), metadata={"las_header": header}))
    with laspy.open(tmp_path / "a.las") as reader:
        assert reader.header.point_format.id == point_format
        assert str(reader.header.version) == ("1.4" if point_format > 5 else "1.2")


def test_more_than_a_las_point_holds_is_left_out_and_said(tmp_path):
    cloud = Cloud(
        np.eye(3), {"shot": np.zeros((3, 352)), "label": np.arange(3), "wide": np.zeros(3, np.longdouble) + 0.1}
    )
    for suffix in (".las", ".laz"):
        said = write_and_ask(tmp_path / f"a{suffix}", cloud)
        assert set(said) <= {"shot", "wide"}
        assert "shot" in said
        assert read(tmp_path / f"a{suffix}").attributes["label"].tolist() == [0, 1, 2]


def test_a_crs_that_las_does_not_know_is_left_out_and_said(tmp_path):
    said = write_and_ask(tmp_path / "a.las", Cloud(np.eye(3), crs="+proj=utm +zone=32"))
    assert said == {"crs": "left out, it is neither WKT nor EPSG:n"}


def test_extra_dimensions_are_described(tmp_path):
    names = (*edgel.edges.ALL_COLUMNS, "reflectance")
    write(tmp_path / "a.las", Cloud(np.eye(3), {name: np.zeros(3, np.float32) for name in names}))
    with laspy.open(tmp_path / "a.las") as reader:
        found = {extra.name: extra.description for extra in reader.header.point_format.extra_dimensions}
    assert list(found) == list(names)
    assert all(found.values())
    assert found["edge_angle"] == "turn between the faces, radians"


def test_text_has_the_decimals_of_las(shared_data, tmp_path):
    cloud = read(shared_data / "airborne" / "autzen_trim.laz").take(np.arange(5))
    write(tmp_path / "a.csv", cloud)
    first = (tmp_path / "a.csv").read_text().splitlines()[1].split(",")[:3]
    assert [len(word.partition(".")[2]) for word in first] == [2, 2, 2]
    moved = Cloud(cloud.xyz + 0.00125, cloud.attributes, metadata=cloud.metadata)
    write(tmp_path / "a.csv", moved)
    np.testing.assert_array_equal(read(tmp_path / "a.csv").xyz, moved.xyz)


def test_text_begins_as_programs_expect_it(tmp_path):
    rng = np.random.default_rng(0)
    names = ("label", "nx", "red", "ny", "green", "nz", "blue", "intensity")
    cloud = Cloud(rng.random((4, 3)), {name: rng.integers(0, 200, 4).astype(np.uint8) for name in names})
    write(tmp_path / "a.xyz", cloud)
    assert (tmp_path / "a.xyz").read_text().split("\n")[0] == "x y z red green blue nx ny nz label intensity"
    assert set(write_and_ask(tmp_path / "a.pts", cloud)) == {"label", "nx", "ny", "nz"}
    lines = (tmp_path / "a.pts").read_text().splitlines()
    assert (lines[0], len(lines[1].split())) == ("4", 7)
    write(tmp_path / "b.xyz", Cloud(cloud.xyz))
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "b.xyz"), cloud.xyz)


def test_fields_of_e57_and_of_extensions_keep_their_names(shared_data, tmp_path):
    lib = pytest.importorskip("pye57").libe57
    cloud = read(shared_data / "malformed" / "e57_cry-inc" / "tiny_pc_with_extension.e57")
    more = {"timeStamp": np.ones(1), "label": np.ones(1, np.int16), "rowIndex": np.ones(1, np.int16), "1 a": np.ones(1)}
    more |= {name: np.ones(1, np.uint8) for name in ("red", "green", "blue")}
    said = write_and_ask(tmp_path / "a.e57", cloud.with_attributes(**more))
    assert said == {"rowIndex": "renamed rowIndex_2, the name rowIndex is taken", "1 a": "renamed _1_a"}
    image = lib.ImageFile(str(tmp_path / "a.e57"), "r")
    scan = image.root()["data3D"][0]
    prototype = lib.StructureNode(scan["points"].prototype())
    names = {prototype[i].elementName() for i in range(prototype.childCount())}
    assert {"nor:normalX", "nor:normalY", "nor:normalZ", "timeStamp", "colorRed", "edgel:label", "edgel:_1_a"} <= names
    assert scan["colorLimits"]["colorRedMaximum"].value() == 255
    image.close()
    assert read(tmp_path / "a.e57").metadata["e57_extensions"] == cloud.metadata["e57_extensions"]


@pytest.mark.skipif(sys.platform == "win32", reason="forks")
def test_no_signal_crashes_the_writing_of_e57(tmp_path):
    """A signal whose handler raises, at every line between the calls of libE57, each in a process of its own."""
    pytest.importorskip("pye57", reason="the extra e57 is not installed")
    code = f"""
import os, signal, sys
import numpy as np
from edgel import Cloud
from edgel.io import e57_write, write
cloud = Cloud(np.random.default_rng(0).random((300, 3)), {{"a": np.arange(300)}})

class Ended(BaseException):
    pass

def end(*_):
    raise Ended

def run(wanted, number):
    seen = 0
    def trace(frame, event, argument):
        nonlocal seen
        if frame.f_code.co_filename == e57_write.__file__ and frame.f_code.co_name == "_write_scan":
            seen += event == "line"
            if seen == wanted and event == "line":
                sys.settrace(None)
                os.kill(os.getpid(), number)
            return trace
    signal.signal(number, end)
    sys.settrace(trace)
    try:
        write(f"{tmp_path}/{{wanted}}.e57", cloud)
    except Ended:
        os._exit(7)
    os._exit(0)

for wanted in range(1, 1000):
    child = os.fork()
    if not child:
        run(wanted, (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGUSR1)[wanted % 4])
    ended = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if ended == 0:
        print(wanted)
        break
    assert ended == 7, (wanted, ended)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 30


# The programs themselves.


def edges_cloud(num=40):
    """What `edgel detect` writes, with colors and an intensity."""
    rng = np.random.default_rng(0)
    attributes = {name: rng.integers(0, 256, num).astype(np.uint8) for name in ("red", "green", "blue")}
    attributes |= {
        "edge_kind": rng.integers(0, 9, num).astype(np.uint8),
        "edge_convex": rng.integers(-1, 2, num).astype("i1"),
    }
    attributes |= {name: rng.random(num).astype(np.float32) for name in ("edge_strength", "intensity", "edge_x")}
    normals = rng.normal(size=(num, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    attributes |= {name: normals[:, i].astype(np.float32) for i, name in enumerate(("nx", "ny", "nz"))}
    attributes |= {
        "id": rng.integers(0, 2**31, num),
        "time": rng.random(num),
        "ring": rng.integers(0, 9, num, np.uint16),
    }
    return Cloud(rng.random((num, 3)).astype(np.float32), attributes)


def test_cloudcompare_takes_every_attribute_for_a_scalar_field(tmp_path, monkeypatch):
    program = shutil.which("CloudCompare")
    if program is None:
        pytest.skip("CloudCompare is not installed (apt-get install cloudcompare)")
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    cloud = edges_cloud()
    write(tmp_path / "a.ply", cloud)
    out = tmp_path / "out.asc"
    options = [
        "-SILENT",
        "-AUTO_SAVE",
        "OFF",
        "-O",
        tmp_path / "a.ply",
        "-C_EXPORT_FMT",
        "ASC",
        "-PREC",
        "9",
        "-ADD_HEADER",
    ]
    subprocess.run([program, *options, "-SAVE_CLOUDS", "FILE", out], capture_output=True, timeout=60, check=True)
    names = out.read_text().splitlines()[0].removeprefix("//").split()
    fields = [name for name in cloud.attributes if name not in ("red", "green", "blue", "nx", "ny", "nz")]
    assert names[:6] == ["X", "Y", "Z", "R", "G", "B"]
    assert names[-3:] == ["Nx", "Ny", "Nz"]
    assert set(names[6:-3]) == set(fields)
    table = dict(zip(names, np.loadtxt(out, comments="//", ndmin=2).T, strict=True))
    np.testing.assert_array_equal(table["R"], cloud.attributes["red"])
    for name in fields:  # CloudCompare keeps single precision
        np.testing.assert_allclose(table[name], cloud.attributes[name], rtol=1e-6, atol=1e-8)


def test_pcl_reads_points_with_normals(tmp_path):
    programs = [shutil.which(name) for name in ("pcl_convert_pcd_ascii_binary", "pcl_pcd2ply", "pcl_voxel_grid")]
    if None in programs:
        pytest.skip("PCL's tools are not installed (apt-get install pcl-tools)")
    cloud = edges_cloud()
    write(tmp_path / "a.pcd", cloud)
    for program, ending in itertools.product(programs, [["b.pcd", "0"]]):
        command = [program, tmp_path / "a.pcd", tmp_path / ("b.ply" if "ply" in str(program) else ending[0])]
        command += ["0"] if "ascii" in str(program) else ["-leaf", "1e-3,1e-3,1e-3"] if "voxel" in str(program) else []
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
        assert "Incorrect" not in done.stderr + done.stdout
        assert "Failed" not in done.stderr + done.stdout
        found = read(command[2])
        assert len(found) == len(cloud)
        if "ascii" in str(program):
            assert_allclose_columns(found, cloud)


def assert_allclose_columns(found, cloud):
    np.testing.assert_allclose(found.xyz, cloud.xyz, rtol=1e-6)
    for name, values in cloud.attributes.items():
        np.testing.assert_allclose(found.attributes[name], values, rtol=1e-6)


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
def test_open3d_reads_every_attribute(tmp_path, suffix):
    o3d = pytest.importorskip("open3d", reason="the extra export is not installed")
    cloud = edges_cloud()
    write(tmp_path / f"a{suffix}", cloud)
    found = o3d.t.io.read_point_cloud(str(tmp_path / f"a{suffix}"))
    np.testing.assert_array_equal(found.point.positions.numpy(), cloud.xyz)
    prefix = "scalar_" if suffix == ".ply" else ""
    for name, values in cloud.attributes.items():
        if name in ("red", "green", "blue"):
            got = found.point.colors.numpy()[:, ("red", "green", "blue").index(name)]
        elif name in ("nx", "ny", "nz"):
            column = "xyz".index(name[1])
            got = (
                found.point.normals.numpy()[:, column]
                if "normals" in found.point
                else found.point[f"normal_{name[1]}"].numpy()[:, 0]
            )
        else:
            got = found.point[name if name == "intensity" else prefix + name].numpy()[:, 0]
        np.testing.assert_array_equal(got, values)
    legacy = o3d.io.read_point_cloud(str(tmp_path / f"a{suffix}"))
    assert legacy.has_normals()
    assert legacy.has_colors()
