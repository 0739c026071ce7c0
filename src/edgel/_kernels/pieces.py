"""Functions that run inside kernels alone: linked into each, and optimised and turned into machine code only there.

Numba optimises each function that a kernel calls for its own sake, makes machine code of it that nobody runs, and wraps
it for Python; that was half of the time in which kernels are compiled.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterable
from typing import Any

from numba.core import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler


class PieceLibrary(JITCodeLibrary):
    """Code that is linked into other libraries, and never runs by itself."""

    sums = False  # in any order: it is chosen here, once, or it would hang on the kernel that the sum is linked into

    def _optimize_functions(self, ll_module: Any) -> None:
        if self.sums:
            super()._optimize_functions(ll_module)
        else:  # the kernel's task
            ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        if self.sums:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Say that there is no machine code."""
        return 0

    @property
    def codegen(self) -> Any:
        """What sets the environment of a function once it is loaded: here nothing is loaded."""
        return self

    def set_env(self, env_name: str, env: Any) -> None:
        """Do nothing: only what raises exceptions made while it runs has use for an environment."""


class PieceCompiler(Compiler):
    """Numba's compiler, into a `PieceLibrary`."""

    def define_pipelines(self) -> Any:
        """Choose the library before anything is compiled into it."""
        state = self.state
        state.library = PieceLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.sums = bool(state.flags.fastmath)
        return super().define_pipelines()


def template_of(of_dispatcher: Callable[..., Any], args: Iterable[Any], kws: dict[str, Any]) -> Any:
    """Type a call without the values of constants among its arguments, each of which would be compiled for itself."""
    return of_dispatcher(
        tuple(types.unliteral(arg) for arg in args), {key: types.unliteral(arg) for key, arg in kws.items()}
    )


def without_collection(compile_: Callable[[Any], Any], sig: Any) -> Any:
    """Compile without looking for garbage, of which there is little among millions of objects: a fifth of the time."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        return compile_(sig)
    finally:
        if enabled:
            gc.enable()
