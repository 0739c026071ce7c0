"""Whatever ends the program while it writes: the old file or the whole new one, and nothing beside it."""

import itertools
import multiprocessing
import os
import signal
import stat
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from edgel import Cloud, plot
from edgel.io import WRITERS, FormatError, FormatWarning, read, write
from edgel.io.files import replacing

FORMATS = [".ply", ".pcd", ".las", ".laz", ".xyz", ".npy", ".npz", ".e57"]

posix = pytest.mark.skipif(sys.platform == "win32", reason="signals, modes and pipes of POSIX")


def sheet(number, num=6000):
    """A cloud that tells by its heights which one it is, and whole by their number."""
    x, y = np.divmod(np.arange(num, dtype=np.float64), 80)
    return Cloud(np.column_stack([x, y, np.full(num, float(number))]), {"label": np.full(num, number, np.uint16)})


@pytest.fixture
def needs(request):
    if ".e57" in request.node.callspec.params.values():
        pytest.importorskip("pye57", reason="the extra e57 is not installed")


def write_forever(path):
    for number in itertools.count(1):
        write(path, sheet(number % 1000))


def check_whole(path, num=6000):
    found = read(path)
    assert len(found) == num
    assert len(np.unique(found.xyz[:, 2])) == 1
    assert (found.attributes["label"] == found.xyz[:, 2]).all()


@posix
@pytest.mark.usefixtures("needs")
@pytest.mark.parametrize("suffix", FORMATS)
def test_killed_at_any_moment(tmp_path, suffix):
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["edgel.io", "edgel.io.las"])
    path = tmp_path / f"a{suffix}"
    rng = np.random.default_rng(0)
    for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGINT) * 3:
        write(path, sheet(0))
        first = path.stat().st_ino
        process = context.Process(target=write_forever, args=(path,))
        process.start()
        assert process.pid is not None
        while path.stat().st_ino == first and process.is_alive():
            time.sleep(0.001)
        time.sleep(rng.uniform(0, 0.05))
        os.kill(process.pid, number)
        process.join()
        assert process.exitcode == (1 if number == signal.SIGINT else -number)  # a crash would be another signal
        check_whole(path)
        if number == signal.SIGINT:
            assert list(tmp_path.iterdir()) == [path]
        write(path, sheet(1))
        assert list(tmp_path.iterdir()) == [path]


@posix
@pytest.mark.usefixtures("needs")
@pytest.mark.parametrize("suffix", FORMATS)
def test_a_full_disk(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    write(path, sheet(7))
    code = f"""
import resource, signal, sys
import numpy as np
from edgel import Cloud, io
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))
try:
    io.write({str(path)!r}, Cloud(np.random.default_rng(0).random((50_000, 3))))
except OSError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip()
    check_whole(path)
    assert list(tmp_path.iterdir()) == [path]


@posix
def test_mode_and_owner_of_a_replaced_file_stay(tmp_path):
    path = tmp_path / "a.ply"
    write(path, sheet(1))
    os.chmod(path, 0o666)
    if os.geteuid() == 0:
        os.chown(path, 1234, 5678)
    before = path.stat()
    with replacing(path) as file:
        assert stat.S_IMODE(os.stat(file.name).st_mode) == 0o666
        file.write(b"new")
    after = path.stat()
    assert (after.st_mode, after.st_uid, after.st_gid) == (before.st_mode, before.st_uid, before.st_gid)
    assert after.st_ino != before.st_ino


@posix
@pytest.mark.skipif(sys.platform != "win32" and os.geteuid() == 0, reason="root may write every file")
def test_a_protected_file_is_not_replaced(tmp_path):
    path = tmp_path / "a.ply"
    write(path, sheet(1))
    os.chmod(path, 0o444)
    with pytest.raises(PermissionError, match="protected from writing"):
        write(path, sheet(2))
    check_whole(path)


@posix
def test_temporaries_of_the_dead_are_cleared_and_those_of_the_living_stay(tmp_path):
    path = tmp_path / "a.ply"
    dead = tmp_path / ".edgel-1-0123456789abcdef.tmp"
    dead.write_bytes(b"half")
    (tmp_path / ".edgel-notes").write_text("not ours")
    os.mkfifo(tmp_path / ".edgel-2-0123456789abcdef.tmp")
    with replacing(path) as file:
        assert not dead.exists()
        write(tmp_path / "b.ply", sheet(1))
        assert os.path.exists(file.name)
        file.write(b"whole")
    assert path.read_bytes() == b"whole"
    names = {".edgel-2-0123456789abcdef.tmp", ".edgel-notes", "a.ply", "b.ply"}
    assert {entry.name for entry in tmp_path.iterdir()} == names


@posix
@pytest.mark.usefixtures("needs")
@pytest.mark.parametrize("suffix", FORMATS)
def test_a_pipe_gets_the_content_or_is_refused_and_stays(tmp_path, suffix):
    pipe, copy = tmp_path / f"pipe{suffix}", tmp_path / f"copy{suffix}"
    os.mkfifo(pipe)
    if suffix == ".e57":
        with pytest.raises(FormatError, match="into no pipe"):
            write(pipe, sheet(3))
    else:
        reader = threading.Thread(target=lambda: copy.write_bytes(pipe.read_bytes()))
        reader.start()
        write(pipe, sheet(3))
        reader.join()
        check_whole(copy)
    assert stat.S_ISFIFO(pipe.stat().st_mode)


@posix
@pytest.mark.usefixtures("needs")
@pytest.mark.parametrize("suffix", FORMATS)
def test_a_device_is_never_removed(tmp_path, suffix):
    device = tmp_path / f"full{suffix}"
    device.symlink_to("/dev/full")
    with pytest.raises((OSError, FormatError)):
        write(device, sheet(3))
    assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


@pytest.mark.usefixtures("needs")
@pytest.mark.filterwarnings("ignore::edgel.FormatWarning")  # PTS has no place for them
@pytest.mark.parametrize("suffix", WRITERS)
def test_an_empty_cloud_with_vectors(tmp_path, suffix):
    vectors = {"normal": np.empty((0, 3), np.float32), "id": np.empty(0, np.uint64), "nothing": np.empty((0, 0))}
    write(tmp_path / f"a{suffix}", Cloud(np.empty((0, 3)), vectors))
    assert len(read(tmp_path / f"a{suffix}")) == 0


def test_two_names_that_a_text_makes_one_stay_two(tmp_path):
    cloud = Cloud(np.eye(3), {"a/b": np.arange(3), "a_b": np.arange(3) + 5})
    with pytest.warns(FormatWarning, match="a/b: renamed a_b; a_b: renamed a_b_2"):
        write(tmp_path / "a.csv", cloud)
    assert read(tmp_path / "a.csv").attributes["a_b_2"].tolist() == [5, 6, 7]


def test_pictures_are_written_in_one_step_too(tmp_path):
    path = tmp_path / "a.png"
    path.write_bytes(b"old")
    with pytest.raises(TypeError):
        plot.save(path, np.zeros((2, 2, 3)))  # no image of doubles
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
