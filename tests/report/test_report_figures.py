"""The figures of reports: what they show, and where."""

from dataclasses import replace

import numpy as np
import pytest
from by_hand import edges_at
from PIL import Image

from edgel import Cloud
from edgel._report.figures.published import cloud_and_projection, normals_at_edges
from edgel._report.figures.views import strongest
from edgel.plot.camera import Viewport
from edgel.plot.zbuffer import ZBuffer


def test_details_are_where_the_strong_edges_are():
    x, y = np.meshgrid(np.arange(120.0), np.arange(90.0))
    cloud = Cloud(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]))
    near = [np.flatnonzero(np.hypot(*(cloud.xyz[:, :2] - at).T) < 4) for at in ((20, 70), (90, 20))]
    rows = np.sort(np.concatenate(near))
    edges = replace(edges_at(cloud, rows), strength=np.where(cloud.xyz[rows, 0] < 50, 1.0, 0.2))
    buffer = ZBuffer(cloud, Viewport((456, 342), "top"))
    first, second, *_ = strongest(buffer, edges)
    assert np.hypot(*(edges.position[first.edge, :2] - (20, 70))) < 3
    assert np.hypot(*(edges.position[second.edge, :2] - (90, 20))) < 5
    assert first.box.right <= second.box.left
    assert first.box.right - first.box.left == pytest.approx(first.box.bottom - first.box.top)


def test_figure_3_shows_the_edge_map_upright(written):
    with Image.open(written.parent / "tee-figure-3.png") as image:
        right = np.asarray(image.convert("L"))[:, 900:1560]
    black = right[60:-200] < 60
    top, bottom = black[: len(black) // 3], black[-len(black) // 3 :]
    # The branch of the tee points to +y, up: the outline is narrower there.
    assert np.ptp(np.flatnonzero(top.any(axis=0))) < np.ptp(np.flatnonzero(bottom.any(axis=0)))


@pytest.mark.usefixtures("small")
def test_the_part_stands_beside_the_cloud(tee):
    with_part = cloud_and_projection(tee.cloud, tee.edges, tee.part)
    assert with_part is not None
    assert [panel.title for panel in with_part.panels] == ["(a) the part", "(b) the cloud", "(c) its projection"]
    part, cloud = ((panel.image("light") < 255).any(axis=2).mean() for panel in with_part.panels[:2])
    assert part > 0.4
    without = cloud_and_projection(tee.cloud, tee.edges, None)
    assert without is not None
    assert [panel.title for panel in without.panels] == ["(a) the cloud", "(b) its projection"]
    assert cloud_and_projection(tee.cloud, tee.other, None) is None
    assert cloud < (without.panels[0].image("light") < 255).any(axis=2).mean()  # there its points are drawn singly


def test_arrows_point_along_the_normals(tee):
    edges = replace(tee.edges, normals=np.full_like(tee.edges.normals, np.nan))
    (with_arrows,), (without,) = (normals_at_edges(tee.cloud, one).panels for one in (tee.edges, edges))
    ink = [(panel.image("light").max(axis=2) < 60).sum() for panel in (with_arrows, without)]
    assert ink[0] > 3 * ink[1]
    assert f"{len(edges):,} edge points have no normal" in normals_at_edges(tee.cloud, edges).caption
