"""What a command is asked to do, cloud by cloud: folders are opened, and each output gets a name of its own."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from edgel._cli import files
from edgel._cli.compare import check_kept
from edgel._cli.errors import ExitCode, Failure, as_option, failing_as
from edgel.cloud import Cloud
from edgel.io.files import COPC, stem

_DOCUMENT = re.compile(r"(readme|licen[cs]e|copying|changelog|notice).*\.txt$", re.IGNORECASE)  # lies beside clouds


@dataclass(frozen=True)
class Job:
    """One cloud that a command reads, and what it writes of it.

    Attributes
    ----------
    source : str
    output : str or None
        A file, or ``-``.
    report : str or None
        The folder of its report.
    among : bool
        Whether the output is one of those that go into a folder, which is made where it is not there.
    no_clobber : bool
        Whether files that are there already stay.
    """

    source: str
    output: str | None = None
    report: str | None = None
    among: bool = False
    no_clobber: bool = False

    @property
    def name(self) -> str:
        """What to call the input."""
        return "stdin" if self.source == files.PIPE else self.source

    @property
    def target(self) -> str:
        """What to call the output."""
        return "stdout" if self.output == files.PIPE else str(self.output)


def expand(words: Sequence[str], reading: files.Reading) -> list[str]:
    """Return the files that words name, each once: themselves, and the clouds in folders, by name."""
    found: dict[str, str] = {}
    for word in words:
        is_folder = word != files.PIPE and os.path.isdir(word)
        for source in _clouds_in(word, reading) if is_folder else [word]:
            found.setdefault(source if source == files.PIPE else os.path.normcase(os.path.abspath(source)), source)
    return list(found.values())


def _clouds_in(folder: str, reading: files.Reading) -> list[str]:
    """Return the files of a folder that the options given are for; without any, all clouds but pictures."""
    from edgel.io import MEANT_FOR, READERS, depth

    images = {extension for extension, read in READERS.items() if read is depth.read}
    meant = [set(MEANT_FOR[name]) for name in reading.given]
    wanted = set.intersection(*meant) if meant else set(READERS) - images
    with failing_as(ExitCode.INPUT, folder):
        names = sorted(entry.name for entry in os.scandir(folder) if entry.is_file() and entry.name[0] != ".")
    chosen = [name for name in names if Path(name).suffix.lower() in wanted and not _DOCUMENT.match(name)]
    if not chosen:
        left = any(Path(name).suffix.lower() in images for name in names)
        remedy = "name files, or another folder"
        if left and not meant:
            remedy = "give the camera of its depth images with --intrinsics"
        what = " and ".join(map(as_option, reading.given))
        raise Failure(ExitCode.INPUT, f"{folder}: is a folder without clouds{what and f' for {what}'}; {remedy}")
    return [os.path.join(folder, name) for name in chosen]


def plan(
    words: Sequence[str],
    reading: files.Reading,
    *,
    output: str | None = None,
    extension: str | None = None,
    known: Iterable[str] | None = None,
    report: str | None = None,
    clobber: bool | None = None,
) -> list[Job]:
    """Return what there is to do, or raise a `Failure` where outputs cannot be told apart or would replace an input.

    Parameters
    ----------
    words : sequence of str
        Files and folders.
    output : str or None
        Of one input a file, or a folder; of several, or a folder of them, a folder.
    extension : str or None
        Of outputs in a folder, with its dot; None for that of the input where it can be written, else ``.ply``.
    known : iterable of str, optional
        The extensions that the command writes; those of clouds unless told.
    report : str or None
        The folder of the report; of several inputs each has a folder in it.
    clobber : bool or None
        Whether files are replaced that are there already; None: one that the user named, none in a folder.
    """
    from edgel.io import WRITERS

    sources, known = expand(words, reading), list(WRITERS if known is None else known)
    several = len(sources) > 1 or any(word != files.PIPE and os.path.isdir(word) for word in words)
    if several and files.PIPE in sources:
        raise Failure(ExitCode.USAGE, "-: stdin carries one cloud, and there are several inputs; name files instead")
    among = output is not None and _is_folder(output, several, known)
    if extension is not None and not among:
        raise Failure(ExitCode.USAGE, "--format: is for outputs in a folder; the extension of the output tells its own")
    outputs: list[str | None] = [output] * len(sources)
    if among and output is not None:
        names = output_names(sources, [extension or _extension_for(source, known) for source in sources])
        outputs = [str(Path(output, name)) for name in names]
        _check_no_input(outputs, sources)
    reports: list[str | None] = [report] * len(sources)
    if report is not None and several:
        reports = [str(Path(report, name)) for name in output_names(sources, [""] * len(sources))]
    kept = among or several if clobber is None else not clobber
    return [Job(*each, among, kept) for each in zip(sources, outputs, reports, strict=True)]


def output_names(sources: Sequence[str], extensions: Sequence[str]) -> list[Path]:
    """Name outputs by their inputs: the same with another extension, whatever other inputs there are.

    Only where two inputs would get one name do all keep their place below the folder that they have in common, and
    where that does not tell them apart, their own extension before the new one.

    Examples
    --------
    >>> [str(name) for name in output_names(["a/x.e57", "a/y.las"], [".ply", ".las"])]
    ['x.ply', 'y.las']
    >>> [name.as_posix() for name in output_names(["a/x.las", "b/x.las", "b/y.las"], [".las"] * 3)]
    ['a/x.las', 'b/x.las', 'b/y.las']
    >>> [str(name) for name in output_names(["x.e57", "x.ply"], [".ply"] * 2)]
    ['x.e57.ply', 'x.ply']
    """
    flat = [Path("stdin" if source == files.PIPE else Path(source).name) for source in sources]
    places = [Path(os.path.abspath(source)) for source in sources]
    below = flat
    if len({place.anchor for place in places}) == 1:
        common = os.path.commonpath([place.parent for place in places])
        below = [place.relative_to(common) for place in places]
    for chosen, whole in ((flat, False), (below, False), (below, True)):
        names = [_renamed(place, new, whole) for place, new in zip(chosen, extensions, strict=True)]
        if len({str(name).casefold() for name in names}) == len(names):  # some systems do not tell A from a
            return names
    folded = [str(name).casefold() for name in names]
    twice = next(i for i, name in enumerate(folded) if name in folded[:i])
    pair = f"{sources[folded.index(folded[twice])]} and {sources[twice]}"
    raise Failure(ExitCode.USAGE, f"{pair}: both would be written to {names[twice]}; run them one after the other")


def _renamed(place: Path, extension: str, whole: bool) -> Path:
    if place.suffix.lower() == extension:
        return place
    return place.with_name((place.name if whole else stem(place) if extension == COPC else place.stem) + extension)


def _extension_for(source: str, known: Sequence[str]) -> str:
    own = Path(source).suffix.lower()
    return own if own in known else ".ply" if ".ply" in known else known[0]


def _is_folder(output: str, several: bool, known: Sequence[str]) -> bool:
    """Return whether an output is a folder, or raise a `Failure` where several clouds would go into one file."""
    separators = tuple(filter(None, (os.sep, os.altsep)))
    if output != files.PIPE and (output.endswith(separators) or os.path.isdir(output)):
        return True
    if not several:
        return False
    if output == files.PIPE or Path(output).suffix.lower() in known or os.path.isfile(output):
        where = "stdout" if output == files.PIPE else output
        raise Failure(ExitCode.USAGE, f"{where}: takes one cloud, and there are several; name a folder, as in edges/")
    return True


def _check_no_input(outputs: Sequence[str | None], sources: Sequence[str]) -> None:
    """Raise a `Failure` where an output would replace the input of another; its own is looked at with its job."""
    inputs = {_identity(source): source for source in sources if source != files.PIPE}
    for output, own in zip(outputs, sources, strict=True):
        other = inputs.get(_identity(output)) if output is not None and os.path.exists(output) else None
        if other not in (None, own):
            raise Failure(ExitCode.USAGE, f"{output}: is the input {other} itself; name another folder")


def _identity(path: str) -> tuple[int, int] | str:
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return path
    return status.st_dev, status.st_ino


def check_job(job: Job, reading: files.Reading, part: str | None = None) -> bool:
    """Return whether a job replaces its own input, or raise a `Failure` for what cannot be written or read.

    Parameters
    ----------
    part : str or None
        Where less than every point is written: what that is and what to do, for those who name the input as output.
    """
    in_place = False
    if job.output is not None:
        in_place = files.check_in_place(job.output, job.source, reading, part)
        files.check_output(job.output, no_clobber=job.no_clobber, among=job.among)
    files.check_input(job.source, reading)
    return in_place


def write(job: Job, cloud: Cloud, original: Cloud | None = None) -> dict[str, str]:
    """Write the cloud of a job, its folder first if need be, and return what became of what its format cannot hold.

    Parameters
    ----------
    original : Cloud or None
        The input as it was read, where it is replaced: by nothing that holds less.
    """
    if job.output is None:
        return {}
    if original is not None:
        check_kept(job.output, original, cloud)
    make_folder(job)
    return files.write_cloud(job.output, cloud, no_clobber=job.no_clobber)


def make_folder(job: Job) -> None:
    """Make the folder that a job's output goes into, where that is the command's to make."""
    if job.output is not None and job.among:
        with failing_as(ExitCode.OUTPUT, job.output):
            Path(job.output).parent.mkdir(parents=True, exist_ok=True)
