"""Kernels on disk: whatever is wrong with a file there, the kernel runs; and it is never an old one."""

import pickle

import pytest
from programs import LISTEN, said_by

PROGRAM = f"""
{LISTEN}
import outer
print(outer.twice(3), outer.thrice(3), len(compiled))
"""
INNER = """
from edgel._kernels.parallel import kernel, part
FACTOR = {factor}
@part
def product(x, y):
    return x * y + {more}
"""
OUTER = """
from edgel._kernels.parallel import kernel
from inner import FACTOR, product
@kernel
def twice(x):
    return product(x, 2)
@kernel
def thrice(x):
    return FACTOR * x
"""


class Moved:
    """A class that is gone when its pickle is read."""


@pytest.fixture
def run(tmp_path, monkeypatch):
    cache = tmp_path / "cache"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(cache))
    (tmp_path / "outer.py").write_text(OUTER)

    def run(factor=3, more=0):
        (tmp_path / "inner.py").write_text(INNER.format(factor=factor, more=more))
        return [int(word) for word in said_by(PROGRAM, tmp_path).split()]

    return run


def files(tmp_path):
    found = [path for path in (tmp_path / "cache").rglob("*") if path.is_file()]
    assert found
    return found


def test_kept_between_runs(run, tmp_path):
    assert run() == [6, 9, 3]
    assert run() == [6, 9, 0]
    assert all(path.suffix == ".nbc" for path in files(tmp_path))


def damage_moved(content):
    moved = pickle.dumps(Moved()).replace(b"test_cache", b"gone_cache")
    return content[:64] + moved


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: b"garbage",
        lambda content: content[: len(content) // 2],
        lambda content: content[:-1],
        lambda content: content[:-2000] + bytes([content[-2000] ^ 1]) + content[-1999:],
        lambda content: bytes(len(content)),
        lambda content: pickle.dumps((1, 2)),
        damage_moved,
    ],
    ids=["empty", "garbage", "half", "one byte less", "one bit", "zeros", "another pickle", "class has moved"],
)
def test_damaged_files_are_made_anew(run, tmp_path, damage):
    run()
    for path in files(tmp_path):
        path.write_bytes(damage(path.read_bytes()))
    assert run() == [6, 9, 3]
    assert run() == [6, 9, 0]


def test_a_pickle_of_classes_that_have_moved_is_made_anew(run, tmp_path, monkeypatch):
    """With its checksum right, as an update of a package leaves it."""
    from hashlib import sha256

    run()
    moved = pickle.dumps(Moved()).replace(b"test_cache", b"gone_cache")
    for path in files(tmp_path):
        path.write_bytes(path.read_bytes()[:32] + sha256(moved).digest() + moved)
    assert run() == [6, 9, 3]


def test_what_is_inlined_or_constant_belongs_to_a_kernel(run):
    assert run() == [6, 9, 3]
    assert run(more=1)[:2] == [7, 9]
    assert run(factor=5)[:2] == [6, 15]


def test_a_folder_in_the_place_of_a_file(run, tmp_path):
    run()
    for path in files(tmp_path):
        path.unlink()
        path.mkdir()
    assert run() == [6, 9, 3]


def test_a_folder_that_cannot_be(run, tmp_path, monkeypatch):
    (tmp_path / "file").write_bytes(b"")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.setenv("HOME", str(tmp_path / "file"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    (tmp_path / "__pycache__").write_bytes(b"")  # beside the module no folder can be made either
    assert run() == [6, 9, 3]
