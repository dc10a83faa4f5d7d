"""Prophesee RAW files: the header, and who decodes what follows it.

EVT 2.0 and 3.0 are decoded in `indexed`, EVT 2.1 in `evt21`.
"""

from __future__ import annotations

from etnet.errors import RecordingError
from etnet.events.formats.base import Format, Opened, Remarks, Request
from etnet.events.formats.prophesee.evt21 import open_evt21
from etnet.events.formats.prophesee.header import read_header, tell_turns
from etnet.events.formats.prophesee.indexed import decode_all, open_indexed

INDEXED_BYTES = 64 << 20
"""Files from this size on are indexed and read by slice; smaller ones are decoded at once."""


def _open(request: Request) -> Opened:
    header = read_header(request)
    version = header.version
    if version == "2.1":
        return open_evt21(request, header)
    if version not in ("2.0", "3.0"):
        raise RecordingError(
            f"{request.name}: a RAW file of EVT version {version or 'not named'}; 2.0, 2.1 and 3.0 are read"
        )
    remarks = Remarks()
    declared = header.sensor(request.name, remarks, request.assume.sensor is not None)
    kind = f"Prophesee EVT{version[0]}"
    is_large = request.path.stat().st_size >= INDEXED_BYTES and not request.assume.drop_outside
    collected = (open_indexed if is_large else decode_all)(request, header, declared, remarks)
    if "camera" not in header.fields and "plugin_name" in header.fields:
        remarks.detected(f"camera {header.fields['plugin_name']}")
    if version == "2.0":
        tell_turns(collected, remarks)
    return Opened(
        kind,
        collected.source,
        collected.sensor,
        collected.span,
        tuple(remarks.kept),
        growth=collected.growth,
        triggers=collected.triggers,
    )


def _is_raw(request: Request) -> bool:
    return request.head[:1] == b"%" and (b"% evt " in request.head or b"% format EVT" in request.head)


RAW = Format("Prophesee RAW", (".raw",), _is_raw, _open)
