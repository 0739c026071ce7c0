"""A worker that does the same work again whenever something changed; of many changes at once only the last counts."""

from __future__ import annotations

import sys
import threading
import traceback
from collections.abc import Callable


class Latest:
    """A thread that calls `work` once for any number of wakes that came meanwhile.

    The work looks up for itself what is wanted when it begins: so it is always the newest, however many wakes there
    were and in whatever order the threads came that called.

    Parameters
    ----------
    work : callable
        Called without arguments. An error in it is printed, and does not end the thread.
    name : str
        Of the thread.

    Examples
    --------
    >>> done = threading.Event()
    >>> worker = Latest(done.set, "example")
    >>> worker.wake()
    >>> done.wait(5)
    True
    >>> worker.close()
    """

    def __init__(self, work: Callable[[], None], name: str) -> None:
        self._work = work
        self._changed = threading.Condition()
        self._wanted = self._busy = self._closed = False
        # A daemon: a stage that runs when the program ends must not hold it up.
        threading.Thread(target=self._run, name=name, daemon=True).start()

    def wake(self) -> None:
        """Ask for the work to be done, once more if it runs already."""
        with self._changed:
            self._wanted = True
            self._changed.notify_all()

    def close(self) -> None:
        """Begin no more work."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def wait_idle(self, timeout: float | None = None) -> bool:
        """Wait until nothing is left to do, and say whether that came to pass within `timeout` seconds."""
        with self._changed:
            return self._changed.wait_for(lambda: not self._busy and (self._closed or not self._wanted), timeout)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._busy = False
                self._changed.notify_all()
                self._changed.wait_for(lambda: self._wanted or self._closed)
                if self._closed:
                    return
                self._wanted, self._busy = False, True
            try:
                self._work()
            except Exception:
                if not sys.is_finalizing() and not self._closed:
                    traceback.print_exc()
