"""Copy as Python: the lines of each card of the attention workspace give what it shows, to the last digit."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from app.catalogue.videos import FilmSetting, VideoShown
from app.engine.jobs import JobResult
from app.engine.pace import Pace
from app.engine.playbacks import LoadedPlayback
from app.html.moment import Moment
from app.html.provenance import ModelFacts
from app.state import intents as ask
from app.state.run import Run
from app.state.view_state import Limits
from app.views.attention.html.code import code_block, row_text, snippet
from app.views.attention.html.dots import table_of
from app.views.attention.html.pins import difference_of, pin_words
from app.views.attention.html.shown import shown_of
from app.views.attention.html.side import waste_of
from app.views.attention.html.stage import stage_html
from app.views.attention.jobs.attention import attention_jobs
from app.views.attention.state import AttentionState, PinnedMap, reduce_attention
from app.views.compare.state import CompareState
from app.views.page import Choice, Page
from app.views.view import Here
from etnet.events.open import open_recording
from etnet.inspection import follow
from etnet.nets.intervention import Intervention
from etnet.nets.presets import build_model
from etnet.nets.runtime import contract_of
from etnet.nets.weights import load_model, save_weights
from etnet.playback.playback import Playback
from etnet.windows import plan_windows
from tests.app.checked_html import map_values
from tests.app.small_loaded import POLICY, QUERY, SITE, opened_in, request_of, whole
from tests.app.views.attention.small_page import INDEX, STATE, ready_of

NEEDED = {"map": ("site", "pin"), "heads": ("atlas",), "tokens": ("tokens", "tokens_also", "basis"), "time": ("curve",)}
MASK = Intervention(masked_heads=frozenset({(SITE, 0)}))


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    return opened_in(tmp_path_factory.mktemp("lines"))


def shown_by(opened, slice_, change=MASK, state=STATE, others=None):
    """`others`: what else is loaded, by the id of its network and its precision; with its file."""
    needed = NEEDED.get(slice_.lines, ("site", "matters", "site_matters"))
    loaded, file, weights = opened
    request = request_of(INDEX, wants_attention=True, intervention=change)
    request = replace(request, recording_id="lines")  # what other files of tests found is kept by name
    state = state.put(slice_)
    asked = attention_jobs(state, request)
    wanted = {slot: job for slot, job in asked.items() if slot.removeprefix("attention.") in needed}
    others = others or {}

    def found(job):
        of = others.get((job.request.model_id, job.request.precision))
        return JobResult(job, whole(job, loaded if of is None else of[0]), 1.0, True)

    results = {slot: found(job) for slot, job in wanted.items()}
    moment = Moment("r", POLICY, INDEX, loaded.playback.recording, loaded.playback.windows)
    listed = tuple(Choice(name, name, source=of[1]) for (name, _), of in others.items())
    page = Page(state, moment, ready_of(loaded, request), results=results, file_name=file,
                model=ModelFacts("tiny", source=weights), models=listed)  # fmt: skip
    return shown_of(page)


def other_network(file, folder, precision):
    """Another network on the same file, in a precision of its own: as the engine holds it, and its weights."""
    weights = folder / "other.safetensors"
    save_weights(build_model("tiny", torch.Generator().manual_seed(7)), weights, dtype=None)
    recording, model = open_recording(file), load_model(weights, precision=precision)
    playback = Playback(model, recording, plan_windows(recording, POLICY))
    return LoadedPlayback(playback, contract_of(model), 4, Pace(), 1.0), str(weights)


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


PINNED = PinnedMap(
    request_of(2), "scale1.encoder.0.self", 1, "mean", "attended by", (3, 15)
)  # another window, site, head, direction and pixel than the page's


@pytest.mark.parametrize("weight", ["alpha", "value"])
def test_the_lines_of_a_difference_give_both_maps_as_each_was_asked(opened, weight):
    request = replace(PINNED.request, recording_id="lines", intervention=MASK)
    slice_ = AttentionState(site=SITE, weight=weight, compare="a", pin_a=replace(PINNED, request=request))
    shown = shown_by(opened, slice_)
    found = difference_of(shown).found
    now = shown.attention.rows(SITE, [shown.token])[:, 0].mean(0)
    assert np.array_equal(found.now.map, now)  # weights, as the pin's are
    assert np.array_equal(made_by(shown), found.log_ratio)
    table = row_text(shown).splitlines()
    assert table[0] == "token,row,column,x,y,now,then,log2_ratio"
    assert [float(line.split(",")[-1]) for line in table[1:]] == pytest.approx(found.log_ratio.tolist(), rel=1e-5)


def test_the_lines_of_two_networks_name_each_by_its_file_and_in_its_precision(opened, tmp_path):
    others = {("other", "bf16"): other_network(opened[1], tmp_path, "bf16")}
    request = replace(PINNED.request, recording_id="lines", model_id="other", precision="bf16")
    pinned = replace(PINNED, request=request, site="scale3.encoder.9.self")  # it has no such site: its first one
    slice_ = AttentionState(site=SITE, compare="a", pin_a=pinned)
    shown = shown_by(opened, slice_, Intervention(), others=others)
    apart = difference_of(shown)
    assert apart.contract.runtime.precision == "bf16"
    assert np.array_equal(made_by(shown), apart.found.log_ratio)
    assert "window 2 · other ·" in pin_words(shown.page, pinned)
    html = stage_html(shown.page)[3]  # network A − network B, with both frames below
    assert np.allclose(map_values(html)[0], apart.found.log_ratio, atol=1e-6)
    assert "</b> window 5 · tiny" in html
    assert "</b> window 2 · other" in html


def test_pins_outlive_a_change_of_the_network():
    held = AttentionState(site=SITE, compare="a", pin_a=PINNED, pin_b=PINNED)
    after = reduce_attention(held, ask.ChooseModel("other"), Here(STATE, Limits()))
    assert (after.pin_a, after.pin_b, after.compare) == (PINNED, PINNED, "a")


@pytest.mark.parametrize("also", ["a", "run 1"])
def test_the_lines_of_similarity_elsewhere_open_what_was_looked_at(opened, tmp_path, also):
    others = {("other", "bf16"): other_network(opened[1], tmp_path, "bf16")}
    run = Run(model_id="other", precision="bf16")
    request = replace(PINNED.request, recording_id="lines", model_id="other", precision="bf16")
    state = STATE.put(CompareState(runs=(run,)))
    slice_ = AttentionState(site=SITE, lines="tokens", also=also, pin_a=replace(PINNED, request=request))
    shown = shown_by(opened, slice_, Intervention(), state, others)
    there = shown.page.results["attention.tokens_also"].value
    assert there.contract.runtime.precision == "bf16"
    assert np.array_equal(made_by(shown), there.similarity(QUERY, of=shown.feature("tokens")))


@pytest.mark.parametrize("lines", ["entropy", "distance"])
def test_the_lines_of_the_dots_give_what_they_lie_at(opened, lines):
    shown = shown_by(opened, AttentionState(site=SITE, lines=lines))
    assert np.array_equal(made_by(shown), table_of(shown)[0 if lines == "entropy" else 1])


@pytest.mark.parametrize("lines", ["uniform", "TPA", "site"])
def test_the_lines_of_whether_attention_matters_give_what_is_measured(opened, lines):
    shown = shown_by(opened, AttentionState(site=SITE, lines=lines))
    found = shown.result("site_matters" if lines == "site" else "matters")
    assert np.array_equal(made_by(shown), found.differences[lines])


def test_the_lines_of_sinks_and_padding_give_what_is_told(opened):
    shown = shown_by(opened, AttentionState(site=SITE, lines="sinks"))
    facts = shown.result("site")
    assert np.array_equal(made_by(shown), facts.sinks)
    on_sinks, _, on_padding, _ = waste_of(shown, facts)
    shown = shown_by(opened, AttentionState(site=SITE, lines="on sinks"))
    assert float(made_by(shown).mean()) == pytest.approx(on_sinks, abs=1e-7)
    shown = shown_by(opened, AttentionState(site=SITE, lines="padding"))
    assert float(made_by(shown)) == on_padding


@pytest.mark.parametrize(
    "what", [{"video": VideoShown(FilmSetting(), 0.0, 1.0, None, False)}, {"is_live": True}, {"file_name": ""}]
)
def test_what_python_cannot_open_has_no_lines_but_a_sentence(opened, what):
    shown = shown_by(opened, AttentionState(site=SITE, over="python"))
    html = code_block(replace(shown, page=replace(shown.page, **what)))
    assert "open_recording" not in html
    assert 'data-testid="no-lines"' in html
    assert "open_recording" in code_block(shown)


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
