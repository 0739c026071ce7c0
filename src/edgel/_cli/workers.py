"""``--workers``: several clouds at a time, each in a process of its own, so that what ends one stops no other."""

from __future__ import annotations

import os
from collections.abc import Generator, Sequence
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any

from edgel._cli.errors import ExitCode
from edgel._cli.jobs import Job
from edgel._cli.outcome import Failed, Told, Work, attempt
from edgel._cli.progress import Watch
from edgel._cli.signals import Terminated, listen
from edgel._kernels.threads import num_threads

_PATIENCE = 5.0  # seconds for a process to clear away what it began
_processes = get_context("spawn")  # forks would inherit threads' locks


class _Worker:
    """A process that does one job after the other."""

    def __init__(self, work: Work, threads: int) -> None:
        self.pipe, theirs = _processes.Pipe()
        self.process = _processes.Process(target=_serve, args=(theirs, work, threads), daemon=True)
        self.process.start()
        theirs.close()  # so that its end is seen here
        self.number = -1

    def begin(self, number: int, job: Job) -> None:
        self.number = number
        with suppress(OSError):  # a process that has ended is seen by `receive`
            self.pipe.send(job)

    def receive(self) -> str | Told | Failed:
        """Return the stage that began, or what came of the job."""
        try:
            return self.pipe.recv()
        except (EOFError, OSError):
            self.process.join(_PATIENCE)
            what = f"its process ended without a word (exit code {self.process.exitcode})"
            remedy = "not enough memory perhaps: try fewer --workers"
            return Failed(ExitCode.DATA, f"{what}; {remedy}", what)


def _serve(pipe: Connection, work: Work, threads: int) -> None:
    """Do the jobs that come through a pipe, until it is closed or the program is to end."""
    listen()
    os.environ.setdefault("EDGEL_NUM_THREADS", str(threads))
    # Whoever interrupts the program says so to its first process, which tells of it.
    with suppress(EOFError, OSError, KeyboardInterrupt, Terminated):
        while True:
            pipe.send(attempt(work, pipe.recv(), pipe.send))


def side_by_side(jobs: Sequence[Job], work: Work, watch: Watch, workers: int) -> Generator[tuple[Job, Told | Failed]]:
    """Yield the jobs in their order with what came of them; up to `workers` are done at the same time."""
    workers = min(workers, len(jobs))
    threads = max(1, num_threads() // workers)
    results: dict[int, Told | Failed] = {}
    left = iter(range(len(jobs)))
    busy: list[_Worker] = []
    try:
        for number in [next(left) for _ in range(workers)]:
            busy.append(_Worker(work, threads))
            busy[-1].begin(number, jobs[number])
        told = 0
        while busy:
            watch.begin(f"{len(results)} of {len(jobs)} done")
            ready: list[Any] = wait([worker.pipe for worker in busy])
            for worker in [worker for worker in busy if worker.pipe in ready]:
                word = worker.receive()
                if isinstance(word, str):
                    watch(f"{word}, {jobs[worker.number].source}")
                    continue
                results[worker.number] = word
                number = next(left, None)
                if number is None or not worker.process.is_alive():
                    busy.remove(worker)
                    worker.pipe.close()
                if number is not None:
                    if worker not in busy:
                        worker = _Worker(work, threads)
                        busy.append(worker)
                    worker.begin(number, jobs[number])
            while told in results:
                yield jobs[told], results[told]
                told += 1
    finally:
        for worker in busy:
            worker.process.terminate()
        for worker in busy:
            worker.process.join(_PATIENCE)
