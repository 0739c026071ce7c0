"""Our covariance analysis beside the published one: does the measuring agree?

``published.csv`` has the scores of CA (Bazazian et al. 2015, as PCEDNet's authors ran it) on the models of
``../shared/data/truth``, but not its k and threshold. One pair for all models is looked for here, then every model is
shown with it: precision, recall and F1 of ours and of the published row.

Run: python benchmarks/rivals/check_ca.py [folder of the truth] [--fit]
"""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rivals.edges import surface_variation

import edgel
from edgel import metrics

TRUTH = Path(__file__).resolve().parents[3] / "shared" / "data" / "truth"
K, THRESHOLD = 0, 0.0  # set by --fit below


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
    """The pair whose precision and recall are nearest to the published ones, absolute difference, mean over models."""
    thresholds = np.round(np.geomspace(0.001, 0.2, 80), 4)
    tried = []
    for k in (6, 8, 10, 12, 15, 16, 20, 25, 30, 40, 50, 70, 100):
        variations = {name: surface_variation(models[name][0], scale(models[name][0]), k) for name in published}
        for threshold in thresholds:
            apart = []
            for name, row in published.items():
                ours = metrics.score_labels(variations[name] > threshold, models[name][1])
                apart.append(
                    [abs(ours.precision - row["precision"]), abs(ours.recall - row["recall"]), abs(ours.f1 - row["f1"])]
                )
            tried.append((float(np.mean(apart)), *np.mean(apart, axis=0).tolist(), k, float(threshold)))
    tried.sort()
    print("mean difference (all, precision, recall, F1), k, threshold: the nearest, and the nearest of each k")
    for one in tried[:5]:
        print("  {:.3f}   {:.3f} {:.3f} {:.3f}   {:3d} {:.4f}".format(*one))
    print()
    for k in sorted({one[4] for one in tried}):
        print("  {:.3f}   {:.3f} {:.3f} {:.3f}   {:3d} {:.4f}".format(*next(one for one in tried if one[4] == k)))
    return tried[0][4], tried[0][5]


def scale(xyz: np.ndarray) -> float:
    """A length of the order of the spacing; the variation does not depend on it."""
    return float(np.ptp(xyz, axis=0).max() / np.sqrt(len(xyz)))


def table(models: dict, published: dict, k: int, threshold: float) -> None:
    """Print ours beside the published rows."""
    print(f"\nk = {k}, threshold = {threshold}")
    print(f"{'model':22} {'ours: precision recall F1':>26} {'published: precision recall F1':>32} {'dF1':>7}")
    apart = []
    for name, (xyz, labels) in models.items():
        ours = metrics.score_labels(surface_variation(xyz, scale(xyz), k) > threshold, labels)
        line = f"{name:22} {ours.precision:13.3f} {ours.recall:6.3f} {ours.f1:5.3f}"
        if name in published:
            row = published[name]
            apart.append(ours.f1 - row["f1"])
            line += f" {row['precision']:19.3f} {row['recall']:6.3f} {row['f1']:5.3f} {apart[-1]:+7.3f}"
        print(line)
    print(
        f"mean difference in F1 {np.mean(apart):+.3f}, mean absolute {np.mean(np.abs(apart)):.3f}, above 0.1: {np.sum(np.abs(apart) > 0.1)} of {len(apart)}"
    )


if __name__ == "__main__":
    main()
