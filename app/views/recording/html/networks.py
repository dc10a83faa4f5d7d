"""The networks that somebody trained: those that are here, and where the weights of the others come from."""

from __future__ import annotations

from collections.abc import Sequence

from app.html.elements import ON_PICK, escape
from app.views.page import Choice
from app.views.recording.html.examination import part
from etnet.nets.listing import LISTED, ListedNetwork


def networks_html(models: Sequence[Choice], chosen: str) -> str:
    """One row a network. What is here can be used at once, as run A or beside it; of the rest it is said how."""
    known = {choice.id: choice for choice in models}
    rows = "".join(_row(network, network.name in known, chosen) for network in LISTED)
    return part("networks", "Networks", f'<div class="etv-networks">{rows}</div>')


def _row(network: ListedNetwork, is_here: bool, chosen: str) -> str:
    what = f'<b>{escape(network.name)}</b><span class="et-note">{escape(network.summary)}</span>'
    source = f'<div class="et-note">{escape(network.source)}</div>'
    if not is_here:
        how = (
            f"<details><summary>Where to get the weights</summary>{source}<code>{escape(network.how)}</code></details>"
        )
        return f'<div data-testid="network-{escape(network.name)}">{what}{how}</div>'
    if network.name == chosen:
        use = '<span class="et-exact">in use</span>'
    else:
        use = f'<button class="et-button" data-k="compare:model:0:{escape(network.name)}" {ON_PICK}>Use</button>'
    beside = f'<button class="et-button" data-k="compare:with:{escape(network.name)}" {ON_PICK}>Compare</button>'
    return f'<div data-testid="network-{escape(network.name)}">{what}<div class="et-chips">{use}{beside}</div></div>'
