"""A large file is shown as far as it is indexed, and all of it by itself once that is done."""

import asyncio
import threading
from dataclasses import replace
from types import SimpleNamespace

import pytest

from app.catalogue.recording_id import known_as, whole_id
from app.catalogue.recordings import Catalogue, CatalogueError
from app.config import ViewerConfig
from app.engine.denoised import CleanedRecordings
from app.html.moment import Moment
from app.session.loader import Opened, Opener, Plan
from app.views.timeline.html import curve_of
from etnet.events.formats.prophesee import index as raw_index
from etnet.events.formats.prophesee import raw as prophesee
from etnet.events.formats.prophesee.evt2_evt3 import EVT
from etnet.events.recording import Growth, recording_of_events
from etnet.events.write import write_recording
from etnet.windows import ByCount, plan_windows
from tests.app.stand_ins import Browser, recording, served
from tests.events.containers import all_events, assert_same_events
from tests.events.test_size import wait_for
from tests.strategies import make_events


@pytest.fixture
def gate(monkeypatch):
    """Indices go on in the background once this is set."""
    opened, version = threading.Event(), EVT["3.0"]

    def skim(*of_it):
        if threading.current_thread().name.startswith("index"):
            assert opened.wait(20)
        return version.skim(*of_it)

    monkeypatch.setitem(EVT, "3.0", replace(version, skim=skim))
    return opened


@pytest.fixture
def large(tmp_path, monkeypatch):
    """A folder with an EVT3 file of some blocks that counts as large, and its events."""
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(prophesee, "INDEXED_BYTES", 0)
    monkeypatch.setattr(raw_index, "BLOCK_BYTES", 1 << 13)
    monkeypatch.setattr("app.catalogue.recordings.OPENS_WITHIN", 0.0)
    events = make_events(60_000, duration=30_000_000)
    (tmp_path / "data").mkdir()
    write_recording(recording_of_events(events), tmp_path / "data" / "large.raw")
    return tmp_path / "data", events


def test_a_part_has_an_id_of_its_own_and_the_whole_follows_by_the_files(large, gate):
    folder, events = large
    catalogue = Catalogue(ViewerConfig(data=folder))
    (entry,) = (each for each in catalogue.entries() if each.kind == "data")
    part = catalogue.open(entry.id)
    part_id = known_as(entry.id, part)
    assert whole_id(part_id) == entry.id != part_id
    assert 0 < part.num_events < len(events)
    assert catalogue.open(entry.id) is part
    assert catalogue.open(part_id) is part
    gate.set()
    wait_for(lambda: part.growth.is_over)
    whole = catalogue.open(entry.id)
    assert known_as(part_id, whole) == entry.id
    assert_same_events(all_events(whole), events)
    assert_same_events(all_events(catalogue.open(part_id)), events[: part.num_events])
    with pytest.raises(CatalogueError, match=r"large\.raw"):
        catalogue.open(f"{entry.id}^7")
    catalogue.close()


def test_the_windows_of_a_part_are_the_first_of_the_whole(large, gate):
    folder, _ = large
    catalogue = Catalogue(ViewerConfig(data=folder))
    (entry,) = (each for each in catalogue.entries() if each.kind == "data")
    part, policy = catalogue.open(entry.id), ByCount(700)
    gate.set()
    wait_for(lambda: part.growth.is_over)
    whole = catalogue.open(entry.id)
    shown, all_windows = (list(plan_windows(each, policy)) for each in (part, whole))
    assert shown[:-1] == all_windows[: len(shown) - 1]
    catalogue.close()


@pytest.fixture
def growing():
    """A part of a recording, and all of it once its growth is over."""
    whole = replace(recording("large"), ground_truth=None)
    part = replace(recording_of_events(whole.read(0, 2500), "large"), growth=Growth(0.41))
    return part, whole


def test_a_page_with_a_part_says_so_and_shows_the_whole_by_itself_at_the_same_window(growing):
    part, whole = growing

    async def visit(running):
        async with Browser.open(running.port) as browser:
            await browser.until_shown("only its beginning: 41 % of the file indexed")
            await browser.use(browser.widget("Window"), 3)
            await browser.until_shown("window 3 of 0 – 4")
            part.growth.share = 0.73
            await browser.until_shown("73 % of the file indexed")
            part.growth.share, part.growth.is_over = 1.0, True
            await browser.until_shown("window 3 of 0 – 14")
            assert "only its beginning" not in browser.html()
            assert '<summary title="Choose a recording"><span>recording a</span></summary>' in browser.html()
            await browser.until_shown("Reconstruction of window 3")
            return [request.recording_id for _, request in running.engine.requests]

    with served() as running:
        running.shelf.open = lambda *_: whole if part.growth.is_over else part
        asked = asyncio.run(visit(running))
    assert set(asked) == {"a^2500", "a"}
    assert asked == sorted(asked, reverse=True)  # nothing of the part is asked for once the whole is there


def test_a_part_that_cannot_become_whole_stays_and_is_told_once(growing):
    part, _ = growing

    def opens(*_):
        if part.growth.is_over:
            raise CatalogueError("large.raw: it went away")
        return part

    async def visit(running):
        async with Browser.open(running.port) as browser:
            await browser.until_shown("only its beginning")
            part.growth.is_over = True
            await browser.until(lambda: browser.notices != [])
            await browser.use(browser.widget("Window"), 2)
            await browser.until_shown("window 2 of 0 – 4")
            await asyncio.sleep(1.5)
            return [notice["body"] for notice in browser.notices]

    with served() as running:
        running.shelf.open = opens
        assert asyncio.run(visit(running)) == ["large.raw: it went away"]


def test_the_curve_of_a_file_is_there_when_the_page_hears_that_it_is_open(growing):
    _, whole = growing
    told, reads = [], []
    source = replace(whole.source)
    whole = replace(whole, source=SimpleNamespace(num_events=source.num_events, read=source.read, close=source.close))
    opener = Opener(SimpleNamespace(open=lambda *_: whole), CleanedRecordings(), told.append)
    opener.want(Plan("curve", ByCount(100)))
    wait_for(lambda: any(isinstance(each, Opened) for each in told))
    (opened,) = (each for each in told if isinstance(each, Opened))
    whole.source.read = lambda start, stop: reads.append((start, stop)) or source.read(start, stop)
    curve_of(Moment(opened.recording_id, opened.policy, 3, whole, opened.windows))
    assert reads == []


def test_a_plan_that_came_true_tells_how_far_its_file_is(growing):
    part, whole = growing
    plan, policy = Plan("a", None), ByCount(500)
    shown, all_of_it = (Opened(plan, policy, each, plan_windows(each, policy)) for each in (part, whole))
    assert (shown.recording_id, shown.share, shown.is_outgrown) == ("a^2500", 0.41, False)
    assert (all_of_it.recording_id, all_of_it.share, all_of_it.is_outgrown) == ("a", None, False)
