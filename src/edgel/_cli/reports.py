"""``--report`` of ``edgel detect``: one page for each cloud."""

from __future__ import annotations

from pathlib import Path

import edgel
from edgel._cli import files
from edgel._cli.errors import ExitCode, failing_as
from edgel._cli.jobs import Job
from edgel._cli.options import PAPER
from edgel.edges import Edges


def check_report(job: Job, reading: files.Reading) -> None:
    """Raise a `Failure` for a report that cannot be written, or must not."""
    if job.report is not None:
        from edgel._report import check_drawing, file_names  # not at the top: it takes time to import

        with failing_as(ExitCode.OUTPUT, job.report):
            check_drawing()
        names = file_names([_name_of(job.source)])
        inputs = [job.source, reading.intrinsics]
        files.check_new_folder(job.report, names, inputs=inputs, no_clobber=job.no_clobber)


def _name_of(source: str) -> str:
    """Return what a report calls an input."""
    return "stdin" if source == files.PIPE else Path(source).stem


def report_on(job: Job, cloud: edgel.Cloud, edges: Edges, directory: str) -> Path:
    """Write the report of one cloud, compared with what the other detector finds in it, and return its page."""
    from edgel._report import Case, write_report  # not at the top: Matplotlib takes time to import

    name = _name_of(job.source)
    find_other = edgel.detect if edges.method == PAPER else edgel.paper.detect
    try:
        other = find_other(cloud)
    except ValueError:  # what one detector can look at is too little for the other: nothing to compare
        other = None
    beside = {"the cloud": job.source, "what was written": job.output}
    beside = {what: path for what, path in beside.items() if path not in (None, files.PIPE)}
    with failing_as(ExitCode.OUTPUT, directory):
        case = Case(name, cloud, edges, other=other, files=beside)
        return write_report([case], directory, title=f"Edges of {name}")
