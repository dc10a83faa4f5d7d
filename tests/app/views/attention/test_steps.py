"""From site to site and from head to head without the atlas: by keys, by the palette, whatever the page shows."""

from dataclasses import replace

from app.engine.jobs import JobResult
from app.engine.network_parts import NetworkPartsJob, network_parts
from app.session.jobs import JobNews
from app.session.visit import Visit
from app.state import intents as ask
from app.state.view_state import Limits
from app.views.attention.state import AttentionState, StepHead, StepSite, hear, reduce_attention
from app.views.view import Here
from etnet.nets.presets import build_model
from tests.app.small_loaded import SITE, request_of
from tests.app.views.attention.small_page import STATE

HERE = Here(STATE, Limits())


def known(slice_=None):
    parts = network_parts(build_model("tiny")).anatomy
    told = ask.NetworkKnown(parts.sites, parts.num_heads)
    return reduce_attention(slice_ or AttentionState(site=SITE), told, HERE), parts


def test_steps_go_through_all_sites_of_the_network_and_around():
    for slice_ in (AttentionState(site=SITE), AttentionState(site=SITE, shows_dots=True, only="scale3")):
        held, parts = known(slice_)
        seen = []
        for _ in parts.sites:
            seen.append(held.site)
            held = reduce_attention(held, hear("site:+1"), HERE)
        assert held.site == SITE
        assert sorted(seen) == sorted(parts.sites)
        assert reduce_attention(reduce_attention(held, hear("site:-1"), HERE), hear("site:+1"), HERE) == held


def test_a_step_from_a_site_that_the_network_has_not_goes_on_from_the_one_that_is_shown():
    held, parts = known(AttentionState(site="scale3.encoder.9.self"))
    assert reduce_attention(held, StepSite(1), HERE).site == parts.sites[1]


def test_steps_go_through_all_heads_and_all_of_them_together():
    held, parts = known()
    seen = []
    for _ in range(parts.num_heads + 1):
        seen.append(held.head)
        held = reduce_attention(held, StepHead(1), HERE)
    assert seen == [None, *range(parts.num_heads)]
    assert held.head is None
    assert reduce_attention(held, StepHead(-1), HERE).head == parts.num_heads - 1


def test_before_the_network_is_known_and_after_another_is_chosen_nothing_is_stepped():
    unknown = AttentionState(site=SITE)
    assert reduce_attention(unknown, StepSite(1), HERE) == unknown
    held, _ = known()
    assert reduce_attention(held, ask.ChooseModel("other"), HERE).sites == ()
    assert reduce_attention(held, ask.ChooseModel("m"), HERE) == held


def test_the_answer_that_tells_a_networks_parts_tells_the_page():
    parts = network_parts(build_model("tiny"))
    news = JobNews("attention.network", JobResult(NetworkPartsJob(replace(request_of(0))), parts, 1.0, True))

    class Booth:
        def kept(self, news):
            return None

    visit = Visit.__new__(Visit)
    visit._booth = Booth()
    assert visit.hand_over(news) == (ask.NetworkKnown(parts.anatomy.sites, parts.anatomy.num_heads),)
