"""Compile the kernels of a first job in several processes: in one, Numba compiles one kernel at a time.

`first_jobs.txt` lists the kernels of each job in the order of need, with the types of their arguments. When one of them
is found to be missing, other processes begin at the end of its job's list and keep what they compile on disk; this one
compiles what it needs, and waits where another process has begun.
"""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable
from functools import cache
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numba.core import types
from numba.np.numpy_support import as_dtype, from_dtype

from edgel._kernels import forms
from edgel._kernels.threads import num_threads

FILE = "first_jobs.txt"
MOST = 3  # processes beside this one
EACH, EACH_BROUGHT = 1.1, 0.25  # CPU seconds that a kernel takes, on average: compiled, and finished from its form
_KEPT = "kept"

_lock = threading.Lock()
_begun: dict[str, threading.Event | None] = {}
"""Kernels that are compiled, with what says that another process is done with it; None where it is this process."""
_started: set[str] = set()


def _begin_anew() -> None:
    _begun.clear()  # in a forked child nobody would say that they are done
    _lock.release()


if hasattr(os, "register_at_fork"):  # held by another thread it would stay locked in the child
    os.register_at_fork(before=_lock.acquire, after_in_parent=_lock.release, after_in_child=_begin_anew)


@cache
def first_jobs() -> dict[str, dict[str, str]]:
    """Read the kernels of each job, by "module:name", with the types of their arguments."""
    jobs: dict[str, dict[str, str]] = {}
    for line in (files("edgel._kernels") / FILE).read_text().splitlines():
        job, name, words = line.split(" ", 2)
        jobs.setdefault(job, {})[name] = words
    return jobs


def compiled_elsewhere(function: Callable[..., Any]) -> bool:
    """Say whether another process compiled a kernel, after waiting for it; if not, it is up to this one."""
    name = f"{function.__module__}:{function.__qualname__}"
    mine = [job for job, kernels in first_jobs().items() if name in kernels]
    with _lock:
        if len(mine) == 1 and mine[0] not in _started:
            _started.add(mine[0])
            _start(list(first_jobs()[mine[0]].items()))
        done = _begun.setdefault(name, None)
    if done is None:
        return False
    done.wait()
    return True


def warm_up(progress: Callable[[int, int], None]) -> None:
    """Compile what the first jobs need; tells how many kernels are ready, and of how many."""
    listed = {name: words for kernels in first_jobs().values() for name, words in kernels.items()}
    for count, (name, words) in enumerate(listed.items()):
        progress(count, len(listed))
        _compile(name, words)
    progress(len(listed), len(listed))


def expected_seconds() -> float:
    """Return about how long the kernels of one job take to compile, beside what else the machine does now."""
    processes, cores = 1 + _helpers(), os.cpu_count() or 1
    others = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0  # not on Windows
    at_once = processes * min(1.0, cores / (processes + others))
    each = EACH_BROUGHT if forms.FILE.exists() else EACH
    return max(len(kernels) for kernels in first_jobs().values()) * each / at_once


def _helpers() -> int:
    # Where Python is part of another program, that program would be started again.
    return min(num_threads() - 1, MOST) if Path(sys.executable or "").stem.startswith("python") else 0


def _start(kernels: list[tuple[str, str]]) -> None:
    program = (
        f"import sys; sys.path[:] = {sys.path!r}\n"
        "from edgel._kernels import ahead, cache\n"
        "ahead.serve(cache.KernelCache)"
    )
    for _ in range(_helpers()):
        try:
            process = subprocess.Popen(
                [sys.executable, "-c", program],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                env=os.environ | {"EDGEL_NUM_THREADS": "1"},
            )
        except OSError:  # no more processes: this one compiles all
            return
        atexit.register(_end, process)
        threading.Thread(target=_feed, args=(process, kernels), name="edgel compiler", daemon=True).start()


def _feed(process: subprocess.Popen[str], kernels: list[tuple[str, str]]) -> None:
    """Have a process compile what nobody has begun, from the end; whatever goes wrong there is left to this one."""
    assert process.stdin is not None
    assert process.stdout is not None
    with process:
        for name, words in reversed(kernels):
            with _lock:
                if name in _begun:
                    continue
                done = _begun[name] = threading.Event()
            try:
                process.stdin.write(f"{name} {words}\n")
                process.stdin.flush()
                if process.stdout.readline().strip() != _KEPT:
                    break
            except OSError:
                break
            finally:
                done.set()
        process.kill()


def _end(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.wait()


def serve(cache: Any) -> None:
    """Compile what is asked for, line by line, until nobody asks any more; says whether the cache keeps it."""
    for line in sys.stdin:
        _compile(*line.split(" ", 1))
        print(_KEPT if cache.keeps else "lost", flush=True)


def _compile(name: str, words: str) -> None:
    module, function = name.split(":")
    getattr(import_module(module), function).compile(types_of(words))


def types_of(words: str) -> tuple[Any, ...]:
    """Read types: ``i8``, ``f8[2]`` for an array of two axes, ``i8*2`` for two, ``module.Class{f8[1],i8}``."""
    return tuple(_type_of(word) for word in words.split())


def _type_of(word: str) -> Any:
    if word.endswith("}"):
        path, inner = word[:-1].split("{")
        module, name = path.rsplit(".", 1)
        return types.NamedTuple([_type_of(each) for each in inner.split(",")], getattr(import_module(module), name))
    if word.endswith("]"):
        kind, axes = word[:-1].split("[")
        return types.Array(_type_of(kind), int(axes), "C")
    if "*" in word:
        kind, count = word.split("*")
        return types.UniTuple(_type_of(kind), int(count))
    return from_dtype(np.dtype(word))


def words_of(of_arguments: Iterable[Any]) -> str:
    """Write types down."""
    return " ".join(_word_of(each) for each in of_arguments)


def _word_of(one: Any) -> str:
    if isinstance(one, types.NamedTuple):
        owner = one.instance_class
        return f"{owner.__module__}.{owner.__qualname__}{{{','.join(_word_of(each) for each in one.types)}}}"
    if isinstance(one, types.UniTuple):
        return f"{_word_of(one.dtype)}*{one.count}"
    if isinstance(one, types.Array):
        return f"{_word_of(one.dtype)}[{one.ndim}]"
    return as_dtype(one).str[1:]
