"""Copy as Python: every inspector's snippet has ten lines at most and gives the library's array to the last digit."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import torch

from etnet.errors import ModelError
from etnet.evaluation import lpips
from etnet.events.assumptions import Assumptions
from etnet.events.denoise import Cleaning, cleaned
from etnet.events.edit import EventEdit
from etnet.events.events import Sensor
from etnet.events.open import open_recording
from etnet.events.opened_as import OpenedAs, View
from etnet.inspection import (
    atlas,
    attribution,
    basis,
    causal_search,
    entropy,
    features,
    follow,
    gates,
    importance,
    input,
    links,
    mass,
    pins,
    rollout,
    similarity,
    sources,
    through_time,
    twin,
    uncertainty,
)
from etnet.inspection.as_python import LINES, Described, as_python
from etnet.inspection.asked import NEEDED, Asked, OneMap, What
from etnet.nets.attention import Attention, AttentionProbe
from etnet.nets.intervention import Intervention
from etnet.nets.presets import build_model
from etnet.nets.runtime import apply_runtime, default_runtime
from etnet.nets.weights import load_model, save_weights
from etnet.playback.playback import Playback
from etnet.windows import ByCount, ByDensity, from_window, plan_windows
from tests.inspection.small import SENSOR
from tests.strategies import make_events

INDEX, PIXEL, TOKEN, SITE = 4, (20, 9), 7, "scale1.decoder.0.cross"
FEATURE = features.Feature("key", SITE, head=1)
REGION = mass.Region(0, 0, 16, 21)
LEVELS = frozenset({1, 2})
CUT = Intervention(uniform_attention=True)
CHANGE = Intervention(zeroed_levels=LEVELS, masked_heads=frozenset({(SITE, 1), ("scale1.encoder.0.self", 0)}))
EDIT = EventEdit(drop=0.2, seed=3)


def write_text(file: Path, num_events: int, sensor: Sensor) -> None:
    """Eight windows of so many events, as text."""
    events = make_events(8 * num_events, sensor)
    rows = [f"{t / 1e6:.6f} {x} {y} {int(p > 0)}"
            for t, x, y, p in zip(events.t, events.x, events.y, events.p, strict=True)]  # fmt: skip
    file.write_text(f"{sensor.width} {sensor.height}\n" + "\n".join(rows) + "\n")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """A text recording with 8 windows of 150 events, and weights."""
    folder = tmp_path_factory.mktemp("moment")
    write_text(folder / "made up.txt", 150, SENSOR)
    save_weights(build_model("tiny"), folder / "tiny.safetensors", dtype=None)
    return str(folder / "made up.txt"), str(folder / "tiny.safetensors")


@pytest.fixture(scope="module")
def moment(files: tuple[str, str]) -> Described:
    return Described(*files, ByCount(150), INDEX)


@pytest.fixture(scope="module")
def playback(files: tuple[str, str]) -> Playback:
    recording = open_recording(files[0])
    return Playback(load_model(files[1]), recording, plan_windows(recording, ByCount(150)))


def run(text: str) -> object:
    """The array that a snippet ends with."""
    assert len(text.splitlines()) <= LINES, text
    names: dict[str, object] = {}
    exec(text, names)
    return names["array"]


def same(one: object, other: object) -> bool:
    """Equal to the last bit, arrays and values alike."""
    if isinstance(one, torch.Tensor):
        return isinstance(other, torch.Tensor) and torch.equal(one, other)
    if isinstance(one, np.ndarray):
        return isinstance(other, np.ndarray) and bool((one == other).all())
    return one == other


def observed(playback: Playback) -> Attention:
    attention = playback.at(INDEX, AttentionProbe(values=True)).attention
    assert attention is not None
    return attention


@dataclass(frozen=True)
class Case:
    """A question, and the library's own answer."""

    asked: Asked
    answer: Callable[[Playback], object]


def last(results):
    *_, found = results
    return found


def path_of(p: Playback) -> list[follow.Place]:
    return list(follow.follow(p.recording, p.windows, INDEX, PIXEL, 6))


def effect_of(p: Playback, name: str) -> torch.Tensor:
    return next(effect for effect in importance.effects(p, INDEX) if effect.ablation.name == name).difference


def track_of(p: Playback, query, windows, **given) -> through_time.Track:
    moments = through_time.attention_through_time(p, query, windows, frozenset({SITE}), **given)
    return through_time.Track.of(moments)


def both_ways(p: Playback, *ends: int) -> dict[int, tuple[int, int]]:
    ways = [follow.pixels_of(follow.follow(p.recording, p.windows, INDEX, PIXEL, end)) for end in ends]
    return {index: pixel for way in ways for index, pixel in way.items()}


def masked_over(p: Playback, path: dict[int, tuple[int, int]]) -> torch.Tensor:
    cut = Intervention(masked_heads=frozenset({(SITE, 1)}))
    apart = {i: (p.at(i, intervention=cut).frame - p.at(i).frame)[0, 0] for i in path}
    return torch.stack([apart[i][path[i][1], path[i][0]] for i in sorted(path)])


CASES = [
    Case(Asked("frame"), lambda p: p.at(INDEX).frame[0, 0]),
    Case(Asked("voxel"), lambda p: input.network_input(p, INDEX).voxel),
    Case(Asked("map", site=SITE, token=TOKEN), lambda p: observed(p).rows(SITE, [TOKEN])[:, 0]),
    Case(Asked("map", site=SITE, token=TOKEN, head=2), lambda p: observed(p).rows(SITE, [TOKEN])[2, 0]),
    Case(
        Asked("map", site=SITE, token=TOKEN, head="mean", direction="attended by"),
        lambda p: observed(p).columns(SITE, [TOKEN])[..., 0].mean(0),
    ),
    Case(
        Asked("numbers", site=SITE, token=TOKEN, quantity="distance"),
        lambda p: entropy.map_numbers(observed(p).rows(SITE, [TOKEN]), observed(p).grid, [TOKEN]).distance,
    ),
    Case(
        Asked("numbers", site=SITE, token=TOKEN, quantity="entropy", head="mean"),
        lambda p: entropy.head_entropies(observed(p).rows(SITE, [TOKEN])).of_mean_map[None],
    ),
    Case(
        Asked("value_weighted", site=SITE, token=TOKEN),
        lambda p: mass.value_weighted(observed(p), SITE, [TOKEN]).by_head,
    ),
    Case(Asked("received", site=SITE), lambda p: mass.received(observed(p), SITE).times_uniform),
    Case(Asked("rollout", token=TOKEN), lambda p: rollout.rollout(observed(p), TOKEN).weights),
    Case(
        Asked("rollout", token=TOKEN, discard=0.3, head="max"),
        lambda p: rollout.rollout(observed(p), TOKEN, 0.3, fusion="max").weights,
    ),
    Case(Asked("links", token=TOKEN, count=5), lambda p: links.strongest_links(observed(p), TOKEN, 5)),
    Case(Asked("effect", part="scale 2"), lambda p: effect_of(p, "scale 2")),
    Case(Asked("atlas"), lambda p: last(atlas.head_atlas(p, INDEX)).on_image),
    Case(Asked("atlas", pixel=PIXEL), lambda p: last(atlas.head_atlas(p, INDEX)).on_pixel(*PIXEL)),
    Case(Asked("feature", feature=FEATURE), lambda p: features.feature_map(p, INDEX, FEATURE).values),
    Case(
        Asked("colours", feature=FEATURE, centre="place"),
        lambda p: basis.fit_basis_to_recording(p, FEATURE, centre="place").colours(
            features.feature_map(p, INDEX, FEATURE)
        ),
    ),
    Case(
        Asked("similarity", feature=FEATURE, pixel=PIXEL),
        lambda p: similarity.cosine_similarity(
            features.feature_map(p, INDEX, FEATURE), features.feature_map(p, INDEX, FEATURE).at(*PIXEL)
        ),
    ),
    Case(Asked("path", pixel=PIXEL, until=6), path_of),
    Case(
        Asked("track", pixel=PIXEL, site=SITE, windows=(2, 5), quantity="mass", region=REGION, head="mean"),
        lambda p: track_of(p, PIXEL, range(2, 6), region=REGION, head="mean").mass,
    ),
    Case(
        Asked("track", pixel=PIXEL, site=SITE, windows=(4, 6), quantity="along_row", until=6),
        lambda p: track_of(p, follow.pixels_of(path_of(p)), range(4, 7)).along_row,
    ),
    Case(
        Asked("track", pixel=PIXEL, site=SITE, windows=(2, 6), quantity="entropy", until=6),
        lambda p: track_of(p, both_ways(p, 2, 6), range(2, 7)).entropy,
    ),
    Case(
        Asked("masked", pixel=PIXEL, site=SITE, windows=(3, 5), head=1),
        lambda p: masked_over(p, dict.fromkeys((3, 4, 5), PIXEL)),
    ),
    Case(
        Asked("masked", pixel=PIXEL, site=SITE, windows=(2, 6), head=1, until=6),
        lambda p: masked_over(p, both_ways(p, 2, 6)),
    ),
    Case(
        Asked("track", pixel=PIXEL, site=SITE, windows=(2, 3), quantity="entropy", until=3),
        lambda p: track_of(p, both_ways(p, 2, 3), range(2, 4)).entropy,  # the path begins after the windows
    ),
    Case(
        Asked("masked", pixel=PIXEL, site=SITE, windows=(5, 6), head=1, until=6),
        lambda p: masked_over(p, {i: at for i, at in both_ways(p, 6).items() if i > INDEX}),
    ),
    Case(
        Asked("attribution", pixel=PIXEL, num_back=1),
        lambda p: attribution.attribute(p, INDEX, PIXEL, 1).windows[-1].weights,
    ),
    Case(Asked("occlusion", pixel=PIXEL, patch=8), lambda p: attribution.occlude(p, INDEX, PIXEL, patch=8).change),
    Case(Asked("gates", level=2, quantity="forget"), lambda p: gates.gates_at(p, INDEX, 2).forget),
    Case(
        Asked("norms", windows=(2, 4)),
        lambda p: torch.stack([n.hidden for _, n in through_time.norms_through_time(p, range(2, 5))]),
    ),
    Case(
        Asked("norms", windows=(2, 4), quantity="cell"),
        lambda p: torch.stack([n.cell for _, n in through_time.norms_through_time(p, range(2, 5))]),
    ),
    Case(
        Asked("attribution", pixel=PIXEL, num_back=1, age=1),
        lambda p: attribution.attribute(p, INDEX, PIXEL, 1).windows[-2].weights,
    ),
    Case(Asked("table", token=TOKEN, quantity="distance"), lambda p: atlas.head_table(observed(p), TOKEN).distance),
    Case(Asked("sinks", site=SITE), lambda p: mass.received(observed(p), SITE).sinks()),
    Case(
        Asked("sinks", site=SITE, token=TOKEN),
        lambda p: (observed(p).rows(SITE, [TOKEN])[:, 0] * mass.received(observed(p), SITE).sinks()).sum(-1),
    ),
    Case(
        Asked("padding", site=SITE, token=TOKEN),
        lambda p: mass.mass_on(observed(p).rows(SITE, [TOKEN])[:, 0].mean(0), mass.padding_shares(observed(p).grid)),
    ),
    Case(
        Asked("without", cut=CUT),
        lambda p: (p.at(INDEX, intervention=CUT).frame - p.at(INDEX).frame)[0, 0],
    ),
    Case(Asked("memory_depth", depths=(0, 2)), lambda p: gates.memory_depth(p, INDEX, (0, 2)).differences),
    Case(
        Asked("cause", pixel=PIXEL, levels=LEVELS, tolerance=1e-4, furthest=3),
        lambda p: last(causal_search.search_cause(p, INDEX, PIXEL, LEVELS, 1e-4, furthest=3)).trials,
    ),
    Case(Asked("sources", pixel=PIXEL), lambda p: last(sources.pixel_sources(p, INDEX, PIXEL)).parts),
    Case(
        Asked("spread", drop=0.3, num_seeds=2, num_back=1),
        lambda p: last(uncertainty.dropout_spread(p, INDEX, 0.3, 2, 1)).deviation,
    ),
    Case(Asked("error"), lambda p: uncertainty.camera_error(p, INDEX, p.at(INDEX).frame[0, 0])),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.asked.what)
def test_a_snippet_gives_the_array_to_the_last_digit(case: Case, moment: Described, playback: Playback):
    assert same(run(as_python(moment, case.asked)), case.answer(playback))


# The change is made in the lines that all share; the slowest are left at that.
FAST = [case for case in CASES if case.asked.what not in ("cause", "spread", "memory_depth", "colours", "occlusion")]


@pytest.mark.parametrize("case", FAST, ids=lambda case: case.asked.what)
def test_a_snippet_of_a_changed_network_has_the_change(case: Case, moment: Described, playback: Playback):
    changed = replace(moment, intervention=CHANGE, edit=EDIT, since=2)
    branch = playback.branch(2, CHANGE, EDIT)
    assert same(run(as_python(changed, case.asked)), case.answer(branch))


def test_two_moments_are_compared_as_the_library_does(moment: Described, playback: Playback):
    before = replace(moment, index=1, intervention=CHANGE, once=True)
    once = twin.changed(playback, 1, CHANGE, once=True)
    asked = Asked("map_difference", site=SITE, pixel=PIXEL, head=3)
    pair = pins.pin(playback, INDEX, PIXEL, SITE, 3), pins.pin(once, 1, PIXEL, SITE, 3)
    assert same(run(as_python(moment, asked, before)), pins.difference(*pair).log_ratio)
    likeness = Asked("similarity", feature=FEATURE, pixel=PIXEL)
    reference = features.feature_map(once, 1, FEATURE).at(*PIXEL)
    expected = similarity.cosine_similarity(features.feature_map(playback, INDEX, FEATURE), reference)
    assert same(run(as_python(moment, likeness, before)), expected)
    with pytest.raises(ModelError, match="two moments"):
        as_python(moment, asked)


def test_each_of_two_maps_has_its_own_query_site_head_and_direction(moment: Described, playback: Playback):
    before = replace(moment, index=1)
    held = OneMap((3, 15), "scale2.encoder.0.self", 1, "attended by")
    asked = Asked("map_difference", site=SITE, pixel=PIXEL, head="max", then=held)
    now = pins.pin(playback, INDEX, PIXEL, SITE, "max")
    then = pins.pin(playback, 1, held.pixel, held.site, held.head, held.direction)
    assert same(run(as_python(moment, asked, before)), pins.difference(now, then).log_ratio)
    other = features.Feature("key", held.site)
    likeness = Asked("similarity", feature=features.Feature("key", SITE), pixel=PIXEL, reference=other)
    reference = features.feature_map(playback, 1, other).at(*PIXEL)
    expected = similarity.cosine_similarity(
        features.feature_map(playback, INDEX, features.Feature("key", SITE)), reference
    )
    assert same(run(as_python(moment, likeness, before)), expected)


@pytest.mark.parametrize("quantity", ["mse", "lpips", "difference"])
def test_how_far_a_change_moves_a_frame_is_told_of_both_frames(quantity: str, tmp_path: Path):
    write_text(tmp_path / "large.txt", 600, Sensor(80, 72))  # LPIPS wants so many pixels a side
    save_weights(build_model("tiny"), tmp_path / "tiny.safetensors", dtype=None)
    files = str(tmp_path / "large.txt"), str(tmp_path / "tiny.safetensors")
    described = Described(*files, ByCount(600), INDEX, intervention=CHANGE, since=2)
    found = open_recording(files[0])
    playback = Playback(load_model(files[1]), found, plan_windows(found, ByCount(600)))
    changed, original = playback.branch(2, CHANGE).at(INDEX).frame, playback.at(INDEX).frame
    expected = (changed - original).square().mean()
    if quantity == "difference":
        expected = (changed - original)[0, 0]
    if quantity == "lpips":
        expected = lpips.perceptual_distance(changed.clamp(0, 1), original.clamp(0, 1))
    assert same(run(as_python(described, Asked("apart", quantity=quantity))), expected)


@pytest.mark.parametrize("once", [False, True])
@pytest.mark.parametrize("pixel", [None, PIXEL])
def test_the_curve_of_a_change_is_that_of_both_playbacks(
    once: bool, pixel: tuple[int, int] | None, moment: Described, playback: Playback
):
    described = replace(moment, intervention=CHANGE, since=2, once=once)
    moments = twin.twin(playback, twin.changed(playback, 2, CHANGE, once=once), range(2, 6))
    curve = twin.EffectCurve.of(moments, pixel)
    expected = curve.mean_absolute if pixel is None else curve.at_pixel
    assert same(run(as_python(described, Asked("curve", windows=(2, 5), pixel=pixel))), expected)


def test_every_question_is_tried_here():
    assert (
        {case.asked.what for case in CASES} | {"map_difference", "curve", "apart"} == set(get_args(What)) == set(NEEDED)
    )


def test_all_that_decides_the_bits_is_in_ten_lines(files: tuple[str, str]):
    opened = OpenedAs(Assumptions(time_unit="s"), View(flip="horizontal"))
    everything = Described(
        *files, ByDensity(0.1), 3, opened, Cleaning(hot_pixels=True, support_within=40_000), 2, "bf16", "cpu",
        torch.get_num_threads(), CHANGE, EDIT, 1, once=True,
    )  # fmt: skip
    recording = open_recording(files[0], assume=opened.assumed, view=opened.view)
    recording = cleaned(recording, everything.cleaning)
    model = load_model(files[1])
    apply_runtime(model, default_runtime("bf16", "cpu"))
    whole = Playback(model, recording, from_window(plan_windows(recording, ByDensity(0.1)), 2))
    changed = twin.changed(whole, 1, CHANGE, EDIT, once=True)
    attention = changed.at(3, AttentionProbe(values=True)).attention
    assert attention is not None
    text = as_python(everything, Asked("value_weighted", site=SITE, token=TOKEN))
    assert same(run(text), mass.value_weighted(attention, SITE, [TOKEN]).by_head)
    assert same(run(as_python(everything, Asked("frame"))), changed.at(3).frame[0, 0])


def test_a_network_of_ones_own_is_named_by_its_file(tmp_path: Path, files: tuple[str, str]):
    own = tmp_path / "mine.py"
    own.write_text(
        "import torch\nfrom etnet.nets.adapter import Adapter\n"
        "network = Adapter(lambda voxel, memory: (voxel.sum(1, keepdim=True), ()), name='mine')\n"
    )
    array = run(as_python(Described(files[0], str(own), ByCount(150), INDEX), Asked("frame")))
    assert isinstance(array, torch.Tensor)
    voxel = run(as_python(Described(*files, ByCount(150), INDEX), Asked("voxel")))
    assert isinstance(voxel, torch.Tensor)
    assert torch.equal(array, voxel.sum(0))


def test_questions_without_what_they_need_are_refused():
    with pytest.raises(ModelError, match="'map' is asked with no site and no token"):
        Asked("map")
