"""The XML section of an E57 file, checked before libE57 parses it: it expands entities and recurses into every node."""

from __future__ import annotations

from typing import Any, BinaryIO
from xml.parsers import expat

from edgel.io.errors import FormatError

# Of each page of 1024 bytes the last four are its checksum.
_PAGE, _PAYLOAD = 1024, 1020
# A scan has about fifty elements, in seven levels.
_MOST_ELEMENTS = 200_000
_MOST_LEVELS = 64
# Of a structure, whose children libE57 looks up one by one; vectors have any number.
_MOST_CHILDREN = 2000


def check_xml(path: str, file: BinaryIO, size: int) -> None:
    """Read the XML section of a file of `size` bytes once.

    Raises
    ------
    FormatError
        If it lies outside the file, is no XML, declares a document type, or is deeper or larger than any scan's.
    """
    file.seek(0)
    head = file.read(48)
    start, length, page = (int.from_bytes(head[at : at + 8], "little") for at in (24, 32, 40))
    if page != _PAGE or start % _PAGE >= _PAYLOAD or length > size or start + length > size:
        raise FormatError(
            f"{path}: declared an XML section of {length} bytes at byte {start} in pages of {page}, the file has "
            f"{size}; it is cut off or damaged: get it again"
        )
    file.seek(start - start % _PAGE)
    pages = file.read(start % _PAGE + (length // _PAYLOAD + 2) * _PAGE)
    payload = b"".join(pages[at : at + _PAYLOAD] for at in range(0, len(pages), _PAGE))
    try:
        _Counter(path).parse(payload[start % _PAGE :][:length])
    except (expat.ExpatError, ValueError) as error:
        if isinstance(error, FormatError):
            raise
        raise FormatError(f"{path}: the XML section of the E57 file is damaged ({error}); get it again") from None


class _Counter:
    def __init__(self, path: str) -> None:
        self._path = path
        self._num_elements = 0
        self._num_children = [0]
        # E57 is UTF-8 whatever the text says: another encoding would hide from one parser what the other sees.
        self._parser = expat.ParserCreate("utf-8")
        self._parser.XmlDeclHandler = self._check_encoding
        self._parser.StartDoctypeDeclHandler = self._refuse
        self._parser.StartElementHandler = self._open
        self._parser.EndElementHandler = self._close

    def parse(self, text: bytes) -> None:
        self._parser.Parse(text, True)

    def _check_encoding(self, _: str, encoding: str | None, __: int) -> None:
        if encoding is not None and encoding.lower() not in ("utf-8", "us-ascii"):
            raise FormatError(f"{self._path}: its XML section is in {encoding[:60]!r}, not UTF-8; get the file again")

    def _refuse(self, *_: Any) -> None:
        raise FormatError(f"{self._path}: its XML section declares a document type, which E57 has not; get it again")

    def _open(self, _: str, attributes: dict[str, str]) -> None:
        self._num_elements += 1
        self._num_children[-1] += 1
        vector = attributes.get("type") == "Vector"
        if (
            self._num_elements > _MOST_ELEMENTS
            or len(self._num_children) > _MOST_LEVELS
            or self._num_children[-1] > _MOST_CHILDREN
        ):
            raise FormatError(
                f"{self._path}: its XML section has over {_MOST_ELEMENTS} elements, {_MOST_LEVELS} levels, or "
                f"{_MOST_CHILDREN} in a structure; it is damaged: get it again"
            )
        # Children of a vector are not looked up by name: they may be many.
        self._num_children.append(-_MOST_ELEMENTS if vector else 0)

    def _close(self, _: str) -> None:
        self._num_children.pop()
