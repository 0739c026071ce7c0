"""The choices of ``--method``: the options that each has, and how its edges are found."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import edgel
from edgel._cli import files
from edgel._cli.errors import ExitCode, Failure, as_option, exit_codes, failing_as
from edgel._cli.help import Command
from edgel._cli.options import METHODS, PAPER
from edgel._cli.where import Where, select
from edgel._stages import Stages
from edgel.edges import Edges, as_kinds


class MethodCommand(Command):
    """A command with ``--method``, which says so to those who ask for the published method as they once had to."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words after the command's name."""
        if any(word.partition("=")[0] == "--preset" for word in args):
            with exit_codes():
                raise Failure(ExitCode.USAGE, f"--preset: no such option; the published method is --method {PAPER}")
        return super().parse_args(ctx, args)


def detector(method: Any) -> Callable[..., Edges]:
    """Return the function behind a method."""
    return edgel.paper.detect if method == PAPER else partial(edgel.detect, method=method)


def arguments(method: str) -> set[str]:
    """Return the names of the arguments that the command line may give to a method."""
    return set(inspect.signature(detector(method)).parameters) - {"points", "progress"}


def check_options(method: str, given: dict[str, Any]) -> dict[str, Any]:
    """Return the options given as `find_edges` takes them, or raise a `Failure` that names the wrong ones."""
    if method not in METHODS:
        raise Failure(ExitCode.USAGE, f"--method: {method!r} is unknown; choose from {', '.join(METHODS)}")
    foreign = [name for name in given if name not in arguments(method)]
    if foreign:
        names, one = ", ".join(map(as_option, foreign)), len(foreign) == 1
        them = "it" if one else "them"
        if method == PAPER:
            what = f"the published method has no such option; leave {them} out, or --method {PAPER}"
        else:
            what = f"{'an option' if one else 'options'} of the published method; "
            what += f"add --method {PAPER}, or leave {them} out"
        raise Failure(ExitCode.USAGE, f"{names}: {what}")
    if "kinds" in given:
        with failing_as(ExitCode.USAGE, "", ["kinds"]):
            given["kinds"] = as_kinds([name for word in given["kinds"].split(",") if (name := word.strip())])
    return given


@dataclass(frozen=True)
class Found:
    """The edges of a cloud that was read.

    Attributes
    ----------
    cloud : Cloud
        As it was read.
    seen : Cloud
        The same without the coordinates of the points that ``--where`` leaves out: what the edges were looked for in.
    edges : Edges
        Their rows are those of either.
    """

    cloud: edgel.Cloud
    seen: edgel.Cloud
    edges: Edges

    @property
    def not_selected(self) -> int:
        """How many finite points ``--where`` left out."""
        finite = [int(np.isfinite(cloud.xyz).all(axis=1).sum()) for cloud in (self.cloud, self.seen)]
        return finite[0] - finite[1]


def find_edges(
    source: str,
    reading: files.Reading,
    where: Where | None,
    method: str,
    given: Mapping[str, Any],
    stages: Stages,
) -> Found:
    """Read a cloud and find its edges, with the options that `check_options` let through."""
    with stages("reading"):
        cloud = files.read_cloud(source, reading)
        seen = select(cloud, where)
    with failing_as(ExitCode.DATA, source, arguments(method)):
        edges = detector(method)(seen, **given, progress=stages.progress)
    stages.seconds.update(edges.seconds)
    return Found(cloud, seen, edges)
