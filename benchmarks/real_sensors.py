"""Real sensors, truth that no detector made: edgel and PCL's organized edges, frame by frame in turn, figures and time.

Run: python benchmarks/real_sensors.py [--real ../shared/real] [--part dev] [--only mosd,ycbv] [--quick]. Prints tables in Markdown; make bench
measures the same. The sets lie beside the repository, with the program that scores them (`score.py`, which says what each
figure means), and are left out where they are absent. The frames in `benchmarks/real` are always there: of the sweeps with a board the
figures of `real_frames.board_figures`, of the others the number of edge points.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import real_frames
from real_frames import Frame
from report_tables import cell, table
from rivals import programs

import edgel

SETS = ("mosd", "ycbv", "lidar_board", "ahn3_bgt", "stereo")
ROUNDS, QUICK_FRAMES = 3, 3
EDGEL, PCL = "edgel default", "PCL organized, gradient"
NOT_ORGANIZED = ("ahn3_bgt",)
Detector = Callable[[np.ndarray], np.ndarray]
Row = dict[str, Any]


def detect_edgel(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Kinds of points (H, W, 3) or (N, 3) by `edgel.detect`, and its seconds."""
    organized = points.ndim == 3
    cloud = edgel.Cloud(points, viewpoint=np.zeros(3) if organized else None)
    start = time.perf_counter()
    edges = edgel.detect(cloud)
    seconds = time.perf_counter() - start
    kind = np.zeros(len(cloud), np.uint8)
    kind[edges.index] = edges.kind
    return kind.reshape(points.shape[:-1]), seconds


def detect_pcl(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Kinds of points (H, W, 3), metres, the camera at the origin, by PCL with its documented defaults; and its seconds."""
    bits, seconds = programs.run(
        "pcl_organized",
        edgel.Cloud(points),
        "u1",
        axes=np.eye(3),
        origin=np.zeros(3),
        scale=1.0,
        use_range=int(np.nanmin(points[..., 2]) <= 0),  # a sweep looks all around: no common Z
        method="gradient",
        smoothing=10.0,
        max_depth_change=0.02,
        depth_threshold=0.02,
        max_search=50,
        low=0.4,
        high=1.1,
    )
    return bits.reshape(points.shape[:2]), seconds


class Turns:
    """Both detectors on the same frame in turn, the first time that either is asked; afterwards their answers are given back."""

    def __init__(self, detectors: dict[str, Callable[[np.ndarray], tuple[np.ndarray, float]]], rounds: int) -> None:
        self.detectors, self.rounds = detectors, rounds
        self.answers: dict[bytes, dict[str, np.ndarray]] = {}
        self.seconds: dict[str, list[float]] = {name: [] for name in detectors}

    def of(self, name: str) -> Detector:
        return lambda points: self._answers(points)[name]

    def _answers(self, points: np.ndarray) -> dict[str, np.ndarray]:
        key = hashlib.sha256(np.ascontiguousarray(points)).digest()
        if key not in self.answers:
            took: dict[str, list[float]] = {name: [] for name in self.detectors}
            self.answers[key] = {}
            for turn in range(self.rounds + (not self.seconds[EDGEL])):  # the first of all warms up
                for name, detector in self.detectors.items():
                    self.answers[key][name], seconds = detector(points)
                    if turn >= (not self.seconds[EDGEL]):
                        took[name].append(seconds)
            for name, each in took.items():
                self.seconds[name].append(float(np.median(each)))
        return self.answers[key]


def detectors(organized: bool) -> dict[str, Callable[[np.ndarray], tuple[np.ndarray, float]]]:
    """Those that can take such clouds and are there."""
    found = {EDGEL: detect_edgel}
    if organized and programs.missing("pcl_organized") is None:
        found[PCL] = detect_pcl
    return found


def run(real: Path, part: str = "dev", only: Sequence[str] = (), quick: bool = False) -> list[Row]:
    """Figures and median time of each detector on each set and on the repository's own frames."""
    if (why := programs.missing("pcl_organized")) is not None:
        print(f"skipped: {PCL}: {why}")
    rounds = 1 if quick else ROUNDS
    rows: list[Row] = []
    if (real / "score.py").is_file():
        rows = list(_shared_rows(real, part, only, quick))
    else:
        print(f"skipped: {', '.join(SETS)}: {real / 'score.py'} is not there")
    return rows if only else [*rows, *of_repository(real_frames.frames(), rounds)]


def _shared_rows(real: Path, part: str, only: Sequence[str], quick: bool) -> Iterator[Row]:
    score = loaded(real / "score.py")
    for name in SETS:
        folder = real / name / part
        if only and name not in only:
            continue
        if not folder.is_dir():
            print(f"skipped: {name}: {folder} is not there")
            continue
        turns = Turns(detectors(name not in NOT_ORGANIZED), 1 if quick else ROUNDS)
        with tempfile.TemporaryDirectory() as few:
            looked_at = fewer(folder, Path(few)) if quick else folder
            for method in turns.detectors:
                figures = getattr(score, name)(str(looked_at), turns.of(method))
                yield row(name, method, figures, turns.seconds[method])


def loaded(path: Path) -> ModuleType:
    """Import a program from its file."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def fewer(folder: Path, into: Path) -> Path:
    """Copy the first frames of a set and what belongs to them; a set of other files whole."""
    left_out = sorted(folder.glob("*.npz"))[QUICK_FRAMES:]
    for file in folder.iterdir():
        if not any(file.name.startswith(one.stem) for one in left_out):
            shutil.copy(file, into)
    return into


def of_repository(frames: Sequence[Frame], rounds: int) -> list[Row]:
    """The same for frames of this repository, a set for each sensor."""
    rows = []
    for name in dict.fromkeys(frame.name.split("_")[0] for frame in frames):
        turns = Turns(detectors(True), rounds)
        found: dict[str, list[dict[str, float]]] = {method: [] for method in turns.detectors}
        for frame in (frame for frame in frames if frame.name.split("_")[0] == name):
            assert frame.cloud.shape is not None
            points = frame.cloud.xyz.reshape(*frame.cloud.shape, 3)
            for method, each in found.items():
                kind = turns.of(method)(points)
                each.append(real_frames.board_figures(frame, kind.ravel()) if frame.board is not None else shares(kind))
        for method, each in found.items():
            figures = {key: np.mean([one[key] for one in each]) for key in each[0]} | {"frames": len(each)}
            rows.append(row(f"{name} (repository)", method, figures, turns.seconds[method]))
    return rows


def shares(kind: np.ndarray) -> dict[str, float]:
    """Edge points that are outlines, and that are creases."""
    outline = int(edgel.EdgeKind.BOUNDARY | edgel.EdgeKind.OCCLUDING | edgel.EdgeKind.OCCLUDED)
    return {"outlines": int(((kind & outline) > 0).sum()), "creases": int(((kind & edgel.EdgeKind.CREASE) > 0).sum())}


def row(name: str, method: str, figures: dict[str, Any], seconds: Sequence[float]) -> Row:
    plain = {key: value if isinstance(value, int) else float(value) for key, value in figures.items()}
    return {"set": name, "method": method, "ms": 1e3 * float(np.median(seconds)), "figures": plain}


def tables(rows: Sequence[Row]) -> str:
    """Tables, in Markdown: one of each set's figures, and how many times as long as PCL a frame takes."""
    texts = []
    for name in dict.fromkeys(row["set"] for row in rows):
        mine = [row for row in rows if row["set"] == name]
        pcl = next((row["ms"] for row in mine if row["method"] == PCL), float("nan"))
        keys = list(mine[0]["figures"])
        lines = [
            [
                row["method"],
                *(number(row["figures"][key]) for key in keys),
                f"{row['ms']:.1f}",
                cell(row["ms"] / pcl, 2),
            ]
            for row in mine
        ]
        texts.append(table([name, *keys, "ms a frame", "times PCL"], lines))
    return "\n\n".join(texts)


def number(value: float) -> str:
    return f"{value:,}" if isinstance(value, int) else cell(value, 3 if abs(value) < 100 else 0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--real", type=Path, default=Path("../shared/real"), help="folder of the sets and score.py")
    parser.add_argument("--part", default="dev")
    parser.add_argument("--only", default="", help="names of sets, with commas")
    parser.add_argument("--quick", action="store_true", help="few frames")
    options = parser.parse_args()
    only = [name for name in options.only.split(",") if name]
    print(tables(run(options.real, options.part, only, options.quick)))


if __name__ == "__main__":
    main()
