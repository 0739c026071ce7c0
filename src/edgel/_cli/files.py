"""Files of the commands: read and written with the right exit codes, ``-`` for the pipes, outputs checked early."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from edgel._cli.errors import ExitCode, Failure, failing_as
from edgel.cloud import Cloud

if TYPE_CHECKING:
    from collections.abc import Iterable

PIPE = "-"


def check_input(path: str, intrinsics: str | None = None) -> None:
    """Raise a `Failure` for an input that cannot be read, before anything else happens."""
    from edgel.io.files import check_readable

    if path == PIPE:
        if sys.stdin.isatty():
            raise Failure(ExitCode.USAGE, "IN is -, and no file is piped in; use `edgel ... - < cloud.ply`, or name it")
        if intrinsics is not None:
            raise Failure(ExitCode.USAGE, "--intrinsics: the pipe carries PLY, which needs none; name the depth image")
        return
    with failing_as(ExitCode.INPUT, path):
        check_readable(path)
    if intrinsics is not None:
        with failing_as(ExitCode.INPUT, intrinsics):
            check_readable(intrinsics)


def read_cloud(path: str, intrinsics: str | None = None) -> Cloud:
    """Read a cloud, PLY from stdin when the path is ``-``."""
    from edgel import io  # not at the top: `edgel --help` reads nothing

    with failing_as(ExitCode.INPUT, "stdin" if path == PIPE else path, ["intrinsics"]):
        return io.read(sys.stdin.buffer) if path == PIPE else io.read(path, intrinsics=intrinsics)


def check_output(path: str) -> None:
    """Raise a `Failure` for an output that could not be written, before the long work rather than after it."""
    from edgel.io import WRITERS

    if path == PIPE:
        if sys.stdout.isatty():
            raise Failure(
                ExitCode.USAGE, "the output is -, a binary PLY, and stdout is the terminal; pipe it, or name a file"
            )
        return
    if os.path.isdir(path):
        raise Failure(ExitCode.USAGE, f"{path}: is a folder; name the file, as in {os.path.join(path, 'edges.ply')}")
    check_extension(path, WRITERS)
    check_folder(path, Path(path).parent)


def check_extension(path: str, known: Iterable[str]) -> None:
    """Raise a `Failure` for a file whose extension names no format."""
    extension = Path(path).suffix.lower()
    if extension not in known:
        what = (
            f"{extension!r} is no format that edgel writes" if extension else "has no extension, which tells the format"
        )
        raise Failure(ExitCode.USAGE, f"{path}: {what}; known: {' '.join(known)}")


def check_folder(path: str, folder: Path) -> None:
    """Raise a `Failure` when nothing can be written in a folder, because of `path`."""
    try:
        # Only a real file tells: access rights say nothing of read-only and special file systems.
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        if not folder.exists():
            what = "does not exist; make it first, or choose another"
        elif not folder.is_dir():
            what = "is a file; choose another folder"
        else:
            what = f"cannot be written to ({(error.strerror or 'unknown reason').lower()}); choose another"
        raise Failure(ExitCode.OUTPUT, f"{path}: {folder} {what}") from error


def check_new_folder(path: str) -> None:
    """Raise a `Failure` for a folder that is not there and cannot be made, or cannot be written."""
    folder = Path(path)
    check_folder(path, next(parent for parent in (folder, *folder.parents) if parent.exists()))


def write_cloud(path: str, cloud: Cloud) -> None:
    """Write a cloud, PLY to stdout when the path is ``-``."""
    from edgel import io

    if path != PIPE:
        with failing_as(ExitCode.OUTPUT, path):
            io.write(path, cloud)
        return
    try:
        with failing_as(ExitCode.OUTPUT, "stdout"):
            io.write(sys.stdout.buffer, cloud)
            sys.stdout.buffer.flush()
    except Failure as failure:
        if isinstance(failure.__cause__, BrokenPipeError):
            # The interpreter flushes stdout once more as it ends, and would complain then.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            message = "stdout: was closed before the whole cloud was written; let the next program read to the end"
            raise Failure(ExitCode.OUTPUT, message) from failure
        raise
