"""Depth images in PNG and TIFF: what they promise is held against their data before Pillow decodes them."""

from __future__ import annotations

import math
import struct
import warnings
import zlib
from io import BytesIO

import numpy as np

from edgel.io.errors import FormatError
from edgel.io.files import reading, wrong_magic
from edgel.io.quiet import quiet_decoder

# 8192 x 8192: above the largest depth cameras and range images there are.
_MOST_PIXELS = 1 << 26
_MODES = ("I;16", "I;16B", "I;16L", "I;16N", "I", "F")
_PNG = b"\x89PNG\r\n\x1a\n"
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
# Deflate packs at most 1032 bytes into one; the other packings of TIFF come near that at best.
_MOST_RATIO = 1032
# Bytes of the types of TIFF fields.
_TYPE_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4, 16: 8, 17: 8, 18: 8}
# Columns and rows of the seven passes of an interlaced PNG: first, step.
_PASSES = [(0, 8, 0, 8), (4, 8, 0, 8), (0, 4, 4, 8), (2, 4, 0, 4), (0, 2, 2, 4), (1, 2, 0, 2), (0, 1, 1, 2)]


def read_picture(path: str) -> np.ndarray:
    """Return the one channel of a PNG or TIFF image, (H, W).

    Raises
    ------
    FormatError
        If the file is no such image, has over 8192 x 8192 pixels, or less data than its size asks for.
    """
    from PIL import Image  # not at the top: most files are no images

    with reading(path) as file:
        raw = file.read()
    if not raw.startswith((_PNG, *_TIFF)):
        wrong_magic(path, "a PNG or TIFF image", raw[:512])
    try:
        if not raw.startswith(_PNG):
            _check_fields(path, raw)
        with quiet_decoder(), warnings.catch_warnings():
            warnings.simplefilter("error")  # what Pillow warns of is damage ...
            warnings.filterwarnings("ignore", "Metadata Warning")  # ... but for a field of too many values
            with Image.open(BytesIO(raw)) as picture:
                mode, single = picture.mode, _is_single(picture)
                if mode in _MODES and single:
                    _check_pixels(path, *picture.size)
                    (_check_png if picture.format == "PNG" else _check_tiff)(path, raw, picture)
                    return np.array(picture)
    except (FormatError, MemoryError):
        raise
    except (Image.DecompressionBombWarning, Image.DecompressionBombError):
        raise FormatError(f"{path}: has over {_MOST_PIXELS} pixels (8192 x 8192), the most that are read") from None
    except Exception as error:  # Pillow's decoders raise whatever a damaged byte leads them to
        raise FormatError(f"{path}: the image is damaged ({error}); get it again") from None
    what = f"a picture of mode {mode}, not depth" if single else "several images"
    raise FormatError(f"{path}: holds {what}; one channel of 16 bits or float is needed")


def _is_single(picture) -> bool:
    """Whether there is one frame; counted no further than two, a chain of them may be long."""
    if picture.format == "PNG":
        return getattr(picture, "n_frames", 1) == 1
    try:
        picture.seek(1)
    except EOFError:
        picture.seek(0)
        return True
    return False


def _check_pixels(path: str, width: int, height: int) -> None:
    if width * height > _MOST_PIXELS:
        raise FormatError(
            f"{path}: {width} x {height} pixels; {_MOST_PIXELS} (8192 x 8192) are read at most: the file is damaged, "
            "or take a part of it"
        )


def _cut_off(path: str, width: int, height: int, needed: int, found: int) -> FormatError:
    return FormatError(
        f"{path}: {width} x {height} pixels need {needed} bytes, found {found}; the file is cut off: get it again"
    )


def _check_png(path: str, raw: bytes, picture) -> None:
    """Unpack the pixels once, keeping nothing: Pillow fills what is missing with zeros."""
    width, height, bits = struct.unpack(">IIB", raw[16:25])
    passes = _PASSES if raw[28] else [(0, 1, 0, 1)]
    needed = 0
    for first_col, col_step, first_row, row_step in passes:
        cols, rows = -((first_col - width) // col_step), -((first_row - height) // row_step)
        needed += rows * (1 + (cols * bits + 7) // 8) if cols > 0 and rows > 0 else 0
    found, position, stream = 0, len(_PNG), zlib.decompressobj()
    while found < needed and position + 8 <= len(raw):
        length, kind = struct.unpack_from(">I4s", raw, position)
        rest = raw[position + 8 : position + 8 + length] if kind == b"IDAT" else b""
        while rest and found < needed and not stream.eof:
            found += len(stream.decompress(rest, 1 << 20))
            rest = stream.unconsumed_tail
        position += 12 + length
    if found < needed:
        raise _cut_off(path, width, height, needed, found)


def _check_fields(path: str, raw: bytes) -> None:
    """Compare the fields of the first TIFF directory with the file: Pillow reads all of them, however large."""
    order = "<" if raw[:2] == b"II" else ">"
    big = 43 in raw[2:4]
    count_code, entry_code = ("Q", "HHQ8s") if big else ("H", "HHI4s")
    (place,) = struct.unpack_from(order + ("Q" if big else "I"), raw, 8 if big else 4)
    (count,) = struct.unpack_from(order + count_code, raw, place)
    entry = struct.Struct(order + entry_code)
    total = place + count * entry.size
    if total <= len(raw):
        start = place + struct.calcsize(order + count_code)
        for _, kind, length, _ in entry.iter_unpack(raw[start : start + count * entry.size]):
            total += length * _TYPE_SIZES.get(kind, 1)
    if total > 2 * len(raw):
        raise FormatError(f"{path}: declared {total} bytes of TIFF fields, found {len(raw)}; get the file again")


def _check_tiff(path: str, raw: bytes, picture) -> None:
    """Compare the strips or tiles with the pixels, and their bytes with what these can unpack to."""
    width, height = picture.size
    tags = picture.tag_v2
    bits = max(tags.get(258, (1,)))
    if 322 in tags:
        tile_width, tile_height, sizes = int(tags[322]), int(tags[323]), tags[325]
        if tile_width < 1 or tile_height < 1:
            raise FormatError(f"{path}: tiles of {tile_width} x {tile_height} pixels; get the file again")
        parts = math.ceil(width / tile_width) * math.ceil(height / tile_height)
        _check_pixels(path, parts * tile_width, tile_height)  # tiles at the border are whole
        needed = parts * tile_width * tile_height * bits // 8
    else:
        rows = min(max(int(tags.get(278, height)), 1), height)
        parts, sizes = math.ceil(height / rows), tags.get(279, ())
        needed = height * math.ceil(width * bits / 8)
    packed = min(sum(sizes), len(raw))
    found = packed * (1 if tags.get(259, 1) == 1 else _MOST_RATIO)
    if len(sizes) < parts or found < needed:
        raise _cut_off(path, width, height, needed, packed)
