"""Who may reach the page: those who know its address, from a page of that address, and nobody else."""

from __future__ import annotations

import asyncio
import hmac
import http
import logging
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

LOCAL = ("127.0.0.1", "localhost", "::1")
_LARGEST = 1 << 20  # bytes of a message from a page: settings and clicks are far smaller
_REFUSED = "This is not the whole address of the page: open the one that edgel has printed.\n"


class Guard:
    """Lets in what carries the token of the page, and comes from that page.

    Any page in any browser may try to connect to this machine, under any name that leads here, and so may every other
    program and user of it. The token is the path of the page's address, which its websocket goes to as well.

    Parameters
    ----------
    host : str
        Address to listen at. At those of this machine alone, only its own names are names of the page.
    """

    def __init__(self, host: str) -> None:
        self._is_local = host in LOCAL
        self.token = secrets.token_urlsafe(16)

    def admits(self, request: Request) -> bool:
        """Whether a request may be answered."""
        given = request.path.lstrip("/").partition("?")[0].partition("/")[0]
        if not hmac.compare_digest(given.encode(), self.token.encode()):
            return False
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        if len(hosts) != 1 or len(origins) > 1:
            return False
        host = _place(f"//{hosts[0]}")
        if host is None or (self._is_local and host[0] not in LOCAL):
            return False
        # Programs send no origin, browsers always do, and no page can change it: another port is another page.
        return not origins or _place(origins[0]) == host

    @contextmanager
    def at_the_door(self, finish: Callable[[Response], Response] = lambda answer: answer) -> Iterator[None]:
        """Have servers that websockets starts meanwhile ask this guard first, and keep their clients' faults quiet.

        `finish` is given what they answer, the page among it.
        """
        original = websockets.asyncio.server.serve

        def serve(*args: Any, process_request: Callable[..., Any], **options: Any) -> Any:
            def ask_first(connection: ServerConnection, request: Request) -> Any:
                if not self.admits(request):
                    return connection.respond(http.HTTPStatus.FORBIDDEN, _REFUSED)
                request.path = "/" + request.path.lstrip("/")[len(self.token) :].lstrip("/")
                answer = process_request(connection, request)
                return _kept_to_itself(finish(answer)) if isinstance(answer, Response) else answer

            asyncio.get_running_loop().set_exception_handler(lambda loop, context: None)
            options |= {"process_request": ask_first, "logger": _silent_logger(), "max_size": _LARGEST}
            return original(*args, **options)

        websockets.asyncio.server.serve = serve  # pyright: ignore[reportAttributeAccessIssue]
        try:
            yield
        finally:
            websockets.asyncio.server.serve = original


def _place(address: str) -> tuple[str, int | None] | None:
    """Return the host and the port of an address, None where there are none."""
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError:
        return None
    return (host, port) if host and parts.username is None else None


def _kept_to_itself(answer: Response) -> Response:
    """Keep the address, and the token in it, from wherever the page may lead, and the page out of frames."""
    answer.headers["Referrer-Policy"] = "no-referrer"
    answer.headers["X-Frame-Options"] = "DENY"
    return answer


def _silent_logger() -> logging.Logger:
    """Return a logger that says nothing of clients who send garbage, or leave in the middle of a word."""
    logger = logging.getLogger("edgel.viewer")
    logger.propagate = False
    logger.setLevel(logging.CRITICAL + 1)
    return logger
