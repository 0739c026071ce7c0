"""What stands below a picture of a cloud: the legend of its colors, and the scale bar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw, ImageFont

_SMALLEST, _LARGEST = 11, 40  # size of the letters, in pixels
_LETTERS = 64  # size of the letters: one in so many of the picture's width
_BAR = 0.16  # longest scale bar, as a share of the picture's width
_RAMP = 4.0  # length of a ramp of colors, in letter sizes
_LONGEST_LABEL = "0.005 units at distance 0.0005"


@dataclass(frozen=True, eq=False)
class Entry:
    """What one or several colors mean.

    Attributes
    ----------
    colors : (K, 3) uint8
        One is shown as a square, several as a ramp from the first to the last.
    text : str
        To the right of them.
    before : str
        To the left of them.
    """

    colors: np.ndarray
    text: str
    before: str = ""


class Strip:
    """A strip as wide as the picture, with room for entries and a scale bar.

    Parameters
    ----------
    entries : sequence of Entry
    width : int
        Pixels of the picture.

    Attributes
    ----------
    height : int
        In pixels.
    fits : bool
        Whether its width holds every entry and the bar.
    """

    def __init__(self, entries: list[Entry], width: int) -> None:
        self._letter = int(np.clip(width / _LETTERS, _SMALLEST, _LARGEST))
        self._font = ImageFont.load_default(self._letter)
        self._width, self._line, self._rim = width, round(1.7 * self._letter), round(0.8 * self._letter)
        self._gap = round(1.4 * self._letter)
        self._places = self._break(entries)
        last = max((x + self._size(entry) for entry, x, line in self._places if line == self._last), default=0)
        bar = _BAR * width + 0.5 * self._letter + self._font.getlength(_LONGEST_LABEL)
        self._bar_line = self._last + (last > 0 and last + self._gap + bar > width - self._rim)
        self.fits = max([bar, *map(self._size, entries)]) + 2 * self._rim <= width
        self.height = (self._bar_line + 1) * self._line + self._rim

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
        for entry, x, line in self._places:
            self._draw_entry(draw, entry, x, top + (line + 0.5) * self._line, ink)
        length = round_length(_BAR * self._width * pixel)
        away = "" if np.isnan(distance) else f" at distance {distance:.2g}"
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
        return max((line for _, _, line in self._places), default=0)

    def _break(self, entries: list[Entry]) -> list[tuple[Entry, int, int]]:
        """Give each entry its place from the left, and its line."""
        places, x, line = [], self._rim, 0
        for entry in entries:
            size = self._size(entry)
            if x > self._rim and x + size > self._width - self._rim:
                x, line = self._rim, line + 1
            places.append((entry, x, line))
            x += size + self._gap
        return places

    def _size(self, entry: Entry) -> int:
        """Width of an entry, in pixels."""
        words = sum(self._font.getlength(word) + 0.45 * self._letter for word in (entry.text, entry.before) if word)
        return round(words + self._patch(entry))

    def _patch(self, entry: Entry) -> int:
        return round(self._letter * (_RAMP if len(entry.colors) > 1 else 0.8))

    def _draw_entry(self, draw: ImageDraw.ImageDraw, entry: Entry, x: float, middle: float, ink: tuple) -> None:
        if entry.before:
            draw.text((x, middle), entry.before, fill=ink, font=self._font, anchor="lm")
            x += self._font.getlength(entry.before) + 0.45 * self._letter
        patch, half = self._patch(entry), round(0.4 * self._letter)
        left, top = round(x), round(middle) - half
        for column in range(patch):
            color = entry.colors[column * len(entry.colors) // patch]
            draw.line([left + column, top, left + column, top + 2 * half], fill=tuple(map(int, color)))
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
