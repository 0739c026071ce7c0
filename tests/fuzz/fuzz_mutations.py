"""Damage to a valid file, the same for the same number: bytes, sections, and the numbers of headers."""

import io
import random
import re
import struct
import zipfile
import zlib

NUMBERS = [b"0", b"-1", b"1", b"255", b"65536", b"2147483647", b"4294967295", b"99999999999", b"9" * 19, b"9" * 5000,
           b"1e400", b"nan", b"0.5", "²".encode()]  # fmt: skip
INTEGERS = [
    0,
    1,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0xFFFF,
    10**6,
    0x7FFFFFFF,
    0x80000000,
    0xFFFFFFFF,
    10**12,
    2**63 - 1,
    2**64 - 1,
]


def _flip(rng: random.Random, raw: bytearray, other: bytes) -> None:
    for _ in range(rng.choice((1, 1, 2, 8))):
        raw[_place(rng, raw)] ^= 1 << rng.randrange(8)


def _overwrite(rng: random.Random, raw: bytearray, _: bytes) -> None:
    place, size = _place(rng, raw), rng.choice((1, 2, 4, 8))
    number = (rng.choice(INTEGERS) + rng.choice((0, 0, -1, 1))) % 256**size
    raw[place : place + size] = number.to_bytes(size, rng.choice(("little", "big")))


def _inflate(rng: random.Random, raw: bytearray, _: bytes) -> None:
    found = list(re.finditer(rb"\d+", raw[:4096]))
    if found:
        match = rng.choice(found)
        raw[match.start() : match.end()] = rng.choice(NUMBERS)


def _insert(rng: random.Random, raw: bytearray, _: bytes) -> None:
    place = _place(rng, raw)
    raw[place:place] = rng.randbytes(rng.choice((1, 2, 4, 100)))


def _remove(rng: random.Random, raw: bytearray, _: bytes) -> None:
    place = _place(rng, raw)
    del raw[place : place + rng.choice((1, 2, 4, 100))]


def _truncate(rng: random.Random, raw: bytearray, _: bytes) -> None:
    del raw[_place(rng, raw) :]


def _splice(rng: random.Random, raw: bytearray, other: bytes) -> None:
    place, start = _place(rng, raw), rng.randrange(len(other) + 1)
    raw[place : place + rng.choice((0, 50, len(raw)))] = other[start : start + rng.choice((20, 400, len(other)))]


def _repeat(rng: random.Random, raw: bytearray, _: bytes) -> None:
    place = _place(rng, raw)
    raw[place:place] = raw[place : place + rng.choice((1, 10, 100, 1000))] * rng.choice((1, 10, 1000))


def _place(rng: random.Random, raw: bytearray) -> int:
    """A place anywhere, every second time near the begin, where headers are."""
    return rng.randrange(max(min(len(raw), rng.choice((64, 512, len(raw), len(raw)))), 1)) if raw else 0


_CHANGES = [_flip, _overwrite, _overwrite, _inflate, _inflate, _insert, _remove, _truncate, _splice, _repeat]


def mutate(reader: str, number: int, seeds: list[tuple[str, bytes]]) -> tuple[str, bytes]:
    """Return suffix and content of input `number` of a reader."""
    rng = random.Random(f"{reader} {number}")
    suffix, content = rng.choice(seeds)
    other = rng.choice(seeds)[1]
    if reader == "npz" and rng.random() < 0.7:
        return suffix, _in_archive(rng, content)
    raw = _change(rng, content, other)
    if rng.random() < 0.8:  # the checksums are right again, else nothing behind them would be tried
        raw = {"png": _mend_png, "e57": mend_e57}.get(reader, bytes)(raw)
    return suffix, raw


def _change(rng: random.Random, content: bytes, other: bytes) -> bytes:
    raw = bytearray(content)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 5))):
        if not raw:
            break
        rng.choice(_CHANGES)(rng, raw, other)
    return bytes(raw[: 1 << 20])


def _in_archive(rng: random.Random, content: bytes) -> bytes:
    """Change members of a zip archive, and pack them with right checksums."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    chosen = rng.choice(list(members))
    members[chosen] = _change(rng, members[chosen], content)
    packing = rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA))
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", packing) as archive:
        for name, member in members.items():
            archive.writestr(name, member)
    return file.getvalue()


def _mend_png(raw: bytes) -> bytes:
    mended, place = bytearray(raw), 8
    while place + 12 <= len(mended):
        (length,) = struct.unpack_from(">I", mended, place)
        if place + 12 + length > len(mended):
            break
        struct.pack_into(">I", mended, place + 8 + length, zlib.crc32(mended[place + 4 : place + 8 + length]))
        place += 12 + length
    return bytes(mended)


def _table() -> list[int]:
    table = []
    for value in range(256):
        for _ in range(8):
            value = value >> 1 ^ (0x82F63B78 if value & 1 else 0)
        table.append(value)
    return table


_CRC32C = _table()


def mend_e57(raw: bytes) -> bytes:
    """Give each page of 1024 bytes its checksum, and the header its length."""
    mended = bytearray(raw[: len(raw) // 1024 * 1024])
    if len(mended) >= 24:
        struct.pack_into("<Q", mended, 16, len(mended))
    for start in range(0, len(mended), 1024):
        checksum = 0xFFFFFFFF
        for byte in mended[start : start + 1020]:
            checksum = _CRC32C[(checksum ^ byte) & 255] ^ checksum >> 8
        struct.pack_into(">I", mended, start + 1020, checksum ^ 0xFFFFFFFF)
    return bytes(mended)
