"""The text at the beginning of Prophesee's RAW and DAT files: lines "% key value".

Keys: docs.prophesee.ai, "RAW file format".
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.base import Remarks, Request
from etnet.events.formats.decode import Collected
from etnet.events.formats.prophesee.clock import header_end
from etnet.files import replacing

CLOCK_PERIOD = 1 << 34
"""µs after which the 28 + 6 bits of time of EVT 2.0 and 2.1 wrap."""

_PLUGINS = (
    ("gen31", Sensor(640, 480)),
    ("gen3", Sensor(640, 480)),
    ("gen41", Sensor(1280, 720)),
    ("gen4", Sensor(1280, 720)),
    ("imx636", Sensor(1280, 720)),
    ("genx320", Sensor(320, 320)),
)
_VGA = (21, 23, 25, 28, 29, 33, 34, 35, 40, 41, 151, 153, 161, 162)
_HD = (26, 30, 31, 39, 46, 48, 49, 50)
_SYSTEMS = {**{system: Sensor(640, 480) for system in _VGA}, **{system: Sensor(1280, 720) for system in _HD}}
"""By system_ID, as in OpenEB's device_system_id.h and psee_raw_file_header.cpp: of Gen 3 and 3.1, of Gen 4 on."""
_LARGEST_HEADER = 1 << 16


@dataclass(frozen=True)
class Header:
    """The lines "% key value" at a file's start, and how many bytes they take."""

    fields: dict[str, str]
    num_bytes: int

    @property
    def version(self) -> str | None:
        """EVT version as "2.0", "2.1" or "3.0"; None if the header names none."""
        if "evt" in self.fields:
            return self.fields["evt"].split()[0]
        name = self.fields.get("format", "").split(";")[0].strip().upper()
        return {"EVT2": "2.0", "EVT21": "2.1", "EVT3": "3.0"}.get(name)

    @property
    def is_legacy(self) -> bool | None:
        """Whether the halves of EVT 2.1's words are swapped; None where the header does not say."""
        order = self._options.get("endianness") or self.fields.get("endianness")
        return None if order is None else order == "legacy"

    @property
    def _options(self) -> dict[str, str]:
        """Of "format EVT21;endianness=legacy;height=720;width=1280" what follows the name."""
        parts = (part.split("=", 1) for part in self.fields.get("format", "").split(";") if "=" in part)
        return {key.strip(): value.strip() for key, value in parts}

    def sensor(self, name: str, remarks: Remarks, is_stated: bool) -> Sensor | None:
        """From geometry, format or (saying so) the camera's model."""
        sides = self.fields.get("geometry", "").split("x")
        if len(sides) != 2:
            sides = [self._options.get("width", ""), self._options.get("height", "")]
        if len(sides) != 2 or not all(side.strip().isdigit() for side in sides):
            sides = [self.fields.get("Width", ""), self.fields.get("Height", "")]
        if all(side.strip().isdigit() for side in sides):
            width, height = (int(side) for side in sides)
            if 0 < width <= 65_536 and 0 < height <= 65_536:
                return Sensor(width, height)
            if not is_stated:
                raise RecordingError(
                    f"{name}: its header gives the sensor {width} × {height}; sides are 1 … 65,536: state the size "
                    "with --assume width=…,height=…"
                )
        if is_stated:
            return None
        plugin = self.fields.get("plugin_name", "")
        for part, sensor in _PLUGINS:
            if part in plugin:
                remarks.assumed(f"sensor {sensor}, that of {plugin}; the header names none: --assume overrules")
                return sensor
        system = self.fields.get("system_ID", "")
        if system.isdigit() and int(system) in _SYSTEMS:
            sensor = _SYSTEMS[int(system)]
            remarks.assumed(f"sensor {sensor}, that of system_ID {system}; the header names none: --assume overrules")
            return sensor
        return None


def read_header(request: Request) -> Header:
    """Read the lines that begin with "% "; a line "% end" closes them."""
    fields: dict[str, str] = {}
    with request.path.open("rb") as file:
        block = file.read(_LARGEST_HEADER)
    place = 0
    while block[place : place + 1] == b"%":
        # The data may begin with the byte of "%" too: a header line is printable up to its end.
        stop = block.find(b"\n", place)
        line = block[place : stop + 1] if stop >= 0 else b""
        if not line or not all(byte in (9, 10, 13) or 32 <= byte < 127 for byte in line):
            break
        place = stop + 1
        key, _, value = line[1:].decode("ascii").strip().partition(" ")
        if key == "end":
            break
        fields[key] = value.strip()
    return Header(fields, place)


def put_fields(path: Path, fields: Mapping[str, str]) -> None:
    """Put lines "% key value" at the end of a header; what is not ASCII is escaped."""
    lines = "".join(f"% {key} {value}\n" for key, value in fields.items()).encode("ascii", "backslashreplace")
    if len(lines) > _LARGEST_HEADER // 2:
        raise RecordingError(f"{path.name}: {len(lines)} bytes are too much for a header")
    with replacing(path) as filled, path.open("rb") as source, filled.open("wb") as target:
        target.write(source.read(header_end(path)) + lines)
        shutil.copyfileobj(source, target, 1 << 20)


def tell_turns(collected: Collected, remarks: Remarks) -> None:
    """Say that the clock of EVT 2.0 and 2.1 wrapped. EVT 3.0's does so every 17 s, by design."""
    if collected.span.stop >= CLOCK_PERIOD:
        remarks.repaired("the 34-bit clock wraps (every 4.8 hours) and was unrolled")
