"""Files of the commands: read and written with the right exit codes, ``-`` for the pipes, outputs checked early."""

from __future__ import annotations

import os
import stat
import sys
import tempfile
import warnings
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from edgel._cli.errors import ExitCode, Failure, as_option, failing_as
from edgel.cloud import Cloud

if TYPE_CHECKING:
    import re
    from collections.abc import Iterable

PIPE = "-"


@dataclass(frozen=True)
class Reading:
    """How inputs are to be read.

    Attributes
    ----------
    intrinsics : str or None
        The file of the camera of depth images.
    columns : str or None
        Names of the columns of texts, commas between.
    sample_mesh : int or None
        Points to sample from meshes.
    topic : str or None
        Topic of ROS recordings, maybe with a colon and the number of a message.
    """

    intrinsics: str | None = None
    columns: str | None = None
    sample_mesh: int | None = None
    topic: str | None = None

    @property
    def given(self) -> dict[str, Any]:
        """What was asked for, by the name of the argument of `edgel.read`."""
        asked = {name: value for name, value in vars(self).items() if value is not None}
        name, colon, number = (self.topic or "").rpartition(":")
        if colon and number.isdecimal():
            asked |= {"topic": name, "message": int(number)}
        return asked


def check_input(path: str, reading: Reading) -> None:
    """Raise a `Failure` for an input that cannot be read, before anything else happens."""
    from edgel.io.files import check_readable

    if path == PIPE:
        if sys.stdin.isatty():
            raise Failure(ExitCode.USAGE, "IN is -, and no file is piped in; use `edgel ... - < cloud.ply`, or name it")
        for name in reading.given:
            raise Failure(ExitCode.USAGE, f"{as_option(name)}: the pipe carries PLY of points; name the file instead")
        return
    with failing_as(ExitCode.INPUT, path):
        check_readable(path)
    if reading.intrinsics is not None:
        with failing_as(ExitCode.INPUT, reading.intrinsics):
            check_readable(reading.intrinsics)


def read_cloud(path: str, reading: Reading = Reading()) -> Cloud:
    """Read a cloud, PLY from stdin when the path is ``-``."""
    from edgel import io  # not at the top: `edgel --help` reads nothing

    with failing_as(ExitCode.INPUT, "stdin" if path == PIPE else path, reading.given):
        return io.read(sys.stdin.buffer if path == PIPE else path, **reading.given)


def check_output(path: str, *, no_clobber: bool = False, among: bool = False) -> None:
    """Raise a `Failure` for an output that could not be written, before the long work rather than after it."""
    from edgel.io import WRITERS

    if path == PIPE:
        if sys.stdout.isatty():
            raise Failure(
                ExitCode.USAGE, "the output is -, a binary PLY, and stdout is the terminal; pipe it, or name a file"
            )
        return
    check_extension(path, WRITERS)
    check_file(path, no_clobber=no_clobber, among=among)


def check_stdout(output: str | None, *, as_json: bool) -> None:
    """Raise a `Failure` where a cloud and JSON would both go to stdout."""
    if as_json and output == PIPE:
        raise Failure(ExitCode.USAGE, "--json: stdout carries the cloud already; name a file to write it into")


def check_file(path: str, *, no_clobber: bool, among: bool = False) -> None:
    """Raise a `Failure` for a file that cannot, or with `no_clobber` must not, be replaced or made.

    With `among` its folder may yet have to be made, and those above it.
    """
    from edgel.io.files import check_replaceable

    if os.path.isdir(path):
        raise Failure(ExitCode.OUTPUT, f"{path}: is a folder, where a file was to be; remove it, or choose another")
    check_clobber(path, no_clobber=no_clobber)
    with failing_as(ExitCode.OUTPUT, path):
        old = check_replaceable(path)
    if old is None or stat.S_ISREG(old.st_mode):  # nothing is made beside a pipe or a device
        folder = Path(os.path.realpath(path) if os.path.islink(path) else path).parent
        check_folder(path, _nearest(folder) if among else folder)


def check_clobber(path: str | os.PathLike[str], *, no_clobber: bool) -> None:
    """Raise a `Failure` for a file that is there already, where those are to stay."""
    if no_clobber and os.path.isfile(path):
        raise Failure(ExitCode.OUTPUT, f"{path}: is there already; choose another name, or add --clobber")


def is_same_file(output: str, source: str) -> bool:
    """Whether an output is the input itself: by whatever name, by links, or by the shell's > and <."""
    out, given = _status(output, sys.stdout), _status(source, sys.stdin)
    return out is not None and given is not None and stat.S_ISREG(out.st_mode) and os.path.samestat(out, given)


def _status(path: str, pipe: TextIO) -> os.stat_result | None:
    with suppress(OSError, ValueError):
        return os.fstat(pipe.fileno()) if path == PIPE else os.stat(path)
    return None


def check_not_input(output: str, inputs: Iterable[str | None], remedy: str = "name another file") -> None:
    """Raise a `Failure` for an output that is an input, whose content it would replace by something else."""
    for source in inputs:
        if source is not None and is_same_file(output, source):
            same = "is the input itself" if output == source else f"is the input {source} itself"
            raise Failure(ExitCode.USAGE, f"{'stdout' if output == PIPE else output}: {same}; {remedy}")


def check_in_place(output: str, source: str, reading: Reading, part: str | None = None) -> bool:
    """Return whether an output is the input itself, or raise a `Failure` where it would hold less than that.

    Parameters
    ----------
    part : str or None
        What would replace the input, and what to do, where that is not every point, as
        `edgel._cli.compare.check_kept` demands.
    """
    check_not_input(output, [reading.intrinsics])
    formats = [".ply" if path == PIPE else Path(path).suffix.lower() for path in (output, source)]
    if part is not None:
        check_not_input(output, [source], part)
    elif output == PIPE or reading != Reading() or formats[0] != formats[1]:
        check_not_input(output, [source])
    return is_same_file(output, source)


def check_extension(path: str, known: Iterable[str]) -> None:
    """Raise a `Failure` for a file whose extension names no format."""
    extension = Path(path).suffix.lower()
    if extension not in known:
        what = f"{extension!r} is no format that edgel writes"
        if not extension:
            what = f"has no extension, which tells the format; write {path}/ for a folder"
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


def _nearest(folder: Path) -> Path:
    """Return a folder, or the first above it that is there."""
    return next(parent for parent in (folder, *folder.parents) if parent.exists())


def check_new_folder(path: str, files: re.Pattern[str], *, inputs: Iterable[str | None], no_clobber: bool) -> None:
    """Raise a `Failure` for a folder that cannot be made or written, or where a file must not be replaced.

    Parameters
    ----------
    files : pattern
        The names that will be written in it.
    inputs : iterable of str or None
        What the command reads.
    """
    folder, inputs = Path(path), list(inputs)
    check_folder(path, _nearest(folder))
    for file in sorted(folder.glob("*")):
        if files.fullmatch(file.name):
            check_not_input(str(file), inputs, "name another folder")
            check_file(str(file), no_clobber=no_clobber)


def write_cloud(path: str, cloud: Cloud, *, no_clobber: bool = False) -> dict[str, str]:
    """Write a cloud, PLY to stdout when the path is ``-``, and return what became of what the format cannot hold."""
    from edgel.io import FormatWarning

    check_clobber(path, no_clobber=no_clobber)  # once more: the work took its time
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", FormatWarning)
        _write(path, cloud)
    said: dict[str, str] = {}
    for warning in caught:
        if isinstance(warning.message, FormatWarning):
            said |= warning.message.said
        else:
            warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    return said


def _write(path: str, cloud: Cloud) -> None:
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
