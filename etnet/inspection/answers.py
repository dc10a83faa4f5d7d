"""The last lines of a snippet: one answer for each inspector, as calls of `etnet.inspection`."""

from __future__ import annotations

from etnet.inspection.asked import Asked
from etnet.inspection.described import Described, change_call
from etnet.inspection.literals import Verbatim, call, code
from etnet.nets.intervention import Intervention

_PLAYBACK, _ATTENTION = Verbatim("playback"), Verbatim("attention")


def answer(asked: Asked, moment: Described, then: Described | None) -> tuple[str, ...]:
    """Lines that go on from `playback` (and `other`, of `then`) and end with `array = …`."""
    match asked.what:
        case "map" | "numbers" | "value_weighted" | "received" | "rollout" | "links" | "table" | "sinks" | "padding":
            return _of_attention(asked, moment.index)
        case "attribution" | "occlusion" | "gates" | "norms" | "memory_depth" | "path" | "track" | "masked":
            return _of_one_playback(asked, moment.index)
        case "feature" | "colours" | "similarity":
            return _of_features(asked, moment.index, then)
        case "map_difference" | "curve" | "apart":
            return _of_two(asked, moment, then)
        case _:
            return _of_a_moment(asked, moment.index)


def _of_a_moment(asked: Asked, index: int) -> tuple[str, ...]:
    pixel = asked.pixel or (0, 0)
    match asked.what:
        case "voxel":
            return (f"array = {call('input.network_input', _PLAYBACK, index)}.voxel",)
        case "effect":
            return (
                f"array = next(e for e in {call('importance.effects', _PLAYBACK, index)} "
                f"if e.ablation.name == {code(asked.part)}).difference",
            )
        case "atlas":
            field = "on_image" if asked.pixel is None else f"on_pixel{code(pixel)}"
            return (f"*_, found = {call('atlas.head_atlas', _PLAYBACK, index)}", f"array = found.{field}")
        case "cause":
            given = asked.given("levels", "tolerance", "towards", "furthest")
            return (
                f"*_, found = {call('causal_search.search_cause', _PLAYBACK, index, pixel, **given)}",
                "array = found.trials",
            )
        case "sources":
            return (f"*_, found = {call('sources.pixel_sources', _PLAYBACK, index, pixel)}", "array = found.parts")
        case "spread":
            given = asked.given("drop", "num_seeds", "num_back")
            found = call("uncertainty.dropout_spread", _PLAYBACK, index, **given)
            return (f"*_, found = {found}", "array = found.deviation")
        case "without":
            apart = f"playback.at({index}, intervention=cut).frame - playback.at({index}).frame"
            return (f"cut = {code(asked.cut)}", f"array = ({apart})[0, 0]")
        case "error":
            frame = Verbatim(f"playback.at({index}).frame[0, 0]")
            return (f"array = {call('uncertainty.camera_error', _PLAYBACK, index, frame)}",)
        case _:
            return (f"array = playback.at({index}).frame[0, 0]",)


def _of_attention(asked: Asked, index: int) -> tuple[str, ...]:
    token, site = asked.token or 0, asked.site
    needs_all = asked.what in ("rollout", "links", "table")
    probe = "AttentionProbe()" if needs_all else f"AttentionProbe({code(frozenset({site}))})"
    if asked.what == "value_weighted":
        probe = f"AttentionProbe({code(frozenset({site}))}, values=True)"
    first = f"attention = playback.at({index}, {probe}).attention"
    rows = f"attention.rows({code(site)}, [{token}])"
    match asked.what:
        case "map":
            chosen = f"{rows}[:, 0]"
            if asked.direction == "attended by":
                chosen = f"attention.columns({code(site)}, [{token}])[..., 0]"
            if asked.head is not None:
                chosen = call("entropy.choose_head", Verbatim(chosen), asked.head)
            last = chosen
        case "numbers":
            if asked.head is not None:  # of the one map that the heads make together, not the mean of their numbers
                rows = f"{call('entropy.choose_head', Verbatim(rows), asked.head)}[None]"
            last = call("entropy.map_numbers", Verbatim(rows), Verbatim("attention.grid"), Verbatim(f"[{token}]"))
            last += f".{asked.quantity}"
        case "value_weighted":
            last = call("mass.value_weighted", _ATTENTION, site, Verbatim(f"[{token}]")) + ".by_head"
            if asked.head is not None:  # one map, as shares; of the mean, what all heads hand over together
                part = ".joint" if asked.head == "mean" else ".by_head[:, 0]"
                first += f"\nfound = {last.removesuffix('.by_head')}{part}"
                last = call("entropy.choose_head", Verbatim("found / found.sum(-1, keepdim=True)"), asked.head)
                last = "found[0] / found[0].sum()" if asked.head == "mean" else last
        case "received":
            last = call("mass.received", _ATTENTION, site) + ".times_uniform"
        case "table":
            last = call("atlas.head_table", _ATTENTION, token) + f".{asked.quantity}"
        case "sinks":
            last = call("mass.received", _ATTENTION, site) + ".sinks()"
            if asked.token is not None:  # what of this row goes to them, by head
                last = f"({rows}[:, 0] * {last}).sum(-1)"
        case "padding":
            first += "\nshares = mass.padding_shares(attention.grid)"
            last = f"mass.mass_on({rows}[:, 0].mean(0), shares)"
        case "rollout":
            fusion = {} if asked.head is None else {"fusion": asked.head}
            last = call("rollout.rollout", _ATTENTION, token, **asked.given("discard"), **fusion) + ".weights"
        case _:
            last = call("links.strongest_links", _ATTENTION, token, asked.count)
    return (*first.split("\n"), f"array = {last}")


def _of_features(asked: Asked, index: int, then: Described | None) -> tuple[str, ...]:
    found = call("features.feature_map", _PLAYBACK, index, asked.feature)
    if asked.what == "feature":
        return (f"array = {found}.values",)
    if asked.what == "colours":
        fitted = call("basis.fit_basis_to_recording", _PLAYBACK, asked.feature, **asked.given("centre"))
        return (f"found = {fitted}", f"array = found.colours({found})")
    pixel = ", ".join(map(str, asked.pixel or ()))
    if then is None:
        return (f"found = {found}", f"array = similarity.cosine_similarity(found, found.at({pixel}))")
    there = call("features.feature_map", Verbatim("other"), then.index, asked.reference or asked.feature)
    return (f"found = {found}", f"array = similarity.cosine_similarity(found, {there}.at({pixel}))")


def _of_two(asked: Asked, moment: Described, then: Described | None) -> tuple[str, ...]:
    if asked.what == "curve":
        first, last = asked.windows or (0, 0)
        both = f"twin.twin(playback, {change_call(moment, 'playback')}, range({first}, {last + 1}))"
        of_pixel = asked.given("pixel")
        field = "at_pixel" if of_pixel else "mean_absolute"
        return (f"array = {call('twin.EffectCurve.of', Verbatim(both), **of_pixel)}.{field}",)
    if asked.what == "apart":
        both = f"(playback, {change_call(moment, 'playback')})"
        frames = f"original, changed = [each.at({moment.index}).frame for each in {both}]"
        if asked.quantity == "lpips":
            return (frames, "array = lpips.perceptual_distance(changed.clamp(0, 1), original.clamp(0, 1))")
        apart = "(changed - original)"
        return (
            frames,
            f"array = {apart}[0, 0]" if asked.quantity == "difference" else f"array = {apart}.square().mean()",
        )
    assert then is not None
    now = call("pins.pin", _PLAYBACK, moment.index, asked.pixel, asked.site, **asked.given("head", "direction"))
    held, other = asked.then, Verbatim("other")
    if held is None:
        before = call("pins.pin", other, then.index, asked.pixel, asked.site, **asked.given("head", "direction"))
    else:
        given = {"head": held.head, "direction": held.direction}
        before = call("pins.pin", other, then.index, held.pixel, held.site, **given)
    pinned = now, before
    return (f"array = {call('pins.difference', *map(Verbatim, pinned), **asked.given('floor'))}.log_ratio",)


def _of_one_playback(asked: Asked, index: int) -> tuple[str, ...]:
    first, last = asked.windows or (0, 0)
    pixel, span = asked.pixel, Verbatim(f"range({first}, {last + 1})")
    match asked.what:
        case "attribution":
            found = call("attribution.attribute", _PLAYBACK, index, pixel, **asked.given("num_back"))
            return (f"array = {found}.windows[{-1 - (asked.age or 0)}].weights",)
        case "occlusion":
            given = asked.given("num_back", "patch")
            return (f"array = {call('attribution.occlude', _PLAYBACK, index, pixel, **given)}.change",)
        case "gates":
            return (f"array = {call('gates.gates_at', _PLAYBACK, index, asked.level)}.{asked.quantity}",)
        case "norms":
            found = call("through_time.norms_through_time", _PLAYBACK, span)
            return (f"array = torch.stack([norms.{asked.quantity or 'hidden'} for _, norms in {found}])",)
        case "memory_depth":
            depths = tuple(asked.depths or ())
            return (f"array = {call('gates.memory_depth', _PLAYBACK, index, depths)}.differences",)
        case "path":
            recording, plan = Verbatim("playback.recording"), Verbatim("playback.windows")
            path = call("follow.follow", recording, plan, index, pixel, asked.until)
            return (f"array = list({path})",)
        case "masked":
            return (*_path(asked, index), *_masked(asked))
        case _:
            sites = frozenset({asked.site})
            query: object = pixel
            lines = _path(asked, index)
            if lines:  # the query goes along a followed path
                query, span = Verbatim("path"), Verbatim(f"[i for i in range({first}, {last + 1}) if i in path]")
            given = asked.given("region", "head", "near")
            found = call("through_time.attention_through_time", _PLAYBACK, query, span, sites, **given)
            return (*lines, f"array = through_time.Track.of({found}).{asked.quantity}")


def _path(asked: Asked, index: int) -> tuple[str, ...]:
    """The way of a patch that is followed, from the moment to both ends of the windows that are asked for."""
    if asked.until is None:
        return ()
    first = min((asked.windows or (index, 0))[0], index)
    ends = [end for end in dict.fromkeys((first, asked.until)) if end != index] or [index]
    recording, plan = Verbatim("playback.recording"), Verbatim("playback.windows")
    ways = [f"follow.pixels_of({call('follow.follow', recording, plan, index, asked.pixel, end)})" for end in ends]
    return (f"path = {' | '.join(ways)}",)


def _masked(asked: Asked) -> tuple[str, ...]:
    """What masking a head, or taking a site out, does to the pixel, window by window."""
    site, (first, last) = asked.site or "", asked.windows or (0, 0)
    if isinstance(asked.head, int):
        cut = Intervention(masked_heads=frozenset({(site, asked.head)}))
    else:
        cut = Intervention(removed_sites=frozenset({site}))
    x, y = asked.pixel or (0, 0)
    each, place = f"i in range({first}, {last + 1})", f"{y}, {x}"
    if asked.until is not None:
        each, place = f"{each} if i in path", "path[i][1], path[i][0]"
    apart = "playback.at(i, intervention=cut).frame - playback.at(i).frame"
    return (f"cut = {code(cut)}", f"array = torch.stack([({apart})[0, 0, {place}] for {each}])")
