"""The engine beside a live source: it keeps up, and says what a frame is that came from a cold start."""

import time
from dataclasses import dataclass, field

import numpy as np
import torch

from app.catalogue.cut import CutRecording
from app.engine import live
from app.engine.requests import FrameRequest
from etnet.errors import ModelError
from etnet.live import pace
from etnet.live.buffer import Keep
from etnet.playback.playback import Playback
from tests.app.fakes import Inbox
from tests.app.views.live.viewers import MODEL, live_viewer, replayed
from tests.live.sources import wait_for


def _request(viewer, index, model_id="etnet-half", **more):
    return FrameRequest(viewer.feed.id, model_id, "fp32", viewer.feed.windows.policy, index, **more)


def _cut(viewer, num):
    wait_for(lambda: viewer.feed.windows is not None and len(viewer.feed.windows.kept) >= num, 30)


def test_windows_go_on_while_nobody_looks_and_any_of_them_is_the_frame_of_a_plain_run():
    with live_viewer() as viewer:
        _cut(viewer, 12)
        for index in (11, 3, 7):
            inbox = Inbox()
            viewer.engine.request("somebody", _request(viewer, index), inbox)
            ready = inbox.ready(index)
            assert ready.is_exact
            recording = viewer.feed.recording()
            plain = Playback(MODEL, recording, recording.cut)
            assert torch.equal(plain.at(index).frame[0, 0], torch.from_numpy(np.array(ready.frame)))


def test_a_network_that_comes_late_begins_cold_and_none_of_its_frames_is_called_exact():
    with live_viewer(replayed(num_events=200_000), Keep(seconds=1.0)) as viewer:
        wait_for(lambda: len(viewer.feed.recording().cut) > viewer.feed.recording().first_held > 0, 30)
        inbox = Inbox()
        late = next(entry.id for entry in viewer.catalogue.models() if entry.id != "etnet-half")
        last = len(viewer.feed.recording().cut) - 1
        viewer.engine.request("somebody", _request(viewer, last, late), inbox)
        ready = inbox.ready(last)
        assert not ready.is_exact
        assert not viewer.engine.cached(ready.request).is_exact
        assert ready.began_at > 0
        inbox = Inbox()
        viewer.engine.request("another", _request(viewer, 0, late), inbox)
        assert "gone: what came before" in inbox.failed().message


def test_events_that_leave_the_buffer_while_they_are_replayed_make_a_cold_frame_and_no_error(monkeypatch):
    with live_viewer(replayed(num_events=200_000), Keep(seconds=1.0)) as viewer:
        wait_for(lambda: len(viewer.feed.recording().cut) > viewer.feed.recording().first_held > 0, 30)
        engine, inbox = viewer.engine, Inbox()
        late = next(entry.id for entry in viewer.catalogue.models() if entry.id != "etnet-half")
        last = len(viewer.feed.recording().cut) - 1
        plain = engine._exact_step

        def slow(turn, loaded):
            if turn.request.model_id == late:
                monkeypatch.undo()
                wait_for(lambda: not loaded.reaches(turn.request.index), 30)
            return plain(turn, loaded)

        monkeypatch.setattr(engine, "_exact_step", slow)
        engine.request("somebody", _request(viewer, last, late), inbox)
        ready = inbox.ready(last)
        assert not ready.is_exact
        assert ready.began_at > 0


def _late(viewer):
    return next(entry.id for entry in viewer.catalogue.models() if entry.id != "etnet-half")


def _has_made(viewer, model_id, at_least=0):
    made = [ready.request for ready in viewer.engine._recent.all()]
    return any(request.model_id == model_id and request.index >= at_least for request in made)


def test_a_network_that_fails_leaves_the_source_to_others(monkeypatch):
    with live_viewer() as viewer:
        _cut(viewer, 3)
        late, plain = _late(viewer), viewer.engine._playbacks._load

        def load(entry, precision, device):
            if entry.id == late:
                raise ModelError("it cannot be loaded")
            return plain(entry, precision, device)

        monkeypatch.setattr(viewer.engine._playbacks, "_load", load)
        viewer.engine.request("somebody", _request(viewer, 0, late), Inbox())
        wait_for(lambda: any("cannot be loaded" in note.text for note in viewer.feed.live.notes), 30)
        _cut(viewer, len(viewer.feed.windows.kept) + 5)
        last = len(viewer.feed.windows.kept)
        viewer.engine.request("somebody", _request(viewer, last - 1), Inbox())
        wait_for(lambda: _has_made(viewer, "etnet-half", last), 30)


def test_a_fault_that_passes_does_not_end_a_source(monkeypatch):
    faults, plain = [], pace.measured_step

    def measured(*given):
        faults.append(given)
        if len(faults) < 4:
            raise MemoryError("a busy moment")
        return plain(*given)

    monkeypatch.setattr(pace, "measured_step", measured)
    monkeypatch.setattr(live, "RESTS", 0.05)
    with live_viewer() as viewer:
        _cut(viewer, 3)
        assert sum("a busy moment" in note.text for note in viewer.feed.live.notes) == 3


def test_events_that_leave_on_the_way_to_the_newest_window_are_no_failure_of_the_network(monkeypatch):
    with live_viewer(replayed(num_events=200_000), Keep(seconds=1.0)) as viewer:
        wait_for(lambda: len(viewer.feed.recording().cut) > viewer.feed.recording().first_held > 0, 30)
        plain, begun = Playback.at, []

        def slow(playback, *given, **more):
            if playback.first > 0:
                begun.append(playback.first)
                if len(begun) == 1:
                    wait_for(lambda: playback.recording.is_gone(playback.windows[playback.first]), 30)
            return plain(playback, *given, **more)

        monkeypatch.setattr(Playback, "at", slow)
        late = _late(viewer)
        viewer.engine.request("somebody", _request(viewer, 0, late), Inbox())
        wait_for(lambda: _has_made(viewer, late), 30)
        assert begun[1] > begun[0]
        assert not any("gone" in note.text for note in viewer.feed.live.notes)


def test_who_waits_while_a_network_comes_late_waits_for_a_stretch_and_not_for_all_that_is_held(monkeypatch):
    with live_viewer() as viewer:
        wait_for(lambda: viewer.feed.windows is not None and len(viewer.feed.windows.kept) >= 20, 120)
        late, plain, encoded = _late(viewer), MODEL.encode, []

        def slow(*given):
            encoded.append(given[0].shape)
            time.sleep(0.05)
            return plain(*given)

        monkeypatch.setattr(live, "STRETCH", 0.1)
        monkeypatch.setattr(MODEL, "encode", slow)
        viewer.engine.request("somebody", _request(viewer, 0, late), inbox := Inbox())
        inbox.ready(0)
        before = len(encoded)
        wait_for(lambda: len(encoded) > before + 2, 30)
        asked = len(encoded)
        viewer.engine.request("another", _request(viewer, 5, wants_attention=True), inbox := Inbox())
        inbox.wait(lambda reply: getattr(reply, "attention", None) is not None)
        assert len(encoded) - asked < 8
        wait_for(lambda: _has_made(viewer, late, 20), 30)


@dataclass(frozen=True)
class Looking:
    """Looks at a window, the first time when events on the way have left the buffer."""

    request: FrameRequest
    begun: list[int] = field(default_factory=list, compare=False)

    def run(self, loaded, cancelled):
        if not self.begun:
            wait_for(lambda: not loaded.reaches(self.request.index), 30)
        self.begun.append(loaded.playback.first)
        step = loaded.playback.at(self.request.index)
        yield step.frame.shape, 1.0


def test_a_question_whose_events_leave_the_buffer_begins_cold_and_is_answered():
    with live_viewer(replayed(num_events=200_000), Keep(seconds=1.0)) as viewer:
        wait_for(lambda: len(viewer.feed.recording().cut) > viewer.feed.recording().first_held > 0, 30)
        late = next(entry.id for entry in viewer.catalogue.models() if entry.id != "etnet-half")
        job, told = Looking(_request(viewer, len(viewer.feed.recording().cut) - 1, late)), []
        viewer.engine.job("somebody", "looking", job, lambda slot, result: told.append(result))
        wait_for(lambda: told and (told[-1].is_whole or told[-1].trouble), 30)
        assert told[-1].trouble == ""
        first, again = job.begun
        assert again > first


def test_a_long_question_about_the_past_does_not_hold_up_the_source():
    with live_viewer() as viewer:
        _cut(viewer, 10)
        inbox = Inbox()
        viewer.engine.request("somebody", _request(viewer, 5, wants_attention=True), inbox)
        ready = inbox.wait(lambda reply: getattr(reply, "attention", None) is not None)
        assert ready.is_exact
        before = len(viewer.feed.windows.kept)
        time.sleep(0.3)
        _cut(viewer, before + 3)
        assert isinstance(viewer.feed.recording(), CutRecording)
