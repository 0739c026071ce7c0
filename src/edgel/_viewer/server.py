"""The server of the page: who may reach it, and how it begins and ends."""

from __future__ import annotations

import io
import os
import socket
import sys
import threading
import webbrowser
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from typing import Any

import viser

from edgel._viewer.document import dress
from edgel._viewer.guard import LOCAL, Guard
from edgel._viewer.page import Page
from edgel._viewer.session import Session

DEFAULT_PORT = 8080
_TRIED_PORTS = 100


def serve(
    paths: Sequence[str],
    *,
    host: str = LOCAL[0],
    port: int | None = None,
    reading: Mapping[str, Any] | None = None,
    open_browser: bool = True,
    ready: Callable[[str], None] = lambda url: None,
) -> None:
    """Show files in the browser until the program is interrupted.

    Parameters
    ----------
    paths : sequence of str
    host : str
        Address to listen at.
    port : int, optional
        Default: the first free one from 8080.
    reading : mapping, optional
        Options of `edgel.read`.
    open_browser : bool
    ready : callable
        Called with the page's address once it can be reached.

    Raises
    ------
    OSError
        If nothing can listen at that address.
    """
    with running(paths, host=host, port=port, reading=reading) as viewer:
        ready(viewer.url)
        if open_browser and _has_screen():
            webbrowser.open(viewer.url)
        while True:
            threading.Event().wait(3600)  # in one endless wait Windows would not see Ctrl-C


@dataclass(frozen=True, eq=False)
class Viewer:
    """The page while it is served: its address, the state behind it, and what draws it."""

    url: str
    session: Session
    page: Page


@contextmanager
def running(
    paths: Sequence[str],
    *,
    host: str = LOCAL[0],
    port: int | None = None,
    reading: Mapping[str, Any] | None = None,
) -> Iterator[Viewer]:
    """Serve the page for as long as the ``with`` lasts; as `serve`, which waits for Ctrl-C."""
    session = Session(paths, reading=reading)
    guard = Guard(host)
    title = ", ".join(source.name for source in session.sources) + " - edgel view"
    server = _listen(host, _free_port(host, port), guard, title)
    page = Page(server, session)
    try:
        yield Viewer(_address(host, server.get_port(), guard.token), session, page)
    finally:
        session.close()
        page.close()
        with redirect_stdout(io.StringIO()):
            server.stop()


def _listen(host: str, port: int, guard: Guard, title: str) -> viser.ViserServer:
    """Start viser without its banner, and behind a guard."""
    with guard.at_the_door(lambda answer: dress(answer, title)), redirect_stdout(io.StringIO()):
        return viser.ViserServer(host, port, verbose=False)


def _address(host: str, port: int, token: str) -> str:
    """Return what to type into the browser of this machine."""
    shown = "localhost" if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host
    return f"http://{shown}:{port}/{token}/"


def _free_port(host: str, port: int | None) -> int:
    """Return a port that can be listened at; viser itself would try a thousand and then wait for ever."""
    tried = range(DEFAULT_PORT, DEFAULT_PORT + _TRIED_PORTS) if port is None else [port]
    error = OSError("no free port")
    for candidate in tried:
        try:
            family = socket.AF_INET6 if ":" in host else socket.AF_INET
            with socket.create_server((host, candidate), family=family):
                return candidate
        except OSError as problem:
            error = problem
    raise error


def _has_screen() -> bool:
    """Whether a browser can show anything; else Python would open one in the terminal."""
    return sys.platform in ("win32", "darwin") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
