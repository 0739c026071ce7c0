"""The grammar of a line of a text of points: its comment, its words, and the numbers that they stand for."""

from __future__ import annotations

import csv
import os
import re

from edgel.io.errors import FormatError
from edgel.io.files import describe, reading
from edgel.io.limits import LONGEST_LINE
from edgel.io.rows import number_of

_COMMENT = re.compile(r"(?:^|(?<=[\s\d]))(?:#|//).*|^\s*[%!].*")
_QUOTED = re.compile(r"\"[^\"]*\"|'[^']*'")
_WORDS = re.compile(r"\"[^\"]*\"|'[^']*'|\S+")
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?|[-+]?\d+(?:[eE][-+]?\d+)?|nan", re.IGNORECASE)
_COMMA_SINCE_FIRST_DIGIT = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
# How programs write what is no number: spreadsheets, databases, pandas, and C libraries ("1.#QNAN", "-nan(ind)").
_MISSING = re.compile(
    r"|[-?.*]+|<?na>?|n/a|#n/a|#num!|#value!|null|\(?null\)?|none|nil|missing|\\n|"
    r"[-+]?(?:nan\(.*\)|\d\.#(?:q|s)?nan\w*|\d\.#ind\w*)",
    re.IGNORECASE,
)
_INFINITE = re.compile(r"([-+]?)\d\.#inf\w*", re.IGNORECASE)
_FLAGS = {"true": "1", "false": "0"}
_FORTRAN = re.compile(r"([-+]?[\d.]+)[dD]([-+]?\d+)")


def read_lines(path: str | os.PathLike[str]) -> list[str]:
    """Return the lines of a text in UTF-8, UTF-16 or Windows-1252.

    Raises
    ------
    FormatError
        If the file is no text, or has a line longer than any point.
    """
    name = os.fspath(path)
    with reading(path) as file:
        raw = file.read()
    seems = describe(raw[:512])
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = raw.decode("utf-16", "replace")
    elif len(raw) > 3 and not any(raw[1:64:2]) and all(raw[:64:2]):
        text = raw.decode("utf-16-le", "replace")
    elif b"\0" in raw[:4096] or seems[1].startswith(("name it .p", "name it .l", "name it .e", "name it .n", "unpack")):
        raise FormatError(f"{name}: not a text of points; the file seems to be {seems[0]}: {seems[1]}")
    else:
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = raw.decode("cp1252", "replace")
    lines = text.splitlines()
    longest = max(lines, key=len, default="")
    if len(longest) > LONGEST_LINE:
        raise FormatError(
            f"{name}: line {lines.index(longest) + 1} is {len(longest)} characters long; one point a line is needed"
        )
    return lines


def bare(line: str) -> str:
    """Return a line without its comment, "" where nothing is left.

    A tab at the beginning or end separates an empty value, and stays.

    Examples
    --------
    >>> bare("1 2 3  # first"), bare("1.#QNAN 0 0"), bare("// X Y Z")
    ('1 2 3', '1.#QNAN 0 0', '')
    """
    text = line
    if "#" in line or "//" in line or line.lstrip()[:1] in ("%", "!"):
        text = _COMMENT.sub("", line)
    text = text.strip(" \r\n\f\v\ufeff")
    return text if any(map(str.isalnum, text)) else ""  # separators alone, or a rule of dashes


def separator(text: str) -> str | None:
    r"""Return what separates the values of a line, None for white space.

    Examples
    --------
    >>> separator("1,5;2,5;3"), separator("1, 2, 3"), separator("1,5 2,5 3"), separator("1\t\t3")
    (';', ',', None, '\t')
    """
    text = _QUOTED.sub("0", text)
    for mark in ";|":
        if mark in text:
            return mark
    words = text.split()
    if "," in text and not (len(words) >= 3 and all(map(_DECIMAL_COMMA.fullmatch, words))):
        return ","
    return "\t" if "\t" in text and all(len(part.split()) <= 1 for part in text.split("\t")) else None


def split(text: str, delimiter: str | None) -> list[str]:
    """Return the values of a line, without quotes.

    Examples
    --------
    >>> split('"1,5";2,5; "a b"', ";"), split("1 'a b'  3", None)
    (['1,5', '2,5', 'a b'], ['1', 'a b', '3'])
    """
    if delimiter is None:
        words = _WORDS.findall(text) if '"' in text or "'" in text else text.split()
    elif '"' in text:
        try:
            words = next(csv.reader([text], delimiter=delimiter, skipinitialspace=True), [])
        except csv.Error:
            words = text.split(delimiter)
    else:
        words = text.split(delimiter)
    return [word.strip().strip("\"'") for word in words]


def has_decimal_comma(tokens: list[str]) -> bool:
    """Whether a value has a comma where others have a point."""
    return any("," in token and _COMMA_SINCE_FIRST_DIGIT.fullmatch(token) for token in tokens)


def as_number(token: str) -> str:
    """Return a value as `float` reads it, "nan" for what is missing; other words as they are.

    Examples
    --------
    >>> [as_number(token) for token in ("1,5", "1.#QNAN", "-1.#INF", "", "NULL", "1.5D+03", "tree")]
    ['1.5', 'nan', '-inf', 'nan', 'nan', '1.5e+03', 'tree']
    """
    if number_of(token):
        return token
    if _MISSING.fullmatch(token):
        return "nan"
    if match := _INFINITE.fullmatch(token):
        return match[1] + "inf"
    if match := _FORTRAN.fullmatch(token):
        return f"{match[1]}e{match[2]}"
    if token.lower() in _FLAGS:
        return _FLAGS[token.lower()]
    plain = token.replace("\u2212", "-")  # a minus as it is printed
    return plain.replace(",", ".") if _COMMA_SINCE_FIRST_DIGIT.fullmatch(plain) else plain


def is_number(token: str) -> bool:
    """Whether a value is a number, or says that it is missing."""
    return number_of(as_number(token))
