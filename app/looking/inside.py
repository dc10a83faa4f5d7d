"""Which studies the inspector that is open asks for; the law is that closed ones ask for nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from app.looking.memory import ChannelsStudy, GivenStudy, NormsStudy, RememberedStudy
from app.looking.parts import AnatomyStudy, AttendedStudy, MattersStudy, OutcomeStudy
from app.looking.pixel import FollowedStudy, RolledOutStudy, TracedStudy
from app.studies import Study
from app.view_state import ViewState
from app.wishes import Wish


def ask_inside(state: ViewState, wish: Wish) -> Mapping[str, Study]:
    """What the inspector that is open wants to know of the moment; nothing while all are closed."""
    inside, query = state.inside, state.query
    plain, asked = wish.plain, replace(wish, wants_attention=False)
    if inside.opened == "none":
        return {}
    wanted: dict[str, Study] = {"inside.anatomy": AnatomyStudy(replace(plain, index=0))}
    match inside.opened:
        case "matters":
            wanted["inside.matters"] = MattersStudy(plain)
            if query is not None:
                wanted["inside.attended"] = AttendedStudy(plain)
        case "change" if not wish.is_original:
            wanted["inside.outcome"] = OutcomeStudy(asked)
        case "input":
            wanted["inside.given"] = GivenStudy(asked)
        case "state":
            wanted["inside.channels"] = ChannelsStudy(asked, inside.level, inside.plane)
            wanted["inside.norms"] = NormsStudy(asked)
        case "memory":
            wanted["inside.remembered"] = RememberedStudy(plain)
        case _:
            pass
    return {**wanted, **_pixel_study(state, asked)}


def _pixel_study(state: ViewState, asked: Wish) -> Mapping[str, Study]:
    """What is asked about the clicked pixel alone."""
    inside, query = state.inside, state.query
    if query is None:
        return {}
    match inside.opened:
        case "events":
            return {"inside.traced": TracedStudy(asked.plain, query, inside.num_back)}
        case "rollout":
            return {"inside.rolled": RolledOutStudy(asked, query, inside.discard / 100)}
        case "time":
            return {"inside.followed": FollowedStudy(asked.plain, query, state.site)}
    return {}
