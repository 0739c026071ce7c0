"""``edgel warmup``: compile the kernels now, so that the first run does not have to."""

from __future__ import annotations

import time

from edgel._cli import options
from edgel._cli.errors import ExitCode, Failure, exit_codes
from edgel._cli.output import print_line, seconds
from edgel._cli.progress import Watch
from edgel._kernels import ahead
from edgel._kernels.cache import KernelCache

HELP = """Compile what detecting edges needs now, by all cores, so that the first run starts at once.

For images of containers and for machines that many people use: kernels are kept beside edgel, or in the folder that
NUMBA_CACHE_DIR names, for this kind of processor.

\b
Examples:
  edgel warmup
  NUMBA_CACHE_DIR=/var/cache/edgel edgel warmup
"""


def warmup(debug: options.Debug = False) -> None:
    """Compile the kernels."""
    with exit_codes(debug=debug):
        began = time.perf_counter()
        with Watch(quiet=True) as watch:
            ahead.warm_up(lambda done, total: watch(f"kernel {done} of {total}"))
        if not KernelCache.keeps:
            raise Failure(ExitCode.OUTPUT, "kernels cannot be kept; set NUMBA_CACHE_DIR to a folder to keep them in")
        print_line(f"kernels are ready, after {seconds(time.perf_counter() - began)}")
