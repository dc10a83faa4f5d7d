"""A site or head that was chosen for another network: every job answers for this one's, and the page says so."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from app.engine.jobs import JobResult
from app.html.moment import Moment
from app.html.provenance import ModelFacts
from app.views.attention.html.atlas import atlas_html
from app.views.attention.html.shelf import time_html
from app.views.attention.html.shown import shown_of
from app.views.attention.html.side import side_html
from app.views.attention.html.stage import stage_html
from app.views.attention.html.tokens import tokens_html
from app.views.attention.jobs.attention import attention_jobs
from app.views.attention.jobs.heads import AtlasJob, MattersJob
from app.views.attention.jobs.site import BasisJob, SiteJob, TokensJob
from app.views.attention.jobs.time import CurveJob, PinJob
from app.views.attention.state import AttentionState, PinnedMap
from app.views.demo.map import map_html
from app.views.inspect.jobs.pixel import ThroughTimeJob
from app.views.page import Page
from app.views.scene.scene import sites_behind
from etnet.inspection.anatomy import anatomy_of
from tests.app.small_loaded import POLICY, QUERY, SITE, loaded_of, request_of, whole
from tests.app.views.attention.small_page import INDEX, STATE, ready_of

FOREIGN, HEAD = "scale3.encoder.9.self", 13


@pytest.fixture(scope="module")
def loaded():
    return loaded_of()


@pytest.fixture(scope="module")
def first(loaded):
    return anatomy_of(loaded.playback.model).sites[0]


def arrays(value):
    """What an answer holds, as arrays in a fixed order."""
    if isinstance(value, torch.Tensor):
        return [value.numpy()]
    if isinstance(value, np.ndarray):
        return [value]
    if isinstance(value, dict | tuple | list):
        held = value.values() if isinstance(value, dict) else value
        return [array for each in held for array in arrays(each)]
    return [
        array
        for name in getattr(value, "__dataclass_fields__", ())
        if name not in ("seconds", "nbytes")
        for array in arrays(getattr(value, name))
    ]


def jobs(site, head):
    request = request_of(INDEX)
    pinned = PinnedMap(request, site, head, "mean", "attends to", QUERY)
    return {
        "site": SiteJob(request, site),
        "tokens": TokensJob(request, site),
        "basis": BasisJob(request_of(0), site),
        "matters": MattersJob(request, site),
        "entropy": CurveJob(request_of(0), QUERY, site, "entropy", None),
        "effect": CurveJob(request_of(0), QUERY, site, "effect", head),
        "followed": ThroughTimeJob(request, QUERY, site, head),
        "pin": PinJob(pinned),
    }


@pytest.mark.parametrize("name", list(jobs(SITE, None)))
def test_every_job_answers_for_the_first_site_and_all_heads(loaded, first, name):
    found, wanted = (arrays(whole(jobs(*asked)[name], loaded)) for asked in ((FOREIGN, HEAD), (first, None)))
    assert found
    assert len(found) == len(wanted)
    assert all(np.array_equal(a, b) for a, b in zip(found, wanted, strict=True))


@pytest.fixture(scope="module")
def page(loaded):
    state = STATE.put(AttentionState(site=FOREIGN, head=HEAD, weight="value", shows_planes=True))
    request = request_of(INDEX, wants_attention=True)
    asked = {slot: job for slot, job in attention_jobs(state, request).items() if slot == "attention.site"}
    results = {slot: JobResult(job, whole(job, loaded), 1.0, True) for slot, job in asked.items()}
    moment = Moment("r", POLICY, INDEX, loaded.playback.recording, loaded.playback.windows)
    return Page(state, moment, ready_of(loaded, request), results=results, model=ModelFacts("tiny"))


def test_the_page_shows_the_first_site_and_says_so(page, first):
    shown = shown_of(page)
    assert (shown.site, shown.look.head) == (first, None)
    assert shown.result("site", site=FOREIGN) is not None
    text = " ".join(stage_html(page))
    assert (
        f"tiny has no site {FOREIGN}, so its first one is shown; it has no head {HEAD}, so all heads are shown." in text
    )
    own = replace(page, state=STATE.put(AttentionState(site=SITE, head=1)))
    assert 'data-testid="instead"' not in " ".join(stage_html(own))


def answers(request, head=None):
    """Every job whose answer a card is drawn from."""
    return {
        "atlas": AtlasJob(request),
        "matters": MattersJob(request),
        "site_matters": MattersJob(request, SITE),
        "site": SiteJob(request, SITE),
        "tokens": TokensJob(request, SITE),
        "curve": CurveJob(replace(request, index=0), QUERY, SITE, "effect", head),
    }


def test_the_answers_of_a_former_network_are_not_shown_as_this_ones(loaded):
    state = STATE.put(AttentionState(site=SITE, curve="effect", head=1))
    request = request_of(INDEX, wants_attention=True)
    moment = Moment("r", POLICY, INDEX, loaded.playback.recording, loaded.playback.windows)
    results = {
        f"attention.{slot}": JobResult(job, whole(job, loaded), 1.0, True)
        for slot, job in answers(request_of(INDEX), 1).items()
    }
    page = Page(state, moment, ready_of(loaded, request), results=results)
    shown = shown_of(page)
    assert all(shown.result(slot) is not None for slot in ("atlas", "matters", "site_matters", "site", "tokens"))
    assert "span:" in time_html(page)[2]
    # The same window of another network: what was found of the first one is none of its answers.
    ready = replace(page.ready, request=replace(request, model_id="other"))
    other = replace(page, ready=ready, state=replace(state, model_id="other"))
    shown = shown_of(other)
    assert all(shown.result(slot) is None for slot in ("atlas", "matters", "site_matters", "site", "tokens"))
    assert "waiting" in atlas_html(other)[0]
    assert "under-way" in tokens_html(other)[3]
    assert "span:" not in time_html(other)[2]
    assert 'data-testid="waste"' not in side_html(other)


def test_the_effect_of_one_head_is_not_shown_as_anothers(loaded):
    job = answers(request_of(INDEX), 2)["curve"]
    moment = Moment("r", POLICY, INDEX, loaded.playback.recording, loaded.playback.windows)
    results = {"attention.curve": JobResult(job, whole(job, loaded), 1.0, True)}
    for head, is_answer in ((2, True), (3, False), (None, False)):
        state = STATE.put(AttentionState(site=SITE, curve="effect", head=head))
        page = Page(state, moment, ready_of(loaded, request_of(INDEX, wants_attention=True)), results=results)
        assert ("span:" in time_html(page)[2]) == is_answer


def test_demo_and_scene_show_the_first_site_too(page, first):
    assert 'alt="Where the network looks"' in map_html(page)
    assert first in sites_behind(page)
