"""Where the real recordings lie that tests read. They may not be committed, so they may be absent."""

import os
from pathlib import Path

import pytest

DATA = Path(os.environ.get("ETNET_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))


def real_file(name: str) -> Path:
    """The path of a real recording, e.g. "aedat4/davis346_street_0.17s.aedat4"; skips the test, by name, without it."""
    path = DATA / name
    if not path.exists():
        pytest.skip(f"real recording {name} is not on this machine")
    return path
