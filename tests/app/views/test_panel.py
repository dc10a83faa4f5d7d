"""What the server shows in a widget is told to the page, and to no listener, even while the server ends."""

import gc

import pytest
import viser

from app.views.panel import assign, on_visitor, seconds_since_touched, set_value


@pytest.fixture
def server():
    running = viser.ViserServer(port=0, verbose=False)
    yield running
    running.stop()


def test_a_value_that_the_server_sets_is_no_visitors_use(server):
    heard, slider = [], server.gui.add_slider("x", 0, 10, 1, 3)
    on_visitor(slider, lambda value: value, heard.append)
    set_value(slider, 7.4)
    assert slider.value == 7  # in the widget's own type
    assert heard == []


def test_a_widget_that_shows_a_value_already_is_not_touched_by_it(server):
    slider = server.gui.add_slider("x", 0, 10, 1, 3)
    slider._impl.update_timestamp = 0.0
    set_value(slider, 3)
    assert seconds_since_touched(slider) > 1e6


def test_a_hand_that_was_on_the_widget_just_now_is_not_overruled(server):
    slider = server.gui.add_slider("x", 0, 10, 1, 3)
    slider._impl.update_timestamp = 0.0
    assign(slider, 5)
    assert slider.value == 5
    assign(slider, 6)
    assert slider.value == 5


def test_a_server_that_has_ended_leaves_no_listener_waiting(server):
    slider = server.gui.add_slider("x", 0, 10, 1, 3)
    on_visitor(slider, lambda value: value, [].append)
    server.stop()
    with pytest.warns(UserWarning, match="closed connection"):
        set_value(slider, 4)
    gc.collect()  # a coroutine that nobody awaited would warn here, and fail
