"""Files on disk: open them with clear errors, say what they seem to be, replace them in one step."""

from __future__ import annotations

import os
import re
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, NoReturn

from edgel.io.errors import FormatError, printable

try:
    import fcntl
except ImportError:  # Windows, where an open file cannot be removed or replaced anyway
    fcntl = None

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
    (rb"CCB[\d2]", "a CloudCompare project", "save its clouds as PLY or E57"),
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
COPC = ".copc.laz"  # an extension in two parts
# How the names of temporary files begin; the process and a random word follow.
_TEMPORARY = ".edgel-"


def stem(path: str | os.PathLike[str]) -> str:
    """Return the name of a file without its extension.

    Examples
    --------
    >>> stem("city/a.b.laz"), stem("city/a.copc.laz")
    ('a.b', 'a')
    """
    name = Path(path)
    return name.name[: -len(COPC)] if name.name.lower().endswith(COPC) else name.stem


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
    except ValueError as error:
        raise _no_name(path, error) from None
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(f"{printable(path)}: is a folder; pass one file of it")
    if stat.S_ISREG(status.st_mode) and status.st_size == 0:
        raise FormatError(f"{os.fspath(path)}: the file is empty; write it again")


def _no_name(path: object, error: ValueError) -> FormatError:
    """Return the error of a name with a NUL in it, or with characters that do not exist."""
    return FormatError(f"{path}: is no name that a file can have ({error}); name another file")


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Write a temporary file in the same folder and put it in place of `path` when all went well.

    Whatever ends the program, and when: there is the old file or the whole new one. A replaced file's mode and owner
    stay. What a killed process left in the folder is cleared. A pipe or a device is never replaced: it gets the content
    once that is complete.

    Yields
    ------
    file : binary file
        Open for writing; ``file.name`` is its path, for libraries that open files themselves, and a number where the
        content goes into a pipe or a device.

    Raises
    ------
    OSError
        If the file must not be replaced, or the folder is missing or not writable; nothing is left behind.
    """
    old = check_replaceable(path)
    if old is not None and not stat.S_ISREG(old.st_mode):
        with tempfile.TemporaryFile() as file:
            yield file
            file.seek(0)
            with open(path, "wb", buffering=0) as stream:
                shutil.copyfileobj(file, stream)
        return
    # A link is followed: its target is replaced, the link stays.
    target = Path(os.path.realpath(path))
    _clear_stale(target.parent)
    with _temporary(path, target.parent, old) as file:
        yield file
        file.flush()
        os.fsync(file.fileno())  # the content is on the disk before the name is: a power cut leaves no empty file
        if fcntl is None:
            file.close()  # Windows moves no open file
        try:
            os.replace(file.name, target)
        except OSError as error:
            raise type(error)(f"{printable(path)}: cannot be replaced ({error.strerror}); name another file") from error
        _sync_folder(target.parent)


def check_replaceable(path: str | os.PathLike[str]) -> os.stat_result | None:
    """Return the status of the file that `path` would replace, None where there is none.

    Raises
    ------
    IsADirectoryError, PermissionError
        If it is a folder, a disk, or protected from writing, which renaming another file over it would not notice.
    """
    try:
        status = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except ValueError as error:
        raise _no_name(path, error) from None
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(f"{printable(path)}: is a folder; name the file to write")
    if stat.S_ISBLK(status.st_mode):
        raise PermissionError(f"{printable(path)}: is a disk, not a file; name the file to write")
    if not os.access(path, os.W_OK):
        raise PermissionError(f"{printable(path)}: is protected from writing; name another file, or chmod it")
    return status


@contextmanager
def _temporary(path: str | os.PathLike[str], folder: Path, old: os.stat_result | None) -> Iterator[BinaryIO]:
    """Create a locked file with the mode and owner of an old one, and remove what is left of it at the end."""
    name = folder / f"{_TEMPORARY}{os.getpid()}-{secrets.token_hex(8)}.tmp"
    mode = 0o666 if old is None else stat.S_IMODE(old.st_mode)
    try:
        try:
            file = _create(name, mode)
        except OSError as error:
            reason = "the folder does not exist" if isinstance(error, FileNotFoundError) else error.strerror
            raise type(error)(f"{printable(path)}: cannot be written ({reason}); choose another folder") from error
        with file:
            if old is not None and hasattr(os, "fchown"):
                with suppress(PermissionError):  # only root gives files away
                    os.fchown(file.fileno(), old.st_uid, old.st_gid)
                os.fchmod(file.fileno(), mode)  # after the owner, whose change takes bits away; umask does not count
            yield file
    finally:
        with suppress(OSError):
            name.unlink()


def _create(name: Path, mode: int) -> BinaryIO:
    while True:
        # Never wider than the old file's mode, not even for a moment.
        file = open(name, "xb", opener=lambda path, flags: os.open(path, flags, mode))  # noqa: SIM115
        if fcntl is None:
            return file
        with suppress(OSError):  # some network folders have no locks: nobody clears them then
            fcntl.flock(file, fcntl.LOCK_EX)
        if os.fstat(file.fileno()).st_nlink:
            return file
        file.close()  # another process took it for stale before it was locked


def _clear_stale(folder: Path) -> None:
    """Remove the temporary files of processes that were killed: nobody holds their lock any more."""
    if fcntl is None:
        return
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if not (entry.name.startswith(_TEMPORARY) and entry.name.endswith(".tmp")):
                continue
            with suppress(OSError):  # locked, or not ours to remove
                if not entry.is_file(follow_symlinks=False):
                    continue
                with open(entry.path, "r+b") as file:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    os.unlink(entry.path)


def _sync_folder(folder: Path) -> None:
    """Put a new name on the disk, where the system can."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
