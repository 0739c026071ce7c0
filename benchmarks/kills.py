"""Runs in tiles that are killed at random moments, and the same command again: is the answer the undisturbed run's?

Run: python benchmarks/kills.py [client worker scheduler cluster disk] [--moments 10] [--noise 1]; prints a table in Markdown.
A moment is a random line of the run's progress and a random part of the time to the next. What dies: "client", a run in one process; of a
run on a cluster of two workers one "worker", the "scheduler", or the client ("cluster"); "disk": the file system of a run in one process
fills up (root alone may mount one of its own). Done twice are results that were whole when it died and are new after.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

VICTIMS = ("client", "disk", "worker", "scheduler", "cluster")
TILE_POINTS = 1_500
PATIENCE = 120.0  # seconds that a run whose scheduler died may take to say so
RUN = """
import sys
from edgel import tiled
out, points, scheduler, *files = sys.argv[1:]
tiled.detect(files, out, tile_points=int(points), scheduler=scheduler or None, progress=lambda line: print(line, flush=True))
"""


def street(folder: Path, noise: float) -> list[str]:
    """Write a street of houses over uneven ground in two files: 20,000 points, a spacing of 1."""
    rng = np.random.default_rng(7)
    grid = np.stack(np.meshgrid(np.arange(590.0), np.arange(34.0)), axis=-1).reshape(-1, 2)
    x, y = plan = (grid + rng.uniform(-0.45, 0.45, grid.shape)).T
    roof = (np.abs(x % 40 - 20) < 11) & (np.abs(y - 17) < 9)
    z = np.sin(x / 40) + np.where(roof, 9 + 0.6 * (9 - np.abs(y - 17)), 0) + noise * rng.standard_normal(len(x))
    files = [str(folder / f"{number}.npy") for number in range(2)]
    for number, file in enumerate(files):
        np.save(file, np.column_stack([*plan, z])[number::2])
    return files


@dataclass
class Run:
    """A run in a process of its own, and the lines that it said."""

    process: subprocess.Popen[str]
    lines: list[str] = field(default_factory=list)

    @staticmethod
    def start(files: list[str], out: Path, scheduler: str = "") -> Run:
        command = [sys.executable, "-c", RUN, str(out), str(TILE_POINTS), scheduler, *files]
        run = Run(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))
        threading.Thread(target=run._listen, daemon=True).start()
        return run

    def _listen(self) -> None:
        assert self.process.stdout is not None
        self.lines += (line for line in self.process.stdout)

    def wait_for(self, line: int) -> bool:
        """Wait for a line; says whether it came before the end."""
        while len(self.lines) <= line and self.process.poll() is None:
            time.sleep(0.002)
        return self.process.poll() is None

    def end(self, patience: float | None = None) -> str:
        """Wait for the end; returns the last line of the error, empty if there was none."""
        try:
            _, said = self.process.communicate(timeout=patience) if patience else (None, self.process.stderr.read())  # pyright: ignore
        except subprocess.TimeoutExpired:
            self.process.kill()
            return "said nothing and was stopped"
        if self.process.wait() < 0:
            return "killed"
        return said.strip().splitlines()[-1] if self.process.returncode else ""


@dataclass
class Cluster:
    """A scheduler and two workers."""

    address: str
    scheduler: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]]


@contextlib.contextmanager
def cluster(folder: Path) -> Iterator[Cluster]:
    file = folder / "scheduler.json"
    file.unlink(missing_ok=True)
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    shared = ["--scheduler-file", str(file), "--no-dashboard"]
    scheduler = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", "0", *shared], **quiet
    )
    while not file.exists():
        time.sleep(0.05)
    address = json.loads(file.read_text())["address"]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", *shared, "--nthreads", "1", "--no-nanny"]
    workers = [subprocess.Popen(worker, **quiet) for _ in range(2)]
    try:
        yield Cluster(address, scheduler, workers)
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()


def results(out: Path) -> dict[str, int]:
    """All results that are whole, and when they were written."""
    whole = [
        path for path in (out / "work").rglob("*.np[yz]") if not any(part.endswith(".part") for part in path.parts)
    ]
    return {str(path.relative_to(out)): path.stat().st_mtime_ns for path in whole}


def digest(out: Path) -> str:
    """A hash of all edge points, and of the files written."""
    total = hashlib.sha256()
    for path in sorted((out / "work" / "label").glob("*.npz")):
        with np.load(path) as found:
            for name in sorted(found.files):
                total.update(found[name].tobytes())
    for path in sorted(out.glob("*.npy")):
        total.update(path.read_bytes())
    return total.hexdigest()


@contextlib.contextmanager
def small_disk(place: Path) -> Iterator[None]:
    """Mount a file system of 128 MB."""
    place.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=128m", "none", place], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", place], check=True)


def fill(place: Path) -> None:
    """Fill the file system of a folder to the last byte."""
    with contextlib.suppress(OSError), open(place, "wb", buffering=0) as file:
        while file.write(bytes(4096)):
            pass


def strike(victim: str, run: Run, out: Path, on: Cluster | None, rng: random.Random) -> None:
    if victim == "disk":
        fill(out.parent / "filler")
    elif victim == "worker" and on is not None:
        rng.choice(on.workers).kill()
    elif victim == "scheduler" and on is not None:
        on.scheduler.kill()
    else:
        os.kill(run.process.pid, signal.SIGKILL)


def kills(
    victim: str, moments: int, folder: Path, files: list[str], lines: int, wanted: str, rng: random.Random
) -> str:
    """Kill so many runs, each once, and finish them; returns a row of the table.

    `lines` and `wanted` are how many lines an undisturbed run says, and the hash of what it finds.
    """
    alone = victim in ("client", "disk")
    same = twice = flying = told = hung = by_itself = 0
    done = []
    for moment in range(moments):
        place = folder / f"{victim}{moment}"
        out = place / "out"
        with contextlib.ExitStack() as whole, contextlib.ExitStack() as stack:
            if victim == "disk":
                whole.enter_context(small_disk(place))
            on = None if alone else stack.enter_context(cluster(folder))
            run = Run.start(files, out, on.address if on else "")
            while not run.wait_for(int(rng.uniform(1, lines))):
                raise SystemExit(f"{victim}: the run ended before it was struck: {run.end()}")
            time.sleep(rng.uniform(0, 0.05))
            strike(victim, run, out, on, rng)
            if victim == "worker":
                said = run.end()
                by_itself += not said
            else:
                said = run.end(PATIENCE)
                hung += "stopped" in said
                told += bool(said) and "stopped" not in said
            if victim in ("scheduler", "cluster") and on is not None:
                for worker in on.workers:
                    worker.kill()
            stack.close()
            before = results(out)
            flying += len(list(out.rglob("*.part")))
            (place / "filler").unlink(missing_ok=True)
            if error := Run.start(files, out).end():
                raise SystemExit(f"{victim}: the same command again failed: {error}")
            after = results(out)
            twice += sum(after[name] != when for name, when in before.items())
            done.append(len(before) / len(after))
            same += digest(out) == wanted
    return (
        f"| {victim} | {same} of {moments} | {twice} | {flying} | {min(done):.0%} to {max(done):.0%} | "
        f"{by_itself if victim == 'worker' else '-'} | "
        f"{f'{told}, {hung} hung' if victim in ('disk', 'scheduler') else '-'} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("victims", nargs="*", default=VICTIMS)
    parser.add_argument("--moments", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--noise", type=float, default=0.03, help="of a spacing: what is looked at more coarsely too")
    options = parser.parse_args()
    rng = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = street(folder, options.noise)
        run = Run.start(files, folder / "undisturbed")
        if error := run.end():
            raise SystemExit(error)
        lines, wanted = len(run.lines) - 1, digest(folder / "undisturbed")
        print(
            "| what died | same answer | whole results done twice | half written | done before | went on alone | said so |"
        )
        print("|---|---|---|---|---|---|---|", flush=True)
        for victim in options.victims:
            print(kills(victim, options.moments, folder, files, lines, wanted, rng), flush=True)


if __name__ == "__main__":
    main()
