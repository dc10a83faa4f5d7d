"""What a page is made of, imported and read while the first visitor's browser is still loading viser."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec

from app.views.view import View


def get_ready(views: Sequence[View]) -> None:
    """Import what draws a page of these views. Done beside the server: a page that comes sooner imports it itself."""
    import_module("app.session.session")
    for view in views:
        package = view.make_panel.__module__
        if hasattr(sys.modules[package], "__path__") and find_spec(f"{package}.panel") is not None:
            import_module(f"{package}.panel")
