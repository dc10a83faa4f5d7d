"""What is like the chosen token, here and elsewhere; tokens as colours; and a site over time."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from app.engine.jobs import JobResult
from app.state.run import Run
from app.state.view_state import Limits
from app.views.attention.html.shelf import time_html
from app.views.attention.html.side import side_html
from app.views.attention.html.tokens import tokens_html
from app.views.attention.jobs.attention import attention_jobs
from app.views.attention.jobs.site import BasisJob, Tokens, TokensJob, feature_of_word, site_of_word
from app.views.attention.jobs.time import CurveJob
from app.views.attention.state import AttentionState, FeatureWord, PinMap, Unpin, reduce_attention
from app.views.compare.state import CompareState
from app.views.stretch import stretch_of
from app.views.view import Here
from etnet.inspection import entropy, similarity
from etnet.inspection.atlas import masking
from etnet.inspection.basis import fit_basis_to_recording
from etnet.inspection.features import feature_map
from etnet.nets.intervention import ORIGINAL
from tests.app.checked_html import Checker, map_values
from tests.app.small_loaded import POLICY, QUERY, SITE, request_of, whole
from tests.app.views.attention.small_page import CHOSEN, INDEX, STATE


def test_similarity_is_the_librarys_and_one_at_the_token_itself(loaded, page_of):
    job = TokensJob(request_of(INDEX), SITE)
    found = feature_map(loaded.playback, INDEX, feature_of_word("tokens", SITE))
    values = similarity.cosine_similarity(found, found.at(*QUERY)).numpy()
    assert np.array_equal(whole(job, loaded).similarity(QUERY), values)
    (shown,) = map_values(tokens_html(page_of(jobs=[("tokens", job)]))[3])
    assert shown[int(np.argmax(values))] == pytest.approx(1.0, abs=1e-6)
    assert np.array_equal(shown, values.reshape(-1))


def test_the_basis_of_colours_is_the_recordings_whatever_was_looked_at(loaded, page_of):
    basis = whole(BasisJob(request_of(0), SITE), loaded)
    expected = fit_basis_to_recording(loaded.playback, feature_of_word("tokens", SITE))
    assert np.array_equal(basis.directions, expected.directions)
    slice_ = AttentionState(site=SITE, tokens="pca")
    jobs = [("tokens", TokensJob(request_of(INDEX), SITE)), ("basis", BasisJob(request_of(0), SITE))]
    _, note, _, html = tokens_html(page_of(slice_, jobs))
    assert "of the variance" in note
    assert "data-etv-values" in html


@pytest.mark.parametrize("quantity", ["entropy", "mass", "effect"])
@pytest.mark.parametrize("follows", [False, True])
def test_a_curve_is_at_the_current_window_what_the_map_says(loaded, ready, page_of, quantity, follows):
    anchor = INDEX if follows else None
    job = CurveJob(request_of(0), QUERY, SITE, quantity, 1 if quantity == "effect" else None, anchor)
    curve = whole(job, loaded)
    place = curve.indices.index(INDEX)
    assert curve.pixels[place] == QUERY
    assert curve.indices == tuple(sorted(curve.indices))
    token = ready.attention.grid.token_at(*QUERY)
    if quantity == "entropy":
        rows = ready.attention.rows(SITE, [token])
        expected = entropy.map_numbers(rows, ready.attention.grid, [token]).entropy[:, 0].numpy()
        assert np.allclose(curve.values[place], expected, atol=1e-5)
    if quantity == "effect":
        x, y = QUERY
        masked = loaded.playback.at(INDEX, intervention=masking(ORIGINAL, SITE, 1)).frame[0, 0, y, x]
        assert curve.values[place, 0] == pytest.approx(float(masked - loaded.playback.at(INDEX).frame[0, 0, y, x]))
    slice_ = AttentionState(site=SITE, curve=quantity, follows=follows, head=1 if quantity == "effect" else None)
    html = time_html(page_of(slice_, [("curve", job)]))[2]
    times = [(stamp - loaded.playback.recording.span.start) / 1e6 for stamp in (curve.stamps[0], curve.stamps[-1])]
    assert f"span:{times[0]:.6f},{times[1]:.6f}" in Checker(html).keys


@pytest.mark.parametrize("word", get_args(FeatureWord))
def test_every_kind_of_vector_has_its_similarity_and_its_colours(loaded, page_of, word):
    slice_ = AttentionState(site=SITE, feature=word)
    asked = site_of_word(word, SITE), word
    job = TokensJob(request_of(INDEX), *asked)
    found = feature_map(loaded.playback, INDEX, feature_of_word(word, SITE))
    expected = similarity.cosine_similarity(found, found.at(*QUERY)).numpy()
    html = tokens_html(page_of(slice_, [("tokens", job)]))[3]
    assert np.allclose(map_values(html)[0], expected.reshape(-1), atol=1e-6)
    jobs = [("tokens", job), ("basis", BasisJob(request_of(0), *asked))]
    assert "of the variance" in tokens_html(page_of(replace(slice_, tokens="pca"), jobs))[1]


@pytest.mark.parametrize(("also", "index"), [("10 back", 0), ("a", 2)])
def test_the_token_is_looked_for_in_another_window_and_both_maps_stand_there(loaded, page_of, also, index):
    slice_ = replace(CHOSEN, also=also)
    slice_ = replace(slice_, pin_a=reduce_attention(CHOSEN, PinMap("a"), Here(replace(STATE, index=2), Limits())).pin_a)
    asked = attention_jobs(STATE.put(slice_), request_of(INDEX))
    assert asked["attention.tokens_also"].request.index == index
    jobs = [(slot, asked[f"attention.{slot}"]) for slot in ("tokens", "tokens_also")]
    html = tokens_html(page_of(slice_, jobs))[3]
    now, then = (feature_map(loaded.playback, at, feature_of_word("tokens", SITE)) for at in (INDEX, index))
    here, there = map_values(html)
    assert np.allclose(here, similarity.cosine_similarity(now, now.at(*QUERY)).reshape(-1), atol=0.006)
    assert np.allclose(there, similarity.cosine_similarity(then, now.at(*QUERY)).reshape(-1), atol=0.006)
    assert f"window {index} · max" in Checker(html).text


def test_a_run_of_compare_is_another_network_at_the_same_window(page_of):
    runs = Run(policy=POLICY), Run(model_id="other")
    state = STATE.put(CompareState(runs=runs))
    slice_ = replace(CHOSEN, also="run 2")
    asked = attention_jobs(state.put(slice_), request_of(INDEX))["attention.tokens_also"]
    assert asked.request == replace(request_of(INDEX), model_id="other")
    side = Checker(side_html(page_of(slice_, state=state)))
    assert "set:attention.also:run 2" in side.keys
    assert "set:attention.also:run 1" not in side.keys  # other windows have no same moment by number


def test_vectors_of_another_length_are_told_not_compared(loaded, page_of):
    job = TokensJob(request_of(INDEX), SITE)
    other = replace(whole(job, loaded).map, values=whole(job, loaded).map.values[..., :5])
    slice_ = replace(CHOSEN, also="10 back")
    page = page_of(slice_, [("tokens", job)])
    then = TokensJob(request_of(0), SITE)
    found = JobResult(then, Tokens(other, loaded.contract, 0), 1.0, True)
    text = Checker(tokens_html(replace(page, results={**page.results, "attention.tokens_also": found}))[3]).text
    assert "has" in text
    assert "5" in text
    assert "take it from a map of the same feature of the same network" in text


def test_a_pin_that_goes_takes_its_second_map_along():
    here = Here(STATE, Limits())
    slice_ = replace(reduce_attention(CHOSEN, PinMap("a"), here), also="a")
    assert reduce_attention(slice_, Unpin("a"), here).also == "none"


@pytest.mark.parametrize("index", [0, 11, 12, 23, 24])
def test_a_curve_reaches_twenty_windows_on_from_every_window(index):
    first, length = stretch_of(index)
    assert first <= index
    assert first + length > index + 20
