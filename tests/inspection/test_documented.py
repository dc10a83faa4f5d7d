"""The examples of `docs/inspect.md` run, each in ten lines at most."""

import re
from pathlib import Path

from tests.inspection.small import small_playback

TEXT = (Path(__file__).resolve().parents[2] / "docs" / "inspect.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)


def test_every_example_runs_and_has_ten_lines_at_most():
    opening, *rest = BLOCKS
    assert all(len(block.strip().splitlines()) <= 10 for block in BLOCKS)
    playback = small_playback()
    names: dict[str, object] = {"playback": playback, "recording": playback.recording, "print": lambda *_: None}
    # The opening reads a file and weights; here a small network on made-up events stands for them.
    small = [line for line in opening.splitlines() if line.startswith(("from ", "index"))]
    for block in ("\n".join(small), *rest):
        exec(block, names)
    assert names["original"] is not None
