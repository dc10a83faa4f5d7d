"""The page before anybody is connected: title, icon, what a chat shows of a link to it, our scripts and styles.

viser serves its own index with its own title and icon; this replaces them in what it answers. Our styles and scripts
stand in the page itself: viser's script is most of it and starts when all of it has been read, so ours run before it,
no touch comes too early for them, and nothing is asked for before there is something to see. What a page shows at once
(`begin_with`) stands before viser's script.
"""

from __future__ import annotations

import gzip
import re
from dataclasses import dataclass, field
from html import escape

from websockets.datastructures import Headers
from websockets.http11 import Response

from app.html.assets import page_folder

STYLE_SHEETS = ("tokens", "panels", "page", "demo")
"""In the head, where no panel of viser's can take them away."""
SCRIPTS = (
    "focus", "channel", "link", "scene", "tour", "upload", "tidy", "keys", "pictures", "booth", "camera", "demo_keys",
)  # fmt: skip
"""At the beginning of the body, in this order."""
TITLE = "ET-Net viewer"
DESCRIPTION = "See what an event camera reports, what a network makes of it, and where it looks, live in the browser."
SOCIAL_SIZE = (1200, 630)
VIEWPORT = "width=device-width, initial-scale=1, minimum-scale=1"
"""viser's, and a lower limit: without it a phone zooms out when a list opens near the sheet's edge, the list moves with
the page, and no finger can choose from it."""
_VIEWPORT = re.compile(rb"<meta\s+name=\"viewport\"[^>]*>")
_ICON = re.compile(rb"<link\s+rel=\"icon\"[^>]*>")
_TITLE = re.compile(rb"<title>[^<]*</title>")
_PACKED = re.compile(rb"<script data-p=.*?</script>", re.DOTALL)
"""viser's client, packed."""
_DESCRIPTION = re.compile(rb"<meta\s+name=\"description\"[^>]*>")


def head_html(public_url: str | None) -> str:
    """Viewport, title, icon; for a page with a public address also the picture and words that a link to it shows."""
    lines = [
        f'<meta name="viewport" content="{VIEWPORT}">',
        f"<title>{TITLE}</title>",
        '<link rel="icon" type="image/svg+xml" href="/static/icon.svg">',
        *(f'<style data-sheet="{name}">{_text(f"{name}.css")}</style>' for name in STYLE_SHEETS),
        f'<meta name="description" content="{escape(DESCRIPTION)}">',
        f'<meta property="og:title" content="{TITLE}">',
        f'<meta property="og:description" content="{escape(DESCRIPTION)}">',
        '<meta property="og:type" content="website">',
    ]
    if public_url is not None:
        base = escape(public_url.rstrip("/"))
        width, height = SOCIAL_SIZE
        lines += [
            f'<meta property="og:url" content="{base}/">',
            f'<meta property="og:image" content="{base}/static/social.jpg">',
            f'<meta property="og:image:width" content="{width}"><meta property="og:image:height" content="{height}">',
            '<meta name="twitter:card" content="summary_large_image">',
        ]
    return "".join(lines)


@dataclass(slots=True)
class IndexPage:
    """Puts our head into viser's index, once for each way in which it is packed."""

    public_url: str | None = None
    _first: str = ""
    _known: dict[str, bytes] = field(default_factory=dict)

    def begin_with(self, html: str) -> None:
        """Show this before viser's client has started."""
        self._first, self._known = html, {}

    def dressed(self, response: Response) -> Response:
        """The answer with our head, if it is an HTML page; any other as it is."""
        if response.status_code != 200 or "text/html" not in response.headers.get("Content-Type", ""):
            return response
        packing = response.headers.get("Content-Encoding", "identity")
        if packing not in ("gzip", "identity") or response.body is None:
            return response
        if packing not in self._known:
            page = gzip.decompress(response.body) if packing == "gzip" else response.body
            page = self._put_in(bytes(page))
            self._known[packing] = gzip.compress(page) if packing == "gzip" else page
        body = self._known[packing]
        headers = {name: value for name, value in response.headers.raw_items() if name.lower() != "content-length"}
        return Response(200, "OK", Headers({**headers, "Content-Length": str(len(body))}), body)

    def _put_in(self, page: bytes) -> bytes:
        end = page.index(b">", page.index(b"<head")) + 1
        # Only the head's beginning: the rest of viser's index is one packed script, which may hold anything.
        start, rest = page[end : end + 5000], page[end + 5000 :]
        for pattern in (_VIEWPORT, _ICON, _TITLE, _DESCRIPTION):
            start = pattern.sub(b"", start, count=1)
        page = page[:end] + head_html(self.public_url).encode() + start + rest
        scripts = "".join(f"<script>{_text(f'{name}.js')}</script>" for name in SCRIPTS)
        return _with_body(page, (scripts + self._first).encode())


def _with_body(page: bytes, begins: bytes) -> bytes:
    """The page with this at the beginning of its body, and viser's client, which it has in the head, at the end."""
    packed = _PACKED.search(page)
    if packed is not None:
        page = page[: packed.start()] + page[packed.end() :]
    start = page.index(b">", page.index(b"<body", 0 if packed is None else packed.start())) + 1
    end = page.rindex(b"</body>")
    return page[:start] + begins + page[start:end] + (b"" if packed is None else packed[0]) + page[end:]


def _text(name: str) -> str:
    return (page_folder() / name).read_text("utf-8")
