"""Who may reach the page, and what odd clients do to it."""

import contextlib
import http.client
import importlib.util
import socket
import struct
from urllib.parse import urlsplit

import pytest

if importlib.util.find_spec("viser") is None:
    pytest.skip("viser is not installed (extra view)", allow_module_level=True)


@pytest.fixture(scope="module")
def viewer(tmp_path_factory):
    import numpy as np

    import edgel
    from edgel._viewer.server import running

    path = tmp_path_factory.mktemp("guard") / "a.ply"
    edgel.write(path, edgel.Cloud(np.random.default_rng(0).random((500, 3))))
    with running([str(path)]) as viewer:
        yield viewer


def get(viewer, *, path=None, host=None, origin=None):
    """Ask for the page, and return the status and the body."""
    address = urlsplit(viewer.url)
    connection = http.client.HTTPConnection(address.hostname, address.port, timeout=30)
    with contextlib.closing(connection):
        headers = {"Host": address.netloc if host is None else host} | ({} if origin is None else {"Origin": origin})
        connection.request("GET", address.path if path is None else path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.read()


def websocket(viewer, *, path=None, origin=None, **options):
    import viser
    from websockets.sync.client import connect
    from websockets.typing import Subprotocol

    address = urlsplit(viewer.url)
    url = f"ws://{address.netloc}{address.path if path is None else path}"
    return connect(url, origin=origin, subprotocols=[Subprotocol(f"viser-v{viser.__version__}")], **options)


def test_the_page_itself(viewer):
    status, body = get(viewer)
    assert status == 200
    assert b"<html" in body
    token = urlsplit(viewer.url).path
    assert len(token.strip("/")) >= 20
    address = urlsplit(viewer.url)
    with websocket(viewer, origin=f"http://{address.netloc}", path=token.rstrip("/")) as client:
        assert client.recv(timeout=30)


@pytest.mark.parametrize("path", ["/", "/index.html", "/aaaaaaaaaaaaaaaaaaaaaa/", "//", "/?token="])
def test_without_the_token(viewer, path):
    from websockets.exceptions import InvalidStatus

    assert get(viewer, path=path)[0] == 403
    with pytest.raises(InvalidStatus, match="403"):
        websocket(viewer, path=path)


@pytest.mark.parametrize(
    "host", ["example.com", "example.com:8080", "localhost.example.com", "127.0.0.1@example.com", ""]
)
def test_under_another_name(viewer, host):
    """A name of somebody else's may be made to lead to this machine (DNS rebinding)."""
    assert get(viewer, host=host)[0] == 403


@pytest.mark.parametrize(
    "origin", ["http://localhost:{other}", "http://127.0.0.1:{other}", "http://example.com", "null"]
)
def test_from_another_page(viewer, origin):
    from websockets.exceptions import InvalidStatus

    other = urlsplit(viewer.url).port + 1
    with pytest.raises(InvalidStatus, match="403"):
        websocket(viewer, origin=origin.format(other=other))
    assert get(viewer, origin=origin.format(other=other))[0] == 403


def test_odd_clients_are_not_told_of(viewer, capfd):
    address = urlsplit(viewer.url)
    place = (address.hostname, address.port)
    half = f"GET {address.path} HTTP/1.1\r\nHost: {address.netloc}\r\nUpgrade: websocket\r\n".encode()
    reset = struct.pack("ii", 1, 0)
    for words in (
        b"",
        b"\0\xff garbage\r\n\r\n",
        b"GET / HTTP/9\r\n\r\n",
        half,
        b"GET /" + b"a" * 100_000,
        half + b"\r\n",
    ):
        with socket.create_connection(place, timeout=30) as client, contextlib.suppress(OSError):
            client.sendall(words)
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, reset)
    for message in (b"garbage", "a text", b"\xc1" * 100, bytes(3 << 20), b"\x81\xa4type\xa3Foo"):
        with websocket(viewer, max_size=None) as client, contextlib.suppress(Exception):
            client.recv(timeout=30)
            client.send(message)
            while True:
                client.recv(timeout=0.3)
    with websocket(viewer) as client:  # leaves in the middle of a frame
        client.socket.sendall(b"\x82\xfe")
        client.socket.close()
    assert get(viewer)[0] == 200
    told = capfd.readouterr()
    assert told.out + told.err == ""
