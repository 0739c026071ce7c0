"""One cloud after the other, or several at a time: each is told of when it is done, what failed is named at the end."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass

import typer

from edgel._cli.errors import ExitCode, Failure, about, error_facts, show_traceback, tell
from edgel._cli.jobs import Job
from edgel._cli.outcome import Failed, Told, Work, attempt
from edgel._cli.output import count, print_json, print_line, print_table, schema
from edgel._cli.progress import Watch


def show_told(told: Told, among: bool) -> None:
    """Tell on stderr of a cloud that is done, alone or among others."""
    if among:
        print_line(told.headline)
    elif told.title:
        print_table(told.title, told.rows)
    for text, style in told.remarks:
        print_line(f"  {text}" if among else text, style=style)
    for text in () if among else told.written:
        print_line(text)


@dataclass(frozen=True)
class Talk:
    """How a command speaks.

    Attributes
    ----------
    name : str
        Of the command, and of its schema.
    as_json, quiet, debug : bool
        As the options of these names say.
    show : callable
        ``show(told, among)`` tells people of a cloud.
    """

    name: str
    as_json: bool = False
    quiet: bool = False
    debug: bool = False
    show: Callable[[Told, bool], None] = show_told


def run_jobs(jobs: Sequence[Job], work: Work, talk: Talk, *, workers: int = 1) -> None:
    """Do all jobs, tell of each in their order, and end the program if some failed, with the code of the first."""
    if workers < 1:
        raise Failure(ExitCode.USAGE, f"--workers: expected 1 or more, got {workers}")
    failures: list[tuple[Job, Failed]] = []
    with Watch(quiet=talk.quiet) as watch:
        if workers > 1 and len(jobs) > 1:
            from edgel._cli.workers import side_by_side  # not at the top: one cloud needs no other processes

            results = side_by_side(jobs, work, watch, workers)
        else:
            results = _in_turn(jobs, work, watch)
        with closing(results):  # whatever happens meanwhile: no process is left at work
            for job, result in results:
                with watch.aside():
                    if isinstance(result, Failed):
                        failures.append((job, result))
                        _tell_failure(job, result, talk, among=len(jobs) > 1)
                    elif talk.as_json:
                        print_json({**schema(talk.name), **result.facts})
                    elif not talk.quiet:
                        talk.show(result, len(jobs) > 1)
    if len(jobs) > 1 and failures:
        others = ", the others are done" if len(failures) < len(jobs) else ""
        tell(f"{count(len(failures))} of {count(len(jobs))} inputs failed{others}:")
        for job, failed in failures:
            print_line(f"  {about(job.source, failed.message)}")
    if failures:
        raise typer.Exit(int(failures[0][1].code))


def _in_turn(jobs: Sequence[Job], work: Work, watch: Watch) -> Generator[tuple[Job, Told | Failed]]:
    for number, job in enumerate(jobs, 1):
        if len(jobs) > 1:
            watch.begin(f"{number} of {len(jobs)}", job.source)
        yield job, attempt(work, job, watch)


def _tell_failure(job: Job, failed: Failed, talk: Talk, *, among: bool) -> None:
    """Tell at once of a job that failed; why is said at the end if there are others."""
    if talk.debug:
        show_traceback(failed.trace)
    if not among:
        tell(failed.message)
    elif not talk.quiet:
        print_line(f"{job.source}: failed", style="red")
    if talk.as_json:
        print_json(error_facts(job.source, failed.code, failed.message))
