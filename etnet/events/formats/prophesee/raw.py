"""Prophesee RAW files: the header, and who decodes what follows it.

How the words of each EVT version are read stands in `evt2_evt3` and `evt21`.
"""

from __future__ import annotations

from etnet.errors import RecordingError
from etnet.events.formats.base import Format, Opened, Remarks, Request
from etnet.events.formats.prophesee.evt2_evt3 import EVT, Version
from etnet.events.formats.prophesee.evt21 import EVT21, EVT21_LEGACY, judged_version
from etnet.events.formats.prophesee.header import Header, read_header, tell_turns
from etnet.events.formats.prophesee.index import BLOCK_BYTES
from etnet.events.formats.prophesee.indexed import decode_all, open_indexed
from etnet.events.provenance import provenance_of

INDEXED_BYTES = 64 << 20
"""Files from this size on are indexed and read by slice; smaller ones are decoded at once."""


def _open(request: Request) -> Opened:
    header, remarks = read_header(request), Remarks()
    version = _version(request, header, remarks)
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


def _version(request: Request, header: Header, remarks: Remarks) -> Version:
    """The one that the header names; how the halves of EVT 2.1's words lie is judged where it does not say."""
    if header.version == "2.1":
        if header.is_legacy is not None:
            return EVT21_LEGACY if header.is_legacy else EVT21
        with request.path.open("rb") as file:
            file.seek(header.num_bytes)
            return judged_version(file.read(BLOCK_BYTES), "the file", remarks)
    version = EVT.get(header.version or "")
    if version is None:
        raise RecordingError(
            f"{request.name}: a RAW file of EVT version {header.version or 'not named'}; 2.0, 2.1 and 3.0 are read"
        )
    return version


def _is_raw(request: Request) -> bool:
    return request.head[:1] == b"%" and (b"% evt " in request.head or b"% format EVT" in request.head)


RAW = Format("Prophesee RAW", (".raw",), _is_raw, _open)
