"""Train the trees of `edgel.evidence` on random scenes of `edgel.synth`, and write their weights into the package.

Run: python benchmarks/train.py [--scenes 1400] (40 minutes on two cores; evidence is kept in benchmarks/cache/training).
Needs `pip install edgel[train]`. Nothing of the benchmark and no real data is seen in training: see `training.example`.

The first trees judge each point by its own evidence. What the second ones hear of the neighbours' chances has to be what
the first say of scenes they were not trained on: each half of the scenes is judged by trees trained on the other half.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from multiprocessing import get_context
from pathlib import Path

import lightgbm
import numpy as np
import training

from edgel import evidence, metrics
from edgel.evidence import Evidence
from edgel.evidence.forest import Forest, evaluate
from edgel.kdtree import build_index

CACHE = Path(__file__).parent / "cache" / "training"
OUT = Path(evidence.__file__).parent / evidence.WEIGHTS
KINDS = ("crease", "outline")
FIRST = {"crease": (160, 31), "outline": (100, 31)}  # trees and leaves of each forest
SECOND = {"crease": (300, 63), "outline": (150, 63)}
SCREEN = (60, 15)
LOOSE = 0.5  # of the screen's threshold: points it would nearly look at are examined in training too
UNLIKELY = 0.02  # share of all the others
NEAR, SHARE_NEAR, SHARE_FAR = 3.0, 0.4, 0.15  # of points that are no edge, within so many spacings of one or not
OPTIONS = {
    "objective": "binary",
    "learning_rate": 0.08,
    "min_data_in_leaf": 40,
    "feature_fraction": 0.6,
    "bagging_fraction": 0.7,
    "bagging_freq": 1,
    "num_threads": 1,  # two forests at a time
    "deterministic": True,
    "max_bin": 127,
    "verbose": -1,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=1400)
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    CACHE.mkdir(parents=True, exist_ok=True)
    with get_context("spawn").Pool(2, initializer=one_thread) as pool:
        for done, path in enumerate(pool.imap(prepare, range(options.scenes)), start=1):
            print(f"\r{done} of {options.scenes} scenes: {path.name}", end="", flush=True)
    features, labels, weights = (np.concatenate(part) for part in zip(*map(load, range(options.scenes)), strict=True))
    half = np.concatenate([np.full(len(load(seed)[2]), seed % 2) for seed in range(options.scenes)])
    print(f"\n{len(features):,} points, {labels[:, 0].sum():,} on creases, {labels[:, 1].sum():,} on outlines")
    for name, array in {"features": features, "labels": labels, "weights": weights, "half": half}.items():
        np.save(CACHE / f"{name}.npy", array)
    del features
    whole = [(f"first {kind}", FIRST[kind], None) for kind in KINDS]
    apart = [(f"first {kind}", FIRST[kind], other) for kind in KINDS for other in (0, 1)]
    with get_context("spawn").Pool(2, initializer=one_thread) as pool:
        forests = dict(zip([*whole, *apart], pool.imap(train, [*whole, *apart]), strict=True))
        screen = pool.apply(train, [("screen", SCREEN, None)])
        trees = [{kind: forests[f"first {kind}", FIRST[kind], other] for kind in KINDS} for other in (0, 1)]
        looked = list(pool.imap(look_around, [(seed, trees[seed % 2]) for seed in range(options.scenes)], chunksize=4))
        print("the first trees", flush=True)
        for name, part in zip(("features", "labels", "weights"), zip(*looked, strict=True), strict=True):
            np.save(CACHE / f"{name}.npy", np.concatenate(part))
        del looked
        second = pool.map(train, [(kind, SECOND[kind], None) for kind in KINDS], chunksize=1)
    named = {"screen": screen, **{name: forests[name, size, None] for name, size, _ in whole}}
    named |= dict(zip(KINDS, second, strict=True))
    fields = Forest.__dataclass_fields__
    np.savez_compressed(options.out, **{f"{n}.{key}": getattr(f, key) for n, f in named.items() for key in fields})
    print(f"{options.out}: {options.out.stat().st_size / 1e3:.0f} kB")


def one_thread() -> None:
    os.environ["EDGEL_NUM_THREADS"] = "1"


def prepare(seed: int) -> Path:
    """Gather the evidence of the points of a scene that deserve a closer look, and of a few others."""
    path = CACHE / f"{seed}.npz"
    if path.exists():
        return path
    example = training.example(seed)
    xyz = np.ascontiguousarray(example.xyz)
    index = build_index(xyz)
    surveyed = evidence.survey(index)
    edge = example.labels.any(axis=1)[index.order]
    likely = surveyed.likely > LOOSE * evidence.SCREEN
    chosen = likely | edge | (np.random.default_rng(seed).random(len(xyz)) < UNLIKELY)
    places = np.flatnonzero(chosen)
    rows = index.order[places]
    found = evidence.examine(index, surveyed, np.ascontiguousarray(xyz[rows]))
    best, _ = found.best_fit()
    near = np.zeros(len(xyz), bool)
    if edge.any():
        near = metrics.nearest(xyz, xyz[index.order[edge]]).distances[:, 0] < NEAR * example.spacing
    part = path.with_suffix(".part.npz")
    np.savez(
        part,
        xyz=xyz,
        places=places,
        features=found.features,
        best=best,
        sheets=found.sheets[np.arange(len(best)), best],
        labels=example.labels[rows],
        counts=example.counts[rows],
        near=near[rows],
        share=np.where(likely | edge, 1.0, UNLIKELY)[places].astype(np.float32),
    )
    part.replace(path)
    return path


def chosen(stored: Sequence, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Which of the examined points are learned from, and how much each counts: all on edges, a share of the others."""
    edge = stored["labels"].any(axis=1)
    share = np.where(edge, 1.0, np.where(stored["near"], SHARE_NEAR, SHARE_FAR))
    kept = stored["counts"] & (np.random.default_rng([seed, 1]).random(len(edge)) < share)
    return kept, (1 / (share * stored["share"]))[kept].astype(np.float32)


def load(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    with np.load(CACHE / f"{seed}.npz") as stored:
        kept, weights = chosen(stored, seed)
        return stored["features"][kept], stored["labels"][kept], weights


def look_around(job: tuple[int, dict[str, Forest]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Add what trees that have not seen the scene say of the neighbours."""
    seed, trees = job
    with np.load(CACHE / f"{seed}.npz") as stored:
        stored = dict(stored)
    chances = {kind: evaluate(trees[kind], stored["features"]) for kind in KINDS}
    good = (np.stack(list(chances.values())) > evidence.SECOND).any(axis=0) & (stored["share"] == 1)
    best = stored["best"]
    sheets = np.zeros((len(best), len(evidence.FITS), stored["sheets"].shape[1]), np.float32)
    sheets[np.arange(len(best)), best] = stored["sheets"]
    found = Evidence(stored["features"], sheets).take(good)
    index = build_index(stored["xyz"])
    features = evidence.look_around(
        index, stored["places"][good], found, chances["crease"][good], chances["outline"][good]
    )
    kept, weights = chosen(stored, seed)
    of_kept = good[kept]
    return features[kept[good]], stored["labels"][kept & good], weights[of_kept]


def train(job: tuple[str, tuple[int, int], int | None]) -> Forest:
    """Train a forest, on all scenes or on those that are not of one half."""
    name, (trees, leaves), other = job
    features, labels, weights = (np.load(CACHE / f"{n}.npy", mmap_mode="r") for n in ("features", "labels", "weights"))
    rows = slice(None) if other is None else np.flatnonzero(np.load(CACHE / "half.npy") != other)
    columns = slice(evidence.NUM_CHEAP if name == "screen" else None)
    wanted = labels.any(axis=1) if name == "screen" else labels[:, KINDS.index(name.split()[-1])]
    data = lightgbm.Dataset(features[rows, columns], wanted[rows], weight=weights[rows])
    return flatten(lightgbm.train(OPTIONS | {"num_leaves": leaves}, data, trees))


def flatten(model: lightgbm.Booster) -> Forest:
    """Lay the trees out one after the other."""
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
    return Forest(
        roots=np.array(roots, np.int32),
        feature=np.array(feature, np.int16),
        threshold=np.array(threshold, np.float32),
        right=np.array(right, np.int32),
    )


if __name__ == "__main__":
    main()
