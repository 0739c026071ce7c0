"""Reports: complete, self-contained, and safe to open."""

import base64
import io
import re
from dataclasses import replace
from urllib.parse import unquote

import numpy as np
import pytest
from by_hand import edges_at
from html_page import Page
from PIL import Image

from edgel import Cloud, paper
from edgel._report import Case, Table, write_report


def test_the_page_holds_every_figure_in_both_lights_and_they_lie_beside_it(written):
    page = Page(written)
    numbers = range(1, 7)
    assert written.name == "report.html"
    assert len(page.images) == 2 * len(numbers)
    brightness = []
    for image in page.images:
        head, data = image.split(",", 1)
        assert head == "data:image/webp;base64"
        with Image.open(io.BytesIO(base64.b64decode(data, validate=True))) as opened:
            assert opened.width == 1600
            brightness.append(np.asarray(opened.convert("L"))[0, 0])
    assert set(brightness[::2]) == {23}  # the source for dark screens comes first
    assert set(brightness[1::2]) == {255}
    names = sorted(path.name for path in written.parent.iterdir())
    assert names == ["report.html", *(f"tee-figure-{number}.png" for number in numbers)]
    at = [page.shown.index(f"Figure {number}. tee:") for number in numbers]
    assert at == sorted(at)  # numbered as it reads
    assert page.shown.count("of the paper.") == 4


def test_links_lead_to_files_beside_the_page(written):
    links = Page(written).links
    targets = [(written.parent / unquote(link)).resolve() for link in links]
    assert all(target.is_file() for target in targets)
    assert {target.name for target in targets} >= {"a tee & more.ply", "tee-figure-1.png", "tee-figure-6.png"}


def test_a_page_stays_small(written):
    # Figures have the same number of pixels whatever the cloud: 2.0 MB of 650,000 points.
    assert written.stat().st_size < 4_000_000


def test_the_page_shows_every_number(written, tee):
    shown = Page(written).shown
    assert f"{len(tee.cloud):,}" in shown
    assert f"{len(tee.edges):,}" in shown
    assert f"{tee.edges.share:.1%}" in shown
    for stage, seconds in tee.edges.seconds.items():
        assert f"{stage} {seconds:.3f}" in shown
    for name, value in tee.edges.parameters.items():
        assert f"{name} {value:g}" in shown
    for what in ("processor", "Python", "numpy", "numba", "edgel"):
        assert what in shown
    assert np.__version__ in shown


def test_nothing_is_loaded_from_elsewhere(written):
    page = Page(written)
    assert page.loaded == []
    assert not re.search(r"https?://|url\(|@import|<script|<link", re.sub(r'"data:[^"]*"', "", page.source))


@pytest.mark.usefixtures("undrawn")
def test_names_are_escaped(tmp_path, tee):
    name = "<script>alert('x')</script> & \"more\""
    page = Page(write_report([replace(tee, name=name)], tmp_path, title=name, findings=[name]))
    assert "script" not in page.tags
    assert name in page.shown
    assert all(re.fullmatch(r"[\w.-]+", path.name) for path in tmp_path.iterdir())


def test_dark_mode_and_print_are_thought_of(written):
    source = Page(written).source
    style = source[source.index("<style>") : source.index("</style>")]
    assert "@media (prefers-color-scheme: dark)" in style
    assert "@media print" in style
    # What is printed from a dark screen is printed on white: its pictures too.
    assert set(re.findall(r'<source media="([^"]+)"', source)) == {"screen and (prefers-color-scheme: dark)"}


@pytest.mark.usefixtures("undrawn")
def test_cases_of_one_name_keep_their_figures_apart(tmp_path):
    cloud = Cloud(np.random.default_rng(0).random((50, 3)))
    case = Case("a/b", cloud, edges_at(cloud, [1, 2, 3]))
    write_report([case, case, replace(case, name="///")], tmp_path)
    figures_4 = sorted(path.name for path in tmp_path.glob("*figure-4.png"))
    assert figures_4 == ["a-b-2-figure-4.png", "a-b-figure-4.png", "cloud-figure-4.png"]


@pytest.mark.usefixtures("small")
def test_edges_of_the_default_method(tmp_path):
    x, y = np.meshgrid(np.arange(40.0), np.arange(30.0))
    roof = Cloud(np.column_stack([x.ravel(), y.ravel(), -np.abs(x.ravel() - 20)]))
    edges = edges_at(roof, roof.xyz[:, 0] == 20, normals=[[np.nan] * 3] + 29 * [[0.0, 0.0, 1.0]])
    page = Page(write_report([Case("roof", roof, edges)], tmp_path))
    assert len(page.images) == 2 * 3
    assert "of the paper" not in page.shown
    assert "Figure 4" not in page.shown
    assert "of kind crease 30 2.5%" in page.shown
    assert "1 edge points have no normal" in page.shown


@pytest.mark.usefixtures("small")
def test_ten_points(tmp_path):
    cloud = Cloud(np.random.default_rng(0).random((10, 3)))
    page = Page(write_report([Case("ten", cloud, edges_at(cloud, [0, 9]))], tmp_path))
    assert "edge points 2 20.0%" in page.shown
    published = Case("ten", cloud, paper.detect(cloud))
    assert len(Page(write_report([published], tmp_path)).images) == 2 * 5


@pytest.mark.usefixtures("small")
def test_points_that_are_not_finite(tmp_path):
    xyz = np.random.default_rng(0).random((200, 3))
    xyz[::10] = np.nan
    cloud = Cloud(xyz.reshape(10, 20, 3), viewpoint=np.array([0.5, 0.5, -3.0]))
    page = Page(write_report([Case("frame", cloud, edges_at(cloud, [1, 2, 3]))], tmp_path))
    assert "not finite, left out 20" in page.shown
    assert f"edge points 3 {3 / 180:.1%}" in page.shown


@pytest.mark.usefixtures("small")
def test_no_edge_points_at_all(tmp_path):
    cloud = Cloud(np.random.default_rng(0).random((100, 3)))
    page = Page(write_report([Case("smooth", cloud, edges_at(cloud, []))], tmp_path))
    assert "edge points 0 0.0%" in page.shown


@pytest.mark.usefixtures("undrawn")
def test_own_tables_of_a_case_are_shown(tmp_path):
    cloud = Cloud(np.random.default_rng(0).random((20, 3)))
    table = Table("Rivals", [{"who": "a & b", "F1": 0.5, "n": None}], {"F1": ".2f"}, note="higher is better")
    page = Page(write_report([Case("c", cloud, edges_at(cloud, [1]), tables=[table])], tmp_path))
    assert "Rivals who F1 n a & b 0.50 \N{EN DASH} higher is better" in page.shown


def test_a_folder_that_cannot_be_made(tmp_path, tee):
    (tmp_path / "file").write_text("here")
    with pytest.raises(FileExistsError, match="is a file; name a folder"):
        write_report([tee], tmp_path / "file")
    with pytest.raises(OSError, match="choose another folder"):
        write_report([tee], tmp_path / "file" / "below")
    assert (tmp_path / "file").read_text() == "here"


def test_no_cases(tmp_path):
    with pytest.raises(ValueError, match="cases"):
        write_report([], tmp_path / "report")
    assert not (tmp_path / "report").exists()


@pytest.mark.usefixtures("undrawn")
def test_a_report_replaces_the_one_before_and_leaves_nothing_else(tmp_path):
    cloud = Cloud(np.random.default_rng(0).random((20, 3)))
    case = Case("c", cloud, edges_at(cloud, [1]))
    first = write_report([case], tmp_path, title="first")
    before = sorted(tmp_path.iterdir())
    assert write_report([case], tmp_path, title="second") == first
    assert sorted(tmp_path.iterdir()) == before
    assert "second" in Page(first).shown
