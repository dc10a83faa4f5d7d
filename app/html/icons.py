"""Line icons of the page, 16 × 16, drawn with the colour of the text."""

from __future__ import annotations

_PATHS = {
    "search": '<circle cx="7" cy="7" r="4.2"/><path d="M10.3 10.3 14 14"/>',
    "link": (
        '<path d="M6.6 9.4 9.4 6.6M7.2 4.6l.9-.9a2.9 2.9 0 0 1 4.2 4.2l-.9.9"/>'
        '<path d="M8.8 11.4l-.9.9a2.9 2.9 0 0 1-4.2-4.2l.9-.9"/>'
    ),
    "download": '<path d="M8 2.500v7.500M4.8 7 8 10.2 11.2 7M3 13.500h10"/>',
    "help": ('<circle cx="8" cy="8" r="6"/><path d="M6.3 6.3a1.8 1.8 0 1 1 2.5 1.7c-.6.3-.8.6-.8 1.2M8 11.3v.1"/>'),
    "expand": '<path d="M2.5 6V2.500H6M10 2.500h3.500V6M13.5 10v3.500H10M6 13.500H2.500V10"/>',
    "first": '<path d="M4 3v10M13 3 6.5 8l6.5 5z"/>',
    "previous": '<path d="M11.5 3 5 8l6.5 5z"/>',
    "next": '<path d="M4.5 3 11 8l-6.5 5z"/>',
    "last": '<path d="M12 3v10M3 3l6.5 5L3 13z"/>',
    "play": '<path d="M5 3v10l8-5z" fill="currentColor"/>',
    "pause": '<path d="M5 3v10M11 3v10" stroke-width="3"/>',
    "loop": '<path d="M3 8a4 4 0 0 1 4-4h5M10 2l2 2-2 2M13 8a4 4 0 0 1-4 4H4M6 14l-2-2 2-2"/>',
    "swipe": '<path d="M8 2v12M2.5 4.500H6v7H2.500zM10 4.500h3.500v7H10z"/>',
    "cube": '<path d="M8 2 13.5 5v6L8 14 2.5 11V5zM2.5 5 8 8l5.5-3M8 8v6"/>',
    "front": '<rect x="3" y="4" width="10" height="8" rx="1"/>',
    "side": '<path d="M5 3v10M11 3v10M5 8h6"/>',
    "info": '<circle cx="8" cy="8" r="6"/><path d="M8 7.3v4M8 4.800v.1"/>',
    "close": '<path d="M4 4l8 8M12 4l-8 8"/>',
    "code": '<path d="M5.5 4.5 2.5 8l3 3.500M10.5 4.500l3 3.5-3 3.5"/>',
    "variance": '<path d="M8 2.500v6M5 5.500h6M4 13h8"/>',
    "dots": (
        '<circle cx="4" cy="11.500" r="1.500"/><circle cx="8.500" cy="7" r="2.200"/>'
        '<circle cx="12.500" cy="3.500" r="1"/><circle cx="12" cy="11.500" r="1.200"/>'
    ),
    "table": '<path d="M2.5 3.500h11v9h-11zM2.5 6.500h11M2.5 9.500h11M6 3.500v9"/>',
    "pin": '<path d="M8 9.500V14M5 9.500h6L10 6V2.500H6V6z"/>',
}


def icon(name: str) -> str:
    """An icon as SVG."""
    return (
        '<svg viewBox="0 0 16 16" aria-hidden="true" fill="none" stroke="currentColor" stroke-width="1.5"'
        f' stroke-linecap="round" stroke-linejoin="round">{_PATHS[name]}</svg>'
    )
