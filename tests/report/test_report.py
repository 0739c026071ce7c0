"""Reports: complete, self-contained, safe to open, and honest about the paper's claim."""

import base64
import io
import re
from dataclasses import replace
from html.parser import HTMLParser
from urllib.parse import unquote

import numpy as np
import pytest
from PIL import Image

import edgel
from edgel import Cloud, EdgeKind, Edges, figures, paper, report, scene, synth
from edgel._demo import Measurement, Times, run_demo, side_by_side
from edgel._demo.tables import CLAIM, PUBLISHED, findings
from edgel._demo.truth import FoundLength, Offsets, found_lengths, offsets
from edgel.edges import one_face
from edgel._report.figures import published, views
from edgel._report.figures.views import strongest
from edgel._report import Case, Table, write_report
from edgel._report.histograms import Histogram, angle_histogram, as_svg, strength_histogram
from edgel._report.tables import count_table, machine_table, parameter_table, preset_table, time_table


class Page(HTMLParser):
    """What a page shows and what it would load; every tag has to be closed in order."""

    VOID = ("meta", "img", "br", "link", "source")

    def __init__(self, path):
        super().__init__()
        self.open, self.images, self.loaded, self.links, self.text, self.tags = [], [], [], [], [], []
        self.source = path.read_text(encoding="utf-8")
        self.feed(self.source)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "srcset"):
                self.images.append(value)
            elif tag == "a" and name == "href":
                self.links.append(value)
            elif name in ("href", "action", "xlink:href"):
                self.loaded.append(value)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not self.open or self.open[-1] != "style":
            self.text.append(data)

    @property
    def shown(self):
        return " ".join(" ".join(self.text).split())


def by_hand(cloud, rows, kind=EdgeKind.CREASE):
    """Edges of the default preset as a detector would answer them, with one normal missing."""
    normals = np.tile([0.0, 0.0, 1.0], (len(rows), 1))
    normals[:1] = np.nan
    return Edges(
        index=np.asarray(rows, np.int64),
        kind=np.full(len(rows), kind, np.uint8),
        strength=np.ones(len(rows)),
        position=cloud.xyz[rows],
        **one_face(normals),
        num_points=len(cloud),
        num_dropped=int((~np.isfinite(cloud.xyz).all(axis=1)).sum()),
        preset="default",
        method="surface",
        reason="asked for",
        parameters={"num_neighbors": 16, "viewpoint": None},
        seconds={"index": 0.125, "normals": 0.25},
    )


@pytest.fixture(scope="module")
def tee():
    scan = synth.scan(synth.tee(), num_points=30_000)
    part = synth.sample(synth.tee(), spacing=0.5).cloud
    return Case("tee", scan.cloud, paper.detect(scan.cloud), part, other=edgel.detect(scan.cloud))


@pytest.fixture(scope="module")
def written(tee, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    edgel.write(folder / "a tee & more.ply", tee.cloud)
    case = replace(tee, files={"the cloud": folder / "a tee & more.ply"})
    return write_report([case], folder / "new" / "folder", title="A <tee> & more", findings=["5 < 6"])


@pytest.fixture
def small(monkeypatch):
    """Draw the figures with few pixels."""
    monkeypatch.setattr(published, "_SIZE", (300, 190))
    for name in ("_OVERVIEW", "_DETAIL", "_HALF"):
        monkeypatch.setattr(views, name, (120, 90))


@pytest.fixture
def undrawn(monkeypatch):
    """Spare the drawing where the words alone are of interest."""
    with io.BytesIO() as file:
        Image.new("RGB", (2, 2)).save(file, format="PNG")
        png = file.getvalue()

    def draw_figures(cloud, edges, *, name, part, other):
        return [figures.FigureImage(number, f"Figure {number}. {name}", png, png, png) for number in (1, 4)]

    monkeypatch.setattr(report, "draw_figures", draw_figures)


def test_the_page_holds_every_figure_in_both_lights_and_they_lie_beside_it(written):
    page = Page(written)
    numbers = (1, 3, 4, 5, 8, 9)
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
    for number in numbers:
        assert f"Figure {number}. tee:" in page.shown


def test_links_lead_to_files_beside_the_page(written):
    links = Page(written).links
    targets = [(written.parent / unquote(link)).resolve() for link in links]
    assert all(target.is_file() for target in targets)
    assert {target.name for target in targets} >= {"a tee & more.ply", "tee-figure-4.png", "tee-figure-9.png"}


def test_a_page_stays_small(written):
    # Figures have the same number of pixels whatever the cloud: 2.0 MB of 650,000 points.
    assert written.stat().st_size < 4_000_000


def test_the_page_shows_every_number(written, tee):
    shown = Page(written).shown
    assert "30,000" in shown
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
    case = Case("a/b", cloud, by_hand(cloud, [1, 2, 3]))
    write_report([case, case, replace(case, name="///")], tmp_path)
    figures_4 = sorted(path.name for path in tmp_path.glob("*figure-4.png"))
    assert figures_4 == ["a-b-2-figure-4.png", "a-b-figure-4.png", "cloud-figure-4.png"]


@pytest.mark.usefixtures("small")
def test_edges_of_the_default_preset(tmp_path):
    x, y = np.meshgrid(np.arange(40.0), np.arange(30.0))
    roof = Cloud(np.column_stack([x.ravel(), y.ravel(), -np.abs(x.ravel() - 20)]))
    page = Page(write_report([Case("roof", roof, by_hand(roof, np.flatnonzero(roof.xyz[:, 0] == 20)))], tmp_path))
    assert len(page.images) == 2 * 4
    assert "Figure 3" not in page.shown
    assert "of kind crease 30 2.5%" in page.shown
    assert "1 edge points have no normal" in page.shown


@pytest.mark.usefixtures("small")
def test_ten_points(tmp_path):
    cloud = Cloud(np.random.default_rng(0).random((10, 3)))
    page = Page(write_report([Case("ten", cloud, by_hand(cloud, [0, 9]))], tmp_path))
    assert "edge points 2 20.0%" in page.shown
    published = Case("ten", cloud, paper.detect(cloud))
    assert len(Page(write_report([published], tmp_path)).images) == 2 * 5


@pytest.mark.usefixtures("small")
def test_points_that_are_not_finite(tmp_path):
    xyz = np.random.default_rng(0).random((200, 3))
    xyz[::10] = np.nan
    cloud = Cloud(xyz.reshape(10, 20, 3), viewpoint=np.array([0.5, 0.5, -3.0]))
    page = Page(write_report([Case("frame", cloud, by_hand(cloud, [1, 2, 3]))], tmp_path))
    assert "not finite, left out 20" in page.shown
    assert f"edge points 3 {3 / 180:.1%}" in page.shown


@pytest.mark.usefixtures("small")
def test_no_edge_points_at_all(tmp_path):
    cloud = Cloud(np.random.default_rng(0).random((100, 3)))
    page = Page(write_report([Case("smooth", cloud, by_hand(cloud, []))], tmp_path))
    assert "edge points 0 0.0%" in page.shown


@pytest.mark.usefixtures("undrawn")
def test_own_tables_of_a_case_are_shown(tmp_path):
    cloud = Cloud(np.random.default_rng(0).random((20, 3)))
    table = Table("Rivals", [{"who": "a & b", "F1": 0.5, "n": None}], {"F1": ".2f"}, note="higher is better")
    page = Page(write_report([Case("c", cloud, by_hand(cloud, [1]), tables=[table])], tmp_path))
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
    case = Case("c", cloud, by_hand(cloud, [1]))
    first = write_report([case], tmp_path, title="first")
    before = sorted(tmp_path.iterdir())
    assert write_report([case], tmp_path, title="second") == first
    assert sorted(tmp_path.iterdir()) == before
    assert "second" in Page(first).shown


def test_a_point_of_two_kinds_counts_in_both():
    cloud = Cloud(np.random.default_rng(0).random((20, 3)))
    edges = by_hand(cloud, [1, 2], EdgeKind.CREASE | EdgeKind.BOUNDARY)
    counted = {row["what"]: row["number"] for row in count_table(edges).rows}
    assert counted["of kind crease"] == counted["of kind boundary"] == counted["edge points"] == 2
    assert counted["edge points without a normal"] == 1
    assert "turn" not in count_table(edges).note
    bent = replace(edges, angle=np.array([np.nan, np.pi / 2]))
    assert "Half of the creases turn by more than 90.0 degrees" in count_table(bent).note


def test_both_presets_are_set_beside_each_other(tee):
    default, published, both = preset_table(tee.edges, tee.other).rows
    assert (default["preset"], published["preset"]) == ("default", "paper")
    assert default["edge points"] == len(tee.other)
    assert published["edge points"] == len(tee.edges)
    assert both["edge points"] == len(set(tee.other.index) & set(tee.edges.index))
    assert f"image {len(tee.edges):,}" in published["kinds"]
    assert default["seconds"] == pytest.approx(sum(tee.other.seconds.values()))


def test_histograms_count_every_edge_point_once():
    cloud = Cloud(np.random.default_rng(0).random((50, 3)))
    edges = by_hand(cloud, np.arange(30), EdgeKind.CREASE | EdgeKind.BOUNDARY)
    angle = np.full(30, np.nan)
    angle[:20] = np.linspace(0, np.pi, 20)
    edges = replace(edges, kind=np.r_[edges.kind[:12], np.full(18, 8, np.uint8)], angle=angle)
    edges = replace(edges, strength=np.linspace(0.31, 1.0, 30))
    strength = strength_histogram(edges)
    assert [(name, counts.sum()) for name, _, counts in strength.stacks] == [("boundary", 12), ("crease", 18)]
    assert strength.edges[0] == pytest.approx(0.3)
    turned = angle_histogram(edges)
    assert turned is not None
    assert turned.stacks[0][2].sum() == 20
    assert angle_histogram(by_hand(cloud, [1])) is None


def test_bars_are_as_high_as_their_counts():
    counts = np.array([4, 0, 2]), np.array([1, 0, 0])
    stacks = [("a", (1, 2, 3), counts[0]), ("b", (4, 5, 6), counts[1])]
    drawn = as_svg(Histogram("Sizes", "size", np.array([0.0, 1.0, 2.0, 3.0]), stacks))
    bars = [re.findall(r"M[\d.]+ ([\d.]+)V([\d.]+)H", path) for path in re.findall(r'd="([^"]*)" fill', drawn)]
    heights = [[float(low) - float(high) for low, high in path] for path in bars]
    assert heights == [pytest.approx([4 * heights[1][0], 2 * heights[1][0]], abs=0.2), [pytest.approx(35.2, abs=0.1)]]
    assert float(bars[1][0][0]) == pytest.approx(float(bars[0][0][1]), abs=0.1)  # b stands on a


def test_details_are_where_the_strong_edges_are():
    x, y = np.meshgrid(np.arange(120.0), np.arange(90.0))
    cloud = Cloud(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]))
    near = [np.flatnonzero(np.hypot(*(cloud.xyz[:, :2] - at).T) < 4) for at in ((20, 70), (90, 20))]
    rows = np.sort(np.concatenate(near))
    edges = replace(by_hand(cloud, rows), strength=np.where(cloud.xyz[rows, 0] < 50, 1.0, 0.2))
    laid = scene.Scene(cloud, direction="top", size=(456, 342), crop=False, margin=0.03)
    (first, box), (second, other), *_ = strongest(laid, edges)
    assert np.hypot(*(edges.position[first, :2] - (20, 70))) < 3
    assert np.hypot(*(edges.position[second, :2] - (90, 20))) < 5
    assert box[2] <= other[0]
    assert box[2] - box[0] == pytest.approx(box[3] - box[1])


def test_the_method_is_named_with_its_reason():
    cloud = Cloud(np.random.default_rng(0).random((20, 3)))
    table = parameter_table(by_hand(cloud, [1]))
    assert {"parameter": "method", "value": "surface"} in table.rows
    assert "asked for" in table.note


def test_tables_are_plain_data():
    cloud = Cloud(np.random.default_rng(0).random((20, 3)))
    edges = by_hand(cloud, [1])
    for table in (count_table(edges), time_table(edges), parameter_table(edges), machine_table()):
        assert all(list(row) == table.columns for row in table.rows)
        assert all(isinstance(value, str) for row in table.text() for value in row.values())
    assert time_table(edges).rows[-1] == {"stage": "all", "seconds": 0.375}
    assert parameter_table(edges).text()[-1] == {"parameter": "viewpoint", "value": "\N{EN DASH}"}


def test_figure_3_shows_the_edge_map_upright(written):
    with Image.open(written.parent / "tee-figure-3.png") as image:
        right = np.asarray(image.convert("L"))[:, 900:1560]
    black = right[60:-200] < 60
    top, bottom = black[: len(black) // 3], black[-len(black) // 3 :]
    # The branch of the tee points to +y, up: the outline is narrower there.
    assert np.ptp(np.flatnonzero(top.any(axis=0))) < np.ptp(np.flatnonzero(bottom.any(axis=0)))


def test_the_drawn_surface_lies_on_the_part():
    xyz, normals = figures.surface(synth.elbow(), step=2.0)
    distance = np.hypot(np.hypot(xyz[:, 0], xyz[:, 1]) - 152.4, xyz[:, 2])
    np.testing.assert_allclose(distance, 57.15, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)
    assert xyz[:, 2].min() < 2.0  # down to the outline


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    told = []
    done = run_demo(tmp_path_factory.mktemp("demo") / "out", repeats=1, num_points=20_000, progress=told.append)
    assert told[0] == "scanning"
    assert "measuring, round 1 of 1" in told
    return done


def test_the_demo_writes_all_it_names(demo):
    assert all(path.stat().st_size > 0 for path in demo.files)
    assert sorted(demo.files) == sorted(demo.page.parent.iterdir())
    cloud = edgel.read(demo.page.parent / "tee.ply")
    edges = edgel.read(demo.page.parent / "tee-edges.ply")
    assert len(cloud) == 20_000
    assert len(edges) == len(demo.measurements[0].edges)
    with Image.open(demo.page.parent / "edges.png") as image:
        assert image.width == 1600


def test_the_page_of_the_demo_says_what_its_tables_and_findings_say(demo):
    shown = Page(demo.page).shown
    for sentence in demo.findings:
        assert sentence in shown
    for table in demo.tables:
        assert table.title in shown
        for row in table.text():
            assert " ".join(row.values()) in shown


def test_the_demo_sets_the_paper_beside_ours(demo):
    counts, normals = demo.tables[:2]
    assert [(row["part"], row["source"]) for row in counts.rows] == [
        ("tee", "paper"),
        ("tee", "edgel"),
        ("elbow", "paper"),
        ("elbow", "edgel"),
    ]
    text = counts.text() + normals.text()
    assert {"53.030", "4.940", "42.030", "4.370"} <= {value for row in text for value in row.values()}
    assert {"647,984", "60,015", "520,915", "53,353"} <= {value for row in text for value in row.values()}
    assert [row["share"] for row in normals.text()[::2]] == ["9.3%", "10.4%"]


def test_the_demo_tells_what_the_method_finds_and_misses(demo):
    found = {(row["part"], row["true edge"]): row["with an edge point"] for row in demo.tables[3].rows}
    assert set(found) == {
        ("tee", "rim"),
        ("tee", "outline"),
        ("tee", "seam"),
        ("elbow", "rim"),
        ("elbow", "outline"),
    }
    assert found["tee", "outline"] > 0.9
    assert found["tee", "seam"] < 0.6


def test_the_picture_shows_both_parts_at_one_scale(demo):
    picture = side_by_side(demo.measurements, width=800)
    drawn = np.any(picture <= 250, axis=2)
    columns = np.flatnonzero(drawn.any(axis=0))
    assert columns[0] <= 8
    assert columns[-1] >= 791
    wide = [np.flatnonzero(half.any(axis=0)) for half in (drawn[:, :400], drawn[:, 400:])]
    assert abs(np.ptp(wide[0]) / np.ptp(wide[1]) - 210 / 209.55) < 0.03


@pytest.mark.parametrize(("share", "holds"), [(0.10, True), (0.104, True), (0.106, False), (0.3, False)])
def test_the_verdict_follows_the_measurement(demo, share, holds):
    times = Times(1.0, share, 0.1, 0.9, 0.09, 0.05)
    said = findings(replace(demo.measurements[0], times=times))
    assert ("The paper's claim of 10% holds here" in said[0]) == holds
    assert ("does not hold" in said[0]) != holds
    assert ("sorting all points" in said[0]) != holds
    assert f"{share + 0.05:.1%}" in said[1]


def test_shares_of_times():
    times = Times(all_normals=2.0, edge_normals=0.5, index=0.2, all_fits=1.6, edge_fits=0.16, image=0.3)
    assert (times.share, times.share_with_image, times.share_of_fits) == (0.25, 0.4, pytest.approx(0.1))
    assert CLAIM == 0.10
    assert PUBLISHED["tee"].points == 647_984


def test_found_lengths_against_brute_force():
    solid = synth.tee()
    cloud = synth.scan(solid, num_points=4000).cloud
    edges = paper.detect(cloud)
    rows, columns = np.nonzero(edges.edge_map)
    dx, dy = edges.grid.pixel
    pixels = np.column_stack([(columns + 0.5) * dx, (rows + 0.5) * dy]) + edges.grid.lower[:2]
    for one in found_lengths(solid, cloud, edges, reach=1.5):
        total = near = 0.0
        for curve in solid.edges:
            if curve.name == one.name:
                for begin, end in zip(curve.points[:-1:40], curve.points[40::40], strict=False):
                    length = np.linalg.norm(end - begin)
                    total += length
                    middle = (begin + end)[:2] / 2
                    near += length * (np.linalg.norm(pixels - middle, axis=1).min() <= 1.5)
        assert one.length == pytest.approx(total, rel=0.05)
        assert one.with_pixel == pytest.approx(near / total, abs=0.06)


def test_truth_without_edge_points():
    solid = synth.elbow()
    scan = synth.scan(solid, num_points=2000)
    edges = paper.detect(scan.cloud, low=1e6, high=1e6)
    assert len(edges) == 0
    assert all(one == FoundLength(one.name, one.length, 0.0, 0.0) for one in found_lengths(solid, scan.cloud, edges))
    assert np.isnan(offsets(solid, scan.cloud, edges).median)
    assert isinstance(Measurement(solid, scan, edges, Times(1, 1, 1, 1, 1, 1), (), Offsets(0, 0, 0)).name, str)


@pytest.mark.parametrize(("options", "message"), [({"repeats": 0}, "repeats"), ({"num_points": 5}, "num_points")])
def test_demo_options(tmp_path, options, message):
    with pytest.raises(ValueError, match=message):
        run_demo(tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()
