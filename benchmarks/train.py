"""Train the trees of `edgel.evidence` on random scenes of `edgel.synth`, and write their weights into the package.

Run: python benchmarks/train.py [--scenes 700] (15 minutes on two cores; features are kept in benchmarks/cache/training).
Needs `pip install edgel[train]`. Nothing of the benchmark and no real data is seen in training: see `training.scene`.
"""

from __future__ import annotations

import argparse
import os
from multiprocessing import get_context
from pathlib import Path

import lightgbm
import numpy as np
import training

from edgel import evidence, metrics
from edgel.kdtree import build_index

CACHE = Path(__file__).parent / "cache" / "training"
OUT = Path(evidence.__file__).parent / evidence.WEIGHTS
TREES = {"crease": (250, 63), "outline": (150, 63), "screen": (60, 15)}  # trees and leaves of each forest
NEAR, SHARE_NEAR, SHARE_FAR = 3.0, 0.35, 0.12  # of the points that are no edge, within so many spacings of one or not
OPTIONS = {
    "objective": "binary",
    "learning_rate": 0.08,
    "min_data_in_leaf": 40,
    "feature_fraction": 0.6,
    "bagging_fraction": 0.7,
    "bagging_freq": 1,
    "num_threads": 2,
    "deterministic": True,
    "verbose": -1,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=700)
    options = parser.parse_args()
    CACHE.mkdir(parents=True, exist_ok=True)
    with get_context("spawn").Pool(2, initializer=one_thread) as pool:
        for done, path in enumerate(pool.imap(prepare, range(options.scenes)), start=1):
            print(f"\r{done} of {options.scenes} scenes: {path.name}", end="", flush=True)
    features, labels, weights = (np.concatenate(part) for part in zip(*map(load, range(options.scenes)), strict=True))
    print(f"\n{len(features):,} points, {labels[:, 0].sum():,} on creases, {labels[:, 1].sum():,} on outlines")
    wanted = {"crease": labels[:, 0], "outline": labels[:, 1], "screen": labels.any(axis=1)}
    arrays = {}
    for name, (trees, leaves) in TREES.items():
        seen = features[:, : evidence.NUM_CHEAP] if name == "screen" else features
        data = lightgbm.Dataset(seen, wanted[name], weight=weights)
        model = lightgbm.train(OPTIONS | {"num_leaves": leaves}, data, trees)
        arrays |= {f"{name}.{key}": value for key, value in flatten(model).items()}
    np.savez_compressed(OUT, **arrays)
    print(f"{OUT}: {OUT.stat().st_size / 1e3:.0f} kB")


def one_thread() -> None:
    os.environ["EDGEL_NUM_THREADS"] = "1"


def prepare(seed: int) -> Path:
    """Gather the evidence of some points of a scene: all on edges, a share of the others, weighted accordingly."""
    path = CACHE / f"{seed}.npz"
    if path.exists():
        return path
    scene = training.scene(seed)
    labels, counts = training.labels(scene)
    xyz = np.ascontiguousarray(scene.cloud.xyz[np.isfinite(scene.cloud.xyz).all(axis=1)])
    edge, near = labels.any(axis=1), np.zeros(len(xyz), bool)
    if edge.any():
        near = metrics.nearest(xyz, xyz[edge]).distances[:, 0] < NEAR * scene.spacing
    share = np.where(edge, 1.0, np.where(near, SHARE_NEAR, SHARE_FAR))
    rows = np.flatnonzero(counts & (np.random.default_rng(seed).random(len(xyz)) < share))
    index = build_index(xyz)
    found = evidence.examine(index, evidence.survey(index), np.ascontiguousarray(xyz[rows]))
    part = path.with_suffix(".part.npz")
    np.savez(part, features=found.features, labels=labels[rows], weights=(1 / share[rows]).astype(np.float32))
    part.replace(path)
    return path


def load(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    with np.load(CACHE / f"{seed}.npz") as stored:
        return stored["features"], stored["labels"], stored["weights"]


def flatten(model: lightgbm.Booster) -> dict[str, np.ndarray]:
    """Lay trees out one after the other, as `edgel.evidence.forest.Forest` has them."""
    roots, feature, threshold, right = [], [], [], []

    def add(node: dict) -> None:
        place = len(feature)
        leaf = "split_feature" not in node
        feature.append(-1 if leaf else node["split_feature"])
        threshold.append(node["leaf_value"] if leaf else node["threshold"])
        right.append(0)
        if not leaf:
            add(node["left_child"])
            right[place] = len(feature)
            add(node["right_child"])

    for tree in model.dump_model()["tree_info"]:
        roots.append(len(feature))
        add(tree["tree_structure"])
    return {
        "roots": np.array(roots, np.int32),
        "feature": np.array(feature, np.int16),
        "threshold": np.array(threshold, np.float32),
        "right": np.array(right, np.int32),
    }


if __name__ == "__main__":
    main()
