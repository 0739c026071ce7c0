"""What reports tell in numbers: tables and histograms."""

import re
from dataclasses import replace

import numpy as np
import pytest
from by_hand import edges_at

from edgel import Cloud, EdgeKind
from edgel._report.histograms import Histogram, Stack, angle_histogram, as_svg, strength_histogram
from edgel._report.tables import count_table, machine_table, method_table, parameter_table, time_table


def test_a_point_of_two_kinds_counts_in_both():
    cloud = Cloud(np.random.default_rng(0).random((20, 3)))
    edges = edges_at(cloud, [1, 2], EdgeKind.CREASE | EdgeKind.BOUNDARY, normals=[[np.nan] * 3, [0.0, 0.0, 1.0]])
    counted = {row["what"]: row["number"] for row in count_table(edges).rows}
    assert counted["of kind crease"] == counted["of kind boundary"] == counted["edge points"] == 2
    assert counted["edge points without a normal"] == 1
    assert "turn" not in count_table(edges).note
    bent = replace(edges, angle=np.array([np.nan, np.pi / 2]))
    assert "Half of the creases turn by more than 90.0 degrees" in count_table(bent).note


def test_both_methods_are_set_beside_each_other(tee):
    default, published, both = method_table(tee.edges, tee.other).rows
    assert (default["method"], published["method"]) == (tee.other.method, "paper")
    assert default["edge points"] == len(tee.other)
    assert published["edge points"] == len(tee.edges)
    assert both["edge points"] == len(set(tee.other.index) & set(tee.edges.index))
    assert f"image {len(tee.edges):,}" in published["kinds"]
    assert default["seconds"] == pytest.approx(sum(tee.other.seconds.values()))


def test_histograms_count_every_edge_point_once():
    cloud = Cloud(np.random.default_rng(0).random((50, 3)))
    edges = edges_at(cloud, np.arange(30), EdgeKind.CREASE | EdgeKind.BOUNDARY)
    angle = np.full(30, np.nan)
    angle[:20] = np.linspace(0, np.pi, 20)
    edges = replace(edges, kind=np.r_[edges.kind[:12], np.full(18, 8, np.uint8)], angle=angle)
    edges = replace(edges, strength=np.linspace(0.31, 1.0, 30))
    strength = strength_histogram(edges)
    assert [(stack.name, stack.counts.sum()) for stack in strength.stacks] == [("boundary", 12), ("crease", 18)]
    assert strength.edges[0] == pytest.approx(0.3)
    turned = angle_histogram(edges)
    assert turned is not None
    assert turned.stacks[0].counts.sum() == 20
    assert angle_histogram(edges_at(cloud, [1])) is None


def test_bars_are_as_high_as_their_counts():
    counts = np.array([4, 0, 2]), np.array([1, 0, 0])
    stacks = [Stack("a", (1, 2, 3), counts[0]), Stack("b", (4, 5, 6), counts[1])]
    drawn = as_svg(Histogram("Sizes", "size", np.array([0.0, 1.0, 2.0, 3.0]), stacks))
    bars = [re.findall(r"M[\d.]+ ([\d.]+)V([\d.]+)H", path) for path in re.findall(r'd="([^"]*)" fill', drawn)]
    heights = [[float(low) - float(high) for low, high in path] for path in bars]
    assert heights == [pytest.approx([4 * heights[1][0], 2 * heights[1][0]], abs=0.2), [pytest.approx(35.2, abs=0.1)]]
    assert float(bars[1][0][0]) == pytest.approx(float(bars[0][0][1]), abs=0.1)  # b stands on a


def test_the_method_is_named_with_its_reason():
    cloud = Cloud(np.random.default_rng(0).random((20, 3)))
    table = parameter_table(edges_at(cloud, [1]))
    assert {"parameter": "method", "value": "surface"} in table.rows
    assert "asked for" in table.note


def test_tables_are_plain_data():
    cloud = Cloud(np.random.default_rng(0).random((20, 3)))
    edges = edges_at(cloud, [1])
    for table in (count_table(edges), time_table(edges), parameter_table(edges), machine_table()):
        assert all(list(row) == table.columns for row in table.rows)
        assert all(isinstance(value, str) for row in table.text() for value in row.values())
    assert time_table(edges).rows[-1] == {"stage": "all", "seconds": 0.375}
    assert parameter_table(edges).text()[-1] == {"parameter": "viewpoint", "value": "\N{EN DASH}"}
