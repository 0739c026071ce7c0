"""Damaged files for every reader: python tests/fuzz/run.py [--inputs 200000] [--seconds 720] [--processes 2].

Each input has to be read or refused with a documented error: no crash, no other exception, nothing printed, at most
5 s of processor time and 200 MB + 20 times the file of memory. The inputs are spread evenly over the readers; an
input is named by its reader and number, and ``--only ply:17`` reads one again.
"""

import argparse
import json
import os
import select
import subprocess
import sys
import threading
import time
from collections import Counter, deque
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).parent
MALFORMED = Path(os.environ.get("EDGEL_DATA", HERE.parents[2] / "shared" / "data")) / "malformed"
BATCH = 50
# Processor time is measured by the worker; a machine that does much else is given time.
HANGS = 40


@dataclass
class Tally:
    """What came of the inputs, by reader."""

    outcomes: dict[str, Counter] = field(default_factory=dict)
    faults: list[tuple[str, int, str]] = field(default_factory=list)
    slowest: float = 0
    largest: int = 0

    def add(self, reader: str, result: dict) -> None:
        """Count one input."""
        self.outcomes.setdefault(reader, Counter())[result["outcome"]] += 1
        self.slowest = max(self.slowest, result.get("seconds", 0))
        self.largest = max(self.largest, result.get("growth", 0))
        if result["fault"]:
            self.faults.append((reader, result["number"], result["fault"]))

    @property
    def count(self) -> int:
        """Number of inputs."""
        return sum(sum(counter.values()) for counter in self.outcomes.values())


class _Worker:
    def __init__(self) -> None:
        command = [sys.executable, str(HERE / "fuzz_worker.py"), *([str(MALFORMED)] if MALFORMED.is_dir() else [])]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)
        self._lines = b""
        self.readers: list[str] = (self._line(600) or {"ready": []})["ready"]

    def _line(self, seconds: float) -> dict | None:
        """The next line, None when none comes in time or the process is gone."""
        pipe = self._process.stdout
        assert pipe is not None
        while b"\n" not in self._lines:
            ready, _, _ = select.select([pipe], [], [], seconds)
            more = os.read(pipe.fileno(), 1 << 16) if ready else b""
            if not more:
                return None
            self._lines += more
        line, _, self._lines = self._lines.partition(b"\n")
        return json.loads(line)

    def run(self, reader: str, first: int, count: int, tally: Tally) -> int:
        """Read `count` inputs; return how many were read before the process was lost, if it was."""
        pipe = self._process.stdin
        assert pipe is not None
        pipe.write(f"{reader} {first} {count}\n".encode())
        for number in range(first, first + count):
            result = self._line(HANGS) and self._line(HANGS)
            if not result:
                hangs = self._process.poll() is None and not self._exits()
                fault = f"hangs over {HANGS} s" if hangs else f"the process ended with {self._process.returncode}"
                tally.add(reader, {"outcome": "fault", "fault": fault, "number": number})
                self.close()
                return number - first + 1
            tally.add(reader, result)
        return count

    def _exits(self) -> bool:
        try:
            self._process.wait(2)
        except subprocess.TimeoutExpired:
            return False
        return True

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe:
                pipe.close()


def fuzz(inputs: int, seconds: float, *, first: int = 0, processes: int = 1, readers: list[str] | None = None) -> Tally:
    """Read `inputs` damaged files, spread evenly over the readers, as far as the seconds reach.

    Parameters
    ----------
    inputs : int
        How many in all.
    seconds : float
        No batch of inputs begins after this time.
    first : int
        Number of the first input of each reader.
    processes : int
    readers : list of str, optional
        Only these.
    """
    tally, lock = Tally(), threading.Lock()
    worker = _Worker()
    readers = readers or worker.readers
    each = -(-inputs // len(readers))
    work = deque((r, first + at, min(BATCH, each - at)) for at in range(0, each, BATCH) for r in readers)
    end = time.monotonic() + seconds

    def drain(worker: _Worker) -> None:
        while time.monotonic() < end:
            with lock:
                if not work:
                    break
                reader, start, count = work.popleft()
            while count:
                done = worker.run(reader, start, count, tally)
                start, count = start + done, count - done
                if tally.faults and tally.faults[-1][2].startswith(("hangs", "the process")):
                    worker.close()
                    worker = _Worker()
        worker.close()

    threads = [threading.Thread(target=lambda: drain(_Worker())) for _ in range(processes - 1)]
    for thread in threads:
        thread.start()
    drain(worker)
    for thread in threads:
        thread.join()
    return tally


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=200_000)
    parser.add_argument("--seconds", type=float, default=1e9)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--readers", nargs="*")
    parser.add_argument("--only", help="reader:number, one input")
    chosen = parser.parse_args()
    if chosen.only:
        reader, number = chosen.only.split(":")
        tally = fuzz(1, chosen.seconds, first=int(number), readers=[reader])
    else:
        tally = fuzz(
            chosen.inputs, chosen.seconds, first=chosen.first, processes=chosen.processes, readers=chosen.readers
        )
    for reader, counter in sorted(tally.outcomes.items()):
        print(f"{reader:12}", *(f"{counter[key]:8} {key}" for key in ("read", "refused", "fault")))
    print(f"{tally.count} inputs; slowest {tally.slowest:.2f} s, largest growth {tally.largest / 1e6:.0f} MB")
    for reader, number, fault in tally.faults:
        print(f"{reader}:{number} {fault}")
    sys.exit(bool(tally.faults))


if __name__ == "__main__":
    main()
