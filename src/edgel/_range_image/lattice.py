"""Lattices in numbers: equal steps that nearly all values lie on, found from the values alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_FEWEST = 8  # steps: fewer could be chance
_BINS = 8  # of the spectrum, for each step of the finest lattice looked for
_LONGEST = 8.0  # of that many steps for the root of the number of values: a grid is no longer than wide 64 times
_MOST_BINS = 1 << 17
_LEAST_BINS = 1 << 9
_SHARP = 0.3  # least share of the values in phase: what places known to 0.35 of a step, evenly, have
_HARMONIC = 0.8  # of the sharpest frequency: the lowest that is about as sharp is the lattice, not a multiple
_STRAYS = 200  # one value in so many, at either end, may be anything
_FITTED = 20_000  # values that the lattice is fitted to
_ROUNDS = 4  # of the fit
NEAR = 0.4  # of a step: most that a value is off its place
_ON = 0.98  # least share of the values that are near


@dataclass(frozen=True)
class Lattice:
    """Places `first` + i `step`, in the unit of the values."""

    first: float
    step: float

    def places(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return which place each value (N,) is nearest to, int64, and how far off it is, in steps, float64."""
        at = (values - self.first) / self.step
        place = np.rint(at)
        return place.astype(np.int64), np.abs(at - place)


def find_lattice(values: np.ndarray) -> Lattice | None:
    """Find the lattice of values, None where they lie on none.

    The spectrum of their density has a peak at the frequency of the steps, however many places stay empty; a line
    through values and places then says step and first place to the last digit.

    Parameters
    ----------
    values : (N,) float64
        One or more, in any order.

    Examples
    --------
    >>> found = find_lattice(0.25 + 0.5 * np.random.default_rng(0).integers(0, 40, 900))
    >>> found is not None and (round(found.step, 9), round(found.first % 0.5, 9))
    (0.5, 0.25)
    >>> find_lattice(np.random.default_rng(0).random(900)) is None
    True
    """
    cut = len(values) // _STRAYS
    low, high = np.partition(values, (cut, len(values) - 1 - cut))[[cut, len(values) - 1 - cut]]
    inner, span = values[(values >= low) & (values <= high)], high - low
    cycles = _cycles((inner - low) / span) if span > 0 else 0.0
    if cycles == 0:
        return None
    fitted = np.sort(inner)[:: len(inner) // _FITTED + 1]
    step, middle = span / cycles, low + span / 2
    first = middle + step * np.angle(np.exp(2j * np.pi * (fitted - middle) / step).sum()) / (2 * np.pi)
    for _ in range(_ROUNDS):
        place = np.rint((fitted - first) / step)
        off = fitted - first - step * place
        mean = place.mean()
        spread = ((place - mean) ** 2).sum()
        change = ((place - mean) * off).sum() / spread if spread > 0 else 0.0
        first, step = first + off.mean() - change * mean, step + change
    found = Lattice(float(first), float(step))
    return found if step > 0 and (found.places(fitted)[1] <= NEAR).mean() >= _ON else None


def _cycles(values: np.ndarray) -> float:
    """How many steps of a lattice lie between 0 and 1, for values (N,) there; 0 where none are seen."""
    finest = _LONGEST * np.sqrt(len(values))
    bins = 1 << int(np.ceil(np.log2(np.clip(_BINS * finest, _LEAST_BINS, _MOST_BINS))))
    density = np.bincount(np.rint(values * (bins - 1)).astype(np.int64), minlength=bins)
    spectrum = np.abs(np.fft.rfft(density, 2 * bins)) / len(values)
    unit = (bins - 1) / (2 * bins)  # cycles, from one frequency to the next
    first, last = int(_FEWEST / unit), int(bins / _BINS / unit)
    looked = spectrum[first:last]
    if len(looked) == 0 or looked.max() < _SHARP:
        return 0.0
    best = int(np.argmax(looked >= _HARMONIC * looked.max()))
    while best + 1 < len(looked) and looked[best + 1] > looked[best]:
        best += 1
    return (first + best) * unit
