"""Ctrl-C and the requests to end: each becomes an exception, so that whatever was begun is cleared away."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from contextlib import suppress
from types import FrameType
from typing import Any, NoReturn

_STOPPING = [name for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
_PATIENCE = 2.0  # seconds in which further signals may not disturb the clearing away
_began: float | None = None  # when the first signal came


class Terminated(BaseException):
    """The system, or the terminal that was closed, asks the program to end."""


def listen() -> None:
    """Turn signals into KeyboardInterrupt and `Terminated`, but for those that whoever started the program ignores."""
    for name in _STOPPING:
        number = getattr(signal, name)
        if signal.getsignal(number) not in (signal.SIG_IGN, None):
            signal.signal(number, _stop)
    sys.unraisablehook = _tell_again


def end_now(code: int) -> NoReturn:
    """End without waiting for threads, which may still compile kernels that nobody wants any more."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):
            stream.flush()
    os._exit(code)


def _stop(number: int, frame: FrameType | None) -> None:
    global _began
    now = time.monotonic()
    if _began is not None:
        if now - _began > _PATIENCE:
            os._exit(128 + number)
        return
    _began = now
    raise KeyboardInterrupt if number == signal.SIGINT else Terminated


def _tell_again(unraisable: Any) -> None:
    """Send a signal once more whose exception got lost, raised where Python cannot pass it on, as in a destructor."""
    global _began
    if not isinstance(unraisable.exc_value, KeyboardInterrupt | Terminated):
        sys.__unraisablehook__(unraisable)
        return
    _began = None
    number = signal.SIGINT if isinstance(unraisable.exc_value, KeyboardInterrupt) else signal.SIGTERM
    threading.Timer(0.02, os.kill, (os.getpid(), number)).start()
