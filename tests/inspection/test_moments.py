"""Moments against moments: pins keep their window and run, ratios are signed, a patch is followed along its events."""

import numpy as np
import pytest
import torch

from etnet.errors import Cancelled, ModelError
from etnet.events.events import Events, Sensor
from etnet.events.recording import Recording, recording_of_events
from etnet.inspection.follow import follow, pixels_of
from etnet.inspection.mass import Region
from etnet.inspection.pins import FLOOR, difference, pin
from etnet.inspection.through_time import Track, attention_through_time
from etnet.nets.attention import AttentionProbe
from etnet.nets.padding import TokenGrid
from etnet.nets.presets import build_model
from etnet.playback.playback import Playback
from etnet.windows import ByDuration, plan_windows
from tests.inspection.small import small_playback

PIXEL, SITE = (20, 9), "scale1.decoder.0.cross"


def test_local_mass_goes_with_the_path_and_is_that_of_the_region_around_each_place():
    playback, near = small_playback(), 5
    path = {2: (6, 4), 3: (20, 9), 4: (33, 18)}
    went = Track.of(attention_through_time(playback, path, sorted(path), frozenset({SITE}), near=near))
    for place, (index, pixel) in enumerate(path.items()):
        square = Region(pixel[0] - near, pixel[1] - near, pixel[0] + near + 1, pixel[1] + near + 1)
        alone = next(attention_through_time(playback, pixel, [index], frozenset({SITE}), square))
        assert torch.equal(went.mass[place], alone.mass)
    with pytest.raises(ValueError, match="or a region"):
        next(attention_through_time(playback, PIXEL, [2], region=Region(0, 0, 4, 4), near=near))


def test_a_pin_keeps_its_moment_whatever_is_looked_at_afterwards():
    playback = small_playback()
    kept = pin(playback, 2, PIXEL, SITE, head=1)
    attention = playback.at(2, AttentionProbe()).attention
    playback.at(7)
    assert attention is not None
    assert (kept.index, kept.t, kept.model) == (2, playback.windows[2].t_stop, "etnet")
    assert torch.equal(kept.map, attention.rows(SITE, [kept.token])[1, 0])
    assert torch.equal(kept.frame, playback.at(2).frame[0, 0])
    read_by = pin(playback, 2, PIXEL, SITE, direction="attended by")
    assert torch.equal(read_by.map, attention.columns(SITE, [kept.token])[..., 0].mean(0))
    assert str(kept) == "etnet · events · window 2 · scale1.decoder.0.cross, head 1, attends to"


def test_now_less_then_is_a_signed_log_ratio_that_swaps_sign_with_the_moments():
    playback = small_playback()
    now, then = (pin(playback, index, PIXEL, SITE) for index in (6, 2))
    found = difference(now, then)
    assert torch.equal(found.difference, now.map - then.map)
    torch.testing.assert_close(found.log_ratio, torch.log2(now.map / then.map), atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(difference(then, now).log_ratio, -found.log_ratio)
    assert not difference(now, now).log_ratio.any()
    other = Playback(build_model("etnet-half"), playback.recording, playback.windows)
    assert difference(now, pin(other, 6, PIXEL, SITE)).log_ratio.any()


def test_one_extreme_token_neither_rules_the_range_nor_divides_by_zero():
    now = pin(small_playback(), 6, PIXEL, SITE)
    grid = TokenGrid(240, 320)
    flat = torch.full((grid.num_tokens,), 1 / grid.num_tokens)
    spiked, empty = 1.5 * flat, flat.clone()
    spiked[3], empty[5] = 1.0, 0.0
    then, now = (_with_map(now, map_, grid) for map_ in (flat, spiked))
    found = difference(now, then)
    assert found.limit == pytest.approx(np.log2(1.5), rel=1e-4)
    assert found.num_clipped == 1
    assert float(difference(_with_map(now, empty, grid), then).log_ratio[5]) == pytest.approx(np.log2(FLOOR))
    with pytest.raises(ModelError, match="same sensor size"):
        difference(now, pin(small_playback(), 6, PIXEL, SITE))


def _with_map(kept, map_: torch.Tensor, grid: TokenGrid):
    import dataclasses

    return dataclasses.replace(kept, map=map_, grid=grid)


def _moving(speed: tuple[float, float], num_windows: int = 8) -> Recording:
    """Fifteen dots that move `speed` pixels a window of 10 ms over still noise, from around (40, 40)."""
    rng = np.random.default_rng(3)
    dots = rng.uniform(-14, 14, (15, 2))
    t = np.sort(rng.integers(0, num_windows * 10_000, 60 * 10 * num_windows))
    which = rng.integers(0, len(dots), len(t))
    place = 40 + dots[which] + np.outer(t / 10_000, speed)
    noise = rng.random(len(t)) < 0.1
    place[noise] = rng.uniform(0, 96, (noise.sum(), 2))
    x, y = np.rint(place).clip(0, 95).astype(np.uint16).T
    return recording_of_events(Events(x, y, t, rng.choice([-1, 1], len(t)).astype(np.int8), Sensor(96, 96)))


@pytest.mark.parametrize("speed", [(3.0, 1.5), (-4.0, 2.0), (0.0, 0.0)])
def test_a_patch_is_followed_forwards_and_backwards(speed: tuple[float, float]):
    recording = _moving(speed)
    windows = plan_windows(recording, ByDuration(10_000))
    start = tuple(round(40 + 3 * v) for v in speed)
    there = list(follow(recording, windows, 2, start, 6))
    assert [place.index for place in there] == [2, 3, 4, 5, 6]
    for place in there:
        assert (place.x, place.y) == pytest.approx([40 + (place.index + 1) * v for v in speed], abs=1.5)
    back = list(follow(recording, windows, 6, there[-1].pixel, 2))
    assert (back[-1].x, back[-1].y) == pytest.approx(start, abs=2)
    if any(speed):
        assert there[1].sharpness > 1.15
        assert there[1].num_events > 100


def test_a_path_ends_at_the_edge_and_stays_where_nothing_happens():
    recording = _moving((12.0, 0.0))
    windows = plan_windows(recording, ByDuration(10_000))
    assert len(list(follow(recording, windows, 2, (76, 40), 7))) < 6
    (place,) = list(follow(recording, windows, 0, (90, 2), 1, radius=4))[1:]
    assert (place.moved, place.sharpness) == ((0.0, 0.0), 1.0)
    with pytest.raises(Cancelled, match="this path"):
        list(follow(recording, windows, 0, (40, 40), 5, cancelled=lambda: True))


def test_a_track_goes_along_a_followed_path():
    playback = small_playback()
    path = pixels_of(follow(playback.recording, playback.windows, 3, PIXEL, 6))
    track = Track.of(attention_through_time(playback, path, sorted(path), frozenset({SITE})))
    assert track.pixels.tolist() == [list(path[index]) for index in sorted(path)]
