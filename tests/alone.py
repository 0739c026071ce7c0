"""Routines, which only kernels call, made kernels of their own: so tests can ask them alone."""

from collections.abc import Callable
from functools import cache
from typing import Any

from edgel._kernels.parallel import kernel


@cache
def alone(routine: Any) -> Callable[..., Any]:
    """Make a kernel of a routine."""
    return kernel(getattr(routine, "py_func", routine))
