"""Copy as Python: the lines of every inspector give what it shows, to the last digit."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from app.catalogue.videos import FilmSetting, VideoShown
from app.engine.jobs import JobResult
from app.engine.requests import FrameRequest, Ready
from app.html.moment import Moment
from app.html.provenance import ModelFacts
from app.state.view_state import ViewState
from app.views.attention.state import AttentionState
from app.views.inspect.html.importance import padding_at, rows_at
from app.views.inspect.html.python import SLOTS, asked_of, code_of, snippet
from app.views.inspect.jobs.inspect import inspect_jobs
from app.views.inspect.state import Change, InspectState
from app.views.page import Page
from etnet.inspection import follow
from etnet.nets.intervention import Intervention
from tests.app.small_loaded import POLICY, QUERY, SITE, opened_in, whole
from tests.app.views.attention.test_lines import moving
from tests.inspection.small import SENSOR

INDEX = 4
ZEROED = Intervention(zeroed_levels=frozenset({1, 2, 3}))


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    return opened_in(tmp_path_factory.mktemp("moment"))


CHOSEN = AttentionState(site=SITE, head=1)


def page_of(opened, inspector, attention=CHOSEN, index=INDEX):
    """A page with all that the inspector asks for, and the result that it is about."""
    loaded, file, weights = opened
    change = Change(ZEROED, since=3) if inspector in ("change", "twin") else Change()
    inside = InspectState(opened=inspector, change=change, tolerance=1, num_back=1, level=2, plane="cell")
    state = ViewState("r", "m", policy=POLICY, index=index, query=QUERY).put(inside, attention)
    plain = FrameRequest("r", "m", "fp32", POLICY, index)
    request = replace(plain, intervention=change.intervention, since=change.since)
    asked = inspect_jobs(state, request)
    results = {slot: JobResult(job, whole(job, loaded), 1.0, True) for slot, job in asked.items()}
    frame = loaded.playback.at(index).frame[0, 0].numpy()
    ready = Ready(plain, frame, None, 1.0, True, False, False, loaded.contract, index)
    moment = Moment("r", POLICY, index, loaded.playback.recording, loaded.playback.windows)
    page = Page(state, moment, ready, results=results, file_name=file, model=ModelFacts("tiny", source=weights))
    return page, results[f"inspect.{SLOTS[inspector]}"]


def run(page, found, name):
    text = snippet(page, found, name)
    assert len(text.splitlines()) <= 10, text
    names = {}
    exec(text, names)
    return names["array"]


def shown_by(inspector, page, found):
    """What the page shows, by the names of its lines; and, where it shows a part of it, which."""
    value = found.value
    match inspector:
        case "none":
            return value.differences
        case "matters":
            attended = page.results["inspect.attended"].value
            attention, token = attended.attention, attended.attention.grid.token_at(*QUERY)
            raw, handed = rows_at(attended, SITE, token)
            sinks = attended.sinks[SITE]
            rows = attention.rows(SITE, [token])[:, 0].numpy()
            return {
                "this part": value[0].difference,
                "attention": raw,
                "contribution": handed,
                "sinks": sinks,
                "on sinks": (rows * sinks).sum(-1),
                "on padding": padding_at(attended, token)[0][SITE],
            }
        case "change":
            return {"changed frame": value.changed, "difference": value.changed - value.original, "MSE": value.mse}
        case "events":
            return {"this window": value.windows[-1].weights, "1 back": value.windows[-2].weights}
        case "sources":
            return {"sources": value.parts}
        case "search":
            return {"trials": value.search.trials}
        case "twin":
            return {"this pixel": value.at(QUERY), "image": value.on_image}
        case "input":
            top, _, left, _ = value.borders
            return {"voxel": value.padded[:, top : top + SENSOR.height, left : left + SENSOR.width]}
        case "state":
            norms = page.results["inspect.norms"].value
            return {"channels": value.values, "norms, hidden": norms.hidden, "norms, cell": norms.cell}
        case "memory":
            return {"memory depth": value.mean_absolute}
        case "rollout":
            return {"rollout": value.weights}
        case "time":
            return {"entropy": value.entropy, "kymograph": value.along_row, "local mass": value.near}
    return {"spread": value.deviation}


def as_shown(inspector, name, found, array):
    """The array that lines end with, as the page shows it."""
    if name == "channels":
        return array[torch.as_tensor(found.value.order.copy())]
    if inspector == "memory":
        return tuple(float(each) for each in array.abs().mean((1, 2)))
    if name == "kymograph":
        return array[:, 0, 0] * found.value.num_tokens
    if inspector == "time":
        return array[:, 0, 0]
    return array


def agree(inspector, page, found):
    shown = shown_by(inspector, page, found)
    assert set(shown) == set(asked_of(page, found))
    for name, wanted in shown.items():
        made = as_shown(inspector, name, found, run(page, found, name))
        if isinstance(wanted, float):
            assert float(made) == wanted
        elif name in ("on sinks", "image"):  # summed in another order
            assert np.allclose(np.asarray(made), wanted, rtol=1e-6, atol=1e-9)
        elif isinstance(wanted, np.ndarray):
            assert np.array_equal(np.asarray(made), wanted), name
        else:
            assert made == wanted


@pytest.mark.parametrize("inspector", SLOTS)
def test_the_lines_of_every_inspector_give_what_it_shows_to_the_last_digit(opened, inspector):
    agree(inspector, *page_of(opened, inspector))


@pytest.mark.parametrize("anchor", [1, INDEX, 6])
def test_the_lines_of_a_patch_that_is_followed_begin_where_it_was_chosen(opened, anchor, monkeypatch):
    monkeypatch.setattr(follow, "follow", moving)
    attention = AttentionState(site=SITE, head=1, follows=True, anchor=anchor)
    agree("time", *page_of(opened, "time", attention))


def test_there_is_a_choice_of_lines_where_an_inspector_shows_several_things(opened):
    page, found = page_of(opened, "time")
    state = page.state.put(replace(page.state.of(InspectState), shows_code=True, lines="local mass"))
    html = code_of(replace(page, state=state))
    assert 'data-set="set:inspect.lines"' in html
    assert ".mass" in html
    assert snippet(page, found) == snippet(page, found, "entropy")


@pytest.mark.parametrize("what", [{"video": VideoShown(FilmSetting(), 0.0, 1.0, None, False)}, {"is_live": True}])
def test_what_python_cannot_open_has_no_lines_but_a_sentence(opened, what):
    page, _ = page_of(opened, "input")
    page = replace(page, state=page.state.put(replace(page.state.of(InspectState), shows_code=True)))
    assert "open_recording" in code_of(page)
    html = code_of(replace(page, **what))
    assert "open_recording" not in html
    assert 'data-testid="no-lines"' in html
