"""Ctrl-C and SIGTERM at any moment: the conventional exit code, no traceback, and nothing left behind."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import edgel

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")


def start(*words, python=(), **environment):
    """Start the program with signals as a terminal has them, whoever runs the tests."""

    def as_in_a_terminal():
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)

    return subprocess.Popen(
        [sys.executable, *python, "-m", "edgel", *map(str, words)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env={**os.environ, **environment},
        preexec_fn=as_in_a_terminal,
    )


def told(process, words):
    """Read what the program says until it says these words."""
    for line in process.stderr:
        if words in line:
            return
    pytest.fail(f"ended with {process.wait()}, and never said {words!r}")


def ended(process):
    """Wait for the end, and return the exit code and the last words."""
    _, words = process.communicate(timeout=120)
    assert b"Traceback" not in words
    assert b"Exception ignored" not in words
    return process.returncode, words


@pytest.fixture
def scan(tmp_path):
    edgel.write(tmp_path / "a.npy", edgel.Cloud(np.random.default_rng(0).random((400_000, 3))))
    return tmp_path / "a.npy"


@pytest.mark.parametrize("module", [b"numpy", b"numba.core.types", b"typer"])
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_while_modules_are_imported(module, number, code, tmp_path):
    process = start("info", tmp_path / "a.ply", python=["-X", "importtime"])
    told(process, module)
    process.send_signal(number)
    assert ended(process)[0] == code


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("threads", ["1", "2"])
def test_while_kernels_are_compiled(scan, tmp_path, number, code, threads):
    process = start("info", scan, NUMBA_CACHE_DIR=str(tmp_path / "cache"), EDGEL_NUM_THREADS=threads)
    told(process, b"compiling kernels")
    process.send_signal(number)
    got, words = ended(process)
    assert got == code
    assert b"nothing was left half written" in words
    assert not list((tmp_path / "cache").rglob("*.tmp"))


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 143)], ids=str
)
def test_while_a_file_is_written(scan, tmp_path, number, code):
    process = start("convert", scan, tmp_path / "b.xyz")
    while not list(tmp_path.glob(".*.tmp")):
        assert process.poll() is None
        time.sleep(0.005)
    process.send_signal(number)
    process.send_signal(number)  # whoever presses it twice
    assert ended(process)[0] == code
    assert [path.name for path in tmp_path.iterdir()] == ["a.npy"]


def test_what_is_ignored_stays_ignored(scan, tmp_path):
    command = [sys.executable, "-m", "edgel", "convert", scan, tmp_path / "b.xyz"]
    ignoring = lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN)  # noqa: E731 - as nohup does
    with subprocess.Popen(command, stderr=subprocess.PIPE, preexec_fn=ignoring) as process:
        while not list(tmp_path.glob(".*.tmp")):
            assert process.poll() is None
            time.sleep(0.005)
        process.send_signal(signal.SIGHUP)
        assert ended(process)[0] == 0
    assert len(edgel.read(tmp_path / "b.xyz")) == 400_000
