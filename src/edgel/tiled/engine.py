"""The engine: one task a tile, in this process or by Dask, whose state is in files alone."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

_PATIENCE = 3  # workers that may die on a task before it counts as failed


@dataclass
class Engine:
    """Runs tasks, and those that failed once more, each alone.

    Attributes
    ----------
    client : dask.distributed.Client or None
        None: tasks run in this process, one after the other.
    progress : callable
        Called with a line for people.
    """

    client: Any
    progress: Callable[[str], None]

    def run(
        self,
        what: str,
        task: Callable[..., Any],
        jobs: Sequence[tuple[Any, ...]],
        check: Callable[[], None] | None = None,
    ) -> dict[int, BaseException]:
        """Run ``task(*job)`` for each; returns what those raised that failed twice, by their number.

        `check` is called when the first is done, and whenever twice as many are: what it raises ends the run.
        """
        failed = self._attempt(what, task, dict(enumerate(jobs)), check)
        for number in failed.copy():
            del failed[number]
            failed |= self._attempt(f"{what}, again", task, {number: jobs[number]})
        return failed

    def _attempt(
        self,
        what: str,
        task: Callable[..., Any],
        jobs: dict[int, tuple[Any, ...]],
        check: Callable[[], None] | None = None,
    ) -> dict[int, BaseException]:
        begin = time.monotonic()
        finish = self._by_dask(task, jobs) if self.client is not None else _here(task, jobs)
        failed = {}
        for done, (number, error) in enumerate(finish, start=1):
            left = (time.monotonic() - begin) / done * (len(jobs) - done)
            self.progress(f"{what}: {done} of {len(jobs)}, about {left:.0f} s left")
            if error is not None:
                failed[number] = error
            if check is not None and done & (done - 1) == 0:
                check()
        return failed

    def _by_dask(
        self, task: Callable[..., Any], jobs: dict[int, tuple[Any, ...]]
    ) -> Iterator[tuple[int, BaseException | None]]:
        from distributed import as_completed  # pyright: ignore[reportMissingImports]

        # Names say nothing of the work: what is done is known by its files, and a scheduler forgets.
        futures = {self.client.submit(task, *job, pure=False): number for number, job in jobs.items()}
        for future in as_completed(list(futures)):
            if future.cancelled():
                break
            error = future.exception()
            yield futures.pop(future), error
            future.release()
        if futures:
            raise ConnectionError(
                f"scheduler: that of the cluster is gone, {len(futures)} of {len(jobs)} tasks not known to be done; "
                "start one and go on with the same call, with its address"
            )


def _here(task: Callable[..., Any], jobs: dict[int, tuple[Any, ...]]) -> Iterator[tuple[int, BaseException | None]]:
    for number, job in jobs.items():
        try:
            task(*job)
        except Exception as error:
            yield number, error
        else:
            yield number, None


@contextmanager
def start(workers: int, scheduler: str | None, progress: Callable[[str], None]) -> Iterator[Engine]:
    """Start the engine: in this process for one worker, on a cluster of our own for more, or on the cluster named."""
    if scheduler is None and workers == 1:
        yield Engine(None, progress)
        return
    try:
        from dask import config
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise ModuleNotFoundError(
            "several workers need Dask distributed: pip install 'edgel[tiles]', or use one worker", name="distributed"
        ) from error
    config.set({"distributed.scheduler.allowed-failures": _PATIENCE})
    if scheduler is not None:
        with Client(scheduler) as client:
            yield Engine(client, progress)
        return
    # Each worker one task at a time, with its share of the cores; memory is bounded by the size of a tile.
    threads = max((os.cpu_count() or 1) // workers, 1)
    with (
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            memory_limit=0,
            dashboard_address=":0",  # any port: another run may have the usual one
            env={"EDGEL_NUM_THREADS": str(threads)},
        ) as cluster,
        Client(cluster) as client,
    ):
        yield Engine(client, progress)
