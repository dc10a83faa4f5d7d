"""A page with our styles and scripts and no viewer behind it: what hands do is read from what it would say to one."""

from websockets.datastructures import Headers
from websockets.http11 import Response

from app.web.index_page import IndexPage
from tests.browser.chromium import PATIENCE

ADDRESS = "http://bare.test/"
STUB = """<script>
  window.said = [];
  window.etnetChannel = "channel";
  window.__viserMutable = {
    sendMessage: (message) => window.said.push(message.updates.value.split("|").slice(0, -1).join("|")),
  };
</script>"""
"""viser's end of the channel."""
PHONE = {"is_mobile": True, "has_touch": True}


def bare_page(browser, body, *, workspace="inspect", address=ADDRESS, before="", clock=False, **context):
    """A page of this HTML. `before`: a script that runs before all others; `clock`: its time goes on when told to."""
    opened = browser.new_context(**context)
    opened.add_init_script(f"localStorage.setItem('etnet-tour', 'seen'); {before}")
    page = opened.new_page()
    if clock:
        page.clock.install()
    page.set_default_timeout(PATIENCE)
    page.errors = []
    page.on("pageerror", lambda error: page.errors.append(str(error)))
    body = f'<i data-etv-workspace="{workspace}"></i>{body}'
    index = f"<!doctype html><html><head></head><body>{STUB}{body}</body></html>".encode()
    whole = IndexPage().dressed(Response(200, "OK", Headers({"Content-Type": "text/html"}), index))
    # The stub stands first: a body's beginning is where our scripts go.
    html = whole.body.replace(STUB.encode(), b"").replace(b"<body>", b"<body>" + STUB.encode())
    page.route("**/*", lambda route: route.fulfill(status=200, content_type="text/html", body=html))
    page.goto(address)
    return page


def told(page, kind="pick"):
    """What was said of a kind since the page is there, without its kind."""
    return [words.partition("|")[2] for words in page.evaluate("window.said") if words.startswith(f"{kind}|")]


def until_told(page, words):
    """Wait until this was said, from its beginning."""
    page.wait_for_function("words => window.said.some((each) => each.startsWith(words))", arg=words)
