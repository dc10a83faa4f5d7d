"""What lies over the demo when it is asked for: the mirror, and the page to take home."""

from __future__ import annotations

from app.html.elements import ON_PICK, escape
from app.html.qr import qr_svg
from app.html.uploads import public_handing_html
from app.views.demo.state import HOME_SLOT, DemoState
from app.views.page import MirrorShown, Page

CONSENT = (
    "Your camera’s pictures go to this viewer, become dots, and are gone when you stop. Nothing is stored, and nobody "
    "else sees them. It is a simulated sensor: a real one would be a thousand times faster."
)
KEPT = "Only what you take home is kept, for half an hour, at an address that nobody else knows."


def sheet_html(page: Page) -> str:
    """What lies over the page; nothing otherwise."""
    state, mirror = page.state.of(DemoState), page.mirror
    if state.sheet == "home":
        return _sheet("Take it home", _home(page), "home")
    if state.sheet == "mirror" and mirror is not None and not mirror.is_live:
        return _sheet("Your own face", _consent(page, mirror), "mirror")
    return '<section class="etv-demo etv-sheet" hidden></section>'


def _sheet(title: str, body: str, name: str) -> str:
    close = f'<button class="etv-big" data-k="demo:close" {ON_PICK}>Close</button>'
    return (
        f'<section class="etv-demo etv-sheet" data-testid="sheet-{name}"><div role="dialog" aria-modal="true"'
        f' aria-label="{escape(title)}"><h2>{escape(title)}</h2>{body}{close}</div></section>'
    )


def _consent(page: Page, mirror: MirrorShown) -> str:
    said = escape(mirror.trouble)
    start = f'<button class="etv-big etv-first" data-etv-camera="{escape(mirror.ticket)}">Use my camera</button>'
    own = "" if page.uploads is None else public_handing_html(page.uploads)
    films = "".join(
        f'<button class="etv-big" data-k="open:{escape(choice.id)}" {ON_PICK}>{escape(choice.title)}, as dots</button>'
        for choice in page.recordings
        if choice.is_film
    )
    words = f"{CONSENT} {KEPT}" if page.gives_home else CONSENT
    hidden = "" if said else " hidden"
    return f'<p>{words}</p><p class="etv-said" role="alert" data-etv-camera-said{hidden}>{said}</p>{start}{films}{own}'


def mirror_html(page: Page) -> str:
    """Sliders and buttons at the foot while the mirror runs; nothing otherwise.

    The sliders speak to the camera's own connection, and this element must stay while they are dragged.
    """
    if page.mirror is None or not page.mirror.is_live:
        return '<section class="etv-demo etv-mirror" data-testid="mirror" hidden></section>'
    home = f'<button class="etv-big" data-k="demo:home" {ON_PICK}>Take it home</button>' if page.gives_home else ""
    return (
        '<section class="etv-demo etv-mirror" data-testid="mirror">'
        '<label>Few dots<input type="range" min="0" max="1" step="0.02" value="0.6" data-etv-mirror="contrast"'
        ' aria-label="Sensitivity: how small a change makes a dot"><span>many</span></label>'
        '<label>Clean<input type="range" min="0" max="3" step="0.1" value="0.2" data-etv-mirror="noise"'
        ' aria-label="Noise of the sensor"><span>noisy</span></label>'
        f'{home}<button class="etv-big" data-etv-camera-stop>Stop the camera</button></section>'
    )


def delay_html(page: Page) -> str:
    """How far the image lags behind the world, while the mirror runs."""
    if page.mirror is None or not page.mirror.is_live or page.mirror.delay is None:
        return ""
    return f'<span class="etv-delay" data-testid="delay">{page.mirror.delay:.1f} s behind you</span>'


def _home(page: Page) -> str:
    state = page.state.of(DemoState)
    if state.home:
        address = page.public_url + state.home
        code = ""
        if page.public_url:
            code = f'<div class="etv-code" role="img" aria-label="QR code of the page">{qr_svg(address)}</div>'
            code += "<p>Point your phone’s camera at it.</p>"
        link = (
            f'<a class="etv-big etv-first" href="{escape(state.home)}" download="events.html"'
            ' data-testid="home-link">Download the page</a>'
        )
        return f"<p>Three seconds of this, as one page that works anywhere. The link ends soon.</p>{code}{link}"
    if state.trouble:
        return f'<p class="etv-said" role="alert">{escape(state.trouble)}</p>'
    result = page.results.get(HOME_SLOT)
    share = 0.0 if result is None else result.share
    return f'<p>Your page is being made: {share:.0%}</p><div class="et-bar"><i style="width:{share:.0%}"></i></div>'
