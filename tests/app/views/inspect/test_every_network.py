"""Every inspector of every make of network: it answers, or it says in one sentence what this network has not."""

import pytest
import torch

from app.engine.jobs import JobResult
from app.engine.network_parts import NetworkPartsJob, network_parts
from app.engine.pace import Pace
from app.engine.playbacks import LoadedPlayback
from app.html.moment import Moment
from app.state.view_state import ViewState
from app.views.attention.html.side import side_html
from app.views.attention.html.tokens import tokens_html
from app.views.attention.jobs.attention import attention_jobs
from app.views.attention.state import AttentionState
from app.views.inspect.html.overview import INSPECTORS, NEEDS
from app.views.inspect.jobs.inspect import inspect_jobs
from app.views.inspect.jobs.pixel import AttributionJob
from app.views.inspect.panel import inspector_html
from app.views.inspect.state import Change, InspectState
from app.views.page import Page
from etnet.events.edit import EventEdit
from etnet.inspection.features import Feature, feature_map
from etnet.inspection.similarity import cosine_similarity
from etnet.nets.abilities import Abilities
from etnet.nets.adapter import Adapter
from etnet.nets.presets import UNTRAINED, build_model
from etnet.nets.runtime import contract_of
from etnet.nets.weights import load_model
from etnet.playback.playback import Playback
from tests.app.checked_html import Checker, map_values
from tests.app.small_loaded import POLICY, QUERY, request_of, whole
from tests.app.views.attention.small_page import ready_of
from tests.inspection.small import small_playback

INDEX = 4
MAKES = ("tiny", "e2vid", "firenet", "pie-net-lite", "leaky-integrator", "adapter", "no gradient")


def _integrate(voxel, memory):
    (brightness,) = memory or (torch.zeros_like(voxel[:, :1]),)
    brightness = 0.95 * brightness + 0.1 * voxel.sum(dim=1, keepdim=True)
    return torch.sigmoid(brightness), (brightness,)


def network(name):
    if name == "adapter":
        return Adapter(_integrate, name="mine")
    if name == "pie-net-lite":
        return load_model(name)
    model = build_model(UNTRAINED.get("leaky-integrator" if name == "no gradient" else name, name))
    if name == "no gradient":
        model.abilities = Abilities()
    return model


@pytest.fixture(scope="module", params=MAKES)
def loaded(request):
    small = small_playback()
    model = network(request.param)
    return LoadedPlayback(Playback(model, small.recording, small.windows), contract_of(model), 4, Pace(), 1.0)


@pytest.mark.parametrize("opened", INSPECTORS)
def test_every_inspector_answers_or_says_what_is_not_there(loaded, opened):
    parts = network_parts(loaded.playback.model)
    edit = EventEdit(drop=0.5, seed=1)
    change = Change(edit=edit, since=2) if opened in ("change", "twin") else Change()
    inside = InspectState(opened=opened, change=change, tolerance=1, num_back=1)
    state = ViewState("r", "m", policy=POLICY, index=INDEX, query=QUERY).put(inside)
    request = request_of(INDEX, edit=change.edit, since=change.since)
    jobs = inspect_jobs(state, request)
    said = parts.lacks.get(NEEDS.get(opened, ""), "")
    results = {"inspect.network": JobResult(NetworkPartsJob(request_of(0)), parts, 1.0, True)}
    if not said:
        results |= {slot: JobResult(job, whole(job, loaded), 1.0, True) for slot, job in jobs.items()
                    if not (slot == "inspect.attended" and "attention" in parts.lacks)}  # fmt: skip
        assert all(found.value is not None for found in results.values())
    moment = Moment("r", POLICY, INDEX, loaded.playback.recording, loaded.playback.windows)
    page = Page(state, moment, None, results=results)
    text = Checker(inspector_html(page)).text
    assert (f"{said}." in text) if said else ("Nothing to show" not in text)


def test_a_pixel_of_a_function_of_ones_own_is_traced_to_its_events():
    small, model = small_playback(), network("adapter")
    loaded = LoadedPlayback(Playback(model, small.recording, small.windows), contract_of(model), 4, Pace(), 1.0)
    found = whole(AttributionJob(request_of(INDEX), QUERY, 1), loaded)
    for window in found.windows:
        here = (window.events.x == QUERY[0]) & (window.events.y == QUERY[1])
        assert not window.weights[~here].any()


@pytest.mark.parametrize("preset", ["e2vid", "firenet"])
def test_the_state_of_a_network_without_attention_is_looked_into_in_tokens(preset):
    small, model = small_playback(), network(preset)
    loaded = LoadedPlayback(Playback(model, small.recording, small.windows), contract_of(model), 4, Pace(), 1.0)
    parts = JobResult(NetworkPartsJob(request_of(0)), network_parts(model), 1.0, True)

    def page_of(feature):
        state = ViewState("r", "m", policy=POLICY, index=INDEX, query=QUERY, workspace="attention")
        state = state.put(AttentionState(feature=feature))
        job = attention_jobs(state, request_of(INDEX))["attention.tokens"]
        results = {"attention.network": parts}
        if feature.startswith("hidden"):
            results["attention.tokens"] = JobResult(job, whole(job, loaded), 1.0, True)
        moment = Moment("r", POLICY, INDEX, loaded.playback.recording, loaded.playback.windows)
        return Page(state, moment, ready_of(loaded, request_of(INDEX)), results=results)

    asked = page_of("tokens")
    assert "has no attention" in Checker(tokens_html(asked)[3]).text
    assert "set:attention.feature:hidden 1" in Checker(tokens_html(asked)[3]).keys
    shown = page_of("hidden 2")
    found = feature_map(loaded.playback, INDEX, Feature("hidden", level=2))
    expected = cosine_similarity(found, found.at(*QUERY)).numpy()
    (values,) = map_values(tokens_html(shown)[3])
    assert (values == expected.reshape(-1)).all()
    assert "recurrent state, level 2" in Checker(side_html(shown)).text
