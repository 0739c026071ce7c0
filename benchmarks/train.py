"""Train the trees of `edgel._surface` on random scenes of `edgel.synth`, and write their weights into the package.

Run: python benchmarks/train.py [--scenes 2000] (15 minutes on two cores; evidence is kept in benchmarks/cache/training).
Needs `pip install edgel[train]`. Nothing of the benchmark and no real data is seen in training: see `training.example`.

Glances, at leaves of the index and at each point's nearest, say where to look closer; the rest learns from what they let
through. The first trees judge each point by its own evidence. What the second ones hear of the neighbours' chances has to be what
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
from edgel._neighbors.kdtree import build_index, leaf_starts
from edgel._surface import Evidence, coarse
from edgel._surface.forest import Forest, evaluate, read_forests

CACHE = Path(__file__).parent / "cache" / "training"
OUT = Path(evidence.__file__).parent / evidence.WEIGHTS
GLANCES = CACHE / "glances.npz"
SPREAD = CACHE / "spread.npy"
CLOUD = slice(
    evidence.NUM_CHEAP - evidence.NUM_CLOUD, evidence.NUM_CHEAP
)  # columns that say what is typical of the cloud
SKIMMED = 500  # scenes that the trees of the first glances learn from
KINDS = ("crease", "outline")
FIRST = {"crease": (160, 31), "outline": (100, 31)}  # trees and leaves of each forest
SECOND = {"crease": (300, 63), "outline": (150, 63)}
SCREEN = (60, 15)
COARSE = (100, 15)
LOOSE = 0.5  # of the screen's threshold: points it would nearly look at are examined in training too
UNLIKELY = 0.02  # share of all the others
NEAR, SHARE_NEAR, SHARE_FAR = 3.0, 0.4, 0.15  # of points that are no edge, within so many spacings of one or not
VAGUE = 0.07  # of its spread among the scenes: error added, point by point, to what is typical of the cloud
OPTIONS = {
    "objective": "binary",
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
    parser.add_argument("--scenes", type=int, default=2000)
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    CACHE.mkdir(parents=True, exist_ok=True)
    skimmed = range(min(options.scenes, SKIMMED))
    with get_context("spawn").Pool(2, initializer=one_thread) as pool:
        points, wanted, weights, leaves, edge = (
            np.concatenate(part) for part in zip(*pool.imap(skim, skimmed), strict=True)
        )
        spread = points[:, -evidence.NUM_CLOUD :].std(axis=0)
        np.save(SPREAD, spread)
        blur(points, slice(-evidence.NUM_CLOUD, None), spread, 0)
        blur(leaves, slice(-evidence.NUM_CLOUD, None), spread, 1)
        print(f"{len(points):,} points and {len(leaves):,} leaves skimmed", flush=True)
        glances = {
            "screen": grow(points, wanted, weights, SCREEN, 0.1),
            "coarse": grow(leaves, edge, np.ones(len(edge)), COARSE, 0.25),
        }
        save(GLANCES, glances)
        for done, path in enumerate(pool.imap(prepare, range(options.scenes)), start=1):
            print(f"\r{done} of {options.scenes} scenes: {path.name}", end="", flush=True)
    parts = list(map(load, range(options.scenes)))
    half = np.concatenate([np.full(len(part[2]), seed % 2) for seed, part in enumerate(parts)])
    features, labels, weights = (np.concatenate(part) for part in zip(*parts, strict=True))
    print(f"\n{len(features):,} points, {labels[:, 0].sum():,} on creases, {labels[:, 1].sum():,} on outlines")
    for name, array in {"features": features, "labels": labels, "weights": weights, "half": half}.items():
        np.save(CACHE / f"{name}.npy", array)
    del features, parts
    whole = [(f"first {kind}", FIRST[kind], None) for kind in KINDS]
    apart = [(f"first {kind}", FIRST[kind], other) for kind in KINDS for other in (0, 1)]
    with get_context("spawn").Pool(2, initializer=one_thread) as pool:
        forests = dict(zip([*whole, *apart], pool.imap(train, [*whole, *apart]), strict=True))
        trees = [{kind: forests[f"first {kind}", FIRST[kind], other] for kind in KINDS} for other in (0, 1)]
        looked = list(pool.imap(look_around, [(seed, trees[seed % 2]) for seed in range(options.scenes)], chunksize=4))
        print("the first trees", flush=True)
        for name, part in zip(("features", "labels", "weights"), zip(*looked, strict=True), strict=True):
            np.save(CACHE / f"{name}.npy", np.concatenate(part))
        del looked
        second = pool.map(train, [(kind, SECOND[kind], None) for kind in KINDS], chunksize=1)
    first = {name: forests[name, size, None] for name, size, _ in whole}
    save(options.out, glances | first | dict(zip(KINDS, second, strict=True)))
    print(f"{options.out}: {options.out.stat().st_size / 1e3:.0f} kB")


def one_thread() -> None:
    os.environ["EDGEL_NUM_THREADS"] = "1"


def skim(seed: int) -> tuple[np.ndarray, ...]:
    """Cheap evidence of some points of a scene, which are edge points, and how much each counts; the same of all leaves."""
    example = training.example(seed)
    index = build_index(np.ascontiguousarray(example.xyz))
    edge, counts = example.labels.any(axis=1)[index.order], example.counts[index.order]
    cloud, _ = evidence.census(index)
    share = np.where(edge, 1.0, SHARE_FAR)
    places = np.flatnonzero(counts & (np.random.default_rng(seed).random(len(edge)) < share))
    leaves, _, _ = coarse.look(index)
    starts = leaf_starts(index)[:-1]
    points, leaves = (
        np.concatenate([part, np.broadcast_to(cloud, (len(part), len(cloud)))], axis=1)
        for part in (evidence.describe(index, places), leaves)
    )
    return points, edge[places], 1 / share[places], leaves, np.logical_or.reduceat(edge, starts)


def prepare(seed: int) -> Path:
    """Gather the evidence of the points of a scene that deserve a closer look, and of a few others."""
    path = CACHE / f"{seed}.npz"
    if path.exists():
        return path
    example = training.example(seed)
    xyz = np.ascontiguousarray(example.xyz)
    index = build_index(xyz)
    surveyed = evidence.survey(index, read_forests(str(GLANCES)))
    edge = example.labels.any(axis=1)[index.order]
    likely = surveyed.likely > LOOSE * evidence.SCREEN
    chosen = likely | edge | (np.random.default_rng(seed).random(len(xyz)) < UNLIKELY)
    places = np.flatnonzero(chosen)
    rows = index.order[places]
    found = evidence.examine(index, surveyed, np.ascontiguousarray(xyz[rows]))
    near = np.zeros(len(xyz), bool)
    if edge.any():
        near = metrics.nearest(xyz, xyz[index.order[edge]]).distances[:, 0] < NEAR * example.spacing
    part = path.with_suffix(".part.npz")
    np.savez(
        part,
        xyz=xyz,
        places=places,
        features=found.features,
        fit=found.fit,
        placed=found.placed,
        labels=example.labels[rows],
        counts=example.counts[rows],
        near=near[rows],
        share=np.where(likely | edge, 1.0, UNLIKELY)[places].astype(np.float32),
    )
    part.replace(path)
    return path


def blur(features: np.ndarray, columns: slice, spread: np.ndarray, seed: int) -> None:
    """Add errors to what is typical of the cloud: else trees know a scene by its exact numbers, and learn it by heart."""
    noise = np.random.default_rng([seed, 2]).standard_normal((len(features), len(spread)))
    features[:, columns] += (VAGUE * spread * noise).astype(np.float32)


def chosen(stored: Sequence, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Which of the examined points are learned from, and how much each counts: all on edges, a share of the others."""
    edge = stored["labels"].any(axis=1)
    share = np.where(edge, 1.0, np.where(stored["near"], SHARE_NEAR, SHARE_FAR))
    kept = stored["counts"] & (np.random.default_rng([seed, 1]).random(len(edge)) < share)
    return kept, (1 / (share * stored["share"]))[kept].astype(np.float32)


def load(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    with np.load(CACHE / f"{seed}.npz") as stored:
        kept, weights = chosen(stored, seed)
        features = stored["features"][kept]
        blur(features, CLOUD, np.load(SPREAD), seed)
        return features, stored["labels"][kept], weights


def look_around(job: tuple[int, dict[str, Forest]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Add what trees that have not seen the scene say of the neighbours."""
    seed, trees = job
    with np.load(CACHE / f"{seed}.npz") as stored:
        stored = dict(stored)
    chances = {kind: evaluate(trees[kind], stored["features"]) for kind in KINDS}
    good = (np.stack(list(chances.values())) > evidence.SECOND).any(axis=0) & (stored["share"] == 1)
    found = Evidence(*(stored[name] for name in ("features", "fit", "placed"))).take(good)
    index = build_index(stored["xyz"])
    features = evidence.look_around(
        index, stored["places"][good], found, chances["crease"][good], chances["outline"][good]
    )
    kept, weights = chosen(stored, seed)
    features, of_kept = features[kept[good]], good[kept]
    blur(features, CLOUD, np.load(SPREAD), seed)
    return features, stored["labels"][kept & good], weights[of_kept]


def train(job: tuple[str, tuple[int, int], int | None]) -> Forest:
    """Train a forest of the kept points, of all scenes or of those that are not of one half."""
    name, size, other = job
    features, labels, weights = (np.load(CACHE / f"{n}.npy", mmap_mode="r") for n in ("features", "labels", "weights"))
    rows = slice(None) if other is None else np.flatnonzero(np.load(CACHE / "half.npy") != other)
    return grow(features[rows], labels[rows, KINDS.index(name.split()[-1])], weights[rows], size)


def grow(
    features: np.ndarray, wanted: np.ndarray, weights: np.ndarray, size: tuple[int, int], rate: float = 0.08
) -> Forest:
    trees, leaves = size
    data = lightgbm.Dataset(features, wanted, weight=weights)
    return flatten(lightgbm.train(OPTIONS | {"num_leaves": leaves, "learning_rate": rate}, data, trees))


def save(path: Path, forests: dict[str, Forest]) -> None:
    fields = Forest.__dataclass_fields__
    np.savez_compressed(path, **{f"{name}.{key}": getattr(f, key) for name, f in forests.items() for key in fields})


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
