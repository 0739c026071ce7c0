"""Write the forms of the first jobs' kernels, which a wheel brings along for this Python and this platform.

Run: python packaging/kernel_forms.py, in half a minute, before the wheel is built: see `edgel._kernels.forms`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from unittest.mock import patch

from numba.core.codegen import JITCodeLibrary

from edgel._kernels import ahead, forms
from edgel._kernels.cache import KernelCache


def forms_of(compile_: Callable[[], Any]) -> dict[str, bytes]:
    """Return the forms, by name, of the kernels that something compiles."""
    bitcode: dict[str, bytes] = {}
    found: dict[str, bytes] = {}
    optimize = JITCodeLibrary._optimize_final_module

    def remember(library: Any) -> None:
        bitcode[library.name] = library._final_module.as_bitcode()
        optimize(library)

    def find_nothing(cache: KernelCache, sig: Any, target_context: Any) -> None:
        target_context.refresh()

    def seal(cache: KernelCache, sig: Any, cres: Any) -> None:
        _, *others = cres._reduce()
        found[cache.name_of(sig)] = cache.sealed(((cres.library.name, bitcode[cres.library.name]), *others))

    with (
        patch.object(JITCodeLibrary, "_optimize_final_module", remember),
        patch.multiple(KernelCache, load_overload=find_nothing, save_overload=seal),
    ):
        compile_()
    return found


if __name__ == "__main__":
    forms.write(forms_of(lambda: ahead.warm_up(lambda done, total: None)))
    print(f"{forms.FILE}: {forms.FILE.stat().st_size / 1e6:.1f} MB")
