"""What a run leaves: the edge points of each input in a file of their own, and an index of all of them."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from edgel._neighbors.normals import OUTWARD, OWN, UNKNOWN
from edgel.edges import Edges
from edgel.io import write
from edgel.io.chunks import read_rows
from edgel.io.files import COPC, stem
from edgel.tiled.aside import made_aside
from edgel.tiled.box import Box
from edgel.tiled.plan import Plan
from edgel.tiled.scans import load_scans, no_edges
from edgel.tiled.spool import ROWS, Part


def edges_of(plan: Plan, part: Part) -> Edges:
    """Gather the edge points of one file from the tiles that it reaches into."""
    if part.num_scans:
        return _edges_of_scans(plan, part)
    keys, columns = [np.zeros(0, np.int64)], {name: [none] for name, none in no_edges().items()}
    for tile in plan.around(Box.around(np.array([part.low, part.high]))) if part.num_points else []:
        with plan.load("label", tile) as found:
            mine = found["key"] >> ROWS == part.number
            keys.append(found["key"][mine])
            for name in columns:
                columns[name].append(found[name][mine])
        if plan.orientation in (OUTWARD, OWN):  # then faces were turned once all were known
            with plan.load("turn", tile) as turned:
                for name in turned.files:
                    columns[name][-1] = turned[name][mine]
    key = np.concatenate(keys)
    order = np.argsort(key)
    return Edges(
        index=key[order] & ((1 << ROWS) - 1),
        **{name: np.concatenate(parts)[order] for name, parts in columns.items()},
        orientation=plan.orientation,
        num_points=part.num_rows,
        num_dropped=part.num_rows - part.num_points,
        method="surface",
        reason="in tiles",
        parameters={"min_strength": plan.options.min_strength, "num_neighbors": plan.options.num_neighbors},
        seconds={},
    )


def _edges_of_scans(plan: Plan, part: Part) -> Edges:
    """Put the edge points of all scans of a file together."""
    found = load_scans(plan, part)
    row = np.concatenate([each["row"] for each in found])
    order = np.argsort(row)
    said = {str(each["orientation"]) for each in found} - {""}
    return Edges(
        index=row[order],
        **{name: np.concatenate([each[name] for each in found])[order] for name in no_edges()},
        orientation=said.pop() if len(said) == 1 else UNKNOWN,
        num_points=part.num_rows,
        num_dropped=part.num_rows - sum(int(each["points"]) for each in found),
        method="scans",
        reason="each scan from its own sensor",
        parameters={"min_strength": plan.options.min_strength, "num_neighbors": plan.options.num_neighbors},
        seconds={},
    )


def write_part(folder: Path, number: int, target: str) -> None:
    """Write the edge points of one file with all their attributes, unless that is done."""
    plan = Plan.read(folder)
    part = plan.spool.parts[number]
    done = _written(folder, number)
    if done.exists() and Path(target).exists():
        return
    edges = edges_of(plan, part)
    if part.num_points or part.num_scans:
        rows = read_rows(part.path, edges.index)
        write(target, replace(edges, index=np.arange(len(edges))).to_cloud(rows))
    with made_aside(done) as beside:
        beside.write_text(str(len(edges)))


def _written(folder: Path, number: int) -> Path:
    """Return the file that says that the edge points of an input are written, and how many."""
    return folder / "written" / f"{number:06d}"


def write_index(path: Path, plan: Plan, targets: Sequence[str]) -> None:
    """Write a virtual point cloud (.vpc): a STAC catalogue of the files, as PDAL and QGIS read it."""
    features = [
        _item(part, target, path.parent, int(_written(plan.folder, part.number).read_text()))
        for part, target in zip(plan.spool.parts, targets, strict=True)
        if part.num_points and Path(target).suffix.lower() in (".las", ".laz")
    ]
    with made_aside(path) as beside:
        beside.write_text(json.dumps({"type": "FeatureCollection", "features": features}, indent=1))


def _item(part: Part, target: str, folder: Path, edges: int) -> dict[str, object]:
    (x0, y0, z0), (x1, y1, z1) = part.low, part.high
    ring = [[x0, y0, z0], [x1, y0, z0], [x1, y1, z0], [x0, y1, z0], [x0, y0, z0]]
    properties: dict[str, object] = {
        "datetime": None,
        "start_datetime": "1970-01-01T00:00:00Z",
        "end_datetime": "1970-01-01T00:00:00Z",
        "pc:count": edges,
        "pc:encoding": "copc" if target.lower().endswith(COPC) else Path(target).suffix.lower()[1:],
        "pc:type": "lidar",
        "proj:bbox": [x0, y0, z0, x1, y1, z1],
        "proj:geometry": {"type": "Polygon", "coordinates": [ring]},
    }
    if part.crs is not None:
        properties["proj:wkt2"] = part.crs
    return {
        "type": "Feature",
        "stac_version": "1.0.0",
        "stac_extensions": [
            "https://stac-extensions.github.io/pointcloud/v1.0.0/schema.json",
            "https://stac-extensions.github.io/projection/v1.1.0/schema.json",
        ],
        "id": stem(target),
        "geometry": None,
        "links": [],
        "properties": properties,
        "assets": {"data": {"href": f"./{os.path.relpath(target, folder)}", "roles": ["data"]}},
    }
