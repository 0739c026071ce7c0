"""Many clouds at once, each with the answer that it would get alone."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from edgel._detect import detect
from edgel._kernels.parallel import run_each
from edgel.edges import Edges


@dataclass(frozen=True, eq=False)
class Detections:
    """What was found in many clouds.

    Attributes
    ----------
    edges : tuple of Edges or None
        Of each cloud, in their order; None where it failed.
    failures : dict of int to Exception
        What each cloud that failed raised, by its number, from 0.
    """

    edges: tuple[Edges | None, ...]
    failures: dict[int, Exception]

    def __len__(self) -> int:
        return len(self.edges)


def detect_many(clouds: Iterable[Any], *, find: Callable[[Any], Edges] = detect) -> Detections:
    """Find the edges of many clouds, several at a time, one a thread.

    Parameters
    ----------
    clouds : iterable of what `detect` takes
        Taken one by one, so that a generator that reads files need not hold them all.
    find : callable
        What is asked of each cloud: `detect`, or it with options of yours, as ``functools.partial(edgel.detect,
        kinds="crease")``, or `edgel.paper.detect`. It is called from several threads.

    Returns
    -------
    Detections
        The same as one by one. A cloud that fails stops no other.

    Examples
    --------
    >>> import numpy as np, edgel
    >>> x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    >>> roofs = [np.c_[x.ravel(), y.ravel(), -abs(x.ravel() - ridge)] for ridge in (8, 9, 10)]
    >>> found = edgel.detect_many([*roofs, np.zeros((0, 3))])
    >>> [edges is not None for edges in found.edges], list(found.failures)
    ([True, True, True, False], [3])
    """
    edges: dict[int, Edges | None] = {}
    failures: dict[int, Exception] = {}

    def work(numbered: tuple[int, Any]) -> None:
        number, points = numbered
        edges[number] = None
        try:
            edges[number] = find(points)
        except Exception as error:
            failures[number] = error

    run_each(work, enumerate(clouds))
    return Detections(tuple(edges[number] for number in range(len(edges))), dict(sorted(failures.items())))
