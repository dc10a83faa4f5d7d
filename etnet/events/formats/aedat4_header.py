"""A look at an AEDAT 4 header before the library sees it.

The `aedat` library ends the whole process where the description is not UTF-8: it panics while it words its error.
Layout: inivation.com, "AEDAT file formats", 4.0: a size-prefixed FlatBuffer with the description as its third field.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from etnet.errors import RecordingError

_VERSION_LINE = 14
_LARGEST_HEADER = 1 << 24
_DESCRIPTION = 2
_MOST_DIGITS = 9
"""Of a stream's number, which has 31 bits."""


class Described(NamedTuple):
    """What the header says of the streams: attributes by their keys, the first of each; the camera that each is from.

    `sources` is by the streams' numbers and lacks those whose camera is not named.
    """

    attributes: dict[str, str]
    sources: dict[int, str]


def check_header(path: Path) -> Described:
    """The streams' description.

    Raises RecordingError if the header is not whole, or its description is no plain XML in UTF-8.
    """
    with path.open("rb") as file:
        file.seek(_VERSION_LINE)
        prefix = file.read(4)
        size = struct.unpack("<I", prefix)[0] if len(prefix) == 4 else 0
        if size > _LARGEST_HEADER:
            raise RecordingError(f"{path.name}: its AEDAT4 header claims {size} bytes; the file is damaged")
        header = file.read(size)
    try:
        if size == 0 or len(header) < size:
            raise ValueError("it ends early")
        text = _description(header).decode("utf-8")
        if "<!" in text:
            raise ValueError("it declares entities")
        tree = ElementTree.fromstring(text)
    except (ValueError, struct.error, ElementTree.ParseError) as slip:
        raise RecordingError(
            f"{path.name}: its AEDAT4 header cannot be read ({slip}); the file is truncated or damaged"
        ) from slip
    found: dict[str, str] = {}
    for attribute in tree.iter("attr"):
        found.setdefault(attribute.get("key", ""), attribute.text or "")
    return Described(found, _sources(tree))


def _sources(tree: ElementTree.Element) -> dict[int, str]:
    """A stream is a node that is called by its number, and what is known of it stands in its node `info`."""
    named: dict[int, str] = {}
    for stream in tree.iter("node"):
        number, source = stream.get("name", ""), stream.find("node[@name='info']/attr[@key='source']")
        if source is not None and source.text and number.isdecimal() and len(number) <= _MOST_DIGITS:
            named[int(number)] = source.text
    return named


def _description(header: bytes) -> bytes:
    """The bytes of the FlatBuffer's string field that describes the streams."""
    table = struct.unpack_from("<I", header)[0]
    fields = table - struct.unpack_from("<i", header, table)[0]
    if fields < 0 or struct.unpack_from("<H", header, fields)[0] < 4 + 2 * (_DESCRIPTION + 1):
        raise ValueError("it has no description")
    offset = struct.unpack_from("<H", header, fields + 4 + 2 * _DESCRIPTION)[0]
    place = table + offset
    place += struct.unpack_from("<I", header, place)[0]
    length = struct.unpack_from("<I", header, place)[0]
    if offset == 0 or place + 4 + length > len(header):
        raise ValueError("its description ends early")
    return header[place + 4 : place + 4 + length]
