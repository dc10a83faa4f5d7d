"""A page that found no place among the visitors."""

import pytest

from tests.browser.bare import ADDRESS, bare_page

CROWDED = '<div class="etv-crowded"><b>Many are looking already</b></div>'


@pytest.mark.parametrize(("body", "comes_again"), [(CROWDED, True), ("<p>A place</p>", False)])
def test_it_looks_again_by_itself_within_forty_seconds(browser, body, comes_again):
    page = bare_page(browser, body, clock=True)
    try:
        loads = []
        page.on("load", lambda: loads.append(page.url))
        page.clock.fast_forward(19_000)
        page.evaluate("0")
        assert loads == []
        if comes_again:
            with page.expect_event("load"):
                page.clock.fast_forward(22_000)
            assert loads == [ADDRESS]
        else:
            page.clock.fast_forward(120_000)
            page.evaluate("0")
            assert loads == []
    finally:
        page.context.close()


def test_it_is_loaded_anew_once_the_server_answers_and_not_into_a_browsers_error(browser):
    page = bare_page(browser, CROWDED, clock=True)
    try:
        loads, asked = [], []
        page.on("load", lambda: loads.append(page.url))
        answers = [lambda route: route.abort(), lambda route: route.fulfill(status=502), lambda route: route.fallback()]
        page.route("**/healthz", lambda route: (asked.append(route.request.url), answers.pop(0)(route)))
        for num in (1, 2):
            with page.expect_event(
                "requestfailed" if num == 1 else "response", lambda each: each.url.endswith("/healthz")
            ):
                page.clock.fast_forward(41_000)
            page.evaluate("new Promise((settled) => queueMicrotask(settled))")
            assert len(asked) == num
            assert loads == []
        with page.expect_event("load"):
            page.clock.fast_forward(41_000)
        assert loads == [ADDRESS]
    finally:
        page.context.close()
