"""Compile kernels and run them over slices from one thread pool.

Kernels release the GIL and take ``(start, stop, ...)``; slices of fixed size keep the result independent of the number
of threads. A pool of our own is safe when called from several threads, where Numba's own layer aborts the process.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from typing import Any, TypeVar

from numba import njit

from edgel._kernels.cache import KernelCache
from edgel._kernels.pieces import PieceCompiler, template_of, without_collection
from edgel._kernels.threads import num_threads

F = TypeVar("F", bound=Callable[..., Any])


_ANY_ORDER = {"reassoc", "nsz", "contract"}


def _compiled(function: Callable[..., Any], **options: Any) -> Any:
    # Division by 0 gives infinity or NaN: a branch to an exception would keep every loop that divides off SIMD. Nothing
    # calls kernels from C.
    chosen: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, **options}
    return njit(**chosen)(function)


def kernel(function: F, **options: Any) -> F:
    """Compile a function that Python calls to machine code, without the GIL, kept on disk between runs."""
    compiled: Any = _compiled(function, **options)
    if compiled is not function:  # as it is under NUMBA_DISABLE_JIT
        compiled._cache = KernelCache(function)
        compiled.compile = partial(without_collection, compiled.compile)
    return compiled


def routine(function: F, **options: Any) -> F:
    """Compile a function that only kernels call, as a piece of each of them; Python cannot call it."""
    compiled: Any = _compiled(function, no_cpython_wrapper=True, pipeline_class=PieceCompiler, **options)
    if compiled is not function:
        compiled.get_call_template = partial(template_of, compiled.get_call_template)
    return compiled


def summing_routine(function: F) -> F:
    """Compile like `routine`, and let sums be taken in any order, so that loops over neighbours run on SIMD.

    The order depends on the loop alone, so results stay the same for any number of threads; NaN and infinity keep their
    meaning. The moments of 32 neighbours take a quarter of the time so.
    """
    return routine(function, fastmath=_ANY_ORDER)


def part(function: F) -> F:
    """Compile like `routine`, and inline it wherever it is called: an array passed costs seven words."""
    return routine(function, forceinline=True)


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="edgel")


# A forked child inherits the pool without its threads, and would wait for them for ever: it makes its own.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)


_thread = threading.local()


def run_slices(compiled: Callable[..., Any], count: int, *arguments: Any, size: int = 8192) -> None:
    """Call ``compiled(start, stop, *arguments)`` for consecutive slices of ``range(count)``, in parallel.

    Parameters
    ----------
    compiled : kernel
        Writes its result into arrays among `arguments`, each slice to its own part.
    count : int
        Length of the range that is sliced.
    size : int
        Length of a slice; depends on the work, never on the number of threads.
    """
    starts = range(0, count, size)
    if not starts:
        return
    threads = 1 if getattr(_thread, "is_busy", False) else min(num_threads(), len(starts))
    if threads == 1:
        for start in starts:
            compiled(start, min(start + size, count), *arguments)
        return
    # Each thread takes the next slice when it is done with one: a job a slice would cost 20 us each. Two threads that
    # meet a kernel for the first time do not compile it twice: Numba holds a lock and looks again.
    left = iter(starts)

    def work() -> None:
        for start in left:
            compiled(start, min(start + size, count), *arguments)

    # The caller works, too: threads woken while it still holds its core would meet on another, and share it.
    jobs = [_pool(threads - 1).submit(work) for _ in range(threads - 1)]
    try:
        work()
        for job in jobs:
            job.result()
    except BaseException:  # Ctrl-C too: what has not begun need not run any more
        for _ in left:
            pass
        raise


def run_each(work: Callable[[Any], None], things: Iterable[Any]) -> None:
    """Call ``work(thing)`` for each thing, in parallel; the kernels that it runs stay on its thread.

    Things are taken one at a time, as threads are done with those before.
    """
    left, over = iter(things), object()
    lock, stopped = threading.Lock(), threading.Event()

    def take() -> Any:
        with lock:  # a generator cannot be entered by two
            return over if stopped.is_set() else next(left, over)

    def keep_on() -> None:
        _thread.is_busy = True  # with a pool that waits for itself it would wait for ever
        try:
            while (thing := take()) is not over:
                work(thing)
        except BaseException:  # Ctrl-C too: what has not begun need not run any more
            stopped.set()
            raise
        finally:
            _thread.is_busy = False

    threads = num_threads()
    jobs = [_pool(threads - 1).submit(keep_on) for _ in range(threads - 1)]
    keep_on()
    for job in jobs:
        job.result()
