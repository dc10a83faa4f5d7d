"""A visitor's own camera: a recording that grows, at the network's pace, and is forgotten."""

import threading
import time

import numpy as np
import pytest

from app.catalogue import mirror as mirrors
from app.catalogue.mirror import SENSOR, MirrorError, Mirrors, MirrorSensor
from etnet.windows import BetweenFrames, plan_windows


class Shelf:
    def __init__(self):
        self.streams, self.entries, self.gone = {}, {}, []

    def stream(self, recording_id, wait):
        self.streams[recording_id] = wait

    def take_in(self, entry):
        self.entries[entry.id] = entry

    def let_go(self, recording_id):
        self.gone.append(recording_id)


@pytest.fixture
def shelf(monkeypatch):
    monkeypatch.setattr(mirrors, "FORGETS", 0.05)
    return Shelf()


@pytest.fixture
def mirror(shelf):
    made = Mirrors(shelf.stream, shelf.take_in, shelf.let_go)
    one = made.mirror()
    yield one
    made.close()


def face(number):
    y, x = np.mgrid[: SENSOR.height, : SENSOR.width]
    return (128 + 90 * np.sin((x - 3 * number) / 9) * np.cos((y + number) / 11)).astype(np.uint8)


def show(mirror, count, start=0):
    for number in range(start, start + count):
        mirror.show(face(number))


def begun(mirror, shelf):
    """The recording of a mirror that has begun; frames come while it is waited for."""
    mirror.begin()
    frames = threading.Thread(target=show, args=(mirror, 8))
    frames.start()
    recording = shelf.streams[mirror.recording_id](lambda: False)
    frames.join()
    return recording


def test_what_the_camera_saw_between_two_free_moments_of_the_network_is_one_window(mirror, shelf):
    recording = begun(mirror, shelf)
    before = plan_windows(recording.latest(), BetweenFrames())
    show(mirror, 5, 8)
    assert recording.latest() is recording.latest(), "nothing was asked for, so nothing is added"
    mirror.advance()
    grown = recording.latest()
    windows = plan_windows(grown, BetweenFrames())
    assert len(windows) == len(before) + 1
    assert windows[-1].start == windows[-2].stop
    assert windows[-1].num_events > 0
    show(mirror, 1, 20)
    mirror.advance()
    assert len(plan_windows(recording.latest(), BetweenFrames())) == len(before) + 2


def test_its_frames_are_those_that_the_camera_showed(mirror, shelf):
    recording = begun(mirror, shelf)
    show(mirror, 1, 30)
    mirror.advance()
    truth = recording.latest().ground_truth
    assert np.allclose(truth.read_frame(len(truth) - 1), face(30) / 255, atol=0.01)


def test_when_it_ends_it_is_told_and_forgotten(shelf):
    made, told = Mirrors(shelf.stream, shelf.take_in, shelf.let_go), []
    mirror = made.mirror(told.append)
    begun(mirror, shelf)
    held = mirror.recording_id
    mirror.end()
    assert told == [held, ""]
    assert mirror.recording_id == ""
    until = time.monotonic() + 3
    while shelf.gone != [held]:
        assert time.monotonic() < until
        time.sleep(0.01)
    with pytest.raises(MirrorError, match="off"):
        mirror.show(face(0))


def until(condition, patience=3.0):
    ends = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < ends
        time.sleep(0.01)


def test_while_a_page_is_made_of_it_it_is_not_forgotten(mirror, shelf):
    begun(mirror, shelf)
    mirror.ordered = held = mirror.recording_id
    mirror.end()
    time.sleep(10 * mirrors.FORGETS)
    assert shelf.gone == []
    mirror.ordered = ""
    until(lambda: shelf.gone == [held])


@pytest.mark.parametrize("ends", ["in time", "with its visitor"])
def test_but_not_for_ever(mirror, shelf, monkeypatch, ends):
    if ends == "in time":
        monkeypatch.setattr(mirrors, "MADE_WITHIN", 0.2)
    begun(mirror, shelf)
    mirror.ordered = held = mirror.recording_id
    mirror.end()
    if ends == "with its visitor":
        mirror.close()
    until(lambda: shelf.gone == [held])


def test_only_so_many_run_at_once_and_one_that_ends_makes_room(shelf):
    made = Mirrors(shelf.stream, shelf.take_in, shelf.let_go)
    running = [made.mirror() for _ in range(mirrors.AT_ONCE)]
    for one in running:
        one.begin()
    late = made.mirror()
    with pytest.raises(MirrorError, match="try again in a minute"):
        late.begin()
    running[0].end()
    late.begin()
    with pytest.raises(MirrorError, match="already"):
        late.begin()
    made.close()


def test_a_camera_is_not_let_in_while_the_former_one_is_being_put_away(mirror, shelf):
    begun(mirror, shelf)
    live, may_stop = mirror._live, threading.Event()
    plain = live.stop
    live.stop = lambda: (may_stop.wait(30), plain())
    ending = threading.Thread(target=mirror.end)
    ending.start()
    until(lambda: mirror.recording_id == "")
    with pytest.raises(MirrorError, match="switched off; try again"):
        mirror.begin()
    may_stop.set()
    ending.join()
    begun(mirror, shelf)
    assert mirror._mirrors._running == {mirror}, "it is the one that runs, so it counts"


def test_a_ticket_is_good_for_as_long_as_its_page_is_open(mirror, shelf):
    made = mirror._mirrors
    assert made.of(mirror.ticket) is mirror
    mirror.close()
    with pytest.raises(MirrorError, match="load it again"):
        made.of(mirror.ticket)
    with pytest.raises(MirrorError, match="load it again"):
        mirror.begin()


def test_more_sensitivity_makes_more_events_and_noise_makes_some_of_nothing():
    counts = {}
    for sensitivity in (0.1, 0.9):
        pixels = MirrorSensor()
        pixels.set(sensitivity, 0.0)
        counts[sensitivity] = sum(len(pixels.expose(face(n), n * 66_000.0)) for n in range(4))
        pixels.close()
    assert counts[0.9] > 2 * counts[0.1] > 0
    still = {}
    for noise in (0.0, 3.0):
        pixels = MirrorSensor()
        pixels.set(0.5, noise)
        still[noise] = sum(len(pixels.expose(face(0), n * 66_000.0)) for n in range(4))
        pixels.close()
    assert still[0.0] == 0 < still[3.0]
