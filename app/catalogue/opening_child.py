"""The process in which a stranger's file is opened: `python -P opening_child.py`, told by one line of JSON on stdin.

It reads the file, writes what is in it as a plain recording of ours, triggers and motion beside it, and says in lines
of JSON how far it is and what was noticed.
"""

from __future__ import annotations

import errno
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.catalogue.limited import TOO_LARGE, TOO_MUCH_MEMORY, told_and_limited


def main() -> int:
    """0 done, 1 a named failure, which is said."""
    told = told_and_limited()
    name = Path(told["path"]).name

    from app.catalogue.plain_tables import write_tables
    from etnet.errors import EtnetError
    from etnet.events.assumptions import Assumptions
    from etnet.events.open import open_recording
    from etnet.events.write import write_recording

    try:
        assume, out = Assumptions(**told["assume"]), Path(told["out"])
        with open_recording(
            Path(told["path"]), assume=assume, progress=lambda share: _say(share=share / 2)
        ) as recording:
            write_tables(recording.triggers, recording.inertial, out)
            plain = replace(recording, triggers=None, inertial=None)
            lost = write_recording(plain, out, progress=lambda share: _say(share=0.5 + share / 2))
            remarks = [(remark.kind, remark.text[:500]) for remark in (*recording.remarks, *lost)]
            _say(remarks=remarks[:50], name=recording.name[:200])
    except EtnetError as error:
        # Writing beyond the limit is an error here, as Python ignores the signal.
        is_too_large = isinstance(error.__cause__, OSError) and error.__cause__.errno == errno.EFBIG
        _say(failed=f"{name}: {TOO_LARGE}" if is_too_large else str(error)[:500])
        return 1
    except MemoryError:
        _say(failed=f"{name}: {TOO_MUCH_MEMORY}")
        return 1
    return 0


def _say(**words: Any) -> None:
    sys.stdout.write(json.dumps(words) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
