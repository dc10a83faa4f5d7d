"""Which studies a view wants: one small function for each part of the page that has any. All of them are pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from app.looking.cutting import SLOT as CUT
from app.looking.cutting import cut_question
from app.looking.doctor import doctor_question
from app.looking.fit import fit_question
from app.looking.inside import ask_inside
from app.looking.taking import SLOT as TAKEN
from app.looking.taking import taking_studies
from app.studies import Study
from app.view_state import ViewState
from app.wishes import Wish

Asker = Callable[[ViewState, Wish], Mapping[str, Study]]
"""(view, the wish for its moment) → studies by slot; none while its part of the page is closed."""

ASKERS: tuple[Asker, ...] = (ask_inside, fit_question, doctor_question, cut_question, taking_studies)


def questions(state: ViewState, wish: Wish) -> dict[str, Study]:
    """All studies that a view wants, by slot."""
    wanted: dict[str, Study] = {}
    for asker in ASKERS:
        wanted.update(asker(state, wish))
    return wanted


def given_up(state: ViewState) -> tuple[str, ...]:
    """Slots of files that nobody waits for any more: they end at once, and not when the page rests."""
    orders = {TAKEN: state.show.order, CUT: state.source.cut}
    return tuple(slot for slot, order in orders.items() if order is None)
