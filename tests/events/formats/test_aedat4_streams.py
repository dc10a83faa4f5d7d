"""AEDAT4 files of several cameras: what is shown beside the events is of the camera that they come from."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest

from etnet.events.events import Sensor
from etnet.events.formats.aedat.aedat4 import own_streams
from etnet.events.open import Assumptions, open_recording
from etnet.events.triggers import Triggers
from etnet.events.writers import aedat4 as writer
from tests.events.containers import all_events, assert_same_events
from tests.strategies import make_events

SENSOR = Sensor(20, 12)
EVENTS = make_events(400, sensor=SENSOR)
KINDS = {"events": "EVTS", "frame": "FRME", "triggers": "TRIG"}
LEFT, RIGHT = "DVXplorer_DXA00001", "DAVIS346_00000002"


def described(streams: list[tuple[str, str]]) -> str:
    """A description as dv-processing writes it; a stream is its kind and its source, which may be missing."""
    size = f'<attr key="sizeX" type="int">{SENSOR.width}</attr><attr key="sizeY" type="int">{SENSOR.height}</attr>'
    nodes = ""
    for number, (kind, source) in enumerate(streams):
        named = f'<attr key="source" type="string">{source}</attr>' if source else ""
        nodes += (
            f'<node name="{number}" path="/{number}/"><attr key="compression" type="string">LZ4</attr>'
            f'<attr key="typeIdentifier" type="string">{KINDS[kind]}</attr>'
            f'<node name="info" path="/{number}/info/">{named}{size}</node></node>'
        )
    return f'<dv version="2.0"><node name="outInfo" path="/">{nodes}</node></dv>'


class _AnyStream(writer.Aedat4File):
    """Writes packets into stream `number`, whatever their kind."""

    number = 0

    def _packet(self, stream: int, content: bytes) -> None:
        super()._packet(self.number, content)


def save(path, streams: list[tuple[str, str]], monkeypatch):
    """Each stream tells its number: by its first event, its picture's brightness, its trigger's stamp."""
    monkeypatch.setattr(writer, "_description", lambda *_: described(streams))
    with closing(_AnyStream(path, SENSOR, {})) as file:
        for number, (kind, _) in reversed(list(enumerate(streams))):
            file.number = number
            if kind == "events":
                file.add_events(EVENTS[10 * number :])
            elif kind == "frame":
                file.add_picture(20_000, np.full((SENSOR.height, SENSOR.width), number, np.uint8))
            else:
                one = np.ones(1, np.int8)
                file.add_triggers(Triggers(np.array([1000 * number]), np.zeros(1, np.int16), one))
    return path


CAMERA = ("events", "frame", "triggers")
TWO = {
    "by their sources": [(kind, source) for source in (LEFT, RIGHT) for kind in CAMERA],
    "by their sources, pictures first": [
        *(("frame", LEFT), ("events", LEFT), ("triggers", LEFT), ("frame", RIGHT), ("events", RIGHT)),
        ("triggers", RIGHT),
    ],
    "by their numbers": [(kind, "") for _ in range(2) for kind in CAMERA],
}


@pytest.mark.parametrize("form", TWO)
@pytest.mark.parametrize("is_second", [False, True])
def test_of_two_cameras_the_pictures_and_triggers_are_those_of_the_events(form, is_second, tmp_path, monkeypatch):
    streams = TWO[form]
    path = save(tmp_path / "a.aedat4", streams, monkeypatch)
    events, frame, triggers = (
        [number for number, (each, _) in enumerate(streams) if each == kind][is_second] for kind in CAMERA
    )
    with open_recording(path, assume=Assumptions(topic=str(events) if is_second else None)) as recording:
        assert_same_events(all_events(recording), EVENTS[10 * events :])
        assert len(recording.ground_truth) == 1
        np.testing.assert_allclose(recording.ground_truth.read_frame(0), frame / 255, atol=1e-6)
        assert recording.triggers.stamps.tolist() == [1000 * triggers]
        said = "\n".join(remark.text for remark in recording.remarks)
    assert f"those of stream {frame} are shown" in said
    assert f"those of stream {triggers} are shown" in said


def test_a_camera_without_pictures_shows_none_of_the_other_one(tmp_path, monkeypatch):
    streams = [("events", LEFT), ("events", RIGHT), ("frame", RIGHT), ("triggers", RIGHT)]
    path = save(tmp_path / "a.aedat4", streams, monkeypatch)
    with open_recording(path) as recording:
        assert recording.ground_truth is None
        assert recording.triggers is None
        said = "\n".join(remark.text for remark in recording.remarks)
        assert "frames are in streams 2; those are not shown, being another camera's" in said
    with open_recording(path, assume=Assumptions(topic="1")) as recording:
        assert len(recording.ground_truth) == 1
        assert recording.triggers.stamps.tolist() == [3000]


E, F, I, T = "events", "frame", "imus", "triggers"  # noqa: E741
ONE_CAMERA = {
    "nothing named": ([F, E, I, T], {}, {0, 2, 3}),
    "two streams of events, one raw and one filtered": ([E, E, F, I], {}, {2, 3}),
    "two of one source": ([E, F, E, I], dict.fromkeys(range(4), LEFT), {1, 3}),
    "a frame camera beside it": ([E, F, T], {0: LEFT, 1: "a frame camera", 2: "a frame camera"}, {1, 2}),
    "its own pictures before those of others": ([F, E, F, I, I], {1: LEFT, 2: LEFT, 0: "b", 3: "b", 4: LEFT}, {2, 4}),
    "pictures alone": ([F, F, I], {}, {2}),
}


@pytest.mark.parametrize("form", ONE_CAMERA)
def test_what_one_camera_writes_stays_together(form):
    kinds, sources, own = ONE_CAMERA[form]
    cameras = [number for number, kind in enumerate(kinds) if kind == E] or [0, 1]
    assert own_streams(dict(enumerate(kinds)), cameras[0], cameras, sources) == own | {cameras[0]}
