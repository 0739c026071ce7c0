"""Train the trees of `edgel._surface` on random scenes of `edgel.synth`, and write their weights into the package.

Run: python training/train.py [--scenes 2200] (half an hour on two cores; evidence is kept in training/cache). Needs
`pip install edgel[train]`. Nothing of the benchmark and no real data is seen in training: see `training_examples`.

The trees of both screenings, by leaves of an octree and by points, say where an edge could be; the others learn from
what they let through. The first trees classify each point by its own evidence. What the second ones hear of the
neighbours' probabilities has to be what the first say of scenes they were not trained on: each half of the scenes is
classified by trees trained on the other half.

Landscapes teach what crowns of trees look like, and cost edges of parts. So these forests are each a mean of two: one
has seen no landscape, the other has, away from its edges. The screenings, which shall lose no edge, have seen none.

The weights in the package are of an earlier form of this, since they find more of small roofs: see docs/decisions.md.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.pool import Pool
from pathlib import Path

import lightgbm
import numpy as np
from training_examples import example, is_landscape

import edgel._surface
from edgel import metrics
from edgel._surface import features
from edgel._surface.classify import SECOND as LIKELY
from edgel._surface.evidence import Evidence
from edgel._surface.forest import Forest, evaluate, read_forests, write_forests
from edgel._surface.screen import POINT as SCREENED
from edgel._surface.training import add_context, blend, screen_cloud, screening_features

CACHE = Path(__file__).parent / "cache"
OUT = Path(edgel._surface.__file__).parent / "weights.npz"
SCREENING = CACHE / "screening.npz"  # forests of both screenings
SPREAD = CACHE / "spread.npy"
KINDS = ("crease", "outline")
SCREENING_SCENES = 500  # scenes that the trees of the screenings learn from
TURNS = 3  # ways in which each is turned for the leaves, whose cells lie along the axes
LOOSE = 0.5  # of the screening's threshold: points that it would nearly let through are gathered in training too
UNLIKELY = 0.02  # share of all the others
NEAR, SHARE_NEAR, SHARE_FAR = 3.0, 0.4, 0.15  # of points that are no edge, within so many spacings of one or not
OUTDOORS = 0.4  # weight of the forests that have seen landscapes: one half costs eaves, a quarter leaves crowns full
VAGUE = 0.07  # of its spread among the scenes: error added, point by point, to the cloud's statistics
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


@dataclass(frozen=True)
class Size:
    """How a forest is grown."""

    trees: int
    leaves: int
    rate: float = 0.08


LEAF, SCREEN = Size(200, 31, 0.15), Size(60, 15, 0.1)
FIRST = {"crease": Size(160, 31), "outline": Size(100, 31)}
SECOND = {"crease": Size(300, 63), "outline": Size(150, 63)}


@dataclass(frozen=True, eq=False)
class Table:
    """Rows to learn from.

    Attributes
    ----------
    features : (R, F) float32
    labels : (R, 2) bool
        Crease, outline.
    weights : (R,) float32
    """

    features: np.ndarray
    labels: np.ndarray
    weights: np.ndarray

    @staticmethod
    def join(tables: Iterable[Table]) -> Table:
        """Put the rows of several together."""
        columns = zip(*((table.features, table.labels, table.weights) for table in tables), strict=True)
        return Table(*(np.concatenate(column) for column in columns))

    def save(self) -> None:
        """Keep the table for the processes that train."""
        for name in Table.__dataclass_fields__:
            np.save(CACHE / f"{name}.npy", getattr(self, name))

    @staticmethod
    def load() -> Table:
        """Take the table that was saved last, without reading it."""
        return Table(*(np.load(CACHE / f"{name}.npy", mmap_mode="r") for name in Table.__dataclass_fields__))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=2200)
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    CACHE.mkdir(parents=True, exist_ok=True)
    with get_context("spawn").Pool(2, initializer=one_thread) as pool:
        screening = train_screenings(pool, min(options.scenes, SCREENING_SCENES))
        write_forests(str(SCREENING), screening)
        for done, path in enumerate(pool.imap(prepare, range(options.scenes)), start=1):
            print(f"\r{done} of {options.scenes} scenes: {path.name}", end="", flush=True)
    with get_context("spawn").Pool(2, initializer=one_thread) as pool:
        first, halves = train_first(pool, options.scenes)
        second = train_second(pool, options.scenes, halves)
    write_forests(str(options.out), screening | first | second)
    print(f"{options.out}: {options.out.stat().st_size / 1e3:.0f} kB")


def one_thread() -> None:
    os.environ["EDGEL_NUM_THREADS"] = "1"


def train_screenings(pool: Pool, scenes: int) -> dict[str, Forest]:
    """Train the forests of both screenings."""
    seeds = [seed for seed in range(2 * scenes) if not is_landscape(seed)][:scenes]
    points, leaves = (Table.join(tables) for tables in zip(*pool.imap(cheap_evidence, seeds), strict=True))
    cloud = features.POINT.block("cloud")
    spread = points.features[:, cloud].std(axis=0)
    np.save(SPREAD, spread)
    blur(points.features, cloud, spread, 0)
    blur(leaves.features, features.LEAF.block("cloud"), spread, 1)
    print(f"{len(points.weights):,} points and {len(leaves.weights):,} leaves to learn the screening from", flush=True)
    return {
        name: grow(table.features, table.labels.any(axis=1), table.weights, size)
        for name, table, size in (("screen", points, SCREEN), ("leaf", leaves, LEAF))
    }


def cheap_evidence(seed: int) -> tuple[Table, Table]:
    """Cheap evidence of some points of a scene, and that of all leaves, with the scene turned in some ways."""
    made, rng = example(seed), np.random.default_rng(seed)
    share = np.where(made.labels.any(axis=1), 1.0, SHARE_FAR)
    asked = made.counts & (rng.random(len(share)) < share)
    turns = [np.eye(3)] + [np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(TURNS - 1)]
    described = [screening_features(made.xyz @ turn, asked) for turn in turns]
    tables = []
    for found in described:
        inside = np.zeros((len(found.leaves), 2), bool)
        for kind in range(len(KINDS)):
            inside[found.leaf[made.labels[:, kind]], kind] = True
        tables.append(Table(found.leaves, inside, np.ones(len(inside))))
    found = described[0]
    return Table(found.features, made.labels[found.points], 1 / share[found.points]), Table.join(tables)


def prepare(seed: int) -> Path:
    """Gather the evidence of the points of a scene that the screening lets through, and of a few others."""
    path = CACHE / f"{seed}.npz"
    if path.exists():
        return path
    made = example(seed)
    xyz, edge = made.xyz, made.labels.any(axis=1)
    screened = screen_cloud(xyz, read_forests(str(SCREENING)))
    likely = screened.probability > LOOSE * SCREENED
    asked = likely | edge | (np.random.default_rng(seed).random(len(xyz)) < UNLIKELY)
    points, evidence = screened.gather_evidence(asked)
    near = np.zeros(len(xyz), bool)
    if edge.any():
        near = metrics.nearest(xyz, xyz[edge]).distances[:, 0] < NEAR * made.spacing
    part = path.with_suffix(".part.npz")
    np.savez(
        part,
        xyz=screened.index.by_point(),
        points=points,
        features=evidence.features,
        fit=evidence.fit,
        placed=evidence.placed,
        labels=made.labels[points],
        counts=made.counts[points],
        near=near[points],
        share=np.where(likely | edge, 1.0, UNLIKELY)[points].astype(np.float32),
    )
    part.replace(path)
    return path


def blur(rows: np.ndarray, columns: slice, spread: np.ndarray, seed: int) -> None:
    """Add errors to the cloud's statistics: else trees know a scene by its exact numbers, and learn it by heart."""
    noise = np.random.default_rng([seed, 2]).standard_normal((len(rows), len(spread)))
    rows[:, columns] += (VAGUE * spread * noise).astype(np.float32)


def train_first(pool: Pool, scenes: int) -> tuple[dict[str, Forest], list[dict[str, Forest]]]:
    """Train the first forests on all scenes; and for each half of them, by kind, on the scenes of the other half."""
    table = keep(map(own_evidence, range(scenes)))
    creases, outlines = table.labels.sum(axis=0)
    print(f"\n{len(table.weights):,} points, {creases:,} on creases, {outlines:,} on outlines", flush=True)
    wanted = [(kind, half) for half in (None, 0, 1) for kind in KINDS]
    jobs = [(kind, FIRST[kind], half, outdoors) for kind, half in wanted for outdoors in (False, True)]
    both = dict(zip(wanted, pairs_of(pool.imap(train, jobs)), strict=True))
    first = {f"first {kind}": blend(*both[kind, None], OUTDOORS) for kind in KINDS}
    return first, [{kind: blend(*both[kind, half], OUTDOORS) for kind in KINDS} for half in (0, 1)]


def train_second(pool: Pool, scenes: int, halves: list[dict[str, Forest]]) -> dict[str, Forest]:
    """Train the second forests, by what those of the halves say of the neighbours."""
    jobs = [(seed, halves[seed % 2]) for seed in range(scenes)]
    keep(pool.imap(evidence_in_context, jobs, chunksize=4))
    print("the first trees are trained", flush=True)
    jobs = [(kind, SECOND[kind], None, outdoors) for kind in KINDS for outdoors in (False, True)]
    pairs = pairs_of(pool.imap(train, jobs))
    return {kind: blend(*pair, OUTDOORS) for kind, pair in zip(KINDS, pairs, strict=True)}


def keep(tables: Iterable[Table]) -> Table:
    """Keep the rows to learn from, a table for each seed, and what scenes they are of."""
    tables = list(tables)
    rows = [len(table.weights) for table in tables]
    np.save(CACHE / "half.npy", np.repeat(np.arange(len(tables)) % 2, rows))
    np.save(CACHE / "landscape.npy", np.repeat([is_landscape(seed) for seed in range(len(tables))], rows))
    joined = Table.join(tables)
    joined.save()
    return joined


def learned(stored: Mapping[str, np.ndarray], seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Which points with evidence are learned from, and how much each counts: all on edges, a share of the others.

    Of landscapes what is near an edge is left out: where boxes overlap, truth and what beams could see differ.
    """
    edge = stored["labels"].any(axis=1)
    share = np.where(edge, 1.0, np.where(stored["near"], SHARE_NEAR, SHARE_FAR))
    kept = stored["counts"] & (np.random.default_rng([seed, 1]).random(len(edge)) < share)
    if is_landscape(seed):
        kept &= ~edge & ~stored["near"]
    return kept, (1 / (share * stored["share"])).astype(np.float32)


def own_evidence(seed: int) -> Table:
    """What the first trees learn from a scene."""
    with np.load(CACHE / f"{seed}.npz") as stored:
        kept, weights = learned(stored, seed)
        rows = stored["features"][kept]
        blur(rows, features.POINT.block("cloud"), np.load(SPREAD), seed)
        return Table(rows, stored["labels"][kept], weights[kept])


def evidence_in_context(job: tuple[int, dict[str, Forest]]) -> Table:
    """What the second trees learn from a scene: its evidence, and what trees that never saw it say of neighbours."""
    seed, trees = job
    with np.load(CACHE / f"{seed}.npz") as file:
        stored = dict(file)
    crease, outline = (evaluate(trees[kind], stored["features"]) for kind in KINDS)
    likely = (np.maximum(crease, outline) > LIKELY) & (stored["share"] == 1)
    evidence = Evidence(*(stored[name] for name in Evidence.__dataclass_fields__)).take(likely)
    rows = add_context(stored["xyz"], stored["points"][likely], evidence, crease[likely], outline[likely])
    kept, weights = learned(stored, seed)
    rows = rows[kept[likely]]
    blur(rows, features.POINT.block("cloud"), np.load(SPREAD), seed)
    return Table(rows, stored["labels"][kept & likely], weights[kept & likely])


def train(job: tuple[str, Size, int | None, bool]) -> Forest:
    """Train a forest of one kind on the table kept last: on all scenes or one half's complement, outdoors or not."""
    kind, size, half, outdoors = job
    table = Table.load()
    left_out = np.load(CACHE / "half.npy") == (-1 if half is None else half)
    if not outdoors:
        left_out |= np.load(CACHE / "landscape.npy")
    rows = np.flatnonzero(~left_out)
    return grow(table.features[rows], table.labels[rows, KINDS.index(kind)], table.weights[rows], size)


def grow(rows: np.ndarray, wanted: np.ndarray, weights: np.ndarray, size: Size) -> Forest:
    data = lightgbm.Dataset(rows, wanted, weight=weights)
    options = OPTIONS | {"num_leaves": size.leaves, "learning_rate": size.rate}
    return flatten(lightgbm.train(options, data, size.trees))


def pairs_of(forests: Iterator[Forest]) -> Iterator[tuple[Forest, Forest]]:
    """Take two at a time."""
    return zip(forests, forests, strict=True)


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
