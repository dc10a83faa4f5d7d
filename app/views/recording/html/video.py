"""How far a video is simulated, and how long that takes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.html.elements import panel

if TYPE_CHECKING:
    from app.catalogue.videos import VideoShown


def film_html(film: VideoShown) -> str:
    """One line, and a bar while it is being made."""
    if film.is_over:
        return panel("film", f'<div class="et-note">{_work(film)}, all of its {film.total:.1f} s are there.</div>')
    if film.work is None:
        return panel("film", '<div class="et-lag"><span>The simulation begins.</span></div>')
    behind = max(film.total - film.done, 0.0)
    share = min(film.done / film.total, 1.0) if film.total else 0.0
    said = (
        f"{film.done:.1f} of {film.total:.1f} s of the video are there. {_work(film)}: "
        f"the last {behind:.1f} s take about {behind * film.work:.0f} s more."
    )
    bar = f'<div class="et-bar"><i style="width:{share:.0%}"></i></div>'
    return panel("film", f'<div class="et-lag"><span>{said}</span>{bar}</div>')


def _work(film: VideoShown) -> str:
    if film.work is None:
        return "Simulated"
    return f"A second of video takes {film.work:.1f} s of work here"
