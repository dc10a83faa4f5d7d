"""Prophesee RAW files: the header, and who decodes what follows it.

How the words of each EVT version are read stands in `evt2_evt3` and `evt21`.
"""

from __future__ import annotations

from etnet.errors import RecordingError
from etnet.events.formats.base import Format, Opened, Remarks, Request
from etnet.events.formats.prophesee.evt2_evt3 import EVT
from etnet.events.formats.prophesee.evt21 import EVT21, EVT21_LEGACY
from etnet.events.formats.prophesee.header import read_header, tell_turns
from etnet.events.formats.prophesee.indexed import decode_all, open_indexed
from etnet.events.provenance import provenance_of

INDEXED_BYTES = 64 << 20
"""Files from this size on are indexed and read by slice; smaller ones are decoded at once."""

_LATER = {"2.1": EVT21, "2.1 legacy": EVT21_LEGACY}


def _open(request: Request) -> Opened:
    header = read_header(request)
    version = EVT.get(header.layout) or _LATER.get(header.layout)
    if version is None:
        raise RecordingError(
            f"{request.name}: a RAW file of EVT version {header.version or 'not named'}; 2.0, 2.1 and 3.0 are read"
        )
    remarks = Remarks()
    declared = header.sensor(request.name, remarks, request.assume.sensor is not None)
    is_large = request.path.stat().st_size >= INDEXED_BYTES and not request.assume.drop_outside
    reader = open_indexed if is_large else decode_all
    collected = reader(request, header, version, declared, remarks)
    if "camera" not in header.fields and "plugin_name" in header.fields:
        remarks.detected(f"camera {header.fields['plugin_name']}")
    if header.version != "3.0":
        tell_turns(collected, remarks)
    return Opened(
        f"Prophesee EVT{(header.version or '').removesuffix('.0')}",
        collected.source,
        collected.sensor,
        collected.span,
        tuple(remarks.kept),
        growth=collected.growth,
        triggers=collected.triggers,
        provenance=provenance_of(header.fields),
    )


def _is_raw(request: Request) -> bool:
    return request.head[:1] == b"%" and (b"% evt " in request.head or b"% format EVT" in request.head)


RAW = Format("Prophesee RAW", (".raw",), _is_raw, _open)
