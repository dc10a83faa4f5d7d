"""Files that the page hands to the browser: what a job makes, and what follows once it is handed over."""

from __future__ import annotations

from dataclasses import dataclass

from app.engine.jobs import KEPT_BYTES

LARGEST = KEPT_BYTES
"""Bytes that are handed out through the page at most; larger ones are made by the command line."""
PATIENCE = 0.05
"""Seconds for which a writer that works on its own holds the engine up at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class Download:
    """A whole file, by the name under which it is handed over: the answer of a job."""

    name: str
    content: bytes


@dataclass(frozen=True, slots=True)
class Downloaded:
    """An intent: the file of the job in this slot is in the browser."""

    slot: str


def plain_name(name: str) -> str:
    """A recording's name as a file's: letters, digits and a few signs."""
    stem = name.removesuffix(".h5").removesuffix(".zip")
    return "".join(sign if sign.isalnum() or sign in "-_." else "_" for sign in stem).strip(".")[:80] or "recording"
