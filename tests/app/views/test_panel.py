"""What the server shows in a widget is told to the page, and to no listener, even while the server ends."""

import gc
import time

import pytest
import viser

from app.views.panel import assign, on_visitor, set_options, set_value


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


def test_what_the_server_shows_never_keeps_it_from_showing_the_next(server):
    slider = server.gui.add_slider("x", 0, 10, 1, 3)
    on_visitor(slider, lambda value: value, [].append)
    for value in (5, 6, 7):
        assign(slider, value)
        assert slider.value == value


def test_a_hand_that_was_on_the_widget_just_now_is_not_overruled(server):
    slider = server.gui.add_slider("x", 0, 10, 1, 3)
    on_visitor(slider, lambda value: value, [].append)
    slider._impl.update_timestamp = time.time()  # as viser has it of a message of the page
    assign(slider, 5)
    assert slider.value == 3


def test_choices_are_offered_with_the_right_one_among_them(server):
    heard, dropdown = [], server.gui.add_dropdown("x", ("a", "b"))
    on_visitor(dropdown, lambda value: value, heard.append)
    set_options(dropdown, ("c", "b", "a"), "b")
    assert dropdown.value == "a"
    set_options(dropdown, ("c", "d"), "d")
    assert dropdown.value == "d"
    assert heard == []


def test_a_server_that_has_ended_leaves_no_listener_waiting(server):
    slider = server.gui.add_slider("x", 0, 10, 1, 3)
    on_visitor(slider, lambda value: value, [].append)
    server.stop()
    with pytest.warns(UserWarning, match="closed connection"):
        set_value(slider, 4)
    gc.collect()  # a coroutine that nobody awaited would warn here, and fail
