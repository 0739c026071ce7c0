"""The manifest: what a folder of results was made of, so that a run goes on where it stopped, and with nothing else."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import llvmlite.binding

import edgel
from edgel.tiled.aside import made_aside
from edgel.tiled.plan import Options
from edgel.tiled.spool import hash_of

FILE = "manifest.json"


def check_manifest(folder: Path, files: Sequence[str], options: Options) -> list[str]:
    """Write the manifest of a new folder, or compare that of an old one; returns what its user should know.

    Raises
    ------
    ValueError
        If the folder holds results of other files, options or another version; the remedy is to overwrite them.
    """
    wanted = {
        "version": edgel.__version__,
        "options": json.loads(json.dumps(asdict(options))),
        "inputs": [_stamp(file) for file in files],
    }
    path, cpu = folder / FILE, llvmlite.binding.get_host_cpu_name()
    if not path.exists():
        stored = {**wanted, "cpus": [cpu]}
    else:
        stored = json.loads(path.read_text())
        before, now = ({"version": of["version"], **of["options"]} for of in (stored, wanted))
        unlike = [f"{key} {before.get(key)}, now {now.get(key)}" for key in now if before.get(key) != now[key]]
        if unlike:
            raise ValueError(
                f"{folder}: holds results of other options ({'; '.join(unlike)}); overwrite them (--overwrite), or "
                "name another folder"
            )
        _compare_inputs(folder, stored["inputs"], wanted["inputs"])
        stored["cpus"] = sorted({*stored["cpus"], cpu})
    with made_aside(path) as beside:
        beside.write_text(json.dumps(stored, indent=1))
    if len(stored["cpus"]) > 1:
        kinds = ", ".join(stored["cpus"])
        return [f"made on several kinds of CPU ({kinds}): the last bits of results may differ between them"]
    return []


def _stamp(file: str) -> dict[str, Any]:
    found = os.stat(file)
    return {"path": os.path.abspath(file), "size": found.st_size, "mtime_ns": found.st_mtime_ns}


def _compare_inputs(folder: Path, before: list[dict[str, Any]], now: list[dict[str, Any]]) -> None:
    if [each["path"] for each in before] != [each["path"] for each in now]:
        raise ValueError(
            f"{folder}: holds results of other files; overwrite them (--overwrite), or name another folder"
        )
    for number, (old, new) in enumerate(zip(before, now, strict=True)):
        if old == new:
            continue
        kept = folder / "work" / "spool" / f"{number:06d}" / "part.json"
        same = old["size"] == new["size"] and kept.exists()
        if not (same and json.loads(kept.read_text())["sha256"] == hash_of(new["path"])):
            raise ValueError(
                f"{new['path']}: changed since {folder} was begun; overwrite it (--overwrite), or name another folder"
            )
