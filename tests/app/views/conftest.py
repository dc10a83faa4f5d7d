"""A moment that all tests of this folder can draw."""

from tests.app.shown_moment import moment, nothing_shared, ready, recording  # noqa: F401
