"""Drawings, maps and tables, opened again by readers that are not ours."""

import csv
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

import edgel
from edgel import synth
from edgel.curves import CurveKind, measures, parallels, simplify, trace, write
from edgel.io import FormatError

ezdxf = pytest.importorskip("ezdxf")
pyogrio = pytest.importorskip("pyogrio")
shapely = pytest.importorskip("shapely")

SHIFT = np.array([155_000.0, 463_000.0, 10.0])


@pytest.fixture(scope="module")
def curves():
    """A gear: lines, circles of its bore, corners; in a CRS, far from its origin."""
    solid = synth.gear(teeth=9, root=28.0, tip=38.0, bore=12.0, thick=22.0)
    scene = synth.sample(solid, pattern="blue_noise", spacing=solid.spacing, seed=5)
    edges = edgel.detect(scene.cloud)
    moved = replace(edges, position=edges.position + SHIFT)
    found = trace(edgel.Cloud(scene.cloud.xyz + SHIFT, crs="EPSG:28992"), moved)
    assert {"line", "circle"} <= set(found.count_kinds())
    return found


@pytest.fixture(scope="module")
def none(curves):
    from test_trace import no_edges

    return replace(trace(np.eye(3), no_edges(3)), crs="EPSG:28992")


def apart(places, curves):
    """The largest distance of places from the curves, in spacings."""

    fine = []
    for k in range(len(curves)):
        path = curves.points_of(k)
        steps = np.linspace(0, len(path) - 1, 40 * len(path))
        fine.append(np.stack([np.interp(steps, np.arange(len(path)), path[:, axis]) for axis in range(3)], axis=1))
    return KDTree(np.concatenate(fine)).query(places)[0].max() / curves.spacing.min()


def test_dxf_holds_what_curves_are(curves, tmp_path):
    write(tmp_path / "a.dxf", curves)
    document = ezdxf.readfile(tmp_path / "a.dxf")
    assert not document.audit().errors
    space = document.modelspace()
    counts = {kind: len(space.query(kind)) for kind in ("LINE", "CIRCLE", "ARC", "POLYLINE", "POINT")}
    expected = [
        (curves.kind == kind).sum() for kind in (CurveKind.LINE, CurveKind.CIRCLE, CurveKind.ARC, CurveKind.POLYLINE)
    ]
    assert list(counts.values()) == [*expected, len(curves.corners)]
    assert {entity.dxf.layer for entity in space} == {"CREASE", "CORNERS"}
    radii = sorted(circle.dxf.radius for circle in space.query("CIRCLE"))
    np.testing.assert_allclose(radii, np.sort(curves.radius[curves.kind == CurveKind.CIRCLE]))
    places = [[*line.dxf.start] for line in space.query("LINE")] + [[*line.dxf.end] for line in space.query("LINE")]
    for round_ in [*space.query("CIRCLE"), *space.query("ARC")]:
        places += [
            [*place]
            for place in round_.vertices(np.linspace(0, 360, 50) if round_.dxftype() == "CIRCLE" else round_.angles(50))
        ]
    assert apart(np.array(places), curves) < 0.05


@pytest.mark.parametrize("name", ["a.gpkg", "a.geojson", "a.shp"])
def test_maps_keep_crs_heights_and_measures(curves, tmp_path, name):
    write(tmp_path / name, curves)
    write(tmp_path / name, curves)  # replaced, not added to
    meta, _, shapes, fields = pyogrio.raw.read(tmp_path / name)
    assert "28992" in str(meta["crs"])
    assert len(shapes) == len(curves)
    places = np.concatenate([shapely.get_coordinates(shapely.from_wkb(shape), include_z=True) for shape in shapes])
    assert apart(places, curves) < 0.05
    columns = dict(zip(meta["fields"], fields, strict=True))
    np.testing.assert_allclose(columns["length"].astype(float), curves.length, rtol=1e-6)
    assert set(columns["kind"]) == set(curves.count_kinds())


def test_svg_is_to_scale(curves, tmp_path):
    write(tmp_path / "a.svg", curves, unit="cm", scale=0.1)
    root = ElementTree.parse(tmp_path / "a.svg").getroot()
    width = float(root.attrib["width"].removesuffix("mm"))
    assert width - 10 == pytest.approx(np.ptp(curves.vertices[:, 0]), abs=1e-3)  # a centimetre at 1:10 is a millimetre
    assert len(root) == len(curves)


def test_line_elements_name_the_vertices_of_the_curves(curves, tmp_path):
    plyfile = pytest.importorskip("plyfile")
    write(tmp_path / "a.ply", curves)
    ply = plyfile.PlyData.read(tmp_path / "a.ply")
    vertices = np.stack([ply["vertex"][axis] for axis in "xyz"], axis=1)
    steps = vertices[ply["edge"]["vertex2"]] - vertices[ply["edge"]["vertex1"]]
    along = np.bincount(ply["edge"]["curve"], np.linalg.norm(steps, axis=1))
    np.testing.assert_allclose(along, curves.length, rtol=2e-3)
    write(tmp_path / "a.obj", curves)
    words = [line.split() for line in (tmp_path / "a.obj").read_text().splitlines()]
    places = np.array([word[1:] for word in words if word[0] == "v"], float)
    chains = [np.array(word[1:], int) - 1 for word in words if word[0] == "l"]
    assert len(chains) == len(curves)
    np.testing.assert_array_equal(places[np.concatenate(chains)], curves.vertices)


def test_table_is_read_by_csv(curves, tmp_path):
    write(tmp_path / "a.csv", curves)
    with (tmp_path / "a.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == measures(curves)["name"].tolist()
    assert len({row["name"] for row in rows}) == len(curves)
    np.testing.assert_allclose([float(row["length"]) for row in rows], curves.length)
    assert all((row["diameter"] == "") == (row["kind"] == "line") for row in rows if row["kind"] != "polyline")


@pytest.mark.filterwarnings("ignore:Measured")  # GDAL of a Shapefile without lines
@pytest.mark.parametrize("name", ["a.dxf", "a.gpkg", "a.geojson", "a.shp", "a.svg", "a.obj", "a.ply", "a.csv"])
def test_nothing_is_a_valid_empty_file(none, tmp_path, name):
    write(tmp_path / name, none)
    if name.endswith("dxf"):
        assert len(ezdxf.readfile(tmp_path / name).modelspace()) == 0
    elif name.endswith(("gpkg", "geojson", "shp")):
        assert len(pyogrio.raw.read(tmp_path / name)[2]) == 0
    else:
        assert (tmp_path / name).stat().st_size > 0


def test_wrong_files_are_refused_with_the_remedy(curves, tmp_path):
    with pytest.raises(FormatError, match=r"known are \.dxf"):
        write(tmp_path / "a.dwg", curves)
    with pytest.raises(FormatError, match="in degrees"):
        write(tmp_path / "a.gpkg", replace(curves, crs="EPSG:4326"))
    with pytest.raises(ValueError, match="view: expected one of"):
        write(tmp_path / "a.svg", curves, view="left")  # pyright: ignore[reportArgumentType]


def test_parallel_lines_of_the_gear_are_its_thickness_apart(curves):
    found = parallels(curves, within=30.0)
    across = np.abs(curves.direction[found.curves[:, 0], 2]) < 0.1
    thick = found.distance[across]
    assert (np.abs(thick - 22.0) < 0.1).any()
    assert (found.distance_std > 0).all()


def test_simplified_curves_stay_near(curves):
    fewer = simplify(curves, 0.5)
    assert len(fewer.vertices) < len(curves.vertices)
    assert apart(curves.vertices, fewer) * curves.spacing.min() <= 0.51
    np.testing.assert_array_equal(fewer.length, curves.length)
    with pytest.raises(ValueError, match="0 or more"):
        simplify(curves, -1)
