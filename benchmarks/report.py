"""Tables and plots of a benchmark's results: docs/benchmarks.md."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import first_run
import growth
import promises
import real_sensors
import report_plots as plots
import report_tables as tables
import roofline
from matplotlib.backends.backend_agg import FigureCanvasAgg
from report_rows import Row

DOCS = Path(__file__).parent.parent / "docs"


def write(results: dict[str, Any]) -> Path:
    """Write docs/benchmarks.md and its plots."""
    (DOCS / "benchmarks").mkdir(exist_ok=True)
    rows = results["accuracy"]
    drawn = {
        "noise-views.png": plots.noise(rows, True, "f1@2.5", "flange and stepped block, pinhole: F1 at 2.5 spacings"),
        "noise-whole.png": plots.noise(rows, False, "f1@1.0", "flange and stepped block, blue noise: F1 at 1 spacing"),
        "angle.png": plots.turn(rows),
    }
    if "speed" in results:
        drawn["time-normals.png"] = plots.time(results["speed"], "normals of all points")
        drawn["time-edges.png"] = plots.time(results["speed"], "edges")
        if results["growth"]:
            drawn["growth.png"] = growth.plot(results["growth"])
    for name, figure in drawn.items():
        FigureCanvasAgg(figure).print_png(str(DOCS / "benchmarks" / name))
    path = DOCS / "benchmarks.md"
    path.write_text("\n\n".join(_page(results, rows)) + "\n")
    return path


def summary(results: dict[str, Any]) -> str:
    """The two main tables, for the terminal."""
    rows = results["accuracy"]
    return "\n\n".join(
        ["Single views, F1 at 2.5 spacings", tables.by_noise(rows, True, "f1@2.5"), "Whole surfaces, F1 at 1 spacing"]
        + [tables.by_noise(rows, False, "f1@1.0"), "False positives in 1000 points, negatives", tables.negatives(rows)]
    )


def _page(results: dict[str, Any], rows: list[Row]) -> Iterable[str]:
    yield from _opening(results, rows)
    yield from _real(results)
    yield from _by_view(rows)
    yield from _by_scene(rows)
    yield from _details(results, rows)
    if "speed" in results:
        yield from _speed(results)
    yield "## Parameters\n\nLengths in spacings, angles in degrees; *tuned* for each level of noise. Every grid entry tried and its mean is in `benchmarks/tuned.json`."
    yield tables.parameters(results["tuning"])
    pictures = DOCS / "benchmarks" / "pictures.md"
    if pictures.exists():
        yield pictures.read_text().strip()


def _opening(results: dict[str, Any], rows: list[Row]) -> Iterator[str]:
    m = results["machine"]
    versions = ", ".join(f"{name} {version}" for name, version in m["versions"].items() if version)
    scenes = len({row["scene"] for row in rows})
    yield "# Benchmarks"
    yield (
        f"`make bench` on {m['date']}, commit {m['commit']}: {m['cores']} cores of {m['cpu']}, Python {m['python']}, {versions}; "
        f"{results['minutes']:.0f} minutes. {scenes} scenes of parts whose edges are known exactly; how they are made, what "
        "counts as an edge and how a score is taken is said in `benchmarks/scenes.py`, `edgel.synth` and `edgel.metrics`."
    )
    yield (
        "Each rival stands twice: with its documented *defaults*, and *tuned*: the best of a small grid, chosen on other "
        "scenes for each level of noise, as if the noise were told to it. edgel has no parameter to tune. All parameters: "
        "`benchmarks/rivals/README.md`, `benchmarks/tuned.json`. A method is scored against every true edge of a scene; "
        "*own kinds* counts only the kinds it claims to find. A crease that turns less than 25 degrees counts neither way."
    )


def _real(results: dict[str, Any]) -> Iterator[str]:
    if results.get("real_sensors"):
        yield "## Real sensors\n\nTruth that no detector made: labels by hand and planes of whole faces (mosd, Kinect), CAD models at their poses (ycbv, Xtion), a board of known size (lidar_board, spinning lasers), surveyed outlines of buildings (ahn3_bgt, airborne), true disparities (stereo, a block matcher). *jump, outline, contact, crease, rim, eaves*: shares found; *crease_mm, offset, iqr*: how far off, mm, and metres; *false, inner*: edge points where there is none, in 1000; *stray*: crease points off all creases; *precision*: share of right outlines. Both detectors in turn on each frame, 2 threads; medians. Those marked *repository* are in `benchmarks/real` (`benchmarks/real_sensors.py`)."
        yield real_sensors.tables(results["real_sensors"])
    if results.get("sensed"):
        yield "## Simulated sensors\n\nViews with the errors of a Kinect, a projecting stereo camera and a spinning laser (`edgel.synth.sense`): mean F1 at 2.5 spacings, every method with its defaults."
        rows = results["sensed"]
        yield tables.by_scene(rows, "view", sorted({row["view"] for row in rows}), lambda row: "all" in row)


def _by_view(rows: list[Row]) -> Iterator[str]:
    yield "## Single views (organized clouds)\n\nMean F1 at 2.5 spacings by noise (in spacings), without outliers."
    yield tables.by_noise(rows, True, "f1@2.5")
    yield "The same, own kinds only."
    yield tables.by_noise(rows, True, "f1@2.5", "own")
    yield "![F1 against noise, single views](benchmarks/noise-views.png)"
    yield "## Whole surfaces (unorganized clouds)\n\nMean F1 at 1 spacing."
    yield tables.by_noise(rows, False, "f1@1.0")
    if any(row.get("ceiling") for row in rows):
        yield "Where points lie at random, or on lines 10 times as far apart as their steps, many a stretch of an edge has no point within a spacing. The mean F1 at 1 spacing of edgel's default beside the best that any choice of points could have:"
        yield tables.ceilings(rows)
    yield "Mean F1 at 2.5 spacings."
    yield tables.by_noise(rows, False, "f1@2.5")
    yield "![F1 against noise, whole surfaces](benchmarks/noise-whole.png)"


def _by_scene(rows: list[Row]) -> Iterator[str]:
    yield "## By view and sampling\n\nMean F1 at 2.5 spacings, noise 0 and 0.1, without outliers."
    yield tables.by_scene(
        rows, "view", sorted({row["view"] for row in rows}), lambda row: row["noise"] <= 0.1 and row["outliers"] == 0
    )
    yield "## By shape\n\nMean F1 at 2.5 spacings, noise 0 and 0.1, without outliers."
    shapes = sorted({row["shape"] for row in rows if "all" in row})
    yield tables.by_scene(rows, "shape", shapes, lambda row: row["noise"] <= 0.1 and row["outliers"] == 0)
    yield "## Outliers\n\nMean F1 at 2.5 spacings by outliers in percent, noise 0 and 0.1."
    yield tables.by_scene(rows, "outliers", sorted({row["outliers"] for row in rows}), lambda row: row["noise"] <= 0.1)
    yield "## Negatives\n\nFound points farther than 2.5 spacings from any true edge, in 1000 points, on shapes without a crease (sphere, torus, wavy sheet, plane; their outlines and borders are true edges), by noise, without outliers."
    yield tables.negatives(rows)


def _details(results: dict[str, Any], rows: list[Row]) -> Iterator[str]:
    if results.get("geometry"):
        yield "## Geometry of creases\n\nMedian errors of edgel's creases (default) on scenes without noise: position in spacings; direction, the worse of both faces' normals, and the turn, in degrees; and for which share of the crease points they are known."
        yield tables.geometry(results["geometry"])
    if results.get("wedges"):
        yield "## Wedges\n\nShare of a wedge's edge that edgel's default finds, within 1 and within 2.5 spacings, by the angle it turns (degrees); no noise."
        yield tables.wedges(results["wedges"])
    if results.get("convexity"):
        yield '## Outside\n\nCreases of closed solids with `orient="outward"`: share of the true ones found that are told convex or concave, and share of those told that are right.'
        yield tables.rows_of(results["convexity"])
        yield "Rims of holes, by radius and noise, in spacings: mean of how far the position lies outside (negative: inside) the rim, its spread, and the median deviation stated (in two directions)."
        yield tables.rows_of(results["rims"])
    yield "## By the turn of the crease\n\nF1 at 1 spacing, all scenes of noise 0 without outliers, by the angle the surface turns (degrees)."
    yield tables.by_turn(rows)
    yield "![F1 against the turn of the crease](benchmarks/angle.png)"
    yield "## All measures\n\nMeans over all scenes with edges. Zero tolerance is against points within half a spacing of an edge; distances in spacings."
    yield tables.measures(rows)
    if results["published"]:
        yield "## Published models\n\nMean F1 at zero tolerance on public models, per point. *Published* rows are the authors' own (`published.csv`), measured on exactly these points; edgel's default is scored by its creases only."
        yield tables.published_scores(results["published"])
    yield "## Normals of all points\n\nAngle to the true normal, degrees, k = 16: median and 95th percentile away from creases, and within 1.5 spacings of one."
    lines = [[r["scene"], r["method"], *(tables.cell(r[key], 2) for key in list(r)[2:])] for r in results["normals"]]
    yield tables.table(["scene", "method", *list(results["normals"][0])[2:]], lines)


def _speed(results: dict[str, Any]) -> Iterator[str]:
    yield "## Speed\n\nThe tee, simulated with as many points; seconds, medians of 5 interleaved rounds on 2 threads, whatever index is needed included."
    yield tables.times(results["speed"], "normals of all points")
    yield "![time of normals](benchmarks/time-normals.png)"
    yield tables.times(results["speed"], "edges")
    yield "![time of edges](benchmarks/time-edges.png)"
    if results.get("frames"):
        yield "Organized clouds: the default beside PCL's organized edges with either of its normals, and beside Open3D's normals of all points; in brackets how many times as long the default takes. PCL takes the parallel view as one from afar; a list of points it cannot take."
        yield tables.frame_times(results["frames"])
    if results.get("memory"):
        yield tables.memory(results["memory"])
    if results.get("first_run"):
        yield "The first run, with an empty cache of kernels, and small clouds: medians of five, CPU of all processes."
        yield first_run.table(results["first_run"])
    yield "Stages of both methods at 647,984 points."
    lines = [[s["method"], s["stage"], f"{s['seconds']:.4f}"] for s in results["stages"]]
    yield tables.table(["method", "stage", "s"], lines)
    yield from _limits(results)


def _limits(results: dict[str, Any]) -> Iterator[str]:
    if results["promises"]:
        yield "### What edgel promises\n\nMedians of interleaved rounds on 2 threads, indexes included (`benchmarks/promises.py`)."
        yield promises.table(results["promises"])
    yield "### How far from the limit\n\nBytes that have to move and operations that have to be done, at least, of each stage on the tee (`benchmarks/roofline.py`)."
    yield roofline.table(results["roofline"])
    if results["growth"]:
        yield "### Growth\n\nA wavy plateau, each size in a process of its own (`benchmarks/growth.py`); *projection* is the default detector with its outlines from an orthographic view."
        yield growth.table(results["growth"])
        yield "![time a point as clouds grow](benchmarks/growth.png)"
