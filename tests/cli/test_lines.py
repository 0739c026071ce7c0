"""``edgel lines``: what it writes, and what it says when there is nothing to write."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import edgel
from edgel._cli import app

ezdxf = pytest.importorskip("ezdxf")


def run(*words):
    return CliRunner().invoke(app, list(map(str, words)))


@pytest.fixture(scope="module")
def roof(tmp_path_factory):
    x, y = np.meshgrid(np.arange(40.0), np.arange(30.0))
    path = tmp_path_factory.mktemp("roof") / "roof.ply"
    edgel.write(path, edgel.Cloud(np.c_[x.ravel(), y.ravel(), -np.abs(x.ravel() - 20)]))
    return path


def test_a_ridge_is_a_line_in_the_drawing(roof, tmp_path):
    result = run("lines", roof, "-o", tmp_path / "a.dxf", "--kinds", "crease", "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert told["kinds"] == {"line": 1}
    (line,) = ezdxf.readfile(tmp_path / "a.dxf").modelspace().query("LINE")
    assert abs(line.dxf.start.x - 20) < 0.05
    assert abs(line.dxf.end.x - 20) < 0.05


def test_no_lines_are_an_empty_file_and_it_is_said(tmp_path):
    x, y = np.meshgrid(np.arange(30.0), np.arange(30.0))
    edgel.write(tmp_path / "flat.ply", edgel.Cloud(np.c_[x.ravel(), y.ravel(), 0 * x.ravel()]))
    result = run("lines", tmp_path / "flat.ply", "-o", tmp_path / "a.dxf", "--kinds", "crease")
    assert result.exit_code == 0, result.output
    assert "valid and empty" in result.output
    assert len(ezdxf.readfile(tmp_path / "a.dxf").modelspace()) == 0


def test_an_unknown_extension_is_wrong_usage(roof, tmp_path):
    result = run("lines", roof, "-o", tmp_path / "a.dwg")
    assert result.exit_code != 0
    assert ".dxf" in result.output
    assert not (tmp_path / "a.dwg").exists()


def test_the_report_shows_measures_on_the_picture(roof, tmp_path):
    result = run("lines", roof, "-o", tmp_path / "a.csv", "--kinds", "crease", "--report", tmp_path / "page", "--json")
    assert result.exit_code == 0, result.output
    page = (tmp_path / "page" / "lines.html").read_text()
    assert page.count("<svg") == 3
    told = json.loads(result.stdout)
    assert f"{told['length']:.4g}</text>" in page
