"""The measurements behind the defaults of `edgel.paper.detect`, on the paper's two parts.

Run: python benchmarks/paper_defaults.py
"""

from itertools import product

import fittings
import numpy as np

from edgel import paper, synth
from edgel._neighbors.kdtree import build_index
from edgel._neighbors.knn import knn
from edgel._neighbors.spacing import occupied_spacing
from edgel.synth import Solid


def flat(points: np.ndarray) -> np.ndarray:
    return np.c_[points[:, :2], np.zeros(len(points))]


def measure(solid: Solid, xyz: np.ndarray, spacings: float, high: float, tolerance: float) -> str:
    """Share of edge points, share of edge pixels away from every true edge, share of the true outline reached."""
    pixel = spacings * occupied_spacing(xyz, xyz.min(axis=0), xyz.max(axis=0))
    width = round(np.ptp(xyz[:, 0]) / pixel)
    found = paper.detect(xyz, width=width, low=0.4 * high, high=high, tolerance=tolerance * pixel)
    truth = np.concatenate([curve.points for curve in solid.edges])
    outline = np.concatenate([curve.points for curve in solid.boundaries])
    rows, cols = np.nonzero(found.edge_map)
    size = np.array(found.grid.pixel)
    centres = np.c_[found.grid.centres(rows, cols), np.zeros(len(rows))]
    stray = knn(build_index(flat(truth)), centres, 1).distances[:, 0] > 2 * size.max()
    reached = knn(build_index(flat(xyz[found.index])), flat(outline), 1).distances[:, 0] < 1.0
    return f"{100 * found.share:5.1f} | {100 * stray.mean():4.1f} | {100 * reached.mean():4.0f}"


def density(xyz: np.ndarray, kept: float) -> str:
    """Share of edge points when only some of the points are kept: tolerance in pixels, and as it is by default."""
    points = xyz[np.random.default_rng(0).random(len(xyz)) < kept]
    default = paper.detect(points)
    pixels = paper.detect(points, tolerance=4 * max(default.grid.pixel))
    return f"{len(points):,} | {100 * pixels.share:.1f} | {100 * default.share:.1f}"


def main() -> None:
    scans = [(solid, fittings.scan(solid).cloud.xyz) for solid in (synth.tee(), synth.elbow())]
    head = (
        "| tee: share % | stray pixels % | outline within 1 mm % | elbow: share % | stray % | outline % |\n"
        + "|---" * 7
        + "|"
    )
    print("high, at pixels of 4 spacings and a tolerance of 4 pixels; low = 0.4 high\n\n| high", head)
    for high in (10, 15, 20, 25, 30, 35, 40, 50, 100, 200):
        print(f"| {high} |", " | ".join(measure(*scan, 4.0, high, 4.0) for scan in scans), "|")
    print("\npixel (spacings) and tolerance (pixels), at high = 40\n\n| pixel, tolerance", head)
    for spacings, tolerance in product((1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 8.0), (0.707, 1.0, 2.0, 4.0, 8.0)):
        print(
            f"| {spacings}, {tolerance} |", " | ".join(measure(*scan, spacings, 40.0, tolerance) for scan in scans), "|"
        )
    print("\nthinner scans\n\n| part | points | share %, 4 pixels | share %, default |\n|---|---|---|---|")
    for (solid, xyz), kept in product(scans, (1.0, 0.25, 0.0625)):
        print(f"| {solid.name} | {density(xyz, kept)} |")


if __name__ == "__main__":
    main()
