"""A process that reads damaged files one after the other and says how it went: python fuzz_worker.py [MALFORMED].

Each line of stdin is ``reader first count``; each input gives two lines of JSON on stdout, before and after it. What
is printed on stderr while an input is read counts against it.
"""

import contextlib
import json
import os
import resource
import sys
import tempfile
import time
import warnings
from pathlib import Path

from fuzz_mutations import mutate
from fuzz_seeds import CAMERA, make_seeds

from edgel.io import FormatError, Intrinsics, read, read_intrinsics

MOST_SECONDS = 5
MOST_ADDRESSES = 4 << 30
CAMERA_OF_SEEDS = Intrinsics(**json.loads(CAMERA))
DOCUMENTED = (FormatError, FileNotFoundError, IsADirectoryError, PermissionError)


def most_growth(size: int) -> int:
    """Bytes that reading a file of `size` bytes may take."""
    return 200 * 10**6 + 20 * size


def _memory(key: str) -> int:
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) * 1024 for line in file if line.startswith(key))


def _read(path: Path) -> None:
    if path.suffix in (".json", ".yaml"):
        read_intrinsics(path)
    elif path.suffix in (".png", ".tif"):
        read(path, intrinsics=CAMERA_OF_SEEDS)
    else:
        read(path)


def measure(path: Path) -> dict:
    """Read one file; say what came of it, and what is wrong with that."""
    with contextlib.suppress(OSError), open("/proc/self/clear_refs", "w") as file:
        file.write("5")  # the peak begins anew
    before, started = _memory("VmRSS"), time.process_time()
    fault = None
    try:
        _read(path)
        outcome = "read"
    except DOCUMENTED:
        outcome = "refused"
    except BaseException as error:  # a panic of Rust is no Exception
        outcome, fault = "fault", f"{type(error).__name__}: {str(error)[:300]}"
    seconds, growth = time.process_time() - started, _memory("VmHWM") - before
    if seconds > MOST_SECONDS:
        fault = f"took {seconds:.1f} s"
    elif growth > most_growth(path.stat().st_size):
        fault = f"took {growth / 1e6:.0f} MB"
    return {"outcome": outcome, "fault": fault, "seconds": seconds, "growth": growth}


def main() -> None:
    warnings.simplefilter("always")
    malformed = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    seeds = make_seeds(malformed)
    out = os.fdopen(os.dup(1), "w", buffering=1)
    with tempfile.TemporaryDirectory() as folder, open(Path(folder, "stderr"), "w+b") as printed:
        for reader, files in seeds.items():  # kernels are compiled, libraries loaded
            for suffix, raw in files:
                path = Path(folder, f"{reader}{suffix}")
                path.write_bytes(raw)
                with contextlib.suppress(FormatError):
                    _read(path)
        resource.setrlimit(resource.RLIMIT_AS, (_memory("VmSize") + MOST_ADDRESSES, resource.RLIM_INFINITY))
        os.dup2(printed.fileno(), 2)
        print(json.dumps({"ready": sorted(seeds)}), file=out)
        for line in sys.stdin:
            reader, first, count = line.split()
            for number in range(int(first), int(first) + int(count)):
                suffix, raw = mutate(reader, number, seeds[reader])
                path = Path(folder, f"input{suffix}")
                path.write_bytes(raw)
                print(json.dumps({"number": number}), file=out)
                result = measure(path)
                sys.stderr.flush()
                if printed.seek(0, 2):
                    printed.seek(0)
                    result["fault"] = result["fault"] or f"printed {printed.read(300)!r}"
                    printed.seek(0)
                    printed.truncate()
                print(json.dumps({"number": number, "bytes": len(raw), **result}), file=out)


if __name__ == "__main__":
    main()
