"""A view is one value of a list: what is in it appears, is asked, kept and linked; what is hidden costs nothing."""

import asyncio
import sys
from collections import Counter
from dataclasses import dataclass, fields, is_dataclass, replace
from types import UnionType
from typing import ClassVar, Literal, Union, get_args, get_origin, get_type_hints

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.engine import downloads
from app.engine.jobs import JobResult
from app.engine.requests import FrameRequest
from app.html.elements import card
from app.session.channel import parse
from app.state import intents as ask
from app.state.checks import passing, text, whole
from app.state.link import from_link, to_link
from app.state.run import Run
from app.state.stored import from_text, to_text
from app.state.view_state import Limits, ViewState
from app.views import VIEWS
from app.views.inspect.state import Change
from app.views.panel import Html, Panel, on_visitor
from app.views.view import NOWHERE, Card, Here, View, areas, open_tab, open_views, reduce_views, tabs
from etnet.events.cleaning import Cleaning
from etnet.windows import BetweenFrames, Policy
from tests.app.stand_ins import Browser, served


@dataclass(frozen=True, slots=True)
class Tally:
    """The slice of a view that counts."""

    view: ClassVar[str] = "tally"
    size: int = whole(1, 1, 9)
    label: str = text("plain", "[a-z]+", 9)
    times: int = passing(0)


@dataclass(frozen=True, slots=True)
class Ring:
    """Once more."""

    times: int = 1


@dataclass(frozen=True, slots=True)
class TallyJob:
    """What it wants computed."""

    request: FrameRequest
    size: int

    def run(self, loaded, cancelled):
        yield self.size, 1.0


def reduce_tally(slice_, intent, here):
    if isinstance(intent, Ring):
        return replace(slice_, times=slice_.times + intent.times)
    return replace(slice_, times=0) if isinstance(intent, ask.OpenRecording) else slice_


def tally_of(workspace="inspect", **more):
    """A view of this test's own, and how often each of its parts is called."""
    calls = Counter()

    class TallyPanel(Panel):
        def build(self, gui, dispatch):
            self._card = Html(gui)

        def build_settings(self, gui, dispatch):
            self._size = gui.add_number("Tally size", 1, min=1, max=9)
            self._told = Html(gui)
            on_visitor(self._size, lambda value: ask.Set("tally", "size", int(value)), dispatch)

        def show(self, page):
            calls["show"] += 1
            slice_ = page.state.of(Tally)
            found = page.results.get("tally.count")
            said = f"size {slice_.size}, rung {slice_.times}, found {None if found is None else found.value}"
            self._card.show(card("tally", "Tally", f"<p>{said}</p>", page.areas))

        def show_settings(self, page):
            calls["show_settings"] += 1
            self._told.show(f"<p>settings of size {page.state.of(Tally).size}</p>")

    def jobs(state, request):
        calls["jobs"] += 1
        return {"tally.count": TallyJob(replace(request.plain, index=0), state.of(Tally).size)}

    view = View(
        "tally",
        "Tally",
        "BELL",
        Tally(),
        lambda client: TallyPanel(),
        workspaces=frozenset({workspace}),
        settings_in=frozenset({workspace}),
        cards=(Card("tally", shelf=frozenset({workspace})),),
        reduce=reduce_tally,
        intents=(ask.OpenRecording,),
        hear=lambda words: Ring() if words == "ring" else None,
        jobs=jobs,
        **more,
    )
    return view, calls


def visit(story, views, **options):
    async def run():
        with served(views=views) as viewer:
            async with Browser.open(viewer.port, tab=91, **options) as browser:
                await browser.until_shown("Reconstruction of window 0")
                await story(viewer, browser)

    asyncio.run(run())


def saying(browser):
    number = iter(range(10**6))
    return lambda key: browser.use(browser.widget("channel"), f"pick|{key}|0.5|0.5|{next(number)}")


def test_a_view_that_is_added_appears_is_asked_computed_shown_and_kept_with_nothing_else_touched():
    view, _ = tally_of()
    storage = {}

    async def use_it(viewer, browser):
        say = saying(browser)
        await browser.until_shown("size 1, rung 0, found None")
        assert 'data-k="tab:tally"' in browser.html()
        await say("tally:ring")
        await say("set:tally.label:loud")
        await browser.until_shown("size 1, rung 1")
        await say("tab:tally")
        await browser.until_shown("settings of size 1")
        await browser.use(browser.widget("Tally size"), 4)
        await browser.until_shown("size 4, rung 1")
        asked = lambda: [job for _, slot, job in viewer.engine.jobs if slot == "tally.count"]  # noqa: E731
        await browser.until(lambda: asked() and asked()[-1] == TallyJob(asked()[-1].request, 4))
        viewer.engine.tell("tally.count", JobResult(asked()[-1], 41, 1.0, is_whole=True))
        await browser.until_shown("found 41")
        await browser.until(lambda: any('"tally":{"size":4' in kept for kept in browser.storage.values()))
        await browser.until(lambda: 'data-etv-moment="ey' in browser.html())
        link = browser.html().split('data-etv-moment="')[1].split('"')[0]
        linked, refused = from_link(link, ViewState(), [each.initial for each in (*VIEWS, view)])
        assert (linked.of(Tally), refused) == (Tally(4, "loud"), ())

    async def come_back(viewer, browser):
        await browser.until_shown("size 4, rung 0")
        assert browser.notices == []

    async def come_without_it(viewer, browser):
        await browser.until(lambda: browser.notices != [])
        assert "tally" in browser.notices[0]["body"]

    visit(use_it, (*VIEWS, view), storage=storage)
    visit(come_back, (*VIEWS, tally_of()[0]), storage=storage)
    visit(come_without_it, VIEWS, storage=storage)


def test_a_view_that_is_hidden_is_never_drawn_nor_asked_however_much_is_dragged():
    view, calls = tally_of("attention")

    async def story(viewer, browser):
        say = saying(browser)
        for index in (5, 9, 3, 17, 22):
            await browser.use(browser.widget("Window"), index)
            await browser.until_shown(f"window {index} of 0")
        await say("tab:export")
        await browser.until_shown("Reconstruction of window 22")
        assert calls == {}
        await say("workspace:attention")
        await browser.until_shown("size 1, rung 0")
        assert calls["show"] > 0
        await browser.until(lambda: any(slot == "tally.count" for _, slot, _ in viewer.engine.jobs))
        await say("workspace:recording")
        await browser.until(lambda: ("tally.count", None) in [asked[1:] for asked in viewer.engine.jobs])
        before = dict(calls)
        for index in (4, 8):
            await browser.use(browser.widget("Window"), index)
            await browser.until_shown(f"window {index} of 0")
        assert dict(calls) == before

    visit(story, (*VIEWS, view))


def test_settings_are_drawn_only_while_their_tab_is_open():
    view, calls = tally_of()

    async def story(viewer, browser):
        say = saying(browser)
        await browser.use(browser.widget("Window"), 5)
        await browser.until_shown("window 5 of 0")
        assert calls["show"] > 0
        assert calls["show_settings"] == 0
        await say("tab:tally")
        await browser.until_shown("settings of size 1")
        await say("tab:export")
        await browser.until(lambda: browser.is_open("Export"))
        before = calls["show_settings"]
        await browser.use(browser.widget("Window"), 9)
        await browser.until_shown("window 9 of 0")
        assert calls["show_settings"] == before

    visit(story, (*VIEWS, view))


def test_its_slice_its_link_and_what_is_kept_of_it_follow_from_the_list_alone():
    view, _ = tally_of()
    views = (*VIEWS, view)
    initial = [each.initial for each in views]
    state = ViewState(recording_id="a", policy=BetweenFrames())
    for intent in (Ring(2), ask.Set("tally", "size", 40), ask.Set("tally", "times", 7)):
        state = reduce_views(state, intent, Limits(), views)
    assert state.of(Tally) == Tally(9, times=2)
    assert from_text(to_text(state), ViewState(), initial) == (replace(state, slices=(Tally(9),)), ())
    assert from_link(to_link(state, 5), ViewState(), initial)[0].of(Tally) == Tally(9)
    assert from_text(to_text(state), ViewState(), initial[:-1])[1] == ("tally",)
    assert parse("pick|tally:ring|0|0|1", views) == Ring()
    assert parse("pick|tally:ring|0|0|1", VIEWS) is None
    assert view in open_views(state, views)
    assert view in tabs(state, views)
    assert open_tab(replace(state, tab="tally"), views) is view
    in_public = replace(state, is_public=True, tab="tally")
    assert view not in (*open_views(in_public, views), *tabs(in_public, views))


WORKSPACES = ("inspect", "attention", "compare", "recording", "demo")
MORE = st.lists(
    st.builds(
        lambda number, on_stage, workspace: View(
            f"more{number}",
            "More",
            "BELL",
            Tally(),
            Panel,
            workspaces=frozenset({workspace}),
            cards=(
                Card(
                    f"more{number}",
                    stage=frozenset({workspace}) if on_stage else NOWHERE,
                    shelf=NOWHERE if on_stage else frozenset({workspace}),
                ),
            ),
        ),
        st.integers(0, 9),
        st.booleans(),
        st.sampled_from(WORKSPACES),
    ),
    max_size=4,
    unique_by=lambda view: view.name,
)


def cards_of(state, views):
    """What is open of a workspace, in order."""
    seen = [card_ for view in open_views(state, views) for card_ in view.cards]
    return [card_.name for card_ in seen if state.workspace in card_.stage | card_.shelf]


@settings(deadline=None)
@given(MORE, st.sampled_from(WORKSPACES), st.text(max_size=5), st.data())
def test_each_open_card_stands_in_one_place_and_no_two_in_one(more, workspace, tab, data):
    views = (*VIEWS, *more)
    state = ViewState(workspace=workspace, tab=tab)
    names = cards_of(state, views)
    staged = data.draw(st.sampled_from([*names, "", "nothing"]))
    places = areas(replace(state, staged=staged), views)
    assert len(set(places.values())) == len(places)
    assert set(places) <= set(names)
    assert set(places.values()) <= {"a", "b", "s1", "s2", "s3", "s4"}
    on_stage = sum(place in ("a", "b") for place in places.values())
    assert on_stage == min(
        2, sum(workspace in card_.stage for view in open_views(state, views) for card_ in view.cards)
    )
    assert len(places) == on_stage + min(4, len(names) - on_stage)  # beyond the shelf's end there is no place


@pytest.mark.parametrize("workspace", WORKSPACES)
def test_of_our_own_views_every_open_card_has_a_place(workspace):
    state = ViewState(workspace=workspace)
    assert sorted(areas(state, VIEWS)) == sorted(cards_of(state, VIEWS))


@pytest.mark.parametrize("workspace", ["inspect", "attention", "recording"])
def test_a_card_of_the_shelf_that_is_staged_changes_places_with_one_of_the_stage_and_back(workspace):
    state = reduce_views(ViewState(), ask.ShowWorkspace(workspace), Limits(), VIEWS)
    before = areas(state, VIEWS)
    for name in [name for name, place in before.items() if place.startswith("s")]:
        staged = reduce_views(state, ask.StageCard(name), Limits(), VIEWS)
        after = areas(staged, VIEWS)
        moved = {card_ for card_ in before if before[card_] != after[card_]}
        (other,) = moved - {name}
        assert name in moved
        assert (after[name], after[other]) == (before[other], before[name])
        assert after[name] in ("a", "b")
        assert areas(reduce_views(staged, ask.StageCard(name), Limits(), VIEWS), VIEWS) == before
    shown_elsewhere = replace(state, staged="compare")
    assert areas(shown_elsewhere, VIEWS) == before


def test_every_name_of_a_view_is_one_word_for_its_slice_folder_and_cards():
    for view in VIEWS:
        assert view.initial.view == view.name
        assert view.initial == type(view.initial)()
        assert type(view.initial).__module__ == f"app.views.{view.name}.state"
        assert all(card_.name.partition(".")[0] in (view.name, "camera") for card_ in view.cards)
    assert len({view.name for view in VIEWS}) == len(VIEWS)


def _sample(hint):
    """Some value of a field's type."""
    if get_origin(hint) is Literal:
        return get_args(hint)[0]
    if get_origin(hint) in (Union, UnionType):
        return _sample(get_args(hint)[0])
    if get_origin(hint) in (frozenset, tuple):
        return get_origin(hint)(_sample(part) for part in get_args(hint) if part is not Ellipsis)
    known = {str: "a", int: 3, float: 0.5, bool: True, object: 1, Policy: BetweenFrames(), Cleaning: Cleaning(True)}
    if hint in known:
        return known[hint]
    return _made(hint) if is_dataclass(hint) else hint()


def _made(kind):
    """A dataclass with some value in each field."""
    hints = get_type_hints(kind)
    return kind(**{entry.name: _sample(hints[entry.name]) for entry in fields(kind) if entry.init})


def _intents():
    """One of each kind that there is, of the page, of what lies below the views, and of every view."""
    modules = [ask, downloads, *(sys.modules[type(view.initial).__module__] for view in VIEWS)]
    named = {module.__name__ for module in modules}
    kinds = [kind for module in modules for kind in vars(module).values() if is_dataclass(kind)]
    for kind in dict.fromkeys(kinds):
        if isinstance(kind, type) and not hasattr(kind, "view") and kind.__module__ in named:
            yield _made(kind)


@pytest.mark.parametrize("view", VIEWS, ids=lambda view: view.name)
def test_a_view_declares_every_intent_that_says_something_to_it(view):
    """What it does not declare is never shown to its reducer; its slice would have stayed as it was."""
    here = Here(ViewState(recording_id="a", policy=BetweenFrames(), is_public=True), Limits())
    busy = replace(view.initial, **_BUSY.get(view.name, {}))
    unheard = [intent for intent in _intents() if not isinstance(intent, ask.Set) and not view.hears(intent)]
    assert len(unheard) > 20
    for intent in unheard:
        assert view.reduce(busy, intent, here) == busy, intent


_BUSY = {
    "demo": {"act": "events", "large": "map", "sheet": "home", "guess": "asked", "home": "a"},
    "inspect": {"change": Change(once=True, since=3), "shows_original": True},
    "attention": {"compare": "a", "also": "b", "head": 2},
    "compare": {"runs": (Run(cold_from=5),), "offset": 7, "camera": "frame"},
    "scene": {"camera": "front", "num_asked": 3},
}
