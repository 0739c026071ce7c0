"""Kernels as Numba leaves them to LLVM: where edgel brings them along, a first run has LLVM's work alone to do.

That is a quarter of the time. A form knows nothing of the processor, so that the code and its last bits are those of a
kernel compiled from its source. It belongs to one Python, platform and Numba: there is a file for each of them, made by
``packaging/kernel_forms.py``, and whatever has changed since is compiled from its source.
"""

from __future__ import annotations

import sys
import sysconfig
import zipfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from llvmlite import binding

FILE = Path(__file__).with_name(f"forms-{sys.implementation.cache_tag}-{sysconfig.get_platform()}.zip")


@cache
def _names() -> frozenset[str]:
    try:
        with zipfile.ZipFile(FILE) as file:
            return frozenset(file.namelist())
    except (OSError, zipfile.BadZipFile):
        return frozenset()


def read(name: str) -> bytes | None:
    """Return the form of a kernel, None where there is none."""
    if name not in _names():
        return None
    with zipfile.ZipFile(FILE) as file:
        return file.read(name)


def write(forms: Mapping[str, bytes], path: Path = FILE) -> None:
    """Write the forms of kernels, by name, for this Python and platform."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_LZMA) as file:
        for name, form in sorted(forms.items()):
            file.writestr(zipfile.ZipInfo(name), form, zipfile.ZIP_LZMA)


def translate(codegen: Any, name: str, bitcode: bytes) -> tuple[str, str, tuple[bytes, bytes]]:
    """Have LLVM optimise and compile a form for this processor: what Numba keeps of a library on disk."""
    library = codegen.create_library(name)
    library._final_module = binding.parse_bitcode(bitcode)
    library._optimize_final_module()
    return name, "object", (codegen._tm.emit_object(library._final_module), library._final_module.as_bitcode())
