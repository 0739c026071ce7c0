"""Forms of kernels that edgel brings along: they are used, give the same, and never stand for another source."""

from pathlib import Path

import pytest
from programs import LISTEN, said_by

PACKAGING = Path(__file__).parents[2] / "packaging"
WRITE = """
from kernel_forms import forms_of
from edgel._kernels import forms
import work
forms.write(forms_of(lambda: (work.total(np.arange(9.0)), work.nearest(np.arange(9.0), 3.2))), path)
"""
USE = f"""
from edgel._kernels import forms
forms.FILE = path
{LISTEN}
import work
x = np.linspace(0, 1, 1001)
print(work.total(x).hex(), work.nearest(x, 0.31), len(set(compiled) & {{"total", "nearest"}}))
"""
WORK = """
from edgel._kernels.parallel import kernel, summing_routine
@summing_routine
def _sum(x):
    total = 0.0
    for i in range(len(x)):
        total += x[i] * x[i]
    return total
@kernel
def total(x):
    return _sum(x) + MORE
@kernel
def nearest(x, to):
    best = 0
    for i in range(len(x)):
        if abs(x[i] - to) < abs(x[best] - to):
            best = i
    return best
"""


@pytest.fixture
def run(tmp_path, monkeypatch):
    (tmp_path / "work.py").write_text(WORK.replace("MORE", "1"))

    def run(program, cache):
        begin = (
            f"import sys, numpy as np, pathlib; path = pathlib.Path('forms.zip'); sys.path.append({str(PACKAGING)!r})"
        )
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / cache))
        return said_by(begin + program, tmp_path).split()

    return run


def test_a_form_gives_what_the_source_gives_and_is_kept_compiled(run, tmp_path):
    *answers, compiled = run(USE, "of_source")
    assert compiled == "2"
    run(WRITE, "of_forms")
    assert run(USE, "of_forms") == [*answers, "0"]
    (tmp_path / "forms.zip").unlink()
    assert run(USE, "of_forms") == [*answers, "0"]


def test_a_form_of_another_source_is_not_used(run, tmp_path):
    run(WRITE, "cache")
    (tmp_path / "work.py").write_text(WORK.replace("MORE", "2"))
    total, _, compiled = run(USE, "cache")
    assert float.fromhex(total) > 2
    assert compiled == "2"


def test_a_damaged_form_is_not_used(run, tmp_path):
    answers = run(USE, "of_source")
    run(WRITE, "of_forms")
    content = bytearray((tmp_path / "forms.zip").read_bytes())
    for place in range(200, len(content) - 400, 97):
        content[place] ^= 1
    (tmp_path / "forms.zip").write_bytes(content)
    assert run(USE, "of_forms") == answers
