"""Our covariance analysis beside the published one: do two codes measure the same?

``published.csv`` has the scores of CA (Bazazian et al. 2015, as the authors of PCEDNet ran it) on 14 of the 21 models of
``../shared/data/truth``, but neither k nor threshold. One pair for all models was looked for (``--fit``): K and THRESHOLD
below. Printed for every model: precision, recall and F1 with that pair, the published row, and the threshold at which our
precision and recall come nearest to the published ones, with what is then left between them.

Run: python benchmarks/rivals/check_ca.py [folder of the truth] [--fit]
"""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import edgel
from edgel import metrics
from rivals.edges import surface_variation

TRUTH = Path(__file__).resolve().parents[3] / "shared" / "data" / "truth"
K, THRESHOLD = 10, 0.0210  # found by --fit
THRESHOLDS = np.geomspace(0.0005, 0.3, 1500)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("truth", nargs="?", type=Path, default=TRUTH)
    parser.add_argument(
        "--fit", action="store_true", help="search the k and the threshold nearest to the published rows"
    )
    options = parser.parse_args()
    models = load(options.truth)
    published = rows(options.truth / "published.csv")
    k, threshold = fit(models, published) if options.fit else (K, THRESHOLD)
    table(models, published, k, threshold)


def load(folder: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Coordinates and labels of every model, by its name."""
    models = {}
    for path in sorted(folder.glob("*.ply")):
        cloud = edgel.read(path)
        models[path.stem] = (cloud.xyz, np.asarray(cloud.attributes["edge"]))
    return models


def rows(path: Path) -> dict[str, dict[str, float]]:
    """The published rows of CA, by the model's name."""
    with path.open() as file:
        found = [row for row in csv.DictReader(file) if row["method"] == "CA"]
    return {
        f"{row['dataset']}_{row['model']}": {name: float(row[name]) for name in ("precision", "recall", "f1")}
        for row in found
    }


def fit(models: dict, published: dict) -> tuple[int, float]:
    """The k with which one threshold a model comes nearest to the published rows, then the one threshold with it."""
    mean_apart = {}
    for k in (6, 8, 9, 10, 11, 12, 16, 20, 30, 50):
        curves = {name: scores(*models[name], k) for name in published}
        nearest = [own_threshold(curves[name], row)[1] for name, row in published.items()]
        left = np.mean([apart(curves[name], row) for name, row in published.items()], axis=0)
        mean_apart[k] = float(np.mean(nearest)), float(left.min()), float(THRESHOLDS[left.argmin()])
        print(
            "k {:3d}, left of precision + recall: own thresholds {:.4f}, one threshold {:.3f} ({:.4f})".format(
                k, *mean_apart[k]
            )
        )
    best = min(mean_apart, key=lambda k: mean_apart[k][0])
    return best, mean_apart[best][2]


def scores(xyz: np.ndarray, labels: np.ndarray, k: int) -> np.ndarray:
    """Precision, recall and F1 at each of THRESHOLDS, (3, T); points to be ignored left out."""
    variation = surface_variation(xyz, scale(xyz), k)
    true, counted = np.sort(variation[labels == 1]), np.sort(variation[labels != metrics.IGNORE])
    hits = len(true) - np.searchsorted(true, THRESHOLDS, side="right")
    found = len(counted) - np.searchsorted(counted, THRESHOLDS, side="right")
    precision, recall = hits / np.maximum(found, 1), hits / len(true)
    return np.array([precision, recall, 2 * hits / (found + len(true))])


def own_threshold(curve: np.ndarray, row: dict[str, float]) -> tuple[float, float]:
    """The threshold at which precision and recall are nearest to a published row, and their summed difference there."""
    left = apart(curve, row)
    return float(THRESHOLDS[left.argmin()]), float(left.min())


def apart(curve: np.ndarray, row: dict[str, float]) -> np.ndarray:
    """How far precision and recall together are from a published row, at each threshold."""
    return np.abs(curve[0] - row["precision"]) + np.abs(curve[1] - row["recall"])


def scale(xyz: np.ndarray) -> float:
    """A length of the order of the spacing; the variation does not depend on it."""
    return float(np.ptp(xyz, axis=0).max() / np.sqrt(len(xyz)))


def table(models: dict, published: dict, k: int, threshold: float) -> None:
    """Print ours beside the published rows."""
    print(f"\nk = {k}, threshold = {threshold:.4f}      precision, recall, F1")
    print(f"{'model':26}{'ours':>18} {'published':>20} {'dF1':>7}   own threshold, left of precision + recall")
    differences, left = [], []
    for name, (xyz, labels) in models.items():
        curve = scores(xyz, labels, k)
        ours = curve[:, np.searchsorted(THRESHOLDS, threshold)]
        line = f"{name:26}" + " ".join(f"{value:5.3f}" for value in ours)
        if name in published:
            row = published[name]
            own, rest = own_threshold(curve, row)
            differences.append(ours[2] - row["f1"])
            left.append(rest)
            line += (
                "    "
                + " ".join(f"{value:5.3f}" for value in row.values())
                + f" {differences[-1]:+7.3f}   {own:.4f} {rest:.4f}"
            )
        print(line)
    size = np.abs(differences)
    print(
        f"\none threshold: F1 differs by {size.mean():.3f} in the mean, by more than 0.1 on {np.sum(size > 0.1)} of {len(size)} models"
    )
    print(
        f"own thresholds: precision and recall together differ by {np.mean(left):.4f} in the mean, {np.max(left):.4f} at most"
    )


if __name__ == "__main__":
    main()
