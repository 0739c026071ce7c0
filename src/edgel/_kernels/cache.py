"""Compiled kernels kept on disk between runs, so that whatever is wrong with a file there only costs its compilation.

Numba's own cache looks at the file of a kernel alone, and fails with whatever unpickling a damaged file raises. Here a
kernel is kept under a stamp of all that was compiled into it, also from other files, and with a checksum: machine code
with one wrong bit would crash, or be wrong in silence. Where nothing can be written, kernels are compiled anew.
"""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import os
import pickle
import secrets
import sys
from collections.abc import Callable, Iterator
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.core import config
from numba.core.caching import CompileResultCacheImpl, NullCache
from numba.core.serialize import dumps

from edgel._kernels.ahead import compiled_elsewhere

_HASH = hashlib.sha256
_HEAD = 2 * _HASH().digest_size  # bytes of a file before the kernel itself: its stamp, and the checksum


class KernelCache(NullCache):
    """The compiled versions of one kernel, one file for each types of its arguments and processor.

    Parameters
    ----------
    function : function
        What is compiled.

    Attributes
    ----------
    keeps : bool
        Of all kernels together: whether each that was compiled could be kept.
    """

    keeps = True

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what was compiled for these types, here or meanwhile in another process, None if there is nothing."""
        target_context.refresh()
        found = self._read(sig, target_context)
        return self._read(sig, target_context) if found is None and compiled_elsewhere(self._function) else found

    def _read(self, sig: Any, target_context: Any) -> Any:
        try:
            content = self._path(sig, target_context.codegen()).read_bytes()
            if content[:_HEAD] != self._head(content[_HEAD:]):
                return None
            return self._numba.rebuild(target_context, pickle.loads(content[_HEAD:]))
        except Exception:  # whatever unpickling raises, classes that have moved included
            return None

    def save_overload(self, sig: Any, cres: Any) -> None:
        """Keep what was compiled, where it can be kept: it runs all the same."""
        try:
            if self._numba.check_cachable(cres):
                compiled = dumps(self._numba.reduce(cres))
                _write(self._path(sig, cres.codegen), self._head(compiled) + compiled)
        except Exception:
            KernelCache.keeps = False

    @cached_property
    def _numba(self) -> CompileResultCacheImpl:
        return CompileResultCacheImpl(self._function)  # RuntimeError where no folder can be written

    @cached_property
    def _stamp(self) -> bytes:
        ingredients = sorted(set(_ingredients(self._function, set())))
        checked = f"bounds checked: {bool(config.BOUNDSCHECK)}"  # pyright: ignore[reportAttributeAccessIssue]
        return _HASH("\0".join([numba.__version__, checked, *ingredients]).encode()).digest()

    def _head(self, compiled: bytes) -> bytes:
        return self._stamp + _HASH(compiled).digest()

    def _path(self, sig: Any, codegen: Any) -> Path:
        module, name = Path(inspect.getfile(self._function)).stem, self._function.__qualname__
        which = _HASH(repr((sig, codegen.magic_tuple())).encode()).hexdigest()[:16]
        version = f"py{sys.version_info[0]}{sys.version_info[1]}{getattr(sys, 'abiflags', '')}"
        folder = Path(self._numba.locator.get_cache_path())
        return folder / f"{module}.{name}-{which}.{version}.nbc".replace("<", "").replace(">", "")


def _ingredients(function: Callable[..., Any], seen: set[Any]) -> Iterator[str]:
    """Yield what is compiled into a function: its file, those of the functions it calls, and their constants."""
    if function in seen:
        return
    seen.add(function)
    yield _hash_of_file(inspect.getfile(function))
    outside = inspect.getclosurevars(function)
    for name, value in {**outside.globals, **outside.nonlocals}.items():
        inner = getattr(value, "py_func", getattr(value, "_defn", None))  # of a kernel, of an intrinsic
        if inner is not None:
            yield from _ingredients(inner, seen)
        elif isinstance(value, np.ndarray):
            yield f"{name} {value.dtype} {value.shape} {_HASH(value.tobytes()).hexdigest()}"
        elif isinstance(value, int | float | str | tuple | np.generic):
            yield f"{name} {value!r}"


@cache
def _hash_of_file(path: str) -> str:
    return _HASH(Path(path).read_bytes()).hexdigest()


def _write(path: Path, content: bytes) -> None:
    """Put a file in its place in one step, and leave nothing else behind."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f"{path.name}.{secrets.token_hex(8)}.tmp")
    try:
        temporary.write_bytes(content)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
