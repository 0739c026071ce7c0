"""A report of edges to look at: one self-contained page, and its figures beside it."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from edgel._report.figures import check_drawing, draw_figures
from edgel._report.histograms import Histogram, angle_histogram, strength_histogram
from edgel._report.page import opening, page, section
from edgel._report.tables import Table, count_table, method_table, parameter_table, time_table
from edgel.cloud import Cloud
from edgel.edges import Edges
from edgel.io.files import replacing

__all__ = ["Case", "Table", "check_drawing", "file_names", "make_directory", "write_report"]

PAGE = "report.html"


@dataclass(frozen=True, eq=False)
class Case:
    """What a report shows of one cloud.

    Attributes
    ----------
    name : str
        What the report calls it.
    cloud : Cloud
    edges : Edges
        Of this cloud.
    part : Cloud or None
        Evenly sampled points, dense and without noise, of the surface that it was scanned from, when it is simulated.
    tables : sequence of Table
        Comparison numbers of this cloud, shown below its own.
    other : Edges or None
        What another method finds in this cloud, to compare.
    files : mapping of str to path
        Files that belong to it, by what they hold; the page links to them.
    """

    name: str
    cloud: Cloud
    edges: Edges
    part: Cloud | None = None
    tables: Sequence[Table] = ()
    other: Edges | None = None
    files: Mapping[str, str | os.PathLike[str]] = field(default_factory=dict)


def write_report(
    cases: Sequence[Case],
    directory: str | os.PathLike[str],
    *,
    title: str = "Edges",
    findings: Sequence[str] = (),
    tables: Sequence[Table] = (),
) -> Path:
    """Write a page with figures, counts, histograms, times and parameters of each case, its figures as PNG beside it.

    Parameters
    ----------
    cases : sequence of Case
        At least one.
    directory : path
        Made if it does not exist. ``report.html`` and the figures in it are replaced.
    title : str
        Heading of the page.
    findings : sequence of str
        Sentences that come first.
    tables : sequence of Table
        Tables of all cases together, after the findings.

    Returns
    -------
    Path
        The page. It holds its figures itself and can be sent on alone; only its links need what lies beside it.

    Raises
    ------
    ValueError
        If there are no cases.
    OSError
        If the directory cannot be made or written.
    """
    if not cases:
        raise ValueError("cases: expected at least one, got none")
    check_drawing()
    folder = make_directory(directory)
    parts, taken = [opening(title, findings, tables)], set()
    for case in cases:
        stem = _file_stem(case.name, taken)
        drawn = draw_figures(case.cloud, case.edges, name=case.name, part=case.part, other=case.other)
        figures = {f"{stem}-figure-{figure.number}.png": figure for figure in drawn}
        for name, figure in figures.items():
            with replacing(folder / name) as file:
                file.write(figure.png)
        parts.append(section(case.name, figures, _tables(case), _histograms(case.edges), _addresses(case, folder)))
    with replacing(folder / PAGE) as file:
        file.write(page(title, parts).encode())
    return folder / PAGE


def file_names(names: Sequence[str]) -> re.Pattern[str]:
    """Match the names of the files that a report of cases with these names may write into its folder."""
    taken: set[str] = set()
    stems = "|".join(re.escape(_file_stem(name, taken)) for name in names)
    return re.compile(rf"{re.escape(PAGE)}|(?:{stems})-figure-\d+\.png", re.IGNORECASE)


def _tables(case: Case) -> list[Table]:
    compared = [] if case.other is None else [method_table(case.edges, case.other)]
    return [count_table(case.edges), *compared, *case.tables, time_table(case.edges), parameter_table(case.edges)]


def _histograms(edges: Edges) -> list[Histogram]:
    angles = angle_histogram(edges)
    return [strength_histogram(edges), *([] if angles is None else [angles])] if len(edges) else []


def _addresses(case: Case, folder: Path) -> list[tuple[str, str]]:
    """What the files of a case hold, and where they lie as seen from the page; none on another drive of Windows."""
    near = {what: path for what, path in case.files.items() if Path(path).resolve().drive == folder.resolve().drive}
    return [(what, Path(os.path.relpath(path, folder)).as_posix()) for what, path in near.items()]


def make_directory(directory: str | os.PathLike[str]) -> Path:
    """Make a folder and those above it, if need be, with an error that says what is in the way."""
    folder = Path(directory)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise FileExistsError(f"{folder}: is a file; name a folder to write the report into") from None
    except OSError as error:
        raise type(error)(f"{folder}: cannot be made ({error.strerror}); choose another folder") from error
    return folder


def _file_stem(name: str, taken: set[str]) -> str:
    """Make a file name of a case's name, and one that no case before it has."""
    stem = re.sub(r"[^A-Za-z0-9._-]+", "-", name).strip("-.")[:60] or "cloud"
    number, unique = 2, stem
    while unique.lower() in taken:
        unique, number = f"{stem}-{number}", number + 1
    taken.add(unique.lower())
    return unique
