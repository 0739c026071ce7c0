"""What edgel promises of its speed, measured: ratios to others in interleaved rounds of one run, processes, files.

Run: python benchmarks/promises.py (part of make bench; three minutes). Prints a table in Markdown.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import fittings
import laspy
import numpy as np
from errata import code_1_seconds
from rivals import NORMALS, RIVALS
from speed import interleaved, timed

import edgel
from edgel import paper, synth
from edgel.synth import Solid

K = 16
PART_POINTS = 1_000_000
VCM_POINTS = 100_000  # CGAL's takes minutes for all, and no less for each of more points
ONE_EACH = ("projection", "canny", "back-projection")
Row = dict[str, Any]


def row(work: str, wanted: str, measured: str, *, holds: bool) -> Row:
    return {"work": work, "wanted": wanted, "measured": measured, "holds": holds}


def run(rounds: int = 7) -> list[Row]:
    """Measure all of it."""
    return [*of_tee(rounds), *of_parts(rounds), *of_processes(5), *of_files(rounds)]


def of_tee(rounds: int) -> list[Row]:
    """All-point normals, the paper and the default on the published parts, in one interleaved run."""
    points = fittings.scan(synth.tee()).cloud.xyz
    found = paper.detect(points)
    work: dict[str, Callable[[], float]] = {
        rival.name: lambda rival=rival: rival.run(points, K)[1] for rival in NORMALS if rival.missing() is None
    }
    work["image"] = lambda: sum(paper.detect(points).seconds[stage] for stage in ONE_EACH)
    work["paper"] = timed(lambda: paper.detect(points))
    work["default"] = timed(lambda: edgel.detect(points))
    times = {name: float(np.median(each)) for name, each in interleaved(work, rounds).items()}
    code_1 = code_1_seconds(points, found) * int(found.edge_map.sum())
    open3d, own = times.get("Open3D", np.nan), times["edgel"]
    rows = []
    for name, least in (("Open3D", 5), ("small_gicp", 4), ("PCL OMP", 4)):
        if name in times:
            gain = times[name] / own
            rows.append(
                row(
                    f"normals of all points of the tee, {1e3 * own:.0f} ms, against {name}, {1e3 * times[name]:.0f} ms",
                    f">= {least} x",
                    f"{gain:.1f} x",
                    holds=gain >= least,
                )
            )
    image = times["image"]
    rows += [
        row(
            f"paper: projection, Canny, back-projection, {1e3 * image:.1f} ms, of Open3D's normals",
            "<= 1/60",
            f"1/{open3d / image:.0f}",
            holds=open3d / image >= 60,
        ),
        row(
            f"the same against the paper's Code 1, corrected, in NumPy (25 pixels timed, {code_1:.0f} s for all)",
            ">= 10,000 x",
            f"{code_1 / image:,.0f} x",
            holds=code_1 / image >= 10_000,
        ),
        _paper_share("tee", times["paper"], image + own),
    ]
    elbow = fittings.scan(synth.elbow()).cloud.xyz
    of_elbow = interleaved(
        {
            "image": lambda: sum(paper.detect(elbow).seconds[stage] for stage in ONE_EACH),
            "paper": timed(lambda: paper.detect(elbow)),
            "normals": timed(lambda: edgel.estimate_normals(elbow, num_neighbors=K)),
        },
        rounds,
    )
    mid = {name: float(np.median(each)) for name, each in of_elbow.items()}
    return [
        *rows,
        _paper_share("elbow", mid["paper"], mid["image"] + mid["normals"]),
        row(
            f"default on the tee, all outputs, {1e3 * times['default']:.0f} ms, of Open3D's normals",
            "<= 1/20",
            f"1/{open3d / times['default']:.1f}",
            holds=open3d / times["default"] >= 20,
        ),
    ]


def _paper_share(name: str, seconds: float, normals: float) -> Row:
    share = seconds / normals
    return row(
        f"paper on the {name} with edge normals, {1e3 * seconds:.0f} ms, of projection and normals of all points",
        "<= 10 %",
        f"{share:.0%}",
        holds=share <= 0.1,
    )


def of_parts(rounds: int) -> list[Row]:
    """The default on whole surfaces of a million points against Open3D's normals and CGAL's Voronoi covariances."""
    others = {rival.name: rival for rival in NORMALS if rival.missing() is None}
    vcm = next((rival for rival in RIVALS if rival.name == "CGAL VCM" and rival.missing() is None), None)
    rows = []
    for solid in (synth.stepped_block(), synth.gear(), synth.thin_plate()):
        points, few = sampled(solid, PART_POINTS), sampled(solid, VCM_POINTS)
        work: dict[str, Callable[[], float]] = {"default": timed(lambda points=points: edgel.detect(points))}
        if "Open3D" in others:
            work["Open3D"] = lambda points=points: others["Open3D"].run(points, K)[1]
        if vcm is not None:
            spacing = float(np.sqrt(solid.area / len(few)))
            work["VCM"] = lambda few=few, spacing=spacing: vcm.run(edgel.Cloud(few), spacing, vcm.defaults).seconds
        times = {name: float(np.median(each)) for name, each in interleaved(work, max(rounds // 2, 1)).items()}
        own = times["default"]
        name = f"default on a {solid.name.replace('_', ' ')} of {len(points):,} points all round, {own:.2f} s,"
        if "Open3D" in times:
            share = own / times["Open3D"]
            rows.append(
                row(f"{name} of Open3D's normals, {times['Open3D']:.2f} s", "<= 1", f"{share:.2f}", holds=share <= 1)
            )
        if "VCM" in times:
            gain = times["VCM"] / len(few) / (own / len(points))
            rows.append(row(f"{name} against CGAL VCM, per point", ">= 100 x", f"{gain:.0f} x", holds=gain >= 100))
    return rows


def sampled(solid: Solid, count: int) -> np.ndarray:
    """Points at random over all of a solid, in random order."""
    return synth.sample(solid, spacing=float(np.sqrt(solid.area / count))).cloud.xyz


def of_processes(rounds: int) -> list[Row]:
    """Import, the command line with a warm cache, and the first run of all, which compiles."""
    with tempfile.TemporaryDirectory() as folder:
        cloud, edges = Path(folder, "tee.ply"), Path(folder, "edges.ply")
        edgel.write(cloud, fittings.scan(synth.tee()).cloud)
        detect = [str(Path(sys.executable).with_name("edgel")), "detect", str(cloud), "-o", str(edges)]
        cold = _process(detect, os.environ | {"NUMBA_CACHE_DIR": str(Path(folder, "cache"))})
        _process(detect)
        whole = float(np.median([_process(detect) for _ in range(rounds)]))
        bare = float(np.median([_process([sys.executable, "-c", "import numpy"]) for _ in range(rounds)]))
        each = [_process([sys.executable, "-X", "importtime", "-c", "import edgel"]) for _ in range(rounds)]
        imported = float(np.median(each))
    return [
        row(
            f"`python -c 'import edgel'`, the whole process ({bare:.2f} s of it Python with NumPy)",
            "<= 0.35 s",
            f"{imported:.2f} s",
            holds=imported <= 0.35,
        ),
        row(
            "`edgel detect tee.ply -o edges.ply`, whole process, warm", "<= 1.5 s", f"{whole:.2f} s", holds=whole <= 1.5
        ),
        row("the same, first run ever, all compilation", "<= 30 s", f"{cold:.1f} s", holds=cold <= 30),
    ]


def _process(command: Sequence[str], environment: Any = None) -> float:
    start = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True, env=environment)
    return time.perf_counter() - start


def of_files(rounds: int) -> list[Row]:
    """Throughput of binary PLY, and LAZ against laspy with lazrs alone; files warm in the page cache."""
    points = fittings.scan(synth.tee()).cloud.xyz
    with tempfile.TemporaryDirectory() as folder:
        ply, laz = Path(folder, "tee.ply"), Path(folder, "tee.laz")
        cloud = edgel.Cloud(np.tile(points, (4, 1)))
        edgel.write(laz, edgel.Cloud(points))
        edgel.write(ply, cloud)
        size = ply.stat().st_size
        times = interleaved(
            {
                "read": timed(lambda: edgel.read(ply)),
                "write": timed(lambda: edgel.write(ply, cloud)),
                "LAZ": timed(lambda: edgel.read(laz)),
                "laspy": timed(lambda: all_dimensions(laz)),
            },
            rounds,
        )
        mid = {name: float(np.median(each)) for name, each in times.items()}
    read, write = size / mid["read"] / 1e9, size / mid["write"] / 1e9
    return [
        row(f"reading a binary PLY of {size / 1e6:.0f} MB", ">= 1 GB/s", f"{read:.1f} GB/s", holds=read >= 1),
        row("writing it", ">= 0.5 GB/s", f"{write:.1f} GB/s", holds=write >= 0.5),
        row(
            f"reading a LAZ of {len(points):,} points against laspy with lazrs alone, all dimensions, "
            f"{1e3 * mid['laspy']:.0f} ms",
            "<= 1",
            f"{mid['LAZ'] / mid['laspy']:.2f}",
            holds=mid["LAZ"] <= mid["laspy"],
        ),
    ]


def all_dimensions(path: Path) -> dict[str, np.ndarray]:
    """Read with laspy alone what `edgel.read` gives: coordinates, and every dimension as an array."""
    las = laspy.read(path)
    return {"xyz": las.xyz, **{name: np.array(las[name]) for name in las.point_format.dimension_names}}


def table(rows: Sequence[Row]) -> str:
    lines = ["| work | wanted | measured | |", "|---|---|---|---|"]
    return "\n".join(
        lines
        + [
            f"| {r['work']} | {r['wanted']} | {r['measured']} | {'holds' if r['holds'] else '**fails**'} |"
            for r in rows
        ]
    )


if __name__ == "__main__":
    print(table(run()))
