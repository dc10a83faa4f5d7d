"""Copy as Python: the lines of each card of the attention workspace give what it shows, to the last digit."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.jobs import JobResult
from app.html.moment import Moment
from app.html.provenance import ModelFacts
from app.views.attention.html.code import snippet
from app.views.attention.html.shown import shown_of
from app.views.attention.jobs.attention import attention_jobs
from app.views.attention.state import AttentionState
from app.views.page import Page
from etnet.inspection import follow
from etnet.nets.intervention import Intervention
from tests.app.small_loaded import POLICY, QUERY, SITE, opened_in, request_of, whole
from tests.app.views.attention.small_page import INDEX, STATE, ready_of

NEEDED = {"map": ("site",), "heads": ("atlas",), "tokens": ("tokens", "tokens_also", "basis"), "time": ("curve",)}
MASK = Intervention(masked_heads=frozenset({(SITE, 0)}))


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    return opened_in(tmp_path_factory.mktemp("lines"))


def shown_by(opened, slice_, change=MASK):
    needed = NEEDED[slice_.lines]
    loaded, file, weights = opened
    request = request_of(INDEX, wants_attention=True, intervention=change)
    request = replace(request, recording_id="lines")  # what other files of tests found is kept by name
    state = STATE.put(slice_)
    asked = attention_jobs(state, request)
    wanted = {slot: job for slot, job in asked.items() if slot.removeprefix("attention.") in needed}
    results = {slot: JobResult(job, whole(job, loaded), 1.0, True) for slot, job in wanted.items()}
    moment = Moment("r", POLICY, INDEX, loaded.playback.recording, loaded.playback.windows)
    page = Page(state, moment, ready_of(loaded, request), results=results, file_name=file,
                model=ModelFacts("tiny", source=weights))  # fmt: skip
    return shown_of(page)


def moving(recording, windows, index, pixel, until, cancelled=None):
    """A patch that goes 3 pixels to the right in every window, so that what lies near it is another place each time."""
    step = 1 if until >= index else -1
    for there in range(index, until + step, step):
        x = pixel[0] + 3 * (there - index)
        if not 0 <= x < recording.sensor.width:
            return
        yield follow.Place(there, float(x), float(pixel[1]), (3.0, 0.0), 50, 2.0)


def made_by(shown):
    text = snippet(shown)
    assert len(text.splitlines()) <= 10, text
    names = {}
    exec(text, names)
    return np.asarray(names["array"])


@pytest.mark.parametrize(
    "asked",
    [
        {},
        {"head": 2, "direction": "attended by"},
        {"gather": "max"},
        {"weight": "value"},
        {"weight": "value", "head": 1},
        {"weight": "value", "direction": "attended by"},
        {"weight": "value", "direction": "attended by", "head": 1},
    ],
)
def test_the_lines_of_the_map_give_the_map(opened, asked):
    shown = shown_by(opened, AttentionState(site=SITE, **asked))
    assert np.array_equal(made_by(shown), shown.row())


def test_who_attends_to_a_token_is_a_column_of_weights_whatever_is_chosen_for_rows(opened):
    shown = shown_by(opened, AttentionState(site=SITE, weight="value", direction="attended by"))
    column = shown.attention.columns(SITE, [shown.token])[..., 0]
    assert np.array_equal(shown.rows(), column.numpy())
    assert np.array_equal(shown.row(), column.mean(0).numpy())


def test_the_lines_of_the_heads_give_their_effects(opened):
    shown = shown_by(opened, AttentionState(site=SITE, lines="heads"))
    assert np.array_equal(made_by(shown), shown.result("atlas").on_pixel(*QUERY).numpy())


@pytest.mark.parametrize("word", ["tokens", "hidden 2"])
def test_the_lines_of_the_tokens_give_similarity_here_and_elsewhere_and_colours(opened, word):
    slice_ = AttentionState(site=SITE, lines="tokens", feature=word)
    shown = shown_by(opened, slice_)
    assert np.array_equal(made_by(shown), shown.feature("tokens").similarity(QUERY))
    shown = shown_by(opened, replace(slice_, also="10 back"), Intervention())
    there = shown.page.results["attention.tokens_also"].value
    assert np.array_equal(made_by(shown), there.similarity(QUERY, of=shown.feature("tokens")))
    shown = shown_by(opened, replace(slice_, tokens="pca"))
    colours = shown.feature("basis").colours(shown.feature("tokens").map)
    assert np.array_equal(made_by(shown), np.asarray(colours))


@pytest.mark.parametrize("follows", [False, True])
@pytest.mark.parametrize(("curve", "head"), [("entropy", None), ("effect", 1), ("effect", None)])
def test_the_lines_of_the_curve_give_the_curve(opened, curve, head, follows):
    shown = shown_by(opened, AttentionState(site=SITE, lines="time", curve=curve, head=head, follows=follows))
    found = shown.page.results["attention.curve"].value
    made = made_by(shown)
    assert np.array_equal(made[:, 0], found.values) if curve == "entropy" else np.array_equal(made, found.values[:, 0])


@pytest.mark.parametrize("follows", [False, True])
def test_the_lines_of_local_mass_give_the_curve(opened, follows, monkeypatch):
    monkeypatch.setattr(follow, "follow", moving)
    shown = shown_by(opened, AttentionState(site=SITE, lines="time", curve="mass", follows=follows))
    assert np.array_equal(made_by(shown)[:, 0], shown.page.results["attention.curve"].value.values)
