"""Recompute the numbers behind docs/errata.md: the paper's kernels, and what its Code 1 as printed would count.

Run: python benchmarks/errata.py
"""

import time

import fittings
import numpy as np

from edgel import paper, synth
from edgel.paper.canny import gaussian_kernel

EQ_9 = np.array(
    [
        [0.0105, 0.0227, 0.0293, 0.0227, 0.0105],
        [0.0227, 0.0924, 0.1192, 0.0924, 0.0227],
        [0.0293, 0.1192, 0.1538, 0.1192, 0.0293],
        [0.0227, 0.0924, 0.1192, 0.0924, 0.0227],
        [0.0105, 0.0227, 0.0293, 0.0227, 0.0105],
    ]
)


def plain_gaussian(size: int, sigma: float) -> np.ndarray:
    """Eq. 7 as it stands, not divided by its sum."""
    offsets = np.arange(size) - size // 2
    weights = np.exp(-(offsets**2) / (2 * sigma**2))
    return np.outer(weights, weights) / (2 * np.pi * sigma**2)


def code_1_hits(points: np.ndarray, found: paper.PaperEdges) -> np.ndarray:
    """Number of points in the window of each edge pixel, in the order of MATLAB's ``find`` (column by column)."""
    t, grid = found.parameters["tolerance"], found.grid
    by_x = points[np.argsort(points[:, 0])]
    extent = grid.upper - grid.lower
    hits = []
    for col, row in zip(*np.nonzero(found.edge_map.T), strict=True):
        x = (col - grid.frame) * extent[0] / grid.width + grid.lower[0]
        y = (row - grid.frame) * extent[1] / grid.height + grid.lower[1]
        first, last = np.searchsorted(by_x[:, 0], [x - t, x + t])
        hits.append(np.count_nonzero(np.abs(by_x[first:last, 1] - y) < t))
    return np.array(hits)


def code_1_seconds(points: np.ndarray, found: paper.PaperEdges, pixels: int = 25) -> float:
    """Median time of Code 1's search for one edge pixel in NumPy."""
    t, seconds = found.parameters["tolerance"], []
    for k in np.random.default_rng(0).integers(0, len(points), pixels):
        start = time.perf_counter()
        m = np.flatnonzero(np.abs(points[:, 0] - points[k, 0]) < t)
        n = np.flatnonzero(np.abs(points[:, 1] - points[k, 1]) < t)
        np.intersect1d(m, n)
        seconds.append(time.perf_counter() - start)
    return float(np.median(seconds))


def main() -> None:
    with np.printoptions(precision=4, suppress=True):
        for name, size, sigma in (("8", 3, 1.4), ("9", 5, 1.4), ("10", 3, 2.0), ("11", 5, 2.0)):
            print(
                f"eq. {name}: {size} x {size}, sigma {sigma}: eq. 7 as it stands, sum {plain_gaussian(size, sigma).sum():.4f}"
            )
            print(plain_gaussian(size, sigma))
            print("normalised\n", gaussian_kernel(size, sigma), sep="")
    print(f"sum of eq. 9 as printed: {EQ_9.sum():.4f}")
    for part in (synth.tee(), synth.elbow()):
        points = fittings.scan(part).cloud.xyz
        found = paper.detect(points)
        hits = code_1_hits(points, found)
        seconds = code_1_seconds(points, found)
        print(
            f"{part.name}: {len(found):,} edge points, each once; {hits.sum():,} rows with repeats; "
            f"{np.maximum.accumulate(hits).sum():,} rows from Code 1 as printed; {len(hits)} edge pixels; "
            f"{1000 * seconds:.1f} ms a pixel, {seconds * len(hits):.0f} s in all"
        )


if __name__ == "__main__":
    main()
