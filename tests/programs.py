"""Programs in a process of their own, where kernels are compiled anew."""

import subprocess
import sys
from pathlib import Path

LISTEN = """
from numba.core import event
compiled = []
class Listener(event.Listener):
    def on_start(self, event): compiled.append(event.data["dispatcher"].py_func.__name__)
    def on_end(self, event): pass
event.register("numba:compile", Listener())
"""
"""Text of a program that keeps the names of what it compiles from here on."""


def said_by(program: str, folder: Path) -> str:
    """Run the text of a program in a folder, which has to end well and to warn of nothing, and return what it says."""
    words = [sys.executable, "-B", "-c", program]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout
