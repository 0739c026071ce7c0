"""What stands below a picture of a cloud: the legend of its colors, and the scale bar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from edgel.plot.arrows import draw_arrow

_SMALLEST, _LARGEST = 11, 40  # size of the letters, in pixels
_LETTERS = 64  # size of the letters: one in so many of the picture's width
_BAR = 0.16  # longest scale bar, as a share of the picture's width
_ARROW, _SQUARE, _RAMP = 1.6, 0.8, 4.0  # length of an arrow, of one color, and of several, in letter sizes
_LONGEST_LABEL = "0.005 units at distance 0.0005"


@dataclass(frozen=True, eq=False)
class Entry:
    """What one or several colors mean.

    Attributes
    ----------
    colors : (K, 3) uint8
        One is shown as a square, several as a ramp from the first to the last, none as an arrow.
    text : str
        To the right of them.
    before : str
        To the left of them.
    """

    colors: np.ndarray
    text: str
    before: str = ""

    @classmethod
    def arrow(cls, text: str) -> Entry:
        """Make the entry of what is drawn as arrows, in the color of the letters."""
        return cls(np.empty((0, 3), np.uint8), text)


@dataclass(frozen=True, eq=False)
class _Placed:
    """An entry, its left end in pixels, and its line from above."""

    entry: Entry
    left: int
    line: int


class Legend:
    """Entries and a scale bar, in a strip as wide as the picture.

    Parameters
    ----------
    entries : sequence of Entry
    size : (int, int)
        Of the picture with its legend, in pixels.

    Attributes
    ----------
    height : int
        Of the legend, in pixels.

    Raises
    ------
    ValueError
        If an entry is wider than the picture, or the legend higher than half of it.
    """

    def __init__(self, entries: list[Entry], size: tuple[int, int]) -> None:
        width = size[0]
        self._letter = int(np.clip(width / _LETTERS, _SMALLEST, _LARGEST))
        self._font = ImageFont.load_default(self._letter)
        self._width, self._line, self._rim = width, round(1.7 * self._letter), round(0.8 * self._letter)
        self._gap = round(1.4 * self._letter)
        self._placed = self._break(entries)
        last = max((one.left + self._size(one.entry) for one in self._placed if one.line == self._last), default=0)
        bar = _BAR * width + 0.5 * self._letter + self._font.getlength(_LONGEST_LABEL)
        self._bar_line = self._last + (last > 0 and last + self._gap + bar > width - self._rim)
        self.height = (self._bar_line + 1) * self._line + self._rim
        if max([bar, *map(self._size, entries)]) + 2 * self._rim > width or self.height > size[1] / 2:
            what = f"{size[0]} x {size[1]} has no room for the legend"
            raise ValueError(f"size: {what}; choose a larger one, or legend=False")

    def draw(self, image: Image.Image, top: int, ink: tuple[int, int, int], pixel: float, distance: float) -> None:
        """Draw it on an image from row `top` on.

        Parameters
        ----------
        ink : (int, int, int)
            Color of letters and bar.
        pixel : float
            Width of a pixel at `distance`, in the cloud's unit.
        distance : float
            Where the bar has its length, in perspective; NaN where it has it everywhere.
        """
        draw = ImageDraw.Draw(image)
        for placed in self._placed:
            self._draw_entry(draw, placed.entry, placed.left, top + (placed.line + 0.5) * self._line, ink)
        length = round_length(_BAR * self._width * pixel)
        away = "" if np.isnan(distance) else f" at distance {two_digits(distance)}"
        label = f"{length:g} unit{'s' * (length != 1)}{away}"
        middle = round(top + (self._bar_line + 0.5) * self._line)
        right = self._width - self._rim
        draw.text((right, middle), label, fill=ink, font=self._font, anchor="rm")
        right -= round(self._font.getlength(label) + 0.5 * self._letter)
        left, thick, tick = right - round(length / pixel) + 1, max(self._letter // 7, 1), self._letter // 3
        draw.rectangle([left, middle - thick // 2, right, middle - thick // 2 + thick - 1], fill=ink)
        for end in (left, right - thick + 1):
            draw.rectangle([end, middle - tick, end + thick - 1, middle + tick], fill=ink)

    @property
    def _last(self) -> int:
        return max((one.line for one in self._placed), default=0)

    def _break(self, entries: list[Entry]) -> list[_Placed]:
        """Put the entries beside each other, in as many lines as they need."""
        placed, x, line = [], self._rim, 0
        for entry in entries:
            size = self._size(entry)
            if x > self._rim and x + size > self._width - self._rim:
                x, line = self._rim, line + 1
            placed.append(_Placed(entry, x, line))
            x += size + self._gap
        return placed

    def _size(self, entry: Entry) -> int:
        """Width of an entry, in pixels."""
        words = sum(self._font.getlength(word) + 0.45 * self._letter for word in (entry.text, entry.before) if word)
        return round(words + self._patch(entry))

    def _patch(self, entry: Entry) -> int:
        """Width of the colors of an entry, in pixels."""
        return round(self._letter * (_ARROW, _SQUARE, _RAMP)[min(len(entry.colors), 2)])

    def _draw_entry(self, draw: ImageDraw.ImageDraw, entry: Entry, x: float, middle: float, ink: tuple) -> None:
        if entry.before:
            draw.text((x, middle), entry.before, fill=ink, font=self._font, anchor="lm")
            x += self._font.getlength(entry.before) + 0.45 * self._letter
        patch, half = self._patch(entry), round(0.4 * self._letter)
        left, top = round(x), round(middle) - half
        if len(entry.colors):
            for column in range(patch):
                color = entry.colors[column * len(entry.colors) // patch]
                draw.line([left + column, top, left + column, top + 2 * half], fill=tuple(map(int, color)))
        else:
            ends = np.array([[left, middle], [left + patch, middle]])
            draw_arrow(draw, *ends, width=max(self._letter / 8, 1.0), color=ink)
        draw.text((left + patch + 0.45 * self._letter, middle), entry.text, fill=ink, font=self._font, anchor="lm")


def round_length(longest: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is no longer.

    Examples
    --------
    >>> round_length(0.7), round_length(230.0)
    (0.5, 200.0)
    """
    power = 10.0 ** np.floor(np.log10(longest))
    return float(max(power * step for step in (1, 2, 5) if power * step <= longest * (1 + 1e-9)))


def two_digits(length: float) -> str:
    """Return a length with two digits, and no power of ten as far as it goes.

    Examples
    --------
    >>> two_digits(283.4), two_digits(0.0471)
    ('280', '0.047')
    """
    return f"{float(f'{length:.2g}'):g}"
