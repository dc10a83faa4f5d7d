"""The process in which a stranger's video is decoded: `python -P video_child.py`, told by one line of JSON on stdin.

What it writes to standard output are blocks: one byte of kind, four of length, the content. `j` is JSON, `f` a frame:
its moment (float64, µs), whether a scene begins, its light (float32). The pipe holds it up when nobody reads.
"""

from __future__ import annotations

import json
import struct
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from app.catalogue.limited import TOO_MUCH_MEMORY, told_and_limited

HEAD = struct.Struct("<cI")
MOMENT = struct.Struct("<d?")


def main() -> int:
    """0 done, 1 a named failure, which is said."""
    told = told_and_limited()

    from etnet.errors import EtnetError
    from etnet.simulation.decode import VideoFootage
    from etnet.simulation.footage import Framing

    try:
        footage = VideoFootage(Path(told["path"]), Framing(**told["framing"]), told["gamma"], told["drops_repeats"])
        _say(
            sensor=[footage.sensor.width, footage.sensor.height],
            tone=asdict(footage.tone),
            bits=footage.bits,
            duration=footage.duration,
            interval=footage.interval,
            remarks=footage.remarks,
        )
        for frame in footage:
            _write(b"f", MOMENT.pack(frame.t, frame.is_cut) + frame.light.astype("<f4", copy=False).tobytes())
        _say(remarks=footage.remarks)
    except EtnetError as error:
        _say(failed=str(error)[:500])
        return 1
    except MemoryError:
        _say(failed=TOO_MUCH_MEMORY)
        return 1
    return 0


def _say(**words: Any) -> None:
    if "remarks" in words:
        words["remarks"] = [text[:500] for text in words["remarks"][:50]]
    _write(b"j", json.dumps(words).encode())


def _write(kind: bytes, content: bytes) -> None:
    sys.stdout.buffer.write(HEAD.pack(kind, len(content)) + content)
    sys.stdout.buffer.flush()


if __name__ == "__main__":
    sys.exit(main())
