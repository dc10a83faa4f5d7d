"""How much a foreign file may cost: what a file declares is held against these bounds before memory is taken.

How a reader uses them:

- a sensor that the file declares, before anything of its size is made: `declared_sensor(width, height, where, assume)`.
  `collect` and `paged` hold every sensor against the bound once more, so a reader that gives them one is safe;
- a picture inside a file (PNG, JPEG, …), before it is decoded: `check_picture(content, where, assume.max_pixels)`; an
  array that will be a picture: `check_pixels(shape, where, assume.max_pixels)`;
- bytes that are about to be allocated because the file says so: `check_bytes(count, where)`;
- a stream that is unpacked: `Unpacked(packed_bytes, where)` and `.take(len(block))` for every block; a size that is
  declared for it: `check_growth(packed_bytes, unpacked_bytes, where)`;
- a loop over a file's parts calls `request.progress(fraction)` every 1 << 20 bytes or so, also where it finds nothing:
  that is how an opening is cancelled (the callback raises).

All raise RecordingError in one line. `where` begins with the file's name. What a person lifts by `--max-pixels` arrives
as `Assumptions.max_pixels`; what they lift by `--unpack-limit` holds for the whole process, because files are unpacked
long after they are opened, and on threads of their own (`allow_unpacking`, `at_most`).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from etnet.errors import RecordingError
from etnet.events.events import Sensor

MAX_PIXELS = 1 << 24
"""Pixels of a sensor or picture: 4096 × 4096, more than any camera of this kind has."""

ANY_PIXELS = 1 << 32
"""What two sides of 16 bits give: for a reader that leaves the judgement to `collect` or `paged`, which know whether a
person stated another size."""

MAX_RATIO = 200
"""What grows more than this, and beyond FREE_SIZE, is taken for a bomb; event text grows about fivefold."""

FREE_SIZE = 256 << 20
"""Bytes that anything may unpack to, whatever it is made of."""

MAX_SMALL_FILE = 64 << 20
"""Largest picture or table that is read whole."""

MAX_BLOCK = 256 << 20
"""Bytes that one chunk, message or record may have once it is unpacked."""

_LARGEST_SIDE = 65_536
_REMEDY = "unpack it by hand, or allow it with --unpack-limit MB, if you trust it"
_allowed = 0
"""Bytes that this process may unpack of anything, whatever the bounds say."""


def allow_unpacking(num_bytes: int) -> None:
    """From now on anything may unpack to so many bytes: whoever started this process trusts its files."""
    global _allowed
    _allowed = num_bytes


def at_most(bound: int) -> int:
    """A bound on bytes, or what was allowed beyond it."""
    return max(bound, _allowed)


def declared_sensor(width: Any, height: Any, where: str, max_pixels: int = MAX_PIXELS) -> Sensor:
    """The sensor that a file declares, if both sides are whole numbers of 1 … 65,536 and it has few enough pixels."""
    sides = [_whole(side) for side in (width, height)]
    if not all(side is not None and 0 < side <= _LARGEST_SIDE for side in sides):
        raise RecordingError(
            f"{where} gives the sensor {str(width)[:20]} × {str(height)[:20]}; sides are whole numbers of "
            f"1 … {_LARGEST_SIDE:,} pixels: state the size with --assume width=…,height=…"
        )
    sensor = Sensor(sides[0] or 0, sides[1] or 0)
    check_sensor(sensor, where, max_pixels)
    return sensor


def check_sensor(sensor: Sensor, where: str, max_pixels: int = MAX_PIXELS) -> None:
    """An error for a sensor of more pixels than are allowed."""
    if sensor.num_pixels > max_pixels:
        raise RecordingError(
            f"{where}: a sensor of {sensor} has {sensor.num_pixels:,} pixels, at most {max_pixels:,} are taken; "
            f"state the right size with --assume width=…,height=… or allow it with --max-pixels {sensor.num_pixels}"
        )


def check_pixels(shape: tuple[int, ...], where: str, max_pixels: int = MAX_PIXELS) -> None:
    """An error for a picture (height, width, …) of more pixels than are allowed; it is not decoded."""
    num_pixels = int(shape[0]) * int(shape[1]) if len(shape) > 1 else max(shape, default=0)
    if num_pixels > max_pixels:
        sides = " × ".join(str(side) for side in shape[:2][::-1])
        raise RecordingError(
            f"{where} has {sides} pixels, at most {max_pixels:,} are read; make it smaller or allow it with "
            f"--max-pixels {num_pixels}"
        )


def check_picture(content: bytes, where: str, max_pixels: int = MAX_PIXELS) -> tuple[int, int]:
    """(height, width) of a picture file by its header alone; an error where it is too large or of no known kind."""
    size = picture_size(content)
    if size is None:
        raise RecordingError(
            f"{where}: not a picture that can be read; wanted PNG, JPEG, BMP, WebP, TIFF or PNM, it may be truncated"
        )
    check_pixels(size, where, max_pixels)
    return size


def check_bytes(count: int, where: str, limit: int = MAX_BLOCK) -> None:
    """An error where a file asks for more memory at once than one record needs."""
    if not 0 <= count <= at_most(limit):
        raise RecordingError(
            f"{where} asks for {count:,} bytes, at most {at_most(limit):,} are taken; the file is damaged there"
        )


def is_bomb(packed: int, unpacked: int) -> bool:
    """Whether so few bytes grow to so many that no recording does it."""
    return unpacked > max(at_most(FREE_SIZE), MAX_RATIO * packed)


def check_growth(packed: int, unpacked: int, where: str, remedy: str = _REMEDY) -> None:
    """An error where a file declares far more than lies in it."""
    if is_bomb(packed, unpacked):
        raise RecordingError(f"{where} would grow from {packed:,} to {unpacked:,} bytes, like a bomb; {remedy}")


@dataclass
class Unpacked:
    """Counts what comes out of a packed stream of `packed` bytes, and stops one that grows like a bomb."""

    packed: int
    where: str
    num_bytes: int = 0

    def take(self, count: int) -> None:
        """So many bytes more have come out."""
        self.num_bytes += count
        if is_bomb(self.packed, self.num_bytes):
            raise RecordingError(
                f"{self.where}: {self.packed:,} bytes grow beyond {self.num_bytes - count:,}, like a bomb; {_REMEDY}"
            )


def _whole(value: Any) -> int | None:
    """A whole number out of anything a file may hold; None where it is none."""
    try:
        flat = np.asarray(value).reshape(-1)
        if flat.size != 1 or flat.dtype.kind not in "iufSU" or len(str(value)) > 40:
            return None
        number = float(flat[0])
        return int(number) if number.is_integer() else None
    except (TypeError, ValueError, OverflowError):
        return None


def picture_size(content: bytes) -> tuple[int, int] | None:
    """(height, width) that the header of a picture file declares; None for what is no picture that is read."""
    try:
        for mark, look in _PICTURES:
            if content.startswith(mark):
                return look(content)
    except (struct.error, ValueError, IndexError):
        return None
    return None


def _png(content: bytes) -> tuple[int, int] | None:
    width, height = struct.unpack_from(">II", content, 16)
    return (height, width) if content[12:16] == b"IHDR" else None


def _bmp(content: bytes) -> tuple[int, int]:
    if struct.unpack_from("<I", content, 14)[0] == 12:
        width, height = struct.unpack_from("<HH", content, 18)
    else:
        width, height = struct.unpack_from("<ii", content, 18)
    return abs(height), abs(width)


def _jpeg(content: bytes) -> tuple[int, int] | None:
    """The largest of all frame headers: a thumbnail may come before the picture."""
    found = [struct.unpack_from(">HH", content, place + 5) for place in _frame_headers(content)]
    return max(found, key=lambda size: size[0] * size[1]) if found else None


def _frame_headers(content: bytes) -> Iterator[int]:
    place = 2
    while place + 4 <= len(content) and content[place] == 0xFF:
        kind = content[place + 1]
        if kind == 0xFF:
            place += 1
            continue
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            yield place
        if kind == 0xDA:
            return
        has_no_length = kind == 0x01 or 0xD0 <= kind <= 0xD8
        place += 2 if has_no_length else 2 + struct.unpack_from(">H", content, place + 2)[0]


def _webp(content: bytes) -> tuple[int, int] | None:
    kind = content[12:16]
    if content[8:12] != b"WEBP":
        return None
    if kind == b"VP8X":
        return 1 + int.from_bytes(content[27:30], "little"), 1 + int.from_bytes(content[24:27], "little")
    if kind == b"VP8L":
        bits = struct.unpack_from("<I", content, 21)[0]
        return 1 + ((bits >> 14) & 0x3FFF), 1 + (bits & 0x3FFF)
    if kind == b"VP8 ":
        width, height = struct.unpack_from("<HH", content, 26)
        return height & 0x3FFF, width & 0x3FFF
    return None


def _tiff(content: bytes) -> tuple[int, int] | None:
    """Width (256) and height (257) of the first directory."""
    order = "<" if content[:2] == b"II" else ">"
    start = struct.unpack_from(order + "I", content, 4)[0]
    sides: dict[int, int] = {}
    for i in range(struct.unpack_from(order + "H", content, start)[0]):
        tag, kind = struct.unpack_from(order + "HH", content, start + 2 + 12 * i)
        if tag in (256, 257):
            sides[tag] = struct.unpack_from(order + ("H" if kind == 3 else "I"), content, start + 10 + 12 * i)[0]
    return (sides[257], sides[256]) if len(sides) == 2 else None


def _pnm(content: bytes) -> tuple[int, int] | None:
    lines = (line.partition(b"#")[0] for line in content[2:512].splitlines())
    numbers = b" ".join(lines).split()
    return (int(numbers[1]), int(numbers[0])) if len(numbers) > 1 and len(numbers[0]) + len(numbers[1]) < 20 else None


_PICTURES = (
    (b"\x89PNG\r\n\x1a\n", _png),
    (b"\xff\xd8", _jpeg),
    (b"BM", _bmp),
    (b"RIFF", _webp),
    (b"II*\x00", _tiff),
    (b"MM\x00*", _tiff),
    *((b"P%d" % kind, _pnm) for kind in range(1, 7)),
)
