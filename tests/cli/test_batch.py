"""Several inputs and folders: each a cloud of its own, with a name of its own, and no failure stops another."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import edgel
from edgel import io
from edgel._cli import app
from edgel._cli.errors import Failure
from edgel._cli.files import Reading
from edgel._cli.jobs import expand, output_names, plan
from edgel._cli.outcome import Failed, Told
from edgel._cli.progress import Watch
from edgel._cli.workers import side_by_side


def run(*words):
    result = CliRunner(env={"COLUMNS": "200"}).invoke(app, [str(word) for word in words])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    assert "Traceback" not in result.output
    return result


def roof(side=20, **attributes):
    x, y = (values.ravel() for values in np.meshgrid(np.arange(float(side)), np.arange(float(side))))
    return edgel.Cloud(np.c_[x, y, -abs(x - side // 2)], {"row": np.arange(side**2), **attributes})


@pytest.fixture
def scans(tmp_path, monkeypatch):
    """A folder with three clouds, a hidden one, and a text that is none, beside where the program runs."""
    folder = tmp_path / "scans"
    folder.mkdir()
    for name in ("a.ply", "b.las", "c.npz", ".hidden.ply"):
        io.write(folder / name, roof())
    (folder / "readme.md").write_text("three clouds")
    (folder / "LICENSE_of_all.txt").write_text("do as you like")
    monkeypatch.chdir(tmp_path)
    return folder


def written(folder):
    return sorted(path.relative_to(folder).as_posix() for path in Path(folder).rglob("*") if path.is_file())


COMMANDS = {
    "detect": (["-o", "out/"], ["a.ply", "b.las", "c.npz"]),
    "normals": (["-o", "out/"], ["a.ply", "b.las", "c.npz"]),
    "convert": (["out/"], ["a.ply", "b.las", "c.npz"]),
    "render": (["-o", "out/", "--size", "320x240"], ["a.png", "b.png", "c.png"]),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_folder_and_its_files_one_by_one_give_the_same(scans, command):
    words, names = COMMANDS[command]
    result = run(command, "scans", *words)
    assert result.exit_code == 0, result.stderr
    assert written("out") == names
    assert len(result.stderr.splitlines()) == 3
    for name in ("a.ply", "b.las", "c.npz"):
        alone = [word.replace("out/", "alone/") for word in words]
        assert run(command, scans / name, *alone).exit_code == 0
    assert written("alone") == names
    for name in names:
        if not name.endswith("z"):  # archives hold the time
            assert Path("out", name).read_bytes() == Path("alone", name).read_bytes()


def test_what_fails_is_named_at_the_end_and_the_others_are_done(scans):
    Path("scans/bad.ply").write_bytes(b"no ply at all")
    io.write("scans/line.xyz", edgel.Cloud(np.c_[np.arange(9.0), np.zeros((9, 2))]))
    result = run("detect", "scans", "missing.ply", "-o", "out")
    assert result.exit_code == 3  # of the first that failed
    assert written("out") == ["a.ply", "b.las", "c.npz"]
    *each, head, first, second, third = result.stderr.splitlines()
    assert head == "edgel: 3 of 6 inputs failed, the others are done:"
    assert [line.split(":")[0] for line in each] == [
        *(f"scans/{name}" for name in ("a.ply", "b.las", "bad.ply", "c.npz", "line.xyz")), "missing.ply"
    ]  # fmt: skip
    assert first.startswith("  scans/bad.ply: not a PLY")
    assert second.startswith("  scans/line.xyz: ")
    assert third == "  missing.ply: no such file; check the name and the folder"
    assert run("detect", "scans/line.xyz", "missing.ply").exit_code == 4
    assert "2 of 2 inputs failed:" in run("detect", "scans/line.xyz", "missing.ply").stderr


def test_nothing_in_a_folder_is_replaced_unless_told(scans):
    Path("out").mkdir()
    Path("out/b.las").write_bytes(b"mine")
    result = run("normals", "scans", "-o", "out")
    assert result.exit_code == 5
    assert "out/b.las: is there already; choose another name, or add --clobber" in result.stderr.splitlines()[-1]
    assert Path("out/b.las").read_bytes() == b"mine"
    assert written("out") == ["a.ply", "b.las", "c.npz"]
    assert run("normals", "scans/b.las", "-o", "out").exit_code == 5
    assert run("normals", "scans/b.las", "-o", "out", "--clobber").exit_code == 0
    assert len(io.read("out/b.las")) == 400
    assert run("normals", "scans/b.las", "-o", "out/b.las").exit_code == 0  # named, so meant
    assert run("normals", "scans/b.las", "-o", "out/b.las", "--no-clobber").exit_code == 5


def test_clouds_of_one_name_do_not_collide(scans):
    for day in ("monday", "tuesday"):
        Path(day).mkdir()
        io.write(f"{day}/tile.ply", roof(20 if day == "monday" else 22))
    io.write("tuesday/tile.xyz", roof(24))
    assert run("convert", "monday/tile.ply", "tuesday/tile.ply", "out/").exit_code == 0
    assert {name: len(io.read(Path("out", name))) for name in written("out")} == {
        "monday/tile.ply": 400, "tuesday/tile.ply": 484
    }  # fmt: skip
    assert run("convert", "tuesday", "all/", "--format", "npz").exit_code == 0
    assert {name: len(io.read(Path("all", name))) for name in written("all")} == {
        "tile.ply.npz": 484, "tile.xyz.npz": 576
    }  # fmt: skip
    jobs = plan(["monday/tile.ply", "tuesday/tile.xyz"], Reading(), report="report")
    assert [Path(str(job.report)).as_posix() for job in jobs] == ["report/monday/tile", "report/tuesday/tile"]
    assert plan(["monday/tile.ply"], Reading(), report="report")[0].report == "report"


@pytest.mark.parametrize(
    ("sources", "names"),
    [
        (["a/x.PLY"], ["x.PLY"]),
        (["a/x.ply", "b/y.e57"], ["x.ply", "y.ply"]),
        (["a/x.ply", "b/x.ply"], ["a/x.ply", "b/x.ply"]),
        (["a/b/x.ply", "a/c/x.ply", "a/y.ply"], ["b/x.ply", "c/x.ply", "y.ply"]),
        (["x.las", "x.e57", "y.e57"], ["x.las.ply", "x.e57.ply", "y.e57.ply"]),
        (["a/X.ply", "b/x.ply"], ["a/X.ply", "b/x.ply"]),
        (["../x.ply", "x.ply"], None),
        (["-"], ["stdin.ply"]),
    ],
)
def test_names(sources, names, tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    found = [name.as_posix() for name in output_names(sources, [".ply"] * len(sources))]
    assert found == (names or ["x.ply", "here/x.ply"])


def test_names_that_cannot_be_told_apart_are_refused():
    with pytest.raises(Failure, match=r"a/x\.ply and a/X\.ply: both would be written to X\.ply"):
        output_names(["a/x.ply", "a/X.ply"], [".ply"] * 2)


def test_an_input_is_never_another_inputs_output(scans):
    Path("out").mkdir()
    Path("out/a.ply").symlink_to(scans / "b.las")
    before = Path("scans/b.las").read_bytes()
    result = run("convert", "scans/a.ply", "scans/b.las", "out/", "--clobber")
    assert (result.exit_code, "out/a.ply: is the input scans/b.las itself" in result.stderr) == (2, True)
    assert Path("scans/b.las").read_bytes() == before
    assert written("out") == ["a.ply"]


def test_folders(scans):
    reading = Reading()
    assert [Path(name).name for name in expand(["scans"], reading)] == ["a.ply", "b.las", "c.npz"]
    assert expand(["scans/b.las", "scans", "./scans/a.ply"], reading) == ["scans/b.las", "scans/a.ply", "scans/c.npz"]
    with pytest.raises(Failure, match="is a folder without clouds; name files, or another folder"):
        expand(["."], reading)


def test_a_folder_of_depth_images_needs_their_camera(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    os.mkdir("frames")
    for name in ("1.png", "2.png"):
        Image.fromarray(np.full((30, 40), 2000, np.uint16)).save(f"frames/{name}")
    Path("camera.json").write_text('{"fx": 30, "fy": 30, "cx": 20, "cy": 15}')
    result = run("info", "frames")
    assert (result.exit_code, "give the camera of its depth images with --intrinsics" in result.stderr) == (3, True)
    assert run("convert", "frames", "clouds", "--intrinsics", "camera.json").exit_code == 0
    assert written("clouds") == ["1.ply", "2.ply"]
    assert io.read("clouds/1.ply").shape == (30, 40)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["convert", "scans", "out.ply"], "out.ply: takes one cloud, and there are several; name a folder"),
        (["convert", "scans", "-"], "stdout: takes one cloud, and there are several"),
        (["convert", "scans", "notes"], "notes: takes one cloud, and there are several"),
        (["convert", "scans/a.ply", "-", "out/"], "-: stdin carries one cloud"),
        (["convert", "scans/a.ply", "b.npz", "--format", "npz"], "--format: is for outputs in a folder"),
        (["convert", "scans", "out", "--format", "doc"], "--format: 'doc' is no format that edgel writes; known: ply"),
        (["detect", "scans", "--workers", "0"], "--workers: expected 1 or more"),
        (["detect", "scans", "-o", "scans"], "add --all"),
    ],
)
def test_wrong_words_change_nothing(scans, words, message):
    Path("notes").write_text("mine")
    result = run(*words)
    assert result.exit_code == 2
    assert message in result.stderr
    assert sorted(os.listdir()) == ["notes", "scans"]
    assert written("scans") == [".hidden.ply", "LICENSE_of_all.txt", "a.ply", "b.las", "c.npz", "readme.md"]


def test_an_output_without_extension_is_a_folder_with_a_slash(scans):
    result = run("convert", "scans/a.ply", "out")
    assert (result.exit_code, "write out/ for a folder" in result.stderr) == (2, True)
    assert run("convert", "scans/a.ply", "out/").exit_code == 0
    assert written("out") == ["a.ply"]


def test_an_output_that_cannot_be_a_folder(scans):
    result = run("normals", "scans", "-o", "scans/readme.md/deep")
    assert result.exit_code == 5
    assert "readme.md" in result.stderr


def test_json_has_a_line_for_each_input_and_no_other(scans):
    Path("scans/bad.ply").write_bytes(b"no ply at all")
    lines = run("info", "scans", "--json").stdout.splitlines()
    told = [json.loads(line) for line in lines]
    assert [entry["schema"] for entry in told] == ["edgel.info", "edgel.info", "edgel.error", "edgel.info"]
    assert {entry["schema_version"] for entry in told} == {1}
    assert [Path(entry["input"]).name for entry in told] == ["a.ply", "b.las", "bad.ply", "c.npz"]
    assert told[2]["code"] == 3
    alone = run("info", "scans/a.ply", "--json").stdout
    assert alone.splitlines() == [lines[0]]


@pytest.mark.parametrize(("command", "words"), [(name, words) for name, (words, _) in COMMANDS.items()])
def test_quiet_says_errors_only(scans, command, words):
    result = run(command, "scans", *words, "--quiet")
    assert (result.exit_code, result.output) == (0, "")
    result = run(command, "missing.ply", *words, "-q")
    assert result.stderr.startswith("edgel: missing.ply: no such file")


def program(*words, **options):
    command = [sys.executable, "-m", "edgel", *map(str, words)]
    return subprocess.run(command, capture_output=True, timeout=300, check=False, text=True, **options)


def test_workers_give_the_same_in_the_same_order(scans):
    Path("scans/bad.ply").write_bytes(b"no ply at all")
    alone = run("convert", "scans", "one/", "--json")
    several = program("convert", "scans", "two/", "--json", "--workers", 2)
    assert alone.exit_code == several.returncode == 3, several.stderr
    assert several.stderr == alone.stderr
    assert several.stdout == alone.stdout.replace("one/", "two/")
    assert written("one") == written("two") == ["a.ply", "b.las", "c.npz"]
    assert Path("one/a.ply").read_bytes() == Path("two/a.ply").read_bytes()


def die_at_b(job, progress):
    progress("dying")
    if job.source == "b":
        os._exit(7)
    return Told({"input": job.source})


def test_a_worker_that_dies_stops_no_other(tmp_path):
    jobs = plan(["a", "b", "c", "d"], Reading())
    results = list(side_by_side(jobs, die_at_b, Watch(), 2))
    assert [job.source for job, _ in results] == ["a", "b", "c", "d"]
    assert [type(result) for _, result in results] == [Told, Failed, Told, Told]
    failed = results[1][1]
    assert isinstance(failed, Failed)
    assert "its process ended without a word (exit code 7)" in failed.message


@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_workers_end_with_the_program(tmp_path, number, code):
    for name in "abcd":
        io.write(tmp_path / f"{name}.npy", edgel.Cloud(np.random.default_rng(0).random((200_000, 3))))
    command = [sys.executable, "-m", "edgel", "convert", "a.npy", "b.npy", "c.npy", "d.npy", "out/"]
    command += ["--format", "xyz", "--workers", "2"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, start_new_session=True) as process:
        while not list(tmp_path.glob("out/.*.tmp")):
            assert process.poll() is None
            time.sleep(0.005)
        process.send_signal(number)
        _, words = process.communicate(timeout=60)  # until no process has stderr open any more
    assert process.returncode == code
    assert b"Traceback" not in words
    assert not list(tmp_path.glob("out/.*"))
    assert len(written(tmp_path / "out")) < 4
