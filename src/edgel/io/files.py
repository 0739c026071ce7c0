"""Files on disk: open them with clear errors, say what they seem to be, replace them in one step."""

from __future__ import annotations

import os
import re
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, NoReturn

from edgel.io.errors import FormatError, printable

# What the first bytes of a file give away: pattern, what it is, what to do with it.
_MAGIC: list[tuple[bytes, str, str]] = [
    (rb"ply[\r\n]", "a PLY point cloud", "name it .ply"),
    (rb"\s*(#\s*\.PCD|VERSION\s+\.|VERSION\s+0\.\d|FIELDS\s)", "a PCD point cloud", "name it .pcd"),
    (rb"LASF", "a LAS or LAZ point cloud", "name it .las or .laz"),
    (rb"ASTM-E57", "an E57 point cloud", "name it .e57"),
    (rb"\x93NUMPY", "a NumPy array", "name it .npy"),
    (rb"PK\x03\x04", "a zip archive or NumPy .npz", "name it .npz if NumPy wrote it, else unpack it"),
    (rb"\x89PNG", "a PNG image", "name it .png and pass intrinsics if it holds depth"),
    (rb"II\*\x00|MM\x00\*|II\+\x00|MM\x00\+", "a TIFF image", "name it .tif and pass intrinsics if it holds depth"),
    (rb"\xff\xd8\xff", "a JPEG image", "a photograph holds no points; pass the depth image"),
    (rb"ISO-10303-21", "a STEP model", "it is a CAD model, not a point cloud; sample it first"),
    (rb"glTF", "a glTF model", "it is a mesh, not a point cloud; sample it first"),
    (rb"solid\s", "an STL mesh", "it is a mesh, not a point cloud; sample it first"),
    (rb"\x89MCAP|#ROSBAG", "a ROS recording", "convert its point clouds to PCD first"),
    (rb"\x1f\x8b", "gzip-compressed", "unpack it first (gunzip)"),
    (rb"BZh|\xfd7zXZ|\x28\xb5\x2f\xfd|7z\xbc\xaf", "a compressed archive", "unpack it first"),
    (rb"\x89HDF", "an HDF5 file", "convert it to .npz first"),
    (rb"%PDF", "a PDF document", "pass the file of the points"),
    (rb"\s*<(!DOCTYPE|html|\?xml)", "a web page or XML document", "check that the download was complete"),
    (rb"version https://git-lfs", "a Git LFS pointer", "fetch the data with `git lfs pull`"),
]
_NUMBERS = re.compile(
    rb"\s*[-+]?(\d|\.\d|nan)[-+.\deEnaif]*([\s,;]+[-+]?(\d|\.\d|nan)[-+.\deEnaif]*){2,}", re.IGNORECASE
)


def describe(head: bytes) -> tuple[str, str]:
    """Say what a file seems to be from its first bytes, and what to do with it.

    Examples
    --------
    >>> describe(b"LASF...")
    ('a LAS or LAZ point cloud', 'name it .las or .laz')
    """
    for pattern, what, remedy in _MAGIC:
        if re.match(pattern, head):
            return what, remedy
    if _NUMBERS.match(head):
        return "a text of x y z columns", "name it .xyz, .txt or .csv"
    if head and b"\0" not in head and all(byte >= 9 for byte in head):
        line = head.splitlines()[0][:60].decode("utf-8", "replace") if head.splitlines() else ""
        return f"a text that begins with {line!r}", "pass the file of the points"
    return f"an unknown binary format that begins with {head[:8]!r}", "pass the file of the points"


def wrong_magic(path: object, expected: str, head: bytes) -> NoReturn:
    """Raise the FormatError of a file whose content is not what its name says."""
    if not head.strip():
        raise FormatError(f"{path}: the file is empty; write it again")
    what, remedy = describe(head)
    raise FormatError(f"{path}: not {expected}; the file seems to be {what}: {remedy}")


@contextmanager
def reading(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a file for reading, with an error that says what is wrong with its name.

    Raises
    ------
    FileNotFoundError, IsADirectoryError, PermissionError
        With the path and the remedy.
    FormatError
        If the file is empty.
    """
    check_readable(path)
    with open(path, "rb") as file:
        yield file


def check_readable(path: str | os.PathLike[str]) -> None:
    """Raise the clear error of a path that is missing, a folder, or an empty file."""
    try:
        status = os.stat(path)
    except FileNotFoundError:
        raise FileNotFoundError(f"{printable(path)}: no such file; check the name and the folder") from None
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(f"{printable(path)}: is a folder; pass one file of it")
    if stat.S_ISREG(status.st_mode) and status.st_size == 0:
        raise FormatError(f"{os.fspath(path)}: the file is empty; write it again")


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Write a temporary file in the same folder and put it in place of `path` when all went well.

    The old file stays whole until the new one is complete, so a cloud may be written over the file it came from.

    Yields
    ------
    file : binary file
        Open for writing; ``file.name`` is its path, for libraries that open files themselves.

    Raises
    ------
    OSError
        If the folder is missing or not writable; nothing is left behind.
    """
    # A link is followed: its target is replaced, the link stays.
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise IsADirectoryError(f"{printable(path)}: is a folder; name the file to write")
    if target.exists() and not target.is_file():  # a device or a pipe cannot be replaced
        with open(target, "wb") as file:
            yield file
        return
    temporary = target.parent / f".edgel-{secrets.token_hex(8)}.tmp"
    try:
        file = open(temporary, "xb")  # noqa: SIM115 - closed below, before the file is moved
    except OSError as error:
        reason = "the folder does not exist" if isinstance(error, FileNotFoundError) else error.strerror
        raise type(error)(f"{printable(path)}: cannot be written ({reason}); choose another folder") from error
    try:
        with file:
            yield file
        os.replace(temporary, target)
    except BaseException:
        with suppress(FileNotFoundError):
            temporary.unlink()
        raise
