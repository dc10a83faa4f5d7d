"""Two pictures over each other, with a line between them that a drag moves (`static/page/pictures.js`)."""

from __future__ import annotations

from app.html.elements import escape


def swiped(left: str, right: str, names: tuple[str, str], ratio: float) -> str:
    """`left` is seen left of the line, `right` right of it; `ratio` is their width to their height."""
    left_name, right_name = (escape(name) for name in names)
    return (
        f'<div class="et-swipe" data-testid="swipe" style="--ratio:{ratio:.4f}">{right}<div>{left}</div><i></i>'
        f'<span class="et-swiped">{left_name}</span><span class="et-swiped">{right_name}</span></div>'
    )
