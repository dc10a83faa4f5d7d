"""What a page may say: the messages of ours pass, and of all others not one."""

import math
import warnings
from types import SimpleNamespace

import msgspec
import pytest
from viser import _messages

from app.web.messages import MessageError, fate_of, read_message
from tests.app.web.fuzz_messages import CAMERA, CLICK, STORED, TYPES, frames


def packed(**message):
    return msgspec.msgpack.encode(message)


def test_what_our_page_sends_passes_as_it_came():
    for message in (CAMERA, CLICK, STORED, {"type": "CommandTriggerMessage", "uuid": "c"}):
        raw = packed(**message)
        assert read_message(raw, is_first=message is CAMERA).raw == raw
    for value in (True, 3, 0.5, "word", [1, 2]):
        read_message(packed(type="GuiUpdateMessage", uuid="u", updates={"value": value}), is_first=False)


def test_no_type_passes_but_those_of_our_page():
    passing = {
        "ViewerCameraMessage", "GuiUpdateMessage", "CommandTriggerMessage", "SceneNodeClickMessage",
        "LocalStorageGetItemResponseMessage",
    }  # fmt: skip
    assert passing <= set(TYPES)
    for kind in set(TYPES) - passing:
        with pytest.raises(MessageError, match="a type that no page sends"):
            read_message(packed(type=kind, uuid="u"), is_first=False)


@pytest.mark.parametrize(
    "change",
    [
        {"fov": math.nan}, {"fov": 0}, {"wxyz": [1, 0, 0]}, {"wxyz": "1000"}, {"position": [math.inf, 0, 0]},
        {"near": None}, {"image_height": math.nan}, {"image_width": -3}, {"image_width": "wide"}, {"extra": 1},
        {"look_at": [[0], 0, 0]}, {"far": 2**60}, {"up_direction": None}, {"far": True},
    ],
)  # fmt: skip
def test_a_camera_that_makes_no_sense_does_not_pass(change):
    with pytest.raises(MessageError):
        read_message(packed(**{**CAMERA, **change}), is_first=True)


def test_a_canvas_without_a_side_is_given_one():
    mended = read_message(packed(**{**CAMERA, "image_height": 0, "image_width": 0.5}), is_first=True).raw
    assert msgspec.msgpack.decode(mended) == {**CAMERA, "image_height": 1, "image_width": 1}


def test_before_its_camera_a_page_says_nothing():
    with pytest.raises(MessageError, match="before its camera"):
        read_message(packed(type="GuiUpdateMessage", uuid="u", updates={"value": 1}), is_first=True)


@pytest.mark.parametrize(
    ("held", "value", "fate"),
    [
        (3, 5, "pass"), (3, 2.0, "pass"), (3, "5", "close"), (3, True, "close"), (3, [5], "close"),
        (0.5, 1, "pass"), (0.5, "x", "close"), (True, False, "pass"), (True, 1, "close"), ("a", "b", "pass"),
        ("a", 1, "close"), ((1, 2), [3, 4], "pass"), ((1, 2), [3], "close"), ((1, 2), ["a", 4], "close"),
        (None, 1, "close"),
    ],
)  # fmt: skip
def test_a_value_is_of_its_widgets_type(held, value, fate):
    assert fate_of(SimpleNamespace(value=held), value) == fate


def test_a_choice_that_is_not_offered_any_more_is_left_out():
    widget = SimpleNamespace(value="a", options=("a", "b"))
    assert fate_of(widget, "b") == "pass"
    assert fate_of(widget, "c") == "drop"


def sound_for_viser(count, seed):
    """Every frame that passes is one that viser reads without a word."""
    num_passed = 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for i, frame in enumerate(frames(count, seed, ("u", "v"))):
            try:
                message = read_message(frame, is_first=i % 7 == 0)
            except MessageError:
                continue
            num_passed += 1
            _messages.Message.deserialize(message.raw)
    return num_passed


def test_whatever_comes_is_refused_by_name_or_read_by_viser():
    assert sound_for_viser(4_000, seed=1) > 300


@pytest.mark.slow
def test_of_a_hundred_thousand_frames_none_gets_through_that_viser_cannot_read():
    assert sound_for_viser(100_000, seed=2) > 10_000
