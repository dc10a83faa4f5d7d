"""Videos as recordings: one simulation for each setting, made while somebody looks, and in nobody's way."""

import threading
import time
from types import SimpleNamespace

import pytest
import torch

from app.catalogue.recordings import Catalogue, CatalogueError
from app.catalogue.uploads import UploadLimits, Uploads
from app.catalogue.videos import AT_ONCE, KEPT, FilmSetting, Videos, film_id, is_simulated, split_id
from app.catalogue.visitor import VisitorCatalogue
from app.catalogue.visitor_uploads import MEGABYTE
from app.config import ViewerConfig
from app.engine.denoised import CleanedRecordings
from app.engine.requests import FrameRequest
from app.session.loader import Opened, Opening, RecordingLoader, Unopened
from app.state.intents import PlayTo, RenameRecording, ReopenRecording, Seek, Settle
from app.state.view_state import Limits, ViewState
from etnet.errors import EtnetError
from etnet.playback.playback import Playback
from etnet.simulation.growing import FEWEST_FRAMES
from etnet.windows import BetweenFrames, ByCount, plan_windows
from tests.app.fakes import CountingModel, Shelf
from tests.app.reducing import reduce
from tests.simulation.test_growing import stepped, video  # noqa: F401
from tests.simulation.test_video import drifting, write

USUAL = FilmSetting()


@pytest.fixture
def videos(monkeypatch):
    monkeypatch.setattr("app.catalogue.videos.QUIET", 0.01)
    forgotten = []
    made = Videos(forgotten.append)
    made.forgotten = forgotten
    yield made
    made.close()


def until(condition):
    ends = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < ends
        time.sleep(0.01)


def test_a_visitors_film_lies_beside_its_video_and_ends_where_there_is_no_room(videos, video, monkeypatch):  # noqa: F811
    monkeypatch.setattr("etnet.simulation.growing.LOOK_AT_SIZE", FEWEST_FRAMES)
    videos.begin("one", "v", video, "drift", unpacking=SimpleNamespace(left_unpacked=-5))
    until(lambda: videos.shown("v").is_over)
    assert videos._films["v"].path.parent == video.parent
    recording = videos.open("v")
    assert len(recording.ground_truth) == FEWEST_FRAMES
    assert any("s only" in remark.text for remark in recording.remarks)
    path = videos._films["v"].path
    videos.let_go("v")
    assert not path.exists()


@pytest.mark.parametrize(
    ("given", "parts"),
    [
        ("data-ab12", ("data-ab12", USUAL)),
        ("data-ab12~0.35~1.50~50~160", ("data-ab12", FilmSetting(0.35, 1.5, 50, 160))),
        ("data-ab12~9.99~1.50~50~160", ("data-ab12~9.99~1.50~50~160", USUAL)),
        ("data-ab12~0.35~1.50~51~160", ("data-ab12~0.35~1.50~51~160", USUAL)),
        ("data-ab12~0.35~1.50~50~999", ("data-ab12~0.35~1.50~50~999", USUAL)),
        ("data-ab12~0.35~1.50", ("data-ab12~0.35~1.50", USUAL)),
        ("~0.35~nan~0~320", ("~0.35~nan~0~320", USUAL)),
    ],
)
def test_a_setting_is_part_of_the_id_and_one_that_is_not_offered_is_none(given, parts):
    assert split_id(given) == parts


def test_a_setting_replaces_the_former_one_and_is_brought_to_what_is_offered():
    assert film_id("data-ab12~0.35~1.50~50~160", FilmSetting(0.5, 0.0)) == "data-ab12~0.50~0.00~0~320"
    assert film_id("data-ab12", FilmSetting(99.0, -1.0, 40, 9999)) == "data-ab12~1.00~0.00~50~480"


def test_a_simulation_is_one_for_all_who_look_and_ends_with_the_last(videos, video):  # noqa: F811
    videos.begin("one", "v", video, "drift")
    videos.begin("other", "v", video, "drift")
    assert videos.open("v").name == "drift"
    assert is_simulated(videos.open("v"))
    videos.watch("one", None)
    assert videos.shown("v") is not None
    until(lambda: videos.shown("v").is_over)
    path = videos._films["v"].path
    assert path.exists()
    videos.close()
    assert not path.exists()
    assert videos.forgotten == ["v"]


def test_a_video_that_failed_is_simulated_again_when_somebody_looks_again(videos, video, tmp_path):  # noqa: F811
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"no video yet")
    for visitor in ("one", "other"):
        videos.begin(visitor, "v", path, "clip")
        with pytest.raises(EtnetError):
            videos.open("v")
    until(lambda: videos.has_failed("v"))
    assert videos._films["v"].watchers == {"one", "other"}
    path.write_bytes(video.read_bytes())
    videos.begin("one", "v", path, "clip")
    assert videos.open("v").name == "clip"
    assert videos._films["v"].watchers == {"one", "other"}


def test_a_video_that_failed_is_not_kept_among_those_that_are_whole(videos, tmp_path):
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"no video")
    videos.begin("one", "v", path, "clip")
    until(lambda: videos.has_failed("v"))
    videos.watch("one", None)
    assert videos.shown("v") is None


def test_a_film_that_somebody_takes_while_it_is_let_go_is_theirs(video, monkeypatch):  # noqa: F811
    monkeypatch.setattr("app.catalogue.videos.QUIET", 0.01)
    took = []

    def forget(recording_id):
        if not took:
            took.append(recording_id)
            made.begin("other", "v", video, "drift")

    made = Videos(forget)
    try:
        made.begin("third", "u", video, "drift")
        made.begin("one", "v", video, "drift")
        made._films["u"].watchers.clear()
        made.watch("one", None)  # "u" and "v" go; of "u" is told first
        assert took == ["u"]
        assert made.open("v").name == "drift"
    finally:
        made.close()


def test_another_setting_ends_the_simulation_before_it(videos, tmp_path, monkeypatch):
    monkeypatch.setattr("app.catalogue.videos.QUIET", 30.0)
    path = write(tmp_path / "clip.mp4", drifting(6))
    videos.begin("one", "v", path, "clip")
    first = videos._films["v"]
    videos.begin("one", "v~0.50~0.20~0~320", path, "clip")
    assert list(videos._films) == ["v~0.50~0.20~0~320"]
    assert first.cancelled.is_set()
    assert videos.forgotten == ["v"]
    with pytest.raises(EtnetError):
        videos.open("v")


def test_settings_that_are_passed_over_while_they_wait_for_their_turn_are_never_simulated(videos, video, monkeypatch):  # noqa: F811
    ran, free = [], threading.Event()

    def run(film, is_cancelled):
        ran.append(film.config.contrast)
        assert free.wait(120)

    monkeypatch.setattr("etnet.simulation.growing.GrowingVideo.run", run)
    for number in range(AT_ONCE):
        videos.begin(f"other {number}", f"w{number}", video, "long")
    until(lambda: len(ran) == AT_ONCE)
    try:
        for tenths in range(3, 9):
            videos.begin("one", f"v~0.{tenths}0~0.20~0~320", video, "drift")
        until(lambda: sum(thread.is_alive() for thread in list(videos._threads)) == AT_ONCE + 1)
    finally:
        free.set()
    until(lambda: len(ran) > AT_ONCE)
    assert ran[AT_ONCE:] == [0.8]


def test_no_simulation_goes_on_when_the_viewer_has_ended(tmp_path):
    path = write(tmp_path / "long.mp4", drifting(240, 2.0))
    kept = Videos()
    kept.begin("one", "a", path, "long")
    kept.open("a")
    assert any(thread.name == "film" for thread in threading.enumerate())
    kept.close()
    assert not any(thread.name == "film" for thread in threading.enumerate())


def test_of_whole_simulations_that_nobody_looks_at_a_few_are_kept(videos, video):  # noqa: F811
    for number in range(KEPT + 2):
        videos.begin("one", f"v~0.{number + 2}0~0.20~0~320", video, "drift")
        videos.open(f"v~0.{number + 2}0~0.20~0~320")
        until(lambda: videos.shown(f"v~0.{number + 2}0~0.20~0~320").is_over)  # noqa: B023
    videos.watch("one", None)
    assert len(videos._films) == KEPT
    assert videos.forgotten == ["v~0.20~0.20~0~320", "v~0.30~0.20~0~320"]


def test_a_playback_that_has_grown_gives_what_one_of_the_whole_gives(stepped):  # noqa: F811
    growing, go_on = stepped
    go_on(FEWEST_FRAMES)
    shelf = Shelf(recordings={"r": growing.wait(lambda: False)})
    from app.engine.playbacks import PlaybackCache

    playbacks = PlaybackCache(shelf, 64 * MEGABYTE, "cpu", None, shelf.load)
    asked = FrameRequest("r", "m", "fp32", BetweenFrames(), 1)
    early = playbacks.loaded(asked).playback.at(1).frame
    before = len(playbacks.loaded(asked).windows)
    go_on(6)
    later = FrameRequest("r", "m", "fp32", BetweenFrames(), before + 3)
    loaded = playbacks.loaded(later)
    assert len(loaded.windows) == before + 6
    frame = loaded.playback.at(before + 3).frame
    whole = Playback(CountingModel(), growing.recording(), plan_windows(growing.recording(), BetweenFrames()))
    assert torch.equal(frame, whole.at(before + 3).frame)
    assert torch.equal(early, whole.at(1).frame)


def test_a_page_goes_on_to_the_moment_that_was_asked_for_as_it_is_made(stepped):  # noqa: F811
    growing, go_on = stepped
    go_on(FEWEST_FRAMES)
    posted = []
    held = RecordingLoader(Watched(), CleanedRecordings(), posted.append)
    recording = growing.wait(lambda: False)
    policy = BetweenFrames()
    stamp = 8 * 20_000
    state = ViewState("v", "m", policy=policy, moment=stamp)
    from app.session.loader import Plan

    plan = Plan("v", policy)
    opened = Opened(plan, policy, recording, plan_windows(recording, policy))
    follows, trouble = held.take(opened, state)
    assert (follows, trouble) == ((RenameRecording("v"), Settle(policy)), "")
    for intent in follows:
        state = reduce(state, intent, held.limits(state))
    assert state.index == len(opened.windows) - 1
    assert held.limits(state).is_growing
    assert held.grow(state) == (False, None)
    go_on(2)
    has_grown, follows = held.grow(state)
    assert has_grown
    state = reduce(state, follows, held.limits(state))
    assert state.index == len(opened.windows) + 1
    go_on(8)
    _, follows = held.grow(state)
    state = reduce(state, follows, held.limits(state))
    assert held.moment(state).window.t_stop == stamp
    go_on(2)
    assert held.grow(state) == (True, None)


class Watched:
    def looks_at(self, recording_id):
        raise AssertionError("it is open")


def test_playing_waits_at_the_end_of_what_is_made_and_does_not_start_over():
    windows = plan_windows(Shelf().recordings["r"], ByCount(50))
    state = ViewState("v", "m", policy=ByCount(50), index=39, is_playing=True)
    growing = Limits(None, windows, 0, is_growing=True)
    assert reduce(state, PlayTo(40), growing) == state
    assert reduce(state, PlayTo(40), Limits(None, windows, 0)).index == 0


def test_another_setting_keeps_the_moment():
    windows = plan_windows(Shelf().recordings["r"], ByCount(50))
    limits = Limits(None, windows, 0)
    state = reduce(ViewState("v", "m", policy=ByCount(50)), Seek(7), limits)
    anew = reduce(state, ReopenRecording("v~0.50~0.20~0~320"), limits)
    assert anew.recording_id == "v~0.50~0.20~0~320"
    assert anew.moment == windows[7].t_stop
    assert reduce(anew, Settle(ByCount(50)), limits).index == 7


def test_a_handed_over_video_is_its_visitors_alone_and_its_simulations_go_with_it(video, monkeypatch):  # noqa: F811
    monkeypatch.setattr("app.catalogue.videos.QUIET", 0.01)
    catalogue = Catalogue(ViewerConfig())
    uploads = Uploads(UploadLimits.of_megabytes(16), catalogue.take_in, catalogue.let_go)
    own_files = uploads.desk()
    content = video.read_bytes()
    transfer = own_files.begin("holiday.mp4", len(content))
    transfer.take(content)
    arrived = transfer.finish()
    own, other = VisitorCatalogue(catalogue, own_files), VisitorCatalogue(catalogue, uploads.desk())
    anew = film_id(arrived, FilmSetting(0.4, 0.0))
    for one in (arrived, anew):
        with pytest.raises(CatalogueError):
            other.open(one)
        other.looks_at(one)
    assert catalogue.films._films == {}
    entry = catalogue.entry(arrived)
    entry.path.write_bytes(b"cut off")
    own.looks_at(anew)
    with pytest.raises(EtnetError):
        own.open(anew)
    until(lambda: catalogue.films.has_failed(anew))
    entry.path.write_bytes(content)
    own.looks_at(anew)
    assert own.open(anew).name == "holiday.mp4"
    assert own.film(anew).setting == FilmSetting(0.4, 0.0)
    path = catalogue.films._films[anew].path
    own.close()
    own_files.close()
    assert catalogue.films._films == {}
    assert not path.exists()
    uploads.close()
    catalogue.close()


def test_messages_of_another_recording_change_nothing():
    held = RecordingLoader(Watched(), CleanedRecordings(), print)
    state = ViewState("v", "m")
    from app.session.loader import Plan

    for letter in (Opening(Plan("w", None), 0.5), Unopened(Plan("w", None), "no")):
        assert held.take(letter, state) == ((), "")
        assert held.trouble == ""
