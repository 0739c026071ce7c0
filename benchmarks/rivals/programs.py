"""The rivals in C++: all are fed the same bytes."""

from __future__ import annotations

import os
import struct
import subprocess
import tempfile
from pathlib import Path

import numpy as np

import edgel

from .interface import THREADS

HERE = Path(__file__).resolve().parent
BUILT = HERE.parent / "cache" / "rivals"


def missing(program: str) -> str | None:
    """Return None, or how to get the program."""
    if (BUILT / program).is_file():
        return None
    return f"{program} is not built: apt-get install cmake g++ libpcl-dev libcgal-dev, then benchmarks/rivals/build.sh"


def raw_bytes(cloud: edgel.Cloud) -> bytes:
    """Return a cloud as the bytes that every program reads (cpp/raw.hpp)."""
    rows, columns = cloud.shape or (0, 0)
    viewpoint = (np.nan,) * 3 if cloud.viewpoint is None else cloud.viewpoint
    head = b"EDGELRAW" + struct.pack("<3q3d", rows, columns, len(cloud), *viewpoint)
    return head + np.ascontiguousarray(cloud.xyz, "<f8").tobytes()


def run(program: str, cloud: edgel.Cloud, dtype: str, **options: object) -> tuple[np.ndarray, float]:
    """Run a program over a cloud and return its answer, flat, and the seconds it computed."""
    with tempfile.TemporaryDirectory(prefix="edgel-rival-") as folder:
        fed, answer = Path(folder, "in.raw"), Path(folder, "out.raw")
        fed.write_bytes(raw_bytes(cloud))
        done = subprocess.run(
            [str(BUILT / program), str(fed), str(answer), *(f"{key}={_text(value)}" for key, value in options.items())],
            capture_output=True,
            text=True,
            env={**os.environ, "OMP_NUM_THREADS": str(THREADS)},
        )
        if done.returncode != 0:
            raise RuntimeError(f"{program}: {done.stderr.strip() or f'ended with {done.returncode}'}")
        seconds = next(float(line.split()[1]) for line in done.stdout.splitlines() if line.startswith("seconds "))
        return np.fromfile(answer, dtype), seconds


def _text(value: object) -> str:
    if isinstance(value, np.ndarray):
        return ",".join(repr(float(number)) for number in value.ravel())
    return str(value)
