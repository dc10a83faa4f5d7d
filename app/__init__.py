"""The viewer. `app.view(recording)` shows it in a notebook; importing this loads neither torch nor viser."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from app.notebook import view

__all__ = ["view"]


def __getattr__(name: str) -> Any:
    if name == "view":
        from app.notebook import view

        return view
    raise AttributeError(f"module 'app' has no attribute {name!r}")
