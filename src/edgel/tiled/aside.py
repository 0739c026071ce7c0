"""Results that appear whole or not at all: made aside, then renamed; what a killed process left is cleared."""

from __future__ import annotations

import os
import shutil
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_END = ".part"
_STALE = 86_400.0  # seconds, after which nobody writes any more what a process of another machine began


@contextmanager
def made_aside(path: Path) -> Iterator[Path]:
    """Give a name for what becomes the file or folder `path` once it is whole.

    Whatever ends the block early, a full disk too, what is half written is removed.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f"{path.name}.{socket.gethostname()}.{os.getpid()}{_END}")
    _remove(beside)
    try:
        yield beside
        if path.is_dir():
            shutil.rmtree(path)
        os.replace(beside, path)
    except BaseException:
        _remove(beside)
        raise


def clear_stale(folder: Path) -> None:
    """Remove what processes that live no longer began below a folder."""
    for path in folder.rglob(f"*{_END}"):
        *_, host, process, _ = path.name.rsplit(".", 3)
        here = host == socket.gethostname() and process.isdigit()
        if path.exists() and not (_lives(int(process)) if here else path.stat().st_mtime > time.time() - _STALE):
            _remove(path)


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # somebody else's
        pass
    return True


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
