"""An address as a QR code."""

from __future__ import annotations

from functools import lru_cache
from io import BytesIO

import segno


@lru_cache(maxsize=32)
def qr_svg(address: str) -> str:
    """The code as one SVG element, dark on white with the quiet zone that readers need."""
    drawn = BytesIO()
    segno.make(address, error="m", micro=False).save(
        drawn, kind="svg", border=4, light="#ffffff", dark="#000000", xmldecl=False, svgns=True, omitsize=True
    )
    return drawn.getvalue().decode()
