"""What is changed on purpose, by name: which site, heads, scale and share of events, and since which window."""

from __future__ import annotations

from app.html.units import count, milliseconds, of_whole, resolution
from etnet.events.edit import EventEdit
from etnet.nets.intervention import Intervention


def site_name(site: str) -> str:
    """A site in few words, its layer counted from 0 as the library does: "1/2 decoder 0, cross"."""
    scale, part, layer, kind = site.split(".")
    return f"{resolution(int(scale.removeprefix('scale')))} {part} {layer}, {kind}"


def change_words(intervention: Intervention, edit: EventEdit) -> str:
    """All that is changed, by name, in a line; empty where nothing is."""
    return " · ".join((*_of_the_network(intervention), *_of_the_events(edit)))


def since_words(since: int | None, once: bool = False) -> str:
    """For which windows it holds."""
    if since is None:
        return "this window only"
    return f"once, in window {count(since)}" if once else f"persistent from window {count(since)}"


def changed_at(intervention: Intervention, site: str) -> str:
    """What is changed at one site, as its map says it; empty where it is as it is."""
    heads = sorted(head for name, head in intervention.masked_heads if name == site)
    said = [f"head {', '.join(map(str, heads))} masked"] if heads else []
    if site in intervention.removed_sites:
        said.append("ablated")
    if site in intervention.uniform_sites or intervention.uniform_attention:
        said.append("uniform attention")
    scale, part, *_ = site.split(".")
    if int(scale.removeprefix("scale")) in intervention.removed_scales:
        said.append("scale removed")
    if intervention.without_decoders and part == "decoder":
        said.append("decoders removed")
    if intervention.without_context:
        said.append("TPA ablated")
    return " · ".join(said)


def _of_the_network(intervention: Intervention) -> list[str]:
    said = [
        words
        for is_set, words in (
            (intervention.without_context, "TPA ablated"),
            (intervention.uniform_attention, "uniform attention at all sites"),
            (intervention.without_decoders, "decoders removed"),
        )
        if is_set
    ]
    by_site: dict[str, list[int]] = {}
    for site, head in sorted(intervention.masked_heads):
        by_site.setdefault(site, []).append(head)
    said += [f"head {', '.join(map(str, heads))} of {site_name(site)} masked" for site, heads in by_site.items()]
    said += [f"{site_name(site)} ablated" for site in sorted(intervention.removed_sites)]
    said += [f"uniform attention at {site_name(site)}" for site in sorted(intervention.uniform_sites)]
    for numbers, words in (
        (intervention.removed_scales, "scale {} removed"),
        (intervention.removed_skips, "skip {} removed"),
    ):
        said += [words.format(resolution(number) if number else "head") for number in sorted(numbers)]
    for numbers, word in ((intervention.zeroed_levels, "zeroed"), (intervention.frozen_levels, "frozen")):
        # By its number: of some networks every level works at full size.
        said += [f"state of level {number} {word}" for number in sorted(numbers)]
    return said


def _of_the_events(edit: EventEdit) -> list[str]:
    said = []
    if edit.drop:
        said.append(f"{of_whole(edit.drop)} of the events dropped")
    if edit.invert:
        said.append(f"polarity of {of_whole(edit.invert)} flipped")
    if edit.jitter:
        said.append(
            f"{of_whole(edit.jitter)} of the timestamps jittered by up to {milliseconds(edit.jitter_by / 1000)}"
        )
    return said
