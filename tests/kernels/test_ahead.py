"""Kernels compiled ahead: the list is that of the first jobs, and other processes compile what it names."""

import os
import threading

import first_jobs
import numpy as np
import pytest
from numba import typeof
from programs import LISTEN, said_by
from typer.testing import CliRunner

from edgel._cli import app
from edgel._cli.errors import ExitCode
from edgel._kernels import ahead
from edgel._kernels.cache import KernelCache
from edgel._surface.forest import load_forests

PROGRAM = f"""
import time
from edgel._kernels import ahead
names = ["a", "b", "c", "d"]
ahead.first_jobs = lambda: {{"job": {{f"work:{{name}}": "f8[1]" for name in names}}}}
import numpy as np, work
{LISTEN}
work.a(np.ones(3))
while len(ahead._begun) < len(names):
    time.sleep(0.01)
print([getattr(work, name)(np.ones(3)) for name in names], compiled)
"""


def test_types_are_read_as_they_were_written():
    trees = load_forests()["screen"].in_step
    for value in (3, 2.0, True, np.float32(1), (1, 2), np.zeros((2, 3), np.float32), np.zeros(2, bool), trees):
        assert ahead.types_of(ahead.words_of([typeof(value)])) == (typeof(value),)


@pytest.mark.skipif(
    bool(os.environ.get("NUMBA_BOUNDSCHECK")), reason="kernels whose indices are checked are not those of users"
)
@pytest.mark.parametrize("job", first_jobs.JOBS)
def test_the_list_is_what_the_first_jobs_need(job):
    needed = dict(line.split(" ", 2)[1:] for line in first_jobs.lines(job))
    assert needed == ahead.first_jobs()[job], "python tests/first_jobs.py writes the list anew"


def test_other_processes_compile_what_this_one_has_not_begun(tmp_path, monkeypatch):
    kernels = [f"@kernel\ndef {name}(x):\n    return x[0] + {number}\n" for number, name in enumerate("abcd")]
    (tmp_path / "work.py").write_text("from edgel._kernels.parallel import kernel\n" + "\n".join(kernels))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    for threads, own in ("1", "['a', 'b', 'c', 'd']"), ("2", "['a"):
        monkeypatch.setenv("EDGEL_NUM_THREADS", threads)
        program = PROGRAM if threads == "2" else PROGRAM.replace("while len", "while False and len")
        answers, compiled = said_by(program, tmp_path).split("] ")
        assert answers == "[1.0, 2.0, 3.0, 4.0"
        assert compiled.startswith(own)
        assert len(list((tmp_path / "cache").rglob("*.nbc"))) == 4
        for path in (tmp_path / "cache").rglob("*.nbc"):
            path.unlink()
    assert "'d'" not in compiled


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_child_forked_while_another_thread_looks_finds_nobody_looking():
    looks, done = threading.Event(), threading.Event()

    def look():
        with ahead._lock:
            looks.set()
            done.wait(0.2)

    other = threading.Thread(target=look)
    other.start()
    looks.wait()
    child = os.fork()
    if child == 0:
        os._exit(0 if ahead._lock.acquire(timeout=10) else 1)
    other.join()
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert not ahead._lock.locked()


def test_warming_up_compiles_what_is_listed_and_says_where_it_cannot_be_kept(monkeypatch):
    compiled = []
    monkeypatch.setattr(ahead, "first_jobs", lambda: {"one": {"a:b": "f8[1]", "a:c": "i8"}, "two": {"a:b": "f8[1]"}})
    monkeypatch.setattr(ahead, "_compile", lambda *kernel: compiled.append(kernel))
    done = CliRunner().invoke(app, ["warmup"])
    assert done.exit_code == 0, done.output
    assert "kernels are ready" in done.output
    assert compiled == [("a:b", "f8[1]"), ("a:c", "i8")]
    monkeypatch.setattr(KernelCache, "keeps", False)
    done = CliRunner().invoke(app, ["warmup"])
    assert done.exit_code == ExitCode.OUTPUT
    assert "NUMBA_CACHE_DIR" in done.stderr
