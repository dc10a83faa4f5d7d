"""The settings of attention: query, comparison, how maps are drawn, what can be changed, and whether it matters."""

from __future__ import annotations

from app.html.attention.changed import change_words, since_words
from app.html.attention.difference import difference_legend
from app.html.attention.maps import highest_of, map_legend
from app.html.controls import button, percent, plain_bar
from app.html.elements import escape, icon_button, panel, segmented, select
from app.html.moment import ARRAYS
from app.html.units import count, of_whole
from app.views.attention.html.pins import difference_of, pin_words
from app.views.attention.html.shown import Shown, lacks_attention, recurrent_of, shown_of
from app.views.attention.html.tokens import FEATURES
from app.views.attention.jobs.site import SiteFacts
from app.views.attention.state import AttentionState, comparable_runs
from app.views.compare.state import NAMES
from app.views.inspect.state import Change, InspectState, is_switched
from app.views.page import Page
from app.views.scene.state import SceneState

KEPT: dict[object, str] = {
    "all": "all", "mass 50": "50 %", "mass 90": "90 %", "top 10": "top 10", "top 50": "top 50",
}  # fmt: skip
SCOPES = {
    "inspect:scope:window": "this window",
    "inspect:scope:on": "from here on",
    "inspect:scope:once": "once",
}


def side_html(page: Page) -> str:
    """Everything that is above the widgets; a sentence for a network without attention."""
    if sentence := lacks_attention(page):
        said = f'<div class="et-say" data-testid="lacks">{escape(sentence)}.</div>'
        tokens = _tokens(page, page.state.of(AttentionState)) if recurrent_of(page) else ""
        return panel("attention-tools", said, tokens)
    slice_, shown = page.state.of(AttentionState), shown_of(page)
    parts = [_query(page, shown, slice_), _map(slice_), _range(shown, slice_)]
    if shown is not None:
        parts.append(change_html(page.state.of(InspectState).change, shown))
        parts += [_matters(shown), _not_on_the_map(shown)]
    parts += [_tokens(page, slice_), _scene(page, slice_)]
    return panel("attention-tools", *parts)


def _choice(label: str, name: str, words: dict[object, str], held: object) -> str:
    options = {f"set:attention.{name}:{word}": text for word, text in words.items()}
    return _row(label, segmented(label, options, f"set:attention.{name}:{held}"))


def _row(label: str, content: str) -> str:
    return f'<div class="etv-row"><label>{label}</label>{content}</div>'


def _query(page: Page, shown: Shown | None, slice_: AttentionState) -> str:
    query = page.state.query
    if query is None:
        return '<h4>Query</h4><div class="et-note">Click into the image to choose a pixel.</div>'
    token = ""
    if shown is not None:
        row, column = divmod(shown.token, shown.grid.columns)
        grid = f"{shown.grid.columns} × {shown.grid.rows}"
        token = _row("Token", f'<span data-testid="token">{column}, {row} of {grid} · no. {shown.token}</span>')
    options = {"attention:compare:none": "none"}
    pins: list[str] = []
    for slot, pinned in (("a", slice_.pin_a), ("b", slice_.pin_b)):
        if pinned is not None:
            options[f"attention:compare:{slot}"] = slot.upper()
            unpin = icon_button(f"attention:unpin:{slot}", "close", f"Unpin {slot.upper()}")
            words = f"<b>{slot.upper()}</b> {escape(pin_words(page, pinned))}"
            pins.append(f'<div class="et-pin" data-testid="pinned"><span>{words}</span>{unpin}</div>')
    compare = segmented("Compare with", options, f"attention:compare:{slice_.compare}")
    if not pins:
        why = "The pin on the map keeps it with its moment and network"
        compare = f'<span class="et-note" title="{why}">nothing pinned</span>'
    follows = {"set:attention.follows:False": "the pixel", "set:attention.follows:True": "the patch under it"}
    followed = _row("Stay on", segmented("Stay on", follows, f"set:attention.follows:{slice_.follows}"))
    if shown is not None:
        query = shown.look.query
        anchor = slice_.anchored(page.state.index)
        if anchor is not None:
            x, y = page.state.query or query
            words = f"the patch that lies at {x}, {y} in window {count(anchor)}"
            if shown.is_lost:
                words = f"{words} has left the image: this is where it was chosen"
            followed += f'<div class="et-note" data-testid="followed">Followed: {words}.</div>'
    return (
        f"<h4>Query: pixel {query[0]}, {query[1]}</h4>{token}{followed}{_row('Compare with', compare)}{''.join(pins)}"
    )


def _map(slice_: AttentionState) -> str:
    heads = segmented(
        "Head aggregation",
        {f"set:attention.gather:{word}": word for word in ("mean", "max", "min")},
        "" if slice_.head is not None else f"set:attention.gather:{slice_.gather}",
    )
    if slice_.head is not None:
        heads += button("all heads", "set:attention.head:none") + f'<span class="et-note">head {slice_.head}</span>'
    ways: dict[object, str] = {"attends to": "attends to", "attended by": "attended by"}
    weights: dict[object, str] = {"alpha": "α", "value": "‖αvW_O‖"}
    weight = _choice("Weight", "weight", weights, slice_.weight)
    if slice_.pinned is not None:
        weight = _row("Weight", '<span class="et-note">α; that is what a pin holds</span>')
    elif slice_.direction == "attended by":
        weight = _row("Weight", '<span class="et-note">α; values are mixed along rows alone</span>')
    direction = _choice("Direction", "direction", ways, slice_.direction)
    threshold = _choice("Tokens drawn", "keep", KEPT, slice_.keep)
    return f"<h4>Map</h4>{_row('Head aggregation', heads)}{direction}{weight}{threshold}"


def _range(shown: Shown | None, slice_: AttentionState) -> str:
    scale = ""
    if shown is not None:
        apart = difference_of(shown)
        row = shown.row()
        scale = map_legend(shown.look, highest_of(row, shown.look))
        if apart is not None:
            scale = difference_legend(apart.found.limit)
    ranges: dict[object, str] = {"shared": "shared", "per map": "per map"}
    scales: dict[object, str] = {False: "log", True: "linear"}
    grains: dict[object, str] = {False: "tokens", True: "smooth"}
    return (
        f"<h4>Colour range</h4>{scale}{_choice('Range', 'map_range', ranges, slice_.map_range)}"
        f"{_choice('Scale', 'is_linear', scales, slice_.is_linear)}"
        f"{_choice('Rendering', 'is_smooth', grains, slice_.is_smooth)}"
    )


def _tokens(page: Page, slice_: AttentionState) -> str:
    """Which vectors similarity and colours are of, and where else similarity is looked for."""
    words = {str(word): said for word, said in FEATURES.items()}
    if lacks_attention(page):
        words = {f"hidden {level}": f"recurrent state, level {level}" for level in recurrent_of(page)}
        words = {"": "choose", **words} if slice_.feature not in words else words
    features = select("Vectors", "set:attention.feature", words, slice_.feature, off="")
    places: dict[object, str] = {"none": "none", "10 back": "−10", "10 on": "+10"}
    places |= {slot: slot.upper() for slot, pinned in (("a", slice_.pin_a), ("b", slice_.pin_b)) if pinned is not None}
    places |= {f"run {place}": f"run {NAMES[place]}" for place, _ in comparable_runs(page.state)}
    said = "Where this token’s vector is found, too: 10 windows back or on, at a pin, or in a run of Compare."
    if slice_.tokens == "pca":
        said = "Colours are fitted to the recording once. Another window stands beside the similarity map alone."
    also = _choice("Also in window", "also", places, slice_.also)
    return f'<h4>Tokens</h4>{_row("Vectors", features)}{also}<div class="et-note">{said}</div>'


def change_html(change: Change, shown: Shown) -> str:
    """What can be changed at this site, how far it reaches, and what is changed now, by name."""
    site, head = shown.site, shown.look.head
    parts = {f"alike {site}": "Uniform attention", f"site {site}": "Ablate site"}
    why = ""
    if head is not None and head < shown.num_heads:
        parts = {f"head {site} {head}": f"Mask head {head}", **parts}
    else:
        why = '<div class="et-note">To mask one head, choose it below the map or by its digit.</div>'
    switches = "".join(
        button(words, f"inspect:switch:{part}", is_on=is_switched(change.intervention, part))
        for part, words in parts.items()
    )
    scope = _row("Scope", segmented("Scope", SCOPES, f"inspect:scope:{change.scope}"))
    if change.scope != "window" and not change.is_nothing and not _reaches_on(change):
        why += '<div class="et-note">What changes the decoding alone leaves no trace in the state.</div>'
    said = ""
    if not change.is_nothing:
        words = f"{change_words(change.intervention, change.edit)} · {since_words(change.since, change.once)}"
        said = (
            f'<div class="et-changed" data-testid="changed"><span>{escape(words)}</span>'
            f"{button('Reset all', 'inspect:reset', classes='et-strong')}</div>"
        )
    return f'<h4>Change</h4><div class="et-chips">{switches}</div>{scope}{why}{said}'


def _reaches_on(change: Change) -> bool:
    return change.intervention.changes_memory or not change.edit.changes_nothing


def _matters(shown: Shown) -> str:
    """Measured: what the pixel and the image lose without attention's choice, without TPA, without this site."""
    whole, own = shown.result("matters"), shown.result("site_matters", site=shown.slice_.site)
    measured = [
        (words, None if found is None else found.at(name, shown.look.query), found and found.on_image(name))
        for words, name, found in (
            ("All uniform", "uniform", whole),
            ("No TPA", "TPA", whole),
            ("This site", "site", own),
        )
    ]
    largest = max((abs(here) for _, here, _ in measured if here is not None), default=0.0)
    rows = "".join(
        f'<span class="et-note">{words}</span><span class="et-measure" data-testid="matters">'
        + (
            "<i></i><b>…</b>"
            if here is None
            else f"{plain_bar(abs(here), largest)}<b>{percent(abs(here), is_signed=False)}</b>"
        )
        + "</span>"
        for words, here, _ in measured
    )
    images = ", ".join("…" if image is None else percent(image, is_signed=False) for _, _, image in measured)
    return (
        f'<h4>Does attention matter here?</h4><div class="et-table et-two et-bars">{rows}</div>'
        f'<div class="et-note">change of this pixel; of the whole image {images}</div>'
    )


def _not_on_the_map(shown: Shown) -> str:
    """Sinks and padding of the chosen site, in words."""
    facts = shown.result("site", site=shown.slice_.site)
    if facts is None:
        return ""
    key = ("waste", shown.ready.key, shown.site, shown.token)
    on_sinks, num_sinks, on_padding, even = ARRAYS.get(key, lambda: waste_of(shown, facts))
    sinks = "No token is a sink: none is attended to by nearly all queries."
    if num_sinks:
        sinks = (
            f"{of_whole(on_sinks)} of this row goes to {num_sinks} token{'s' if num_sinks > 1 else ''} that most "
            "queries attend to (sinks)."
        )
    padding = f"{of_whole(on_padding, 1)} falls on padding; uniform attention gives {of_whole(even, 1)}."
    return f'<h4>Attention sinks and padding</h4><div class="et-note" data-testid="waste">{sinks} {padding}</div>'


def waste_of(shown: Shown, facts: SiteFacts) -> tuple[float, int, float, float]:
    """Of the row: the share on sinks (mean of the heads), the number of sinks, the share on padding; and uniform's."""
    from etnet.inspection.mass import mass_on, padding_shares

    rows = facts.attention.rows(shown.site, [shown.token])[:, 0]
    shares = padding_shares(shown.grid)
    on_sinks = float((rows.cpu().numpy() * facts.sinks).sum(-1).mean())
    padding = float(mass_on(rows.mean(0), shares.to(rows.device)))
    return on_sinks, int(facts.sinks.any(0).sum()), padding, float(shares.mean())


def _scene(page: Page, slice_: AttentionState) -> str:
    """What of this site stands in the event cloud, and why a switch cannot act now."""
    links: dict[object, str] = {False: "off", True: "on"}
    planes: dict[object, str] = {False: "events", True: "maps"}
    scene, held = page.state.of(SceneState), str(slice_.shows_planes)
    said = "Shown in the event cloud of Inspect."
    if not slice_.shows_planes and not scene.shows_events:
        held = "neither"
        said = "Events are off in the event cloud, so nothing stands behind the image. Switch them on there."
    elif slice_.shows_planes and scene.camera == "front":
        said = "Maps stand behind the image; the front view hides them. Choose Perspective or Side in the event cloud."
    elif scene.camera == "front":
        said = (
            "The front view shows nothing behind the image. Choose Perspective or Side in the event cloud of Inspect."
        )
    return (
        f"<h4>In the event cloud</h4>{_choice('Strongest links', 'shows_links', links, slice_.shows_links)}"
        f'{_choice("Behind image", "shows_planes", planes, held)}<div class="et-note">{said}</div>'
    )
