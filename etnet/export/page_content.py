"""What a one-file page holds: small pictures, quantised events, attention of a grid of pixels, within a byte budget."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import UInt8, UInt32

from etnet.errors import EtnetError
from etnet.events.events import Events, Sensor
from etnet.export.images import to_uint8
from etnet.export.page_attention import AttentionSheets, query_pixels
from etnet.export.table import window_numbers
from etnet.export.take import IsCancelled, Moment, Progress, Take
from etnet.files import in_megabytes
from etnet.nets.attention import AttentionProbe
from etnet.nets.base import Reconstructor
from etnet.playback.playback import Playback
from etnet.reconstruction import window_voxel
from etnet.render.colours import GROUND, OFF, ON, diverge, diverging, hexadecimal, sequential
from etnet.render.encode import webp
from etnet.render.voxels import signed_max_pool, voxel_limit
from etnet.windows import BetweenFrames, ByActivity, ByCount, ByCountOrDuration, ByDensity, ByDuration, ByStamps, Policy

MOST_EVENTS = 4000
"""Events a window that a page shows at most; more do not look denser on a screen."""
FEWEST_EVENTS = 300
ATTENTION_SHARE = 0.5
"""Of what pictures and voxels leave, at most so much goes to attention; events get the rest."""
VOXEL_STEPS = 15
"""Levels on either side of zero in the voxel pictures: as many as the eye tells apart, and small files."""
VOXEL_WIDTH = 160
"""Pixels: a bin's picture is at most so wide; on a screen five of them share a panel."""
VOXEL_BYTES = 0.16
"""Bytes that one pixel of a voxel picture takes, measured on slider_depth: decides their size in a tight budget."""
PICTURE_QUALITY = 82
_ENCODED = 4 / 3
"""Base64."""
_OWN_BYTES = 120_000
"""The page's own text, scripts and numbers, generously."""


@dataclass(frozen=True, slots=True)
class PageConfig:
    """How a page is made. `query_grid` is (columns, rows) of pixels whose attention it holds."""

    title: str
    query_grid: tuple[int, int] = (6, 4)
    budget_bytes: int = 15_000_000
    gamma: float = 1.0

    def __post_init__(self) -> None:
        if not (1 <= self.query_grid[0] <= 16 and 1 <= self.query_grid[1] <= 16):
            raise EtnetError(f"the grid of query pixels is {self.query_grid}; it takes 1 … 16 columns and rows")
        if self.budget_bytes < 1_000_000:
            raise EtnetError(f"a page of {in_megabytes(self.budget_bytes)} is too small; allow at least 1 MB")


@dataclass(frozen=True, slots=True)
class Content:
    """Facts that go in as JSON, and one block of bytes: the streams of `facts["streams"]` one after the other."""

    facts: dict[str, Any]
    data: bytes


@dataclass
class _Gathered:
    """What the moments gave, before the budget is shared out."""

    lanes: list[list[bytes]] = field(default_factory=list)
    camera: list[bytes] = field(default_factory=list)
    voxels: list[bytes] = field(default_factory=list)
    events: list[UInt32[np.ndarray, " n"]] = field(default_factory=list)
    limits: list[float] = field(default_factory=list)
    numbers: list[dict[str, float | int | None]] = field(default_factory=list)
    picture_bytes: int = 0
    """What lanes, camera and voxels take."""

    def keep(self, pictures: list[bytes], picture: bytes) -> None:
        """One more picture, in one of the lists above."""
        pictures.append(picture)
        self.picture_bytes += len(picture)


def gather(
    take: Take,
    policy: Policy,
    config: PageConfig,
    other_models: Sequence[Reconstructor] = (),
    progress: Progress | None = None,
    is_cancelled: IsCancelled | None = None,
) -> Content:
    """Render the take, under each model, and pack it into `config.budget_bytes`.

    Raises:
        EtnetError: it does not fit, said as soon as that is known.
    """
    steps = len(take) * (1 + len(other_models))
    room = int(config.budget_bytes / _ENCODED) - _OWN_BYTES - 60 * len(take)
    got = _Gathered()
    _check_room(take, config, got, room)
    factor = _voxel_factor(take, room / len(take))
    sheets = AttentionSheets(query_pixels(take.recording.sensor, config.query_grid))
    own: list[bytes] = []
    for moment in take.moments(AttentionProbe(), _shifted(progress, 0, steps), is_cancelled):
        got.keep(own, _grey(moment.frame, config.gamma))
        if moment.camera is not None:
            got.keep(got.camera, _grey(moment.camera, config.gamma))
        voxel, limit = _voxel_picture(take, moment, factor)
        got.keep(got.voxels, voxel)
        _check_room(take, config, got, room)
        got.limits.append(limit)
        got.events.append(pack_events(thinned(moment.events, MOST_EVENTS), moment.window.t_start, moment.window.t_stop))
        got.numbers.append(window_numbers(moment))
        sheets.add(moment.step.attention)
    got.lanes.append(own)
    for place, model in enumerate(other_models, start=1):
        other = Take(Playback(model, take.recording, take.playback.windows, 64 << 20), take.start, take.stop)
        told = _shifted(progress, place * len(take), steps)
        lane: list[bytes] = []
        for moment in other.moments(None, told, is_cancelled):
            got.keep(lane, _grey(moment.frame, config.gamma))
            _check_room(take, config, got, room)
        got.lanes.append(lane)
    return _packed(take, policy, config, other_models, got, sheets, room, factor)


def _check_room(take: Take, config: PageConfig, got: _Gathered, room: int) -> None:
    """An error once the pictures so far leave no room for a few events of each window."""
    if room - got.picture_bytes >= 4 * FEWEST_EVENTS * len(take):
        return
    num_done = len(got.voxels)
    taken = f" (the pictures of the first {num_done:,} take {in_megabytes(round(got.picture_bytes * _ENCODED))})"
    raise EtnetError(
        f"{take.recording.name}: {len(take):,} windows do not fit in {in_megabytes(config.budget_bytes)}"
        f"{taken if num_done else ''}; take a shorter --range or allow more --megabytes"
    )


def _packed(
    take: Take,
    policy: Policy,
    config: PageConfig,
    other_models: Sequence[Reconstructor],
    got: _Gathered,
    sheets: AttentionSheets,
    room: int,
    factor: int,
) -> Content:
    left = room - got.picture_bytes
    attention, about_attention = sheets.encoded(left * ATTENTION_SHARE)
    each = max((left - sum(map(len, attention))) // (4 * len(take)), FEWEST_EVENTS)
    events = [packed[_spread(len(packed), each)] for packed in got.events]
    streams: dict[str, list[bytes]] = {f"lane{i}": lane for i, lane in enumerate(got.lanes)}
    streams |= {"camera": got.camera, "voxels": got.voxels, "attention": attention}
    streams["events"] = [packed.astype("<u4").tobytes() for packed in events]
    facts = _facts(take, policy, config, other_models, got)
    facts["attention"] = about_attention
    facts["voxels"] = {"bins": take.playback.model.bins, "factor": factor, "limits": [round(v, 3) for v in got.limits]}
    facts["streams"] = [[name, [len(part) for part in parts]] for name, parts in streams.items()]
    return Content(facts, b"".join(part for parts in streams.values() for part in parts))


def _facts(
    take: Take, policy: Policy, config: PageConfig, other_models: Sequence[Reconstructor], got: _Gathered
) -> dict[str, Any]:
    recording, sensor = take.recording, take.recording.sensor
    windows = take.windows
    models: list[Any] = [take.playback.model, *other_models]
    return {
        "title": config.title,
        "recording": recording.name,
        "format": recording.format,
        "sensor": [sensor.width, sensor.height],
        "policy": policy_words(policy),
        "lanes": [str(getattr(model, "card", {}).get("title", model.name)) for model in models],
        "windows": [window.index for window in windows],
        "starts": [window.t_start - recording.span.start for window in windows],
        "stops": [window.t_stop - recording.span.start for window in windows],
        "counts": [window.num_events for window in windows],
        "rates": [round(float(numbers["events_per_second"] or 0)) for numbers in got.numbers],
        "ssim": [None if (v := numbers["ssim"]) is None else round(float(v), 3) for numbers in got.numbers],
        "hasCamera": len(got.camera) == len(windows),
        "eventShift": event_shift(sensor),
        "colours": {
            "on": ON,
            "off": OFF,
            "ground": GROUND,
            "attention": [hexadecimal(_triple(row)) for row in sequential()[::32]],
            "voxels": [hexadecimal(_triple(row)) for row in diverging()[:: len(diverging()) // 12]],
        },
    }


def event_shift(sensor: Sensor) -> int:
    """Bits that pixels are shifted right so that x and y fit 11 bits; 0 up to 2048 × 2048."""
    return max(0, math.ceil(math.log2(max(sensor.width, sensor.height) / 2048)))


def pack_events(events: Events, t_start: int, t_stop: int) -> UInt32[np.ndarray, " n"]:
    """One word an event: x (11 bits, high), y (11), time within the window (9), polarity (1, low)."""
    shift = event_shift(events.sensor)
    share = (events.t - t_start) / max(t_stop - t_start, 1)
    time = np.clip(share * 512, 0, 511).astype(np.uint32)
    x, y = (column.astype(np.uint32) >> np.uint32(shift) for column in (events.x, events.y))
    return (x << 21) | (y << 10) | (time << 1) | (events.p > 0)


def thinned(events: Events, most: int) -> Events:
    """At most `most` of the events, spread evenly over them."""
    kept = _spread(len(events), most)
    return Events(events.x[kept], events.y[kept], events.t[kept], events.p[kept], events.sensor)


def _spread(length: int, most: int) -> np.ndarray:
    """Indices of at most `most` of `length`, one from each of `most` equal parts.

    Which one runs through the golden ratio: regular steps would beat against a sensor's readout by rows.
    """
    if length <= most:
        return np.arange(length)
    places = np.arange(most)
    return ((places + (places * 0.618033988749895) % 1) * (length / most)).astype(np.int64)


def policy_words(policy: Policy) -> str:
    """How the events are cut into windows, in plain words."""
    match policy:
        case BetweenFrames():
            return "one image for each frame of the camera"
        case ByCount(num_events):
            return f"one image every {num_events:,} events"
        case ByDensity(events_per_pixel):
            return f"one image every {events_per_pixel:g} events per pixel"
        case ByDuration():
            return f"one image every {policy.step / 1000:g} ms"
        case ByCountOrDuration(num_events, duration):
            return f"one image every {num_events:,} events, at the latest after {duration / 1000:g} ms"
        case ByActivity(active_pixels):
            return f"one image each time {active_pixels:.0%} of the pixels have had an event"
        case ByStamps(stamps):
            return f"one image at each of {len(stamps):,} given moments"


def _voxel_factor(take: Take, bytes_per_window: float) -> int:
    """By how much voxel pictures shrink, so that they take at most a third of what a window may take."""
    sensor = take.recording.sensor
    pixels = take.playback.model.bins * sensor.num_pixels
    for_budget = math.sqrt(pixels * VOXEL_BYTES / (bytes_per_window / 3))
    return math.ceil(max(1.0, for_budget, sensor.width / VOXEL_WIDTH))


def _voxel_picture(take: Take, moment: Moment, factor: int) -> tuple[bytes, float]:
    """All bins side by side, and the magnitude at which their colours end."""
    grid = window_voxel(take.playback.model, take.recording, moment.window).numpy()
    limit = voxel_limit(grid)
    pooled = signed_max_pool(grid, factor)
    # A faint value keeps the first step: an event must not vanish in rounding.
    steps = np.sign(pooled) * np.ceil(np.clip(np.abs(pooled) / limit, 0, 1) * VOXEL_STEPS - 0.25)
    colours: UInt8[np.ndarray, "n h w 3"] = diverge(steps, VOXEL_STEPS)
    return webp(np.concatenate(list(colours), axis=1), None), limit


def _grey(frame: np.ndarray, gamma: float) -> bytes:
    return webp(to_uint8(frame, gamma), PICTURE_QUALITY)


def _shifted(progress: Progress | None, before: int, total: int) -> Progress | None:
    return None if progress is None else lambda done, _: progress(before + done, total)


def _triple(row: np.ndarray) -> tuple[int, int, int]:
    return int(row[0]), int(row[1]), int(row[2])
