"""Help at 80 columns: nothing is cut, options stand in groups, and what it shows to type can be pasted and works."""

import glob
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import edgel
from edgel import io
from edgel._cli import app

COMMANDS = ("detect", "view", "normals", "info", "convert", "render", "lines", "match", "demo", "warmup")
ROOT = Path(__file__).parents[2]
FACE = "facet normal 0 0 0\nouter loop\nvertex {}\nvertex {}\nvertex {}\nendloop\nendfacet\n"
CORNER = FACE.format("0 0 0", "1 0 0", "0 1 0") + FACE.format("0 0 0", "0 1 0", "0 0 1")


def run(*words, columns=80):
    result = CliRunner(env={"COLUMNS": str(columns), "TERMINAL_WIDTH": str(columns)}).invoke(app, list(words))
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def examples(page):
    """The lines that help shows to type."""
    return [line.strip() for line in page.splitlines() if re.match(r"\s{2,4}(edgel|cat) ", line)]


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_nothing_is_cut_at_80_columns(command):
    page = run(*filter(None, [command]), "--help").stdout
    assert max(map(len, page.splitlines())) <= 80
    assert "…" not in page
    assert "<bool>" not in page
    assert "list[str]" not in page
    wide = run(*filter(None, [command]), "--help", columns=200).stdout
    assert examples(page) == examples(wide) != []


@pytest.mark.parametrize("command", COMMANDS)
def test_options_stand_in_groups(command):
    page = run(command, "--help").stdout
    panels = re.findall(r"^╭─ ([^─]+) ─", page, re.MULTILINE)
    assert "Options" not in panels
    assert panels[-1] == "Messages"
    assert len(panels) == len(set(panels))


def test_every_default_is_whole():
    page = " ".join(run("detect", "--help").stdout.replace("│", " ").split())
    assert "[default: boundary, occluding, occluded, crease]" in page
    assert "[default: what the file says, else from above]" in page


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What the examples name: a scan in many formats, a depth image with its camera."""
    folder = tmp_path_factory.mktemp("examples")
    x, y = (values.ravel() for values in np.meshgrid(np.arange(30.0), np.arange(30.0)))
    colors = {name: np.full(900, 99, np.uint16) for name in ("red", "green", "blue")}
    labels = np.where(x + y < 40, 6, 2).astype(np.uint8)
    xyz = np.c_[x, y, 10 - abs(x - 12)] + [637000, 849000, 0]
    scan = edgel.Cloud(xyz, {"classification": labels, **colors})
    for name in ("scan.ply", "scan.las", "scan.laz", "scan.pcd", "other.laz"):
        io.write(folder / name, scan)
    Image.fromarray(np.tile(np.arange(1000, 1060, dtype=np.uint16), (40, 1))).save(folder / "depth.png")
    (folder / "scan.txt").write_text("".join(f"{i} {px} {py} {pz} 7\n" for i, (px, py, pz) in enumerate(xyz)))
    (folder / "part.stl").write_text(f"solid\n{CORNER}endsolid\n")
    (folder / "camera.json").write_text(json.dumps({"fx": 60, "fy": 60, "cx": 30, "cy": 20, "depth_scale": 0.001}))
    return folder


SHOWN = [line for command in COMMANDS for line in examples(run(command, "--help").stdout)]
if (ROOT / "docs" / "command-line.md").is_file():
    SHOWN += re.findall(r"^\| `(edgel .+?)` \|", (ROOT / "docs" / "command-line.md").read_text(), re.MULTILINE)
# They wait for someone, take half a minute, want a scan of a part, or a result in tiles; each has tests of its own.
LONG = ("edgel view", "edgel demo", "edgel warmup", "edgel match", "edgel lines out/")
TRIED = [line for line in dict.fromkeys(SHOWN) if not line.startswith(LONG)]


@pytest.mark.parametrize("line", [line for line in TRIED if "|" not in line])
def test_every_example_works(folder, line, monkeypatch):
    if "e57" in line:
        pytest.importorskip("pye57", reason="the extra e57 is not installed")
        io.write(folder / "scan.e57", io.read(folder / "scan.ply"))
    if "--report" in line:
        pytest.skip("a report takes long; test_detect_report has it")
    if "--sample-mesh" in line:
        pytest.importorskip("trimesh", reason="the extra mesh is not installed")
        line = line.replace("200000", "2000")  # so many take a while
    monkeypatch.chdir(folder)
    before = set(os.listdir())
    words = [name for word in shlex.split(line)[1:] for name in (sorted(glob.glob(word)) or [word])]
    if "--workers" in words:
        words[words.index("--workers") + 1] = "1"
    result = run(*words)
    assert result.exit_code == 0, result.output
    for name in set(os.listdir()) - before:
        os.system(f"rm -r {shlex.quote(name)}")


@pytest.mark.skipif(os.name != "posix", reason="a shell")
@pytest.mark.parametrize("line", [line for line in TRIED if "|" in line])
def test_every_example_with_a_pipe_works(folder, line):
    line = re.sub(r"\bedgel (?=[a-z])", f"{shlex.quote(sys.executable)} -m edgel ", line)
    done = subprocess.run(["bash", "-o", "pipefail", "-c", line], cwd=folder, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    assert len(io.read(folder / line.split()[-1])) > 0


def test_all_that_json_says_is_documented(folder, monkeypatch):
    document = ROOT / "docs" / "command-line.md"
    if not document.is_file():
        pytest.skip("the source distribution has no docs")
    monkeypatch.chdir(folder)
    parts = re.split(r"^### `edgel\.(\w+)`", document.read_text(), flags=re.MULTILINE)
    told = dict(zip(parts[1::2], parts[2::2], strict=True))
    commands = {
        "detect": ["scan.ply"],
        "render": ["scan.ply", "-o", "j.png", "--size", "320x240"],
        "lines": ["scan.ply", "-o", "j.csv"],
        "normals": ["scan.ply", "-o", "j.ply"],
        "info": ["scan.ply"],
        "convert": ["scan.ply", "j.ply"],
        "error": ["none.ply"],
    }
    assert set(told) - {"match"} == set(commands)  # it has a test of its own
    for name, words in commands.items():
        result = run("info" if name == "error" else name, *words, "--json")
        facts = json.loads(result.stdout)
        assert facts.pop("schema") == f"edgel.{name}"
        assert facts.pop("schema_version") == 1
        documented = set(re.findall(r"^\| `(\w+)`", told[name], re.MULTILINE))
        assert documented == set(facts), name
