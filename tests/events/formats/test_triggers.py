"""Edges on a camera's trigger inputs come out of every format that holds them: stamp, input, edge."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from etnet.events.formats.prophesee import raw as prophesee
from etnet.events.open import open_recording

Edge = tuple[int, int, int]
"""t in µs, input, +1 or −1."""

EVENTS = [(1000 * i, i % 60, i % 30, i % 2) for i in range(40)]
EDGES: list[Edge] = [(500, 0, 1), (7_000, 0, -1), (7_000, 3, 1), (39_500, 1, 1)]
PERIODS = {"2.0": 1 << 34, "2.1": 1 << 34, "3.0": 1 << 24}


def raw_words(version: str, events: Sequence[tuple[int, int, int, int]], edges: Sequence[Edge]) -> bytes:
    """Time words before each event and trigger, all in the order of time."""
    rows = [(t, 0, x, y, p) for t, x, y, p in events] + [(t, 1, channel, edge, 0) for t, channel, edge in edges]
    words: list[int] = []
    for t, is_edge, a, b, p in sorted(rows):
        rising = int(b > 0)
        if version == "2.0":
            low = (t & 63) << 22
            words += [0x8 << 28 | (t >> 6) & 0xFFFFFFF]
            words += [0xA << 28 | low | a << 8 | rising if is_edge else p << 28 | low | a << 11 | b]
        elif version == "2.1":
            low = (t & 63) << 54
            words += [0x8 << 60 | ((t >> 6) & 0xFFFFFFF) << 32]
            pixel = p << 60 | low | (a & ~31) << 43 | b << 32 | 1 << (a & 31)
            words += [0xA << 60 | low | a << 40 | rising << 32 if is_edge else pixel]
        else:
            words += [0x8 << 12 | (t >> 12) & 0xFFF, 0x6 << 12 | t & 0xFFF]
            words += [0xA << 12 | a << 8 | rising] if is_edge else [b, 0x2 << 12 | p << 11 | a]
    kind = {"2.0": "<u4", "2.1": "<u8", "3.0": "<u2"}[version]
    return f"% evt {version}\n% geometry 64x32\n% end\n".encode() + np.array(words, np.uint64).astype(kind).tobytes()


def found(recording) -> list[Edge]:
    triggers = recording.triggers
    return list(zip(triggers.stamps.tolist(), triggers.channels.tolist(), triggers.edges.tolist(), strict=True))


@pytest.mark.parametrize("begin", ["at 0", "before a turn of the clock"])
@pytest.mark.parametrize("is_large", [False, True])
@pytest.mark.parametrize("version", ["2.0", "2.1", "3.0"])
def test_triggers_of_raw_files_beside_unchanged_events(tmp_path: Path, monkeypatch, version, is_large, begin):
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(prophesee, "INDEXED_BYTES", 0 if is_large else 64 << 20)
    shift = 0 if begin == "at 0" else PERIODS[version] - 20_000
    events, edges = [(t + shift, *rest) for t, *rest in EVENTS], [(t + shift, *rest) for t, *rest in EDGES]
    with_triggers, without = tmp_path / "a.raw", tmp_path / "b.raw"
    with_triggers.write_bytes(raw_words(version, events, edges))
    without.write_bytes(raw_words(version, events, []))
    for _ in range(2):  # the second time from the index
        with open_recording(with_triggers) as recording, open_recording(without) as plain:
            assert found(recording) == edges
            assert any("4 triggers (3 rising, 1 falling) on input 0, 1, 3" in r.text for r in recording.remarks)
            assert plain.triggers is None
            ours, theirs = recording.read(0, recording.num_events), plain.read(0, plain.num_events)
            for axis in "xytp":
                np.testing.assert_array_equal(getattr(ours, axis), getattr(theirs, axis))


def test_triggers_before_a_streams_first_time_are_none(tmp_path: Path):
    for version, word, kind in (("2.0", 0xA << 28, "<u4"), ("2.1", 0xA << 60, "<u8"), ("3.0", 0xA << 12, "<u2")):
        content = raw_words(version, EVENTS, EDGES[:1])
        head, data = content[: content.index(b"% end\n") + 6], content[content.index(b"% end\n") + 6 :]
        path = tmp_path / f"{version}.raw"
        path.write_bytes(head + np.array([word], kind).tobytes() + data)
        with open_recording(path) as recording:
            assert found(recording) == EDGES[:1]
