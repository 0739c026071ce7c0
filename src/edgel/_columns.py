"""The columns of a cloud that make room for ours: kept, under another name."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from edgel.cloud import Cloud


def set_aside(taken: Iterable[str], names: Iterable[str]) -> dict[str, str]:
    """Say how the attributes of a cloud are called once columns of ours take their names.

    Parameters
    ----------
    taken : iterable of str
        Names of the cloud's attributes.
    names : iterable of str
        Names of our columns. Neither upper case nor blanks make another name: in some files they do not.

    Returns
    -------
    dict of str to str
        New names by old ones, of those attributes only that get one: ``input_nx``, or ``input_nx_2`` where that is
        there too, as after a second run.

    Examples
    --------
    >>> set_aside(["label", "nx", "input_nx"], ["nx", "ny", "nz"])
    {'nx': 'input_nx_2'}
    """
    ours, renamed = {plain(name) for name in names}, {}
    used = {plain(name) for name in taken} | ours
    for name in taken:
        if plain(name) in ours:
            stem = new = f"input_{name.strip()}"
            number = 2
            while plain(new) in used:
                new, number = f"{stem}_{number}", number + 1
            used.add(plain(new))
            renamed[name] = new
    return renamed


def make_room(cloud: Cloud, names: Iterable[str]) -> Cloud:
    """Return a cloud whose attributes leave some names free; see `set_aside`."""
    new = set_aside(cloud.attributes, names)
    return replace(cloud, attributes={new.get(name, name): values for name, values in cloud.attributes.items()})


def plain(name: str) -> str:
    """Return how names of columns are compared: blanks are underscores, and case does not matter."""
    return "_".join(name.split()).lower()
