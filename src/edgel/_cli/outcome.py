"""What comes of one cloud: what a command says of it, or why it could not be done."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from edgel._cli.errors import ExitCode, verdict
from edgel._cli.jobs import Job
from edgel.cloud import Cloud
from edgel.io.errors import FormatWarning


@dataclass(frozen=True)
class Told:
    """What a command says of a cloud that it is done with.

    Attributes
    ----------
    facts : dict
        What ``--json`` prints.
    title : str
    rows : sequence of tuple of str
        The table under that title, shown of a cloud alone.
    headline : str
        What is shown instead of a cloud among others.
    remarks : sequence of (str, str or None)
        Lines that are shown of either, and their style.
    written : sequence of str
        Lines that say what lies where, shown of a cloud alone.
    """

    facts: dict[str, Any]
    title: str = ""
    rows: Sequence[tuple[str, ...]] = ()
    headline: str = ""
    remarks: Sequence[tuple[str, str | None]] = ()
    written: Sequence[str] = ()


def notices(cloud: Cloud) -> list[str]:
    """Return what a reader found that the user should know: a mesh, the camera that was used."""
    return [*cloud.metadata.get("notices", ())]


def sentences(lost: Mapping[str, str]) -> list[str]:
    """Say what became of what an output has not kept, by its name."""
    return FormatWarning("", lost).lines()


def cautions(job: Job, cloud: Cloud, lost: Mapping[str, str]) -> list[tuple[str, str | None]]:
    """Return the remarks of what was found in the input, and of what the output has not kept."""
    lines = [f"{job.name}: {notice}" for notice in notices(cloud)]
    lines += [f"{job.target}: the format could not keep all"] if lost else []
    return [*((line, "yellow") for line in lines), *((f"  {line}", None) for line in sentences(lost))]


@dataclass(frozen=True)
class Failed:
    """What is said of a cloud that a command could not do."""

    code: ExitCode
    message: str
    trace: str


Work: TypeAlias = Callable[[Job, Callable[[str], None]], Told]
"""What a command does with one cloud; the second argument wants the name of each stage as it begins."""


def attempt(work: Work, job: Job, progress: Callable[[str], None]) -> Told | Failed:
    """Do one job, and return what went wrong instead of raising it; to be interrupted is no failure."""
    try:
        return work(job, progress)
    except Exception as error:
        code, message = verdict(error)
        return Failed(code, message, traceback.format_exc())
