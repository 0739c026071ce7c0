"""The demo: the published experiment again, and honest about the paper's claim."""

from dataclasses import replace

import numpy as np
import pytest
from html_page import Page
from PIL import Image

import edgel
from edgel import paper, synth
from edgel._demo import Measurement, Times, run_demo, side_by_side
from edgel._demo.tables import CLAIM, PUBLISHED, findings
from edgel._demo.truth import FoundLength, Offsets, found_lengths, offsets


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
