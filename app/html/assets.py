"""Where logo, theme and help lie."""

from __future__ import annotations

from pathlib import Path


def page_folder() -> Path:
    """Where logo, theme and help lie: in a wheel beside this module, in a checkout under static/page."""
    installed = Path(__file__).parents[1] / "static"
    return installed if installed.is_dir() else Path(__file__).parents[2] / "static" / "page"
