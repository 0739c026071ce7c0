"""The worker of the viewer: of many changes the last counts."""

import threading
import time

from hall import TIMEOUT

from edgel._viewer.latest import Latest


def test_of_many_wakes_only_the_last_counts():
    wanted, seen, may_go = [0], [], threading.Event()

    def work():
        seen.append(wanted[0])
        may_go.wait(TIMEOUT)

    worker = Latest(work, "test")
    for value in range(1, 21):
        wanted[0] = value
        worker.wake()
        time.sleep(0.001)
    may_go.set()
    assert worker.wait_idle(TIMEOUT)
    worker.close()
    assert seen[-1] == 20
    assert len(seen) == 2


def test_worker_survives_an_error(capsys):
    calls = []

    def work():
        calls.append(1)
        raise KeyError("once")

    worker = Latest(work, "test")
    for _ in range(2):
        worker.wake()
        assert worker.wait_idle(TIMEOUT)
    worker.close()
    assert len(calls) == 2
    assert "KeyError" in capsys.readouterr().err


def test_closed_worker_does_nothing():
    calls = []
    worker = Latest(lambda: calls.append(1), "test")
    worker.close()
    worker.wake()
    assert worker.wait_idle(TIMEOUT)
    assert calls == []
