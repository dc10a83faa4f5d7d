"""A stranger's video is decoded in a process of its own, to the bit, and what goes wrong there is one sentence."""

import threading
import time
from contextlib import closing
from types import SimpleNamespace

import numpy as np
import pytest

from app.catalogue import video_apart
from app.catalogue.entries import Entry
from app.catalogue.recordings import Catalogue
from app.catalogue.video_apart import FootageApart
from app.catalogue.videos import AT_ONCE, Videos
from app.config import ViewerConfig
from etnet.errors import Cancelled, EtnetError, RecordingError
from etnet.simulation.growing import GrowingVideo
from etnet.simulation.video import VideoConfig, footage_of
from tests.app.catalogue.test_opening_apart import children
from tests.simulation.test_video import drifting, write

CONFIG = VideoConfig(contrast=0.15, noise=0.5)


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    return write(tmp_path_factory.mktemp("videos") / "drift.mp4", drifting(24, speed=2.0))


def never():
    return False


def apart(path, is_cancelled=never):
    return closing(FootageApart(path, CONFIG, is_cancelled))


def test_frames_and_facts_are_those_of_the_decoder_here(video):
    with closing(footage_of(video, CONFIG)) as here, apart(video) as there:
        for name in ("name", "sensor", "tone", "bits", "duration", "interval"):
            assert getattr(here, name) == getattr(there, name)
        for mine, theirs in zip(here, there, strict=True):
            assert (mine.t, mine.is_cut) == (theirs.t, theirs.is_cut)
            assert mine.light.tobytes() == theirs.light.tobytes()
        assert here.remarks == there.remarks
    assert children() == []


def test_what_is_simulated_of_it_is_the_same_recording(video, tmp_path):
    films = [
        GrowingVideo(video, tmp_path / "here.h5", CONFIG, "drift"),
        GrowingVideo(video, tmp_path / "there.h5", CONFIG, "drift", opened=FootageApart),
    ]
    columns = []
    for film in films:
        film.run(never)
        recording = film.recording()
        events = recording.read(0, recording.num_events)
        columns.append([events.x, events.y, events.t, events.p])
    assert len(columns[0][0]) > 100
    assert all(np.array_equal(mine, theirs) for mine, theirs in zip(*columns, strict=True))
    assert films[0].recording().remarks == films[1].recording().remarks


def test_a_video_of_a_stranger_is_begun_apart_and_ends_with_its_visitor(video, monkeypatch):
    monkeypatch.setattr("app.catalogue.videos.QUIET", 0.01)
    videos = Videos()
    try:
        videos.begin("visitor", "upload-1", video, "drift.mp4", is_strangers=True)
        assert videos.open("upload-1").num_events
        assert isinstance(videos._films["upload-1"].video._frames, FootageApart)
    finally:
        videos.close()


@pytest.mark.parametrize("content", [b"", b"no video" * 100, b"\x00\x00\x00\x18ftypmp42" + b"\xff" * 5000])
def test_what_is_no_video_is_one_sentence_and_leaves_no_process(tmp_path, content):
    (tmp_path / "a.mp4").write_bytes(content)
    with pytest.raises(RecordingError, match=r"a\.mp4") as refusal:
        FootageApart(tmp_path / "a.mp4", CONFIG, never)
    assert "\n" not in str(refusal.value)
    assert str(tmp_path) not in str(refusal.value)
    assert children() == []


FACTS = '{"sensor": [16, 8], "tone": {"curve": "srgb"}, "bits": 8, "duration": 1.0, "interval": 40000.0}'
SAYS = f"""
import json, os, struct, sys, time
told = json.loads(sys.stdin.readline())
def say(kind, content):
    sys.stdout.buffer.write(struct.pack("<cI", kind, len(content)) + content)
    sys.stdout.buffer.flush()
facts = {FACTS!r}
frame = struct.pack("<d?", 0.0, False) + bytes(4 * 128)
"""


@pytest.mark.parametrize(
    ("child", "why"),
    [
        ("os.abort()", "ended the process"),
        ("say(b'j', b'[' * 5000)", "oddly"),
        ("say(b'j', facts.replace('16, 8', '60000, 60000').encode())", "pixels"),
        ("say(b'j', facts.replace('1.0', '1e999').encode())", "oddly"),
        ("say(b'j', facts.replace('8,', '-8,').encode())", "oddly"),
        ("say(b'f', frame)", "oddly|no frame"),
        ("sys.stdout.buffer.write(b'j\\xff\\xff\\xff\\xff')", "no frame"),
        ("say(b'j', facts.encode()); say(b'f', frame); say(b'f', frame)", "no frame"),
        ("say(b'j', facts.encode()); say(b'f', frame[:-4])", "no frame"),
        ("say(b'j', facts.encode()); say(b'f', frame[:-4] + b'\\xff' * 4)", "no frame"),
        ("say(b'j', facts.encode()); os.kill(os.getpid(), 11)", "ended the process"),
        ("say(b'j', facts.encode()); say(b'j', b'{\"failed\": \"a.mp4: no\"}')", "a.mp4: no"),
        ("say(b'j', facts.encode()); time.sleep(60)", "no frame came"),
    ],
)
def test_a_decoder_that_is_taken_over_is_one_sentence(tmp_path, monkeypatch, child, why):
    (tmp_path / "child.py").write_text(SAYS + child + "\n")
    (tmp_path / "a.mp4").write_bytes(b"")
    monkeypatch.setattr(video_apart.video_child, "__file__", str(tmp_path / "child.py"))
    monkeypatch.setattr(video_apart, "SILENCE", 0.5 if "sleep" in child else 60.0)
    with pytest.raises(RecordingError, match=why) as refusal, apart(tmp_path / "a.mp4") as footage:
        list(footage)
    assert "\n" not in str(refusal.value)
    assert children() == []


def test_it_ends_with_its_visitor(video):
    asked = iter(range(10**9))
    with pytest.raises(Cancelled), apart(video, lambda: next(asked) > 5) as footage:
        list(footage)
    assert children() == []


@pytest.fixture(params=["a stranger's", "one's own"])
def parts(request, tmp_path, monkeypatch):
    """Videos of which a part is shown, so that they are simulated first; and how many are at the same time."""
    inside, most, lock, entered = [], [], threading.Lock(), threading.Semaphore(0)
    is_strangers = request.param == "a stranger's"
    others = {"public_url": "http://show.example", "uploads": 16} if is_strangers else {}
    catalogue = Catalogue(ViewerConfig(downsample=2, **others))

    def simulate(*given):
        with lock:
            inside.append(given)
            most.append(len(inside))
        entered.release()
        for _ in range(20):
            if len(inside) <= AT_ONCE:
                time.sleep(0.02)
        with lock:
            inside.pop()
        raise RecordingError("simulated")

    monkeypatch.setattr("etnet.simulation.video.simulate_footage", simulate)
    monkeypatch.setattr("etnet.simulation.video.simulate_video", simulate)
    monkeypatch.setattr(video_apart, "FootageApart", lambda *given: SimpleNamespace(close=lambda: None))
    for number in range(4):
        (tmp_path / f"{number}.mp4").write_bytes(b"")
        catalogue.take_in(Entry(f"upload-{number}", f"{number}.mp4", "upload", "", tmp_path / f"{number}.mp4"))
    yield catalogue, most
    catalogue.close()


def failures(catalogue, count, act=lambda: None):
    """What is said of so many videos that are opened at the same time, while `act` is done."""
    said = []

    def open_one(number):
        try:
            catalogue.open(f"upload-{number}")
        except EtnetError as error:
            said.append(error)

    threads = [threading.Thread(target=open_one, args=(number,)) for number in range(count)]
    for thread in threads:
        thread.start()
    act()
    for thread in threads:
        thread.join(60)
        assert not thread.is_alive()
    return said


def test_videos_of_which_a_part_is_shown_are_simulated_two_at_a_time_too(parts):
    catalogue, most = parts
    assert [str(error) for error in failures(catalogue, 4)] == ["simulated"] * 4
    assert max(most) <= AT_ONCE


@pytest.mark.parametrize("ends", ["visitor", "viewer"])
def test_one_that_waits_for_its_turn_ends_with_its_visitor_and_with_the_viewer(parts, ends):
    catalogue, most = parts
    end = catalogue.close if ends == "viewer" else lambda: catalogue.let_go("upload-0")
    with catalogue.films.turn(never), catalogue.films.turn(never):
        (error,) = failures(catalogue, 1, end)
    assert isinstance(error, EtnetError)
    assert most == []
