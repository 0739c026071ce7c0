"""The short run of ``tests/fuzz/run.py``: the same inputs every time, as many as a minute allows."""

import os

import pytest
from run import fuzz

SECONDS = float(os.environ.get("EDGEL_FUZZ_SECONDS", "60"))


@pytest.mark.skipif(not os.path.exists("/proc/self/clear_refs"), reason="memory is measured by Linux's /proc")
def test_damaged_files_are_read_or_refused():
    tally = fuzz(11_000, SECONDS, processes=1)
    assert tally.faults == [], "python tests/fuzz/run.py --only READER:NUMBER reads one again"
    assert len(tally.outcomes) >= 10
