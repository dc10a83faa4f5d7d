"""The process in which a stranger's file is opened: `python -P opening_child.py`, told by one line of JSON on stdin.

It reads the file, writes what is in it as a plain recording of ours, and says in lines of JSON how far it is and what
was noticed. Its memory, its CPU time and what it writes are limited, and it ends with the viewer.
"""

from __future__ import annotations

import json
import resource
import sys
from pathlib import Path
from typing import Any


def main() -> int:
    """0 done, 1 a named failure, which is said."""
    told: dict[str, Any] = json.loads(sys.stdin.readline())
    _limit(told["memory"], told["seconds"], told["bytes"])

    from etnet.errors import EtnetError
    from etnet.events.assumptions import Assumptions
    from etnet.events.open import open_recording
    from etnet.events.write import write_recording

    try:
        assume = Assumptions(**told["assume"])
        with open_recording(
            Path(told["path"]), assume=assume, progress=lambda share: _say(share=share / 2)
        ) as recording:
            lost = write_recording(recording, Path(told["out"]), progress=lambda share: _say(share=0.5 + share / 2))
            remarks = [(remark.kind, remark.text[:500]) for remark in (*recording.remarks, *lost)]
            _say(remarks=remarks[:50], name=recording.name[:200])
    except EtnetError as error:
        _say(failed=str(error)[:500])
        return 1
    except MemoryError:
        _say(failed="needs more memory than a visitor's file may have here")
        return 1
    return 0


def _limit(memory: int, seconds: int, written: int) -> None:
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    resource.setrlimit(resource.RLIMIT_FSIZE, (written, written))
    if sys.platform == "linux":
        import ctypes
        import signal

        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


def _say(**words: Any) -> None:
    sys.stdout.write(json.dumps(words) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
