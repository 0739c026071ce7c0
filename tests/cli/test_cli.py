"""The command line: what each command does, what its exit codes mean, and that bad input never shows a traceback."""

import dataclasses
import inspect
import json
import os
import re
import subprocess
import sys
from io import BytesIO

import numba
import numpy as np
import pytest
from typer.testing import CliRunner

import edgel
from edgel import io
from edgel._cli import app
from edgel._cli.compare import differences
from edgel._cli.detect import detect
from edgel._cli.methods import arguments
from edgel._cli.options import METHODS
from edgel._cli.output import print_json
from edgel._cli.progress import COMPILING, Watch
from edgel._cli.summary import summary

RUNNER = CliRunner(env={"COLUMNS": "200"})
PAPER = ("--method", "paper")


def run(*words):
    """Run a command in this process; any exception that reaches Typer fails the test."""
    result = RUNNER.invoke(app, [str(word) for word in words])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert "Traceback" not in result.output
    return result


def program(*words, stdin=None, cwd=None):
    """Run the program as a shell would."""
    command = [sys.executable, "-m", "edgel", *map(str, words)]
    return subprocess.run(command, input=stdin, capture_output=True, cwd=cwd, timeout=120, check=False)


def step(side=50):
    x, y = np.meshgrid(np.arange(side) / 10, np.arange(side) / 10)
    return np.c_[x.ravel(), y.ravel(), 2.0 * (x.ravel() > 2.45)]


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """A step of 2,500 points with labels."""
    path = tmp_path_factory.mktemp("cli") / "scan.ply"
    io.write(path, edgel.Cloud(step(), {"label": np.arange(2500, dtype=np.uint16)}))
    return path


@pytest.fixture
def bad(tmp_path):
    """Write a file that is not as it should be, and return its path."""
    header = "ply\nformat binary_little_endian 1.0\nelement vertex {}\n" + "property float {}\n" * 3 + "end_header\n"
    contents = {
        "empty.ply": b"",
        "truncated.ply": header.format(100, *"xyz").encode() + bytes(120),
        "magic.ply": b"LASF and so on",
        "words.xyz": b"once upon a time\n",
        "promises.ply": header.format(10**12, *"xyz").encode() + bytes(12),
        "negative.ply": header.format(-1, *"xyz").encode(),
        "noise.las": bytes(range(256)) * 4,
        "broken.npz": b"PK\x03\x04 broken",
        "unknown.foo": b"1 2 3\n",
        "model.stl": b"solid part\n",
        "depth.png": b"\x89PNG\r\n\x1a\n and no more",
        "one.xyz": b"1 2 3\n",
        "two.xyz": b"1 2 3\n4 5 6\n",
        "same.xyz": b"1 2 3\n" * 40,
        "line.xyz": b"".join(b"%d 1 1\n" % i for i in range(40)),
        "nan.xyz": b"nan nan nan\n" * 40,
    }

    def write(name):
        path = tmp_path / name
        if name in contents:
            path.write_bytes(contents[name])
        return path

    return write


UNREADABLE = [
    *("missing.ply", "empty.ply", "truncated.ply", "magic.ply", "words.xyz", "promises.ply", "negative.ply"),
    *("noise.las", "broken.npz", "unknown.foo", "model.stl", "depth.png"),
]


def test_detect_writes_the_edge_points(scan, tmp_path):
    result = run("detect", scan, "-o", tmp_path / "edges.ply", *PAPER)
    assert result.exit_code == 0
    assert result.stdout == ""
    assert "2,500" in result.stderr
    assert "reading" in result.stderr
    assert "writing" in result.stderr
    found = edgel.paper.detect(io.read(scan))
    edges = io.read(tmp_path / "edges.ply")
    assert edges.attributes["label"].tolist() == found.index.tolist()
    assert {"edge_kind", "edge_strength", "nx", "ny", "nz"} < set(edges.attributes)
    assert {"edge_angle", "edge_convex", "nz2", "tz", "edge_z"} < set(edges.attributes)


def test_detect_all_keeps_every_point(scan, tmp_path):
    assert run("detect", scan, "-o", tmp_path / "all.npz", "--all", *PAPER, "--tolerance", 0.1).exit_code == 0
    cloud = io.read(tmp_path / "all.npz")
    assert len(cloud) == 2500
    assert 0 < (cloud.attributes["edge_kind"] > 0).sum() < 2500


def test_detect_with_its_own_method(scan, tmp_path):
    result = run("detect", scan, "-o", tmp_path / "edges.xyz", "--viewpoint", 0, 0, -9, "--num-neighbors", 12)
    assert result.exit_code == 0
    found = edgel.detect(io.read(scan), viewpoint=(0, 0, -9), num_neighbors=12)
    assert np.array_equal(io.read(tmp_path / "edges.xyz").attributes["label"], found.index)


def test_detect_without_output_shows_the_summary_and_how_to_write(scan):
    result = run("detect", scan, *PAPER)
    assert result.exit_code == 0
    assert "add -o" in result.stderr
    memory = re.search(r"memory +([\d,]+) MB", result.stderr)
    assert sys.platform == "win32" or (memory is not None and int(memory[1].replace(",", "")) > 50)


def test_detect_json(scan, tmp_path):
    words = ("--width", 40, "--sigma", 1, "--low", 10, "--tolerance", 0.2)
    result = run("detect", scan, "-o", tmp_path / "edges.ply", "--json", *PAPER, *words)
    found = json.loads(result.stdout)
    assert found["points"] == 2500
    assert found["not_finite"] == 0
    assert found["edge_points"] == len(io.read(tmp_path / "edges.ply"))
    assert found["share"] == found["edge_points"] / 2500
    assert found["kinds"] == {"image": found["edge_points"]}
    assert {"width": 40, "sigma": 1.0, "low": 10.0, "tolerance": 0.2, "num_neighbors": 16}.items() <= found[
        "parameters"
    ].items()
    assert {"reading", "canny", "normals", "writing"} < set(found["seconds"])
    assert found["output"] == str(tmp_path / "edges.ply")
    assert {"input", "report", "normals_undefined", "peak_memory_bytes"} < set(found)
    assert "preset" not in found
    assert (found["method"], found["reason"]) == ("paper", "the published method looks along Z")
    assert found["creases"] == {"median_angle_degrees": None, "convex": 0, "concave": 0}


def test_detect_kinds_and_method(scan, tmp_path):
    words = ("--kinds", "crease, Boundary", "--method", "surface")
    result = run("detect", scan, "-o", tmp_path / "edges.npz", *words)
    assert result.exit_code == 0
    assert "surface" in result.stderr
    assert "asked for" in result.stderr
    expected = edgel.detect(io.read(scan), kinds=["crease", "boundary"], method="surface")
    assert np.array_equal(io.read(tmp_path / "edges.npz").attributes["label"], expected.index)
    assert "red, green and blue" in run("detect", scan, "--kinds", "color").stderr


def test_detect_at_a_scale_of_sharp_creases_in_a_box(scan, tmp_path):
    words = ("--scale", "2", "--min-angle", "20", "--crop", "-inf", "-inf", "-inf", "inf", "0.5", "inf")
    result = run("detect", scan, "-o", tmp_path / "edges.npz", "--json", *words)
    assert result.exit_code == 0
    cloud = io.read(scan)
    expected = edgel.detect(cloud, scale=2).drop_blunt(np.radians(20))
    expected = expected.take(cloud.xyz[expected.index, 1] <= 0.5)
    assert np.array_equal(io.read(tmp_path / "edges.npz").attributes["label"], expected.index)
    told = json.loads(result.stdout)
    assert (told["points"], told["edge_points"]) == (len(cloud), len(expected))
    assert told["parameters"]["scale"] == 2


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--kinds", "sharp"), "--kinds: 'sharp' is unknown; choose from boundary, occluding"),
        (("--kinds", ","), "--kinds: none is asked for"),
        (("--method", "best"), "--method: 'best' is unknown; choose from auto, surface"),
        (("--method", "default"), "--method: 'default' is unknown; choose from auto, surface"),
        (
            ("--kinds", "crease", *PAPER),
            "--kinds: the published method has no such option; leave it out, or --method paper",
        ),
        (
            (*PAPER, "--viewpoint", "0", "0", "1", "--min-strength", "0.5"),
            "--min-strength, --viewpoint: the published method has no such option; leave them out, or --method paper",
        ),
        (("--sigma", "2"), "--sigma: an option of the published method; add --method paper, or leave it out"),
        (
            ("--method", "surface", "--low", "1", "--high", "2"),
            "--low, --high: options of the published method; add --method paper, or leave them out",
        ),
        ((*PAPER, "--min-angle", "30"), "--min-angle: the published method tells no creases apart; leave it out"),
        (("--preset", "paper"), "--preset: no such option; the published method is --method paper"),
        (("--preset=paper",), "--preset: no such option; the published method is --method paper"),
    ],
)
def test_detect_names_wrong_kinds_and_methods(scan, words, message):
    result = run("detect", scan, *words)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"edgel: {message}")
    assert len(result.stderr.splitlines()) == 1


def test_render_refuses_what_a_method_has_not(scan, tmp_path):
    for words in ((*PAPER, "--kinds", "crease"), ("--method", "best"), ("--preset", "paper")):
        result = run("render", scan, "-o", tmp_path / "picture.png", *words)
        assert result.exit_code == 2
        assert result.stderr.startswith(f"edgel: {words[-2]}: ")
    assert not (tmp_path / "picture.png").exists()


def test_the_published_method_at_a_scale(scan, tmp_path):
    result = run("detect", scan, "-o", tmp_path / "edges.npz", "--json", *PAPER, "--scale", 2, "--sigma", 1)
    assert result.exit_code == 0
    told = json.loads(result.stdout)
    expected = edgel.paper.detect(io.read(scan), scale=2, sigma=1)
    assert np.array_equal(io.read(tmp_path / "edges.npz").attributes["label"], expected.index)
    assert (told["method"], told["points"], told["parameters"]["scale"]) == ("paper", 2500, 2)
    assert {"thinning", "canny"} < set(told["seconds"])
    assert run("detect", scan, *PAPER, "--scale", 0.5).exit_code == 2


@pytest.mark.parametrize("method", ["surface", "orthographic"])
def test_detect_by_a_method_says_so(scan, method):
    told = json.loads(run("detect", scan, "--json", "--method", method).stdout)
    assert told["method"] == method
    assert told["edge_points"] == len(edgel.detect(io.read(scan), method=method))


def test_the_summary_tells_what_is_known_of_the_creases():
    edges = edgel.detect(step())
    angle = np.where(np.arange(len(edges)) % 2, np.pi / 2, np.nan)
    convex = np.where(np.arange(len(edges)) % 2, 1, -1).astype(np.int8)
    kind = np.full(len(edges), edgel.EdgeKind.CREASE, np.uint8)
    rows = {
        row[0].strip(): row
        for row in summary(dataclasses.replace(edges, kind=kind, angle=angle, convex=convex), 0, "foot", {})
    }
    assert rows["unit"] == ("unit", "", "foot, says the file")
    assert rows["crease"][2].startswith("median angle 90.0 degrees, ")
    assert "convex" in rows["crease"][2]
    assert "concave" in rows["crease"][2]
    assert rows["method"] == ("method", edges.method, edges.reason)


def test_detect_report(scan, tmp_path):
    result = run("detect", scan, "--report", tmp_path / "new" / "report", *PAPER)
    page = tmp_path / "new" / "report" / "report.html"
    assert f"{page}: the report" in result.stderr
    assert "scan" in page.read_text()
    assert run("detect", scan, "--report", scan).exit_code == 5
    assert run("detect", scan, "--report", "/proc/report").exit_code == 5


def test_the_report_compares_the_methods_and_links_to_the_files(scan, tmp_path):
    run("detect", scan, "-o", tmp_path / "edges.ply", "--report", tmp_path / "report")
    page = (tmp_path / "report" / "report.html").read_text()
    assert "Both methods" in page
    assert 'href="../edges.ply"' in page
    assert f'href="{os.path.relpath(scan, tmp_path / "report")}"' in page


def test_a_report_of_what_the_paper_cannot_look_at_has_nothing_to_compare(tmp_path):
    y, z = np.meshgrid(np.arange(30.0), np.arange(20.0))
    io.write(tmp_path / "wall.ply", edgel.Cloud(np.c_[0 * y.ravel(), y.ravel(), z.ravel()]))
    assert run("detect", tmp_path / "wall.ply", "--report", tmp_path / "report").exit_code == 0
    page = (tmp_path / "report" / "report.html").read_text()
    assert "of kind boundary" in page
    assert "Both methods" not in page


def test_a_cloud_that_is_all_edges_is_remarked(scan):
    assert "too sparse" in run("detect", scan, *PAPER).stderr


def test_every_argument_of_the_detectors_is_an_option_and_its_default_is_shown():
    names = set(inspect.signature(detect).parameters)
    assert arguments("auto") | arguments("paper") <= names | {"edge_map"}  # an image of one's own: in Python alone
    page = RUNNER.invoke(app, ["detect", "--help"]).stdout
    for option, default in (
        ("--sigma", "1.4"),
        ("--kernel-size", "5"),
        ("--num-neighbors", "16"),
        ("--method", "auto"),
    ):
        text = " ".join(page.replace("\N{BOX DRAWINGS LIGHT VERTICAL}", " ").split())
        said = text.split(f" {option} ")[1:]  # examples and other options may name it too
        assert any(part[part.find("[default:") :].startswith(f"[default: {default}]") for part in said)


def test_normals_of_every_point(scan, tmp_path):
    assert run("normals", scan, "-o", tmp_path / "normals.pcd", "--viewpoint", 2, 2, -50).exit_code == 0
    cloud = io.read(tmp_path / "normals.pcd")
    expected = edgel.estimate_normals(io.read(scan), viewpoint=(2, 2, -50))
    assert np.allclose(cloud.attributes["nz"], expected.normals[:, 2], atol=1e-6)
    assert np.allclose(cloud.attributes["variation"], expected.variation, atol=1e-6)
    assert len(cloud.attributes["label"]) == 2500


def test_normals_says_which_points_have_none(tmp_path):
    points = step()
    points[7] = np.nan
    io.write(tmp_path / "holes.ply", edgel.Cloud(points))
    result = run("normals", tmp_path / "holes.ply", "-o", tmp_path / "normals.ply")
    assert "not finite" in result.stderr
    assert np.isnan(io.read(tmp_path / "normals.ply").attributes["nx"]).sum() == 1


def test_info_json(tmp_path):
    points = np.r_[step(), step()[:10], [[np.nan, 0, 0]]]
    cloud = edgel.Cloud(
        points, {"heat": np.r_[np.full(2510, 2.5), np.inf]}, viewpoint=np.array([1.0, 2, 3]), crs="EPSG:1"
    )
    io.write(tmp_path / "a.npz", cloud)
    found = json.loads(run("info", tmp_path / "a.npz", "--json").stdout)
    assert found["points"] == 2511
    assert found["not_finite"] == 1
    assert found["duplicates"] == 20
    assert found["spacing"] == pytest.approx(0.1)
    assert found["lower"] == [0, 0, 0]
    assert found["extent"] == pytest.approx([4.9, 4.9, 2])
    assert found["organized"] is None
    assert found["viewpoint"] == [1, 2, 3]
    assert found["crs"] == "EPSG:1"
    assert found["fields"] == [
        {"name": "heat", "dtype": "float64", "columns": 1, "min": 2.5, "max": 2.5, "not_finite": 1}
    ]


def test_info_for_people(tmp_path):
    cloud = edgel.Cloud(step().reshape(50, 50, 3), {"label": np.arange(2500)})
    io.write(tmp_path / "a[b].ply", cloud)
    page = run("info", tmp_path / "a[b].ply").stdout
    for words in ("a[b].ply", "2,500", "50 x 50", "spacing", "label", "2499"):
        assert words in page


@pytest.mark.parametrize("name", ["one.xyz", "two.xyz", "same.xyz", "line.xyz", "nan.xyz"])
def test_info_describes_what_cannot_be_processed(bad, name):
    result = run("info", bad(name), "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout)["points"] > 0


@pytest.mark.parametrize("extension", [".ply", ".pcd", ".npz", ".npy", ".csv", ".las"])
def test_convert_keeps_the_points_and_their_attributes(scan, tmp_path, extension):
    result = run("convert", scan, tmp_path / f"copy{extension}")
    assert result.exit_code == 0
    copy = io.read(tmp_path / f"copy{extension}")
    assert np.allclose(copy.xyz, io.read(scan).xyz, atol=1e-6)
    assert np.array_equal(copy.attributes["label"], np.arange(2500))


def test_convert_says_what_is_lost(tmp_path):
    cloud = edgel.Cloud(step().reshape(50, 50, 3), viewpoint=np.zeros(3))
    io.write(tmp_path / "a.ply", cloud)
    result = run("convert", tmp_path / "a.ply", tmp_path / "a.xyz")
    assert result.exit_code == 0
    assert "organized rows and columns, viewpoint: left out" in result.stderr
    assert "left out" not in run("convert", tmp_path / "a.ply", tmp_path / "a.xyz", "--no-check").stderr


def test_differences_of_a_copy():
    cloud = edgel.Cloud(step(), {"a": np.arange(2500), "b": np.zeros((2500, 2))})
    copy = edgel.Cloud(step() + 0.25, {"a": np.arange(2500) + 1, "b_0": np.zeros(2500), "b_1": np.zeros(2500)})
    assert differences(cloud, copy) == {
        "coordinates": "rounded, by 0.25 at most",
        "a": "values changed",
        "b": "split into b_0 to b_1",
    }
    assert differences(cloud, copy.take(np.arange(7))) == {"points": "7 of 2,500"}
    assert differences(cloud, cloud) == {}


@pytest.mark.parametrize("command", ["detect", "normals", "convert"])
def test_the_output_may_be_the_input(tmp_path, command):
    path = tmp_path / "a.ply"
    io.write(path, edgel.Cloud(step()))
    words = {"detect": ["-o", path, "--all", *PAPER], "normals": ["-o", path], "convert": [path]}[command]
    assert run(command, path, *words).exit_code == 0
    assert len(io.read(path)) == 2500
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.ply"]


def test_pipes(scan):
    found = program("detect", "-", "-o", "-", *PAPER, stdin=scan.read_bytes())
    assert found.returncode == 0, found.stderr
    edges = io.read(BytesIO(found.stdout))
    assert len(edges) == len(edgel.paper.detect(io.read(scan)))
    assert json.loads(program("info", "-", "--json", stdin=found.stdout).stdout)["points"] == len(edges)
    # By now the kernels lie on the disk, and nothing is compiled.
    assert program("info", "-", stdin=found.stdout).stderr == b""


def test_a_pipe_that_closes_early_is_told_without_a_traceback(tmp_path):
    io.write(tmp_path / "a.npy", edgel.Cloud(np.random.default_rng(0).random((500_000, 3))))
    command = [sys.executable, "-m", "edgel", "convert", "a.npy", "-"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.read(10)
        process.stdout.close()
        message = process.stderr.read().decode()
    assert process.returncode == 5
    assert message.startswith("edgel: stdout: ")
    assert len(message.splitlines()) == 1


def test_words_in_a_pipe(bad):
    result = program("info", "-", stdin=b"once upon a time")
    assert result.returncode == 3
    assert result.stderr.decode().startswith("edgel: ")
    assert len(result.stderr.splitlines()) == 1
    assert program("normals", "-", "-o", "-", stdin=b"").returncode == 3


def test_the_program_itself_ends_with_the_code(scan, tmp_path):
    result = program("detect", "missing.ply", cwd=tmp_path)
    assert (result.returncode, result.stdout) == (3, b"")
    assert result.stderr == b"edgel: missing.ply: no such file; check the name and the folder\n"


@pytest.mark.parametrize("name", UNREADABLE)
def test_input_that_cannot_be_read(bad, tmp_path, name):
    path, out = bad(name), tmp_path / "out.ply"
    for words in (["detect", path, "-o", out], ["normals", path, "-o", out], ["info", path], ["convert", path, out]):
        result = run(*words)
        assert result.exit_code == 3
        assert str(path) in result.stderr
        assert len(result.stderr.splitlines()) == 1
        assert not out.exists()


@pytest.mark.parametrize("method", ["auto", "paper"])
@pytest.mark.parametrize("name", ["one.xyz", "two.xyz", "same.xyz", "line.xyz", "nan.xyz"])
def test_data_that_cannot_be_processed(bad, tmp_path, name, method):
    result = run("detect", bad(name), "-o", tmp_path / "out.ply", "--method", method)
    assert result.exit_code == 4
    assert name in result.stderr
    assert not (tmp_path / "out.ply").exists()


def test_folders_are_no_clouds(tmp_path, scan):
    result = run("info", tmp_path)
    assert (result.exit_code, "is a folder without clouds" in result.stderr) == (3, True)
    (tmp_path / "a.ply").mkdir()
    assert run("convert", scan, tmp_path / "a.ply" / "b" / "c.ply").exit_code == 5


@pytest.mark.parametrize("name", ["out.foo", "out", "out.png"])
def test_an_unknown_extension_is_told_before_the_work(bad, tmp_path, name):
    # The input is bad too: what is wrong with the command is said first.
    for words in (
        ["detect", bad("empty.ply"), "-o"],
        ["normals", bad("empty.ply"), "-o"],
        ["convert", bad("empty.ply")],
    ):
        result = run(*words, tmp_path / name)
        assert result.exit_code == 2
        assert ".ply .pcd" in result.stderr


def test_output_that_cannot_be_written(scan, tmp_path):
    for folder in (tmp_path / "none", scan, "/proc"):
        for words in (["detect", scan, "-o"], ["normals", scan, "-o"], ["convert", scan]):
            result = run(*words, os.path.join(folder, "out.ply"))
            assert result.exit_code == 5
            assert str(folder) in result.stderr


def test_output_that_a_format_cannot_hold(tmp_path):
    points = step()
    points[3] = np.nan
    io.write(tmp_path / "a.ply", edgel.Cloud(points))
    result = run("convert", tmp_path / "a.ply", tmp_path / "a.las")
    assert result.exit_code == 5
    assert "a.las" in result.stderr


@pytest.mark.parametrize(
    "words",
    [
        ["--sigma", "2"],
        ["--low", "1", "--high", "2"],
        [*PAPER, "--viewpoint", "0", "0", "1"],
        ["--method", "other"],
        ["--all"],
        ["--json", "-o", "-"],
        ["--num-neighbors", "2"],
        [*PAPER, "--sigma", "-1"],
        [*PAPER, "--kernel-size", "4"],
        [*PAPER, "--high", "1"],
        ["--num-neighbors", "many"],
        ["--scale", "0.5"],
        [*PAPER, "--min-angle", "30"],
        ["--min-angle", "-1"],
        ["--crop", "1", "0", "0", "0", "1", "1"],
        ["--crop", "0", "0", "0", "1", "1", "nan"],
        ["--unknown"],
        ["-", "--intrinsics", "a.json"],
    ],
)
def test_wrong_usage(scan, words):
    result = run("detect", *([] if words[0] == "-" else [scan]), *words)
    assert result.exit_code == 2
    assert words[0] in result.stderr or words[-2] in result.stderr


def test_demo(tmp_path):
    result = run("demo", "-o", tmp_path / "new" / "demo", "--num-points", 3000)
    assert result.exit_code == 0
    for words in ("Table 1", "Table 2", "647,984", "60,015", "53.03", "4.37", "9.3", "tee: ", "elbow: "):
        assert words in result.stdout
    assert f"{tmp_path / 'new' / 'demo' / 'report.html'}: the report" in result.stdout
    assert (tmp_path / "new" / "demo" / "report.html").exists()
    assert run("demo", "-o", tmp_path / "demo", "--num-points", 3).exit_code == 2
    (tmp_path / "file").touch()
    assert run("demo", "-o", tmp_path / "file").exit_code == 5


def test_no_command_shows_help():
    assert "detect" in run().output
    assert "Exit codes of every command" in run("--help").stdout
    assert run("--version").stdout == f"edgel {edgel.__version__}\n"
    for command in ("detect", "normals", "info", "convert", "render", "demo"):
        page = run(command, "--help").stdout
        assert f"edgel {command}" in page
        assert "Examples:" in page
        assert "Exit codes" not in page  # they are said once
        assert "preset" not in page


def test_python_runs_the_package():
    result = program("--version")
    assert (result.returncode, result.stdout.decode().split()) == (0, ["edgel", edgel.__version__])


def test_help_names_every_method():
    for command in ("detect", "render"):
        page = run(command, "--help").stdout
        assert all(name in page for name in METHODS)


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (KeyboardInterrupt(), 130),
        (MemoryError(), 3),
        (RuntimeError("odd"), 1),
        (PermissionError(13, "Permission denied"), 3),
    ],
)
def test_what_may_happen_while_reading(scan, monkeypatch, error, code):
    def read(*_, **__):
        raise error

    monkeypatch.setattr(io, "read", read)
    result = run("info", scan, "--json")
    assert result.exit_code == code
    assert json.loads(result.stdout)["code"] == code
    assert json.loads(result.stdout)["error"] in result.stderr.replace("\n", "")


def test_debug_shows_the_traceback(bad):
    result = RUNNER.invoke(app, ["info", str(bad("words.xyz")), "--debug"])
    assert result.exit_code == 3
    assert "Traceback" in result.stderr


def test_depth_images_need_their_camera(tmp_path):
    np.save(tmp_path / "depth.npy", np.full((30, 40), 2.0))
    assert run("info", tmp_path / "depth.npy").exit_code == 3
    (tmp_path / "camera.json").write_text('{"fx": 30, "fy": 30, "cx": 20, "cy": 15}')
    camera = ("--intrinsics", tmp_path / "camera.json")
    found = json.loads(run("info", tmp_path / "depth.npy", "--json", *camera).stdout)
    assert found["organized"] == [30, 40]
    assert run("info", tmp_path / "depth.npy", "--intrinsics", tmp_path / "none.json").exit_code == 3


def test_intrinsics_of_what_is_no_depth_image(scan, tmp_path):
    (tmp_path / "camera.json").write_text('{"fx": 30, "fy": 30, "cx": 20, "cy": 15}')
    result = run("info", scan, "--intrinsics", tmp_path / "camera.json")
    assert result.exit_code == 2
    assert "--intrinsics" in result.stderr


def test_kernels_that_are_compiled_are_told(capsys):
    with Watch() as watch:
        watch("adding")
        numba.njit(lambda x: x + 1)(1)
    assert capsys.readouterr().err.startswith(COMPILING)
    with Watch():
        pass
    assert capsys.readouterr().err == ""


def test_json_has_no_nan(capsys):
    print_json({"a": np.float32(np.nan), "b": np.array([1, 2]), "c": (np.inf, None, True), "d": {"e": np.uint8(3)}})
    assert json.loads(capsys.readouterr().out) == {"a": None, "b": [1, 2], "c": [None, None, True], "d": {"e": 3}}
