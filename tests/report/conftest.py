"""What the tests of reports share: the report of the paper's tee, and figures that cost little."""

import io
from dataclasses import replace

import pytest
from by_hand import tee as tee_points
from PIL import Image

import edgel
from edgel import Cloud, _report, paper
from edgel._report import Case, write_report
from edgel._report.figures import FigureImage, published, views


@pytest.fixture(scope="session")
def tee():
    cloud, part = Cloud(tee_points(30_000)), Cloud(tee_points(60_000))
    return Case("tee", cloud, paper.detect(cloud), part, other=edgel.detect(cloud))


@pytest.fixture(scope="session")
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
        return [FigureImage(number, f"Figure {number}. {name}", png, png, png) for number in (1, 4)]

    monkeypatch.setattr(_report, "draw_figures", draw_figures)
