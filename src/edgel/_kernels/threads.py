"""How many threads kernels run on."""

from __future__ import annotations

import os


def num_threads() -> int:
    """Return how many threads kernels use: ``EDGEL_NUM_THREADS``, or the cores this process may run on."""
    asked = os.environ.get("EDGEL_NUM_THREADS", "")
    if asked and (not asked.isdigit() or int(asked) == 0):
        raise ValueError(f"EDGEL_NUM_THREADS={asked!r}: expected a whole number above 0")
    return (
        int(asked)
        if asked
        else len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count() or 1
    )
