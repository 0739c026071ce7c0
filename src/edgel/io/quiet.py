"""Keep off the screen what decoders written in C and Rust print over damaged files."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_lock = threading.Lock()


@contextmanager
def quiet_decoder() -> Iterator[None]:
    """Send file descriptor 2 nowhere: a panic of Rust and the errors of libtiff go there, not to ``sys.stderr``.

    What went wrong is in the exception as well. One thread at a time: two would restore each other's nowhere.
    """
    with _lock:
        try:
            kept = os.dup(2)
        except OSError:  # closed, as in a service: nothing is printed anyway
            yield
            return
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 2)
        try:
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            os.close(nowhere)
