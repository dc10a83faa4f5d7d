"""The page's reducer over all views, as sessions use it."""

from app.state.link import from_link as from_link_of
from app.state.stored import from_text as from_text_of
from app.views import VIEWS
from app.views.view import reduce_views

INITIAL = [view.initial for view in VIEWS]


def reduce(state, intent, limits):
    return reduce_views(state, intent, limits, VIEWS)


def from_text(text, default):
    return from_text_of(text, default, INITIAL)


def from_link(value, present):
    return from_link_of(value, present, INITIAL)
