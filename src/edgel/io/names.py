"""What programs call the columns of a text: which are coordinates, which colors and normals."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

import numpy as np

from edgel._objects import COLORS, NORMALS, find_xyz

# What stands around x, y and z: "Points:0", "POINT_X", "X [mm]", "pose.position.x", "x_coord", "X-Koordinate".
_EAST, _NORTH = "east(?:ings?)?|rechtswert|ostwert", "north(?:ings?)?|hochwert|nordwert"
_HEIGHT = "(?:ellipsoidal|ortho(?:metric)?)?(?:height|hgt|elev(?:ation)?|alt(?:itude)?)|hoehe|höhe"
_AROUND = (
    "points?|pos(?:ition)?|koordinaten?|coord(?:inate)?s?|loc(?:ation|al)?|vertex|vertices|pose|field|xyz|scan|utm|"
    f"world|global|cent(?:er|re)|{_EAST}|{_NORTH}|{_HEIGHT}"
)
_AFTER = f"(?:{_AROUND}|[munckµ]?m|met(?:er|re)s?|us|ft|feet|foot|in|inch(?:es)?){{0,4}}"
_PLAIN = {axis: re.compile(f"(?:{_AROUND}){{0,4}}{axis}{_AFTER}") for axis in "xyz"}
_NUMBERED = {axis: re.compile(f"(?:{_AROUND}){{1,4}}{i}") for i, axis in enumerate("xyz")}
_ON_MAPS = {
    axis: re.compile(f"(?:{_AROUND}){{0,4}}(?:{words}){_AFTER}")
    for axis, words in {"x": f"e|{_EAST}|rw", "y": f"n|{_NORTH}|hw", "z": f"[zh]|up|rl|{_HEIGHT}"}.items()
}
_DEGREES = [re.compile(f"{word}(?:itude)?(?:deg(?:rees?)?)?(?:wgs84)?") for word in ("lat", "lon|lng|long")]
_COLORS = ("r g b", "red green blue", "colorred colorgreen colorblue", "diffusered diffusegreen diffuseblue")
_NORMALS = ("nx ny nz", "normalx normaly normalz", "normalsx normalsy normalsz")
_SPELLINGS = {
    tuple(COLORS): [*_COLORS, *(f"{word}:0 {word}:1 {word}:2" for word in ("rgb", "rgba", "color", "colors"))],
    tuple(NORMALS): [*_NORMALS, *(f"{word}:0 {word}:1 {word}:2" for word in ("normal", "normals"))],
}


def find_axes(names: Sequence[str]) -> list[str] | None:
    """Return the columns of x, y and z: by these names, by names that hold them, or by those of maps.

    Examples
    --------
    >>> find_axes(["Points:0", "Points:1", "Points:2"])
    ['Points:0', 'Points:1', 'Points:2']
    >>> find_axes(["id", "Northing", "Easting", "Height (m)"])
    ['Easting', 'Northing', 'Height (m)']
    >>> find_axes(["nx", "ny", "nz"]) is None
    True
    """
    plain = find_xyz(names)
    if plain is not None:
        return plain
    held, on_maps, numbered = (_match(names, patterns) for patterns in (_PLAIN, _ON_MAPS, _NUMBERED))
    for found in ({**on_maps, **held}, {**held, **on_maps}, numbered):
        if len(found) == 3 and len({*found.values()}) == 3:
            return [found[axis] for axis in "xyz"]
    return None


def _match(names: Iterable[str], patterns: dict[str, re.Pattern[str]]) -> dict[str, str]:
    """Return the first name that matches each pattern."""
    found: dict[str, str] = {}
    for name in names:
        for axis, pattern in patterns.items():
            if axis not in found and len(name) < 80 and pattern.fullmatch(_key(name)):
                found[axis] = name
    return found


def in_degrees(names: Iterable[str]) -> bool:
    """Whether columns are latitude and longitude, which are no lengths.

    Examples
    --------
    >>> in_degrees(["Lat", "Lon", "Alt"]), in_degrees(["lat", "x"])
    (True, False)
    """
    keys = [_key(name) for name in names]
    return all(any(pattern.fullmatch(key) for key in keys) for pattern in _DEGREES)


def standard_names(names: Sequence[str]) -> dict[str, str]:
    """Return how the names of colors and normals are spelled everywhere else, by their own spelling.

    Examples
    --------
    >>> standard_names(["R", "G", "B", "Normal_X", "Normal_Y", "Normal_Z", "label"])
    {'R': 'red', 'G': 'green', 'B': 'blue', 'Normal_X': 'nx', 'Normal_Y': 'ny', 'Normal_Z': 'nz'}
    """
    keys = {key: name for name in reversed(names) for key in (name.lower(), _key(name))}
    new: dict[str, str] = {}
    for standard, spellings in _SPELLINGS.items():
        for spelling in map(str.split, spellings):
            if all(key in keys for key in spelling) and not {*standard} & ({*names} - {keys[key] for key in spelling}):
                new.update((keys[key], name) for key, name in zip(spelling, standard, strict=True))
                break
    return {old: name for old, name in new.items() if old != name}


def guess_names(columns: Sequence[np.ndarray]) -> list[str]:
    """Name the columns of points without a header, the first three of them x, y and z.

    Unit vectors are normals, integers 0..255 at the end or at the beginning colors, one column beside them intensity.
    """
    names = {0: "x", 1: "y", 2: "z"}
    rest = list(range(3, len(columns)))
    for start in reversed(rest[:-2]):
        if _are_unit_vectors(columns[start : start + 3]):
            names.update(zip(range(start, start + 3), NORMALS, strict=True))
            rest = [i for i in rest if i not in names]
            break
    for triple in (rest[-3:], rest[:3] if len(rest) == 4 else []):
        if len(triple) == 3 and all(is_byte(columns[i]) for i in triple):
            names.update(zip(triple, COLORS, strict=True))
            rest = [i for i in rest if i not in names]
            break
    if len(rest) == 1:
        names[rest[0]] = "intensity"
    return [names.get(i, f"column_{i}") for i in range(len(columns))]


def is_byte(values: np.ndarray) -> bool:
    """Whether a column holds integers 0..255 alone."""
    return values.dtype.kind in "iu" and len(values) > 0 and int(values.min()) >= 0 and int(values.max()) <= 255


def _are_unit_vectors(columns: Sequence[np.ndarray]) -> bool:
    """Whether columns are unit vectors, but for a few that are zero or not known."""
    with np.errstate(all="ignore"):
        lengths = np.sqrt(sum(values.astype(np.float64) ** 2 for values in columns))
    known = lengths[(lengths > 0) & np.isfinite(lengths)]
    return 2 * len(known) > len(lengths) and bool((np.abs(known - 1) < 0.01).all())


def _key(name: str) -> str:
    """Return a name in lower case, of letters and digits alone."""
    return "".join(c for c in name.lower() if c.isalnum())
