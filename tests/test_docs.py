"""The documentation holds: every block of Python and every command of README.md and docs/ runs, page by page.

The blocks of a page run in their order, in one namespace and one folder, in which lie the files that a page takes for
granted: a scan in several formats, a depth image, tiles. What cannot run here is named below, with where it does run.
"""

import glob
import json
import re
import shlex
import shutil
import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import edgel
from edgel._cli import app

ROOT = Path(__file__).parents[1]
PARTS = {ROOT / "docs/benchmarks/pictures.md"}  # of a page that a program writes
PAGES = [path for path in sorted((ROOT / "docs").rglob("*.md")) if path not in PARTS]
PAGES += [path for path in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "SECURITY.md") if path.is_file()]
ELSEWHERE = {
    "pip install": "make release-check installs the wheel",
    "python3 -m venv": "make release-check",
    ". .venv/bin/activate": "make release-check",
    ".venv/bin/": "make release-check, .ci/run",
    "make ": ".ci/run, make release-check",
    "git ": "it changes the checkout, or needs the network",
    "dask ": "a cluster; tests/tiled",
    "edgel warmup": "it compiles everything; tests/kernels",
    "edgel demo": "tests/demo, make release-check",
    "edgel view": "waits for a browser; tests/viewer",
}
NEEDS = r"(?:^<!-- needs: (?P<needs>\w+) -->\n)?"
BLOCK = re.compile(NEEDS + r"^```(?P<kind>python|console)\n(?P<text>.*?)^```$", re.M | re.S)


def blocks(page):
    """What a page shows to run: (kind, text, module that it needs)."""
    text = page.read_text()
    found = [(m.start(), m["kind"], m["text"], m["needs"]) for m in BLOCK.finditer(text)]
    indented = re.finditer(r"^    (edgel (?!COMMAND).*)$", BLOCK.sub(lambda m: " " * len(m[0]), text), re.M)
    found += [(m.start(), "console", m[1], None) for m in indented]
    return [block[1:] for block in sorted(found, key=lambda block: block[0])]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The files that pages take for granted."""
    folder = tmp_path_factory.mktemp("pages")
    x, y = (values.ravel() for values in np.meshgrid(np.arange(40.0), np.arange(40.0)))
    colors = {name: np.full(1600, 99, np.uint16) for name in ("red", "green", "blue")}
    labels = np.where(x + y < 50, 6, 2).astype(np.uint8)
    returns = np.ones(1600, np.uint8)
    place = np.c_[x, y, 15 - abs(x - 18)] + [637000, 849000, 0]
    scan = edgel.Cloud(
        place, {"classification": labels, "intensity": np.ones(1600, np.uint16), "return_number": returns, **colors}
    )
    names = ["scan.ply", "scan.laz", "scan.las", "scan.pcd", "scans/a.ply", "scans/b.ply", "city/a.laz"]
    for name in names:
        (folder / name).parent.mkdir(exist_ok=True)
        edgel.write(folder / name, scan)
    edgel.write(folder / "city/b.laz", edgel.Cloud(scan.xyz + [40, 0, 0], scan.attributes))
    (folder / "demo").mkdir()
    edgel.write(folder / "demo/tee.ply", edgel.synth.scan(edgel.synth.tee(), num_points=20_000).cloud)
    if find_spec("rosbags"):
        record_clouds(folder / "drive.mcap", scan.xyz - [637000, 849000, 0])
    depth = np.full((60, 80), 2000, np.uint16)
    depth[20:40, 20:40] = 1500
    Image.fromarray(depth).save(folder / "depth.png")
    (folder / "camera.json").write_text(json.dumps({"fx": 80, "fy": 80, "ppx": 39.5, "ppy": 29.5}))
    return folder


@pytest.fixture
def folder(files, tmp_path, monkeypatch):
    shutil.copytree(files, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")


def record_clouds(path, xyz):
    """Record two PointCloud2 on the topic /points."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types: Any = store.types
    name = "sensor_msgs/msg/PointCloud2"
    stamp = types["builtin_interfaces/msg/Time"](sec=1, nanosec=0)
    fields = [types["sensor_msgs/msg/PointField"](axis, 4 * i, 7, 1) for i, axis in enumerate("xyz")]
    data = xyz.astype(np.float32).view(np.uint8).ravel()
    header = types["std_msgs/msg/Header"](stamp, "sensor")
    message = types[name](header, 1, len(xyz), fields, False, 12, 12 * len(xyz), data, True)
    with Writer(path.with_suffix(""), version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/points", name, typestore=store)
        for number in range(2):
            writer.write(topic, number + 1, store.serialize_cdr(message, name))
    next(path.with_suffix("").glob("*.mcap")).rename(path)


def run_command(line):
    """Run a command of edgel as a shell would; others have to be among those that run elsewhere."""
    line = re.sub(r"\s+#.*", "", line).strip()
    if not line or line.startswith(tuple(ELSEWHERE)) or "--scheduler" in line:  # one is needed; tests/tiled have it
        return
    assert line.startswith("edgel "), f"nobody runs this: {line}"
    words = shlex.split(line)[1:]
    words = [name for word in words for name in (sorted(glob.glob(word)) or [word])]
    if "--workers" in words:  # each would load the kernels anew; tests/cli has them
        words[words.index("--workers") + 1] = "1"
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, f"{line}\n{result.output}"


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("page", [*filter(blocks, PAGES)], ids=lambda page: str(page.relative_to(ROOT)))
def test_every_block_runs(page):
    names = {"__name__": "__main__"}
    for kind, text, needs in blocks(page):
        if needs and not find_spec(needs):
            continue
        if kind == "console":
            for line in text.splitlines():
                run_command(line)
        else:
            with warnings.catch_warnings():
                if needs:  # other people's
                    warnings.simplefilter("ignore")
                exec(compile(text, str(page), "exec"), names)


@pytest.mark.skipif(not (ROOT / "mkdocs.yml").is_file(), reason="the source distribution has no docs")
def test_python_blocks_name_what_they_need():
    """Nothing hides from the runner: no fence is in another spelling of Python or of a shell."""
    for page in PAGES:
        kinds = re.findall(r"^ *```(\w+)", page.read_text(), re.M)
        assert set(kinds) <= {"python", "console", "text", "yaml", "toml"}, page


def anchors(page):
    """The anchors of a page's headings, as the site names them, and those it sets itself."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S)
    heads = [re.sub(r"\{.*\}|`", "", head).strip() for head in re.findall(r"^#+ (.+)$", text, re.M)]
    slugs = {re.sub(r"[\s-]+", "-", re.sub(r"[^\w\s-]", "", head.lower())).strip("-") for head in heads}
    own = set(re.findall(r"\{ #([\w-]+) \}", text))
    return slugs | own | set(re.findall(r"^::: ([\w.]+)$", text, re.M))


@pytest.mark.skipif(not (ROOT / "mkdocs.yml").is_file(), reason="the source distribution has no docs")
def test_links_lead_somewhere():
    """What make docs checks too, and what it does not see: links from the README and out of docs/."""
    for page in PAGES:
        text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.M | re.S)
        for target in re.findall(r"\]\(([^)\s]+)\)", text):
            if re.match(r"https?:", target):
                continue
            file, _, anchor = target.partition("#")
            there = (page.parent / file).resolve() if file else page
            assert there.is_file(), f"{page}: {target}"
            assert not anchor or anchor in anchors(there), f"{page}: {target}"


@pytest.mark.skipif(not (ROOT / "mkdocs.yml").is_file(), reason="the source distribution has no docs")
def test_every_page_is_in_the_menu():
    menu = (ROOT / "mkdocs.yml").read_text()
    for page in PAGES:
        if page.is_relative_to(ROOT / "docs"):
            name = page.relative_to(ROOT / "docs").as_posix()
            assert f": {name}\n" in menu or f"/{name}\n" in menu, name
