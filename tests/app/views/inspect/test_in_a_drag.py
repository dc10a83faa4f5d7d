"""In a drag an open inspector stands as it is, and says so."""

from dataclasses import replace

import pytest

from app.state.view_state import ViewState
from app.views.inspect.jobs import parts
from app.views.inspect.panel import InspectPanel
from tests.app.small_loaded import QUERY, loaded_of, request_of, whole
from tests.app.views.inspect.pages import moment_of, page_of


@pytest.fixture(scope="module")
def loaded():
    return loaded_of()


@pytest.fixture
def moment(loaded):
    return moment_of(loaded)


class Drawn:
    """A page's element that keeps what it was sent."""

    def __init__(self):
        self.sent = []

    def show(self, content):
        self.sent.append(content)


def test_in_a_drag_an_open_inspector_stands_still_and_says_so(loaded, moment):
    job = parts.AblatedPartsJob(request_of(5).plain)
    state = ViewState(index=5, query=QUERY)
    page = page_of(state, moment, None, ablated=(job, whole(job, loaded)))
    state, panel = page.state, InspectPanel()
    panel._lag, panel._body, panel._drawn, panel._drawn_at = Drawn(), Drawn(), None, 0
    panel.show_settings(page)
    for index in (6, 7):
        panel.show_settings(replace(page, state=replace(state, index=index), is_moving=True))
    assert len(panel._body.sent) == 1
    assert panel._lag.sent[1:] == [panel._lag.sent[1]] * 2  # equal text is not sent again
    assert "shows window 5" in panel._lag.sent[1]
    panel.show_settings(replace(page, state=replace(state, index=7, query=(1, 2)), is_moving=True))
    assert len(panel._body.sent) == 2  # a hand changed something
    panel.show_settings(replace(page, state=replace(state, index=7)))
    assert len(panel._body.sent) == 3  # at rest
    assert panel._lag.sent[-1] == ""


@pytest.mark.parametrize(("query", "follows"), [(None, False), (QUERY, True)])
def test_in_a_drag_a_list_of_inspectors_without_an_answer_is_of_no_window(moment, query, follows):
    page = replace(page_of(ViewState(index=5, query=query), moment, None), follows=follows)
    panel = InspectPanel()
    panel._lag, panel._body, panel._drawn, panel._drawn_at = Drawn(), Drawn(), None, 0
    panel.show_settings(page)
    panel.show_settings(replace(page, state=replace(page.state, index=6), is_moving=True))
    assert panel._lag.sent == ["", ""]
    assert len(panel._body.sent) == 1
