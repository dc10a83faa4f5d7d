"""What the open attention view wants to know of the moment, beside the maps that come with its frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from app.engine.jobs import Job
from app.engine.network_parts import NetworkPartsJob
from app.engine.requests import FrameRequest
from app.state.view_state import ViewState
from app.views.attention.jobs.heads import AtlasJob, MattersJob
from app.views.attention.jobs.site import BasisJob, SiteJob, TokensJob, site_of_word
from app.views.attention.jobs.time import CurveJob, PathJob, PinJob
from app.views.attention.state import AttentionState, other_moment
from app.views.stretch import stretch_of


def attention_jobs(state: ViewState, request: FrameRequest) -> Mapping[str, Job]:
    """Nothing before a pixel is chosen but what the network has. What answers for every pixel names none."""
    slice_, query = state.of(AttentionState), state.query
    plain, asked = request.plain, replace(request, wants_attention=False)
    wanted: dict[str, Job] = {"attention.network": NetworkPartsJob(replace(plain, index=0))}
    if query is None or state.workspace != "attention":
        return wanted
    site, first = slice_.site, replace(plain, index=stretch_of(plain.index)[0])
    anchor = slice_.anchored(plain.index)
    if anchor is not None:
        wanted["attention.path"] = PathJob(first, query, anchor)
    wanted["attention.site"] = SiteJob(asked, site)
    of_site = site_of_word(slice_.feature, site), slice_.feature
    wanted["attention.tokens"] = TokensJob(asked, *of_site)
    if slice_.tokens == "pca":
        wanted["attention.basis"] = BasisJob(replace(plain, index=0), *of_site)
    elif (elsewhere := other_moment(state, asked)) is not None:
        wanted["attention.tokens_also"] = TokensJob(elsewhere, *of_site)
    wanted["attention.matters"] = MattersJob(plain)
    wanted["attention.site_matters"] = MattersJob(plain, site)
    if slice_.pinned is not None:
        wanted["attention.pin"] = PinJob(slice_.pinned)
    wanted["attention.atlas"] = AtlasJob(plain)
    head = slice_.head if slice_.quantity_has_a_head else None
    wanted["attention.curve"] = CurveJob(first, query, site, slice_.curve, head, anchor)
    return wanted
