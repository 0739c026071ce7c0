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
from types import SimpleNamespace
from typing import Any

import numba
import numpy as np
from numba.core import config, event
from numba.core.caching import CompileResultCacheImpl, NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from edgel._kernels import forms
from edgel._kernels.ahead import compiled_elsewhere

FINISHING = "edgel:finish"  # what is told of while a kernel that was brought along is finished, as of one compiled
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
        if found is None and compiled_elsewhere(self._function):
            found = self._read(sig, target_context)
        return self._translated(sig, target_context) if found is None else found

    def _read(self, sig: Any, target_context: Any) -> Any:
        try:
            kept = self.checked(self._path(sig, target_context.codegen()).read_bytes())
            return None if kept is None else CompileResult._rebuild(target_context, *kept)
        except Exception:  # whatever unpickling raises, classes that have moved included
            return None

    def _translated(self, sig: Any, target_context: Any) -> Any:
        """Return what LLVM makes of the form that edgel brought along, and keep it; None where there is none of use."""
        try:
            brought = forms.read(self.name_of(sig))
            form = None if brought is None else self.checked(brought)
            if form is None:
                return None
            (name, bitcode), *others = form
            with event.trigger_event(FINISHING, {"dispatcher": SimpleNamespace(py_func=self._function)}):
                compiled = forms.translate(target_context.codegen(), name, bitcode), *others
            found = CompileResult._rebuild(target_context, *compiled)
        except Exception:  # as above: the source is there
            return None
        self._keep(sig, found, lambda: compiled)
        return found

    def save_overload(self, sig: Any, cres: Any) -> None:
        """Keep what was compiled, where it can be kept: it runs all the same."""
        self._keep(sig, cres, cres._reduce)

    def _keep(self, sig: Any, cres: Any, reduce: Callable[[], Any]) -> None:
        try:
            if self._numba.check_cachable(cres):
                _write(self._path(sig, cres.codegen), self.sealed(reduce()))
        except Exception:
            KernelCache.keeps = False

    def sealed(self, compiled: Any) -> bytes:
        """Return what was made of this kernel as bytes, with the stamp of all that went into it and a checksum."""
        content = dumps(compiled)
        return self._stamp + _HASH(content).digest() + content

    def checked(self, content: bytes) -> Any:
        """Return what was sealed, None where it was made of something else or is damaged."""
        head = self._stamp + _HASH(content[_HEAD:]).digest()
        return pickle.loads(content[_HEAD:]) if content[:_HEAD] == head else None

    def name_of(self, sig: Any) -> str:
        """Return a name of the kernel for arguments of these types."""
        function = self._function
        return f"{function.__module__}.{function.__qualname__}-{_HASH(repr(sig).encode()).hexdigest()[:16]}"

    @cached_property
    def _numba(self) -> CompileResultCacheImpl:
        return CompileResultCacheImpl(self._function)  # RuntimeError where no folder can be written

    @cached_property
    def _stamp(self) -> bytes:
        ingredients = sorted(set(_ingredients(self._function, set())))
        checked = f"bounds checked: {bool(config.BOUNDSCHECK)}"  # pyright: ignore[reportAttributeAccessIssue]
        return _HASH("\0".join([numba.__version__, checked, *ingredients]).encode()).digest()

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
