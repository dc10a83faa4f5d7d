"""The files that a visitor hands over: the way in, how far one is, those that are here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.html.elements import ON_PICK, bar, escape, panel

if TYPE_CHECKING:
    from app.catalogue.visitor_uploads import UploadsShown

_CHOOSE = '<button class="et-button" data-etv-upload>Open a file of yours</button>'
_STOP = '<button class="et-button" data-etv-upload-stop>Stop</button>'


def handing_html(desk: UploadsShown) -> str:
    """The panel of the page's own tab."""
    files = "".join(
        f'<div class="et-file"><span>{escape(file.title)}</span><span class="et-note">{escape(file.size)}</span>'
        f'<button class="et-button" data-k="remove:{escape(file.id)}" {ON_PICK}>Remove</button></div>'
        for file in desk.files
    )
    note = (
        f"A recording or a video, up to {escape(desk.limit)}; it may be dropped anywhere on the page. Nobody else sees "
        "it, and it is deleted when you leave."
    )
    return panel(
        "handing",
        _CHOOSE if desk.coming is None else "",
        coming_html(desk),
        f'<div class="et-note">{note}</div>',
        files,
    )


def coming_html(desk: UploadsShown) -> str:
    """How far the one on its way is, or why it did not come."""
    parts = ['<div class="et-failed" role="alert" data-etv-upload-said hidden></div>']
    if desk.refused:
        parts.append(f'<div class="et-failed" role="alert" data-testid="refused">{escape(desk.refused)}</div>')
    if desk.coming is not None:
        name, share = desk.coming
        parts.append(
            f'<div class="et-lag" data-testid="coming"><span>{escape(name)}, {share:.0%}</span>{_STOP}'
            f"{bar(share)}</div>"
        )
    return "".join(parts)


def public_handing_html(desk: UploadsShown) -> str:
    """A button that a finger cannot miss, for a page in public."""
    button = f'<button class="etv-big" data-etv-upload>Your own video, up to {escape(desk.limit)}</button>'
    return (button if desk.coming is None else "") + coming_html(desk)
