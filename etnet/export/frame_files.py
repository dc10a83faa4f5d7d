"""How frames in a folder, and the table of their stamps, are called."""

import re

STAMPS = "stamps.csv"
FRAME = re.compile(r"frame_\d{6,}\.png")


def frame_name(index: int) -> str:
    """A frame's file."""
    return f"frame_{index:06d}.png"
