"""RAW files of a camera that ran for longer than its clock counts: 34 bits of µs are 4.8 hours, EVT 3.0's 24 16.8 s."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.formats.prophesee import raw as prophesee
from etnet.events.open import open_recording

PERIOD = 1 << 34
Event = tuple[int, int, int, int]
"""t in µs, x, y, p in 0 … 1."""


def evt2(events: Sequence[Event]) -> bytes:
    """A time word and a pixel word for each event."""
    words = []
    for t, x, y, p in events:
        words += [0x8 << 28 | t % PERIOD >> 6, p << 28 | (t & 63) << 22 | x << 11 | y]
    return b"% evt 2.0\n% geometry 64x32\n% end\n" + np.array(words, "<u4").tobytes()


def evt21(events: Sequence[Event]) -> bytes:
    """A time word and a word with one pixel set for each event."""
    words = []
    for t, x, y, p in events:
        base = p << 60 | (t & 63) << 54 | (x & ~31) << 43 | y << 32
        words += [0x8 << 60 | (t % PERIOD >> 6) << 32, base | 1 << (x & 31)]
    return b"% evt 2.1\n% geometry 64x32\n% end\n" + np.array(words, "<u8").tobytes()


@pytest.mark.parametrize("written", [evt2, evt21])
def test_a_clock_that_began_anew_goes_on_and_is_told(tmp_path: Path, written: Callable[[Sequence[Event]], bytes]):
    events = [(PERIOD - 2000 + 1000 * i, 3 * i, i, i % 2) for i in range(6)]
    path = tmp_path / "long.raw"
    path.write_bytes(written(events))
    with open_recording(path) as recording:
        read = recording.read(0, 6)
        assert (read.t - read.t[0]).tolist() == [1000 * i for i in range(6)]
        assert read.x.tolist() == [x for _, x, _, _ in events]
        assert read.p.tolist() == [2 * p - 1 for *_, p in events]
        told = [remark.text for remark in recording.remarks if "wraps" in remark.text]
    assert told == ["the 34-bit clock wraps (every 4.8 hours) and was unrolled"]


@pytest.mark.parametrize("written", [evt2, evt21])
def test_a_clock_that_did_not_is_not_spoken_of(tmp_path: Path, written: Callable[[Sequence[Event]], bytes]):
    path = tmp_path / "short.raw"
    path.write_bytes(written([(PERIOD - 9000 + 1000 * i, i, i, 1) for i in range(6)]))
    with open_recording(path) as recording:
        assert not [remark for remark in recording.remarks if "wraps" in remark.text]


TURN = 1 << 24
HEADER = b"% evt 3.0\n% geometry 64x32\n% end\n"


def evt3(stamps: Sequence[int], stop: int, hole: range = range(0)) -> bytes:
    """A camera's words: the high time every 4096 µs whatever happens, but for a hole in which all words got lost."""
    words, pending = [], list(stamps)
    for start in range(0, stop, 4096):
        part = [0x8 << 12 | (start >> 12) & 0xFFF]
        while pending and pending[0] < start + 4096:
            t = pending.pop(0)
            part += [0x6 << 12 | t & 0xFFF, 5, 0x2 << 12 | 1 << 11 | 7]
        words += [] if start in hole else part
    return HEADER + np.array(words, "<u2").tobytes()


HOLES = (range(0), range(TURN - 2 * 4096, TURN + 2 * 4096), range(15_000_000, 18_000_000))


@pytest.mark.parametrize("is_large", [False, True])
@pytest.mark.parametrize("hole", HOLES)
def test_evt3_keeps_its_clock_over_words_that_got_lost(tmp_path: Path, monkeypatch, is_large: bool, hole: range):
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(prophesee, "INDEXED_BYTES", 0 if is_large else 64 << 20)
    stamps = range(0, 2 * TURN, 1000)
    path = tmp_path / "hole.raw"
    path.write_bytes(evt3(stamps, 2 * TURN, hole))
    with open_recording(path) as recording:
        found = recording.read(0, recording.num_events).t.tolist()
    assert found == [t for t in stamps if t // 4096 * 4096 not in hole]


def _high(time: int) -> int:
    return 0x8 << 12 | time


@pytest.mark.parametrize("is_large", [False, True])
def test_evt3_tells_what_was_odd_whatever_the_size(tmp_path: Path, monkeypatch, is_large: bool):
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(prophesee, "INDEXED_BYTES", 0 if is_large else 64 << 20)
    low, line, pixel = 0x6 << 12, 5, 0x2 << 12 | 7
    words = [
        line,
        pixel,
        pixel,
        _high(9),
        low | 100,
        pixel,
        _high(8),
        low | 50,
        pixel,
        pixel,
        _high(9),
        low | 200,
        pixel,
    ]
    path = tmp_path / "odd.raw"
    path.write_bytes(HEADER + np.array(words, "<u2").tobytes() + b"\x00")
    first = 9 * 4096 + 100
    with open_recording(path) as recording:
        assert recording.read(0, recording.num_events).t.tolist() == [first, first, first, first + 100]
        told = [remark.text for remark in recording.remarks if remark.kind == "repaired"]
    assert told == [
        "1 bytes after the last whole word were left out; the file may be truncated",
        "2 words before the stream's first time were left out",
        "time ran back by up to 4146 µs; 1 stamps were held at the last one before",
    ]


@pytest.mark.parametrize("written", [evt2, evt21, lambda events: evt3([t for t, *_ in events], 6_000_000)])
@pytest.mark.parametrize("is_large", [False, True])
def test_two_recordings_in_one_file_are_named_and_not_flattened(tmp_path: Path, monkeypatch, written, is_large):
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(prophesee, "INDEXED_BYTES", 0 if is_large else 64 << 20)
    content = written([(1000 * i, i % 60, i % 30, i % 2) for i in range(6000)])
    data = content[content.index(b"% end\n") + 6 :]
    path = tmp_path / "two.raw"
    path.write_bytes(content + data)
    with pytest.raises(RecordingError, match="the clock restarts"):
        open_recording(path)


def busy_evt21(is_dense: bool) -> np.ndarray:
    """A high time every 64 µs, and after each a hundred words with one pixel or about half of them set."""
    rng = np.random.default_rng(0)
    words = []
    for high in range(300):
        masks = rng.integers(0, 1 << 32, 100) if is_dense else 1 << rng.integers(0, 32, 100)
        words.append(0x8 << 60 | (1000 + high) << 32)
        words += [i % 2 << 60 | 64 * i // 100 << 54 | i % 30 << 32 | int(mask) for i, mask in enumerate(masks)]
    return np.array(words, "<u8")


ORDERS = [
    # What the header says, whether the halves are swapped, and whether that is a guess.
    ("", False, False),
    ("", True, True),
    ("% endianness legacy\n", True, False),
    ("% format EVT21;endianness=legacy;height=32;width=64\n", True, False),
    ("% format EVT21;height=32;width=64\n% plugin_name hal_plugin_imx636_evk4\n% system_ID 49\n", True, True),
    ("% format EVT21;endianness=little;height=32;width=64\n% endianness legacy\n", False, False),
]


@pytest.mark.parametrize("is_large", [False, True])
@pytest.mark.parametrize("is_dense", [False, True])
@pytest.mark.parametrize(("said", "is_swapped", "is_guess"), ORDERS, ids=range(len(ORDERS)))
def test_halves_of_evt21_lie_as_the_option_or_key_says_else_as_times_ascend(
    tmp_path: Path, monkeypatch, said: str, is_swapped: bool, is_guess: bool, is_dense: bool, is_large: bool
):
    monkeypatch.setenv("ETNET_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(prophesee, "INDEXED_BYTES", 0 if is_large else 64 << 20)
    words = busy_evt21(is_dense)
    plain, path = tmp_path / "plain.raw", tmp_path / "a.raw"
    plain.write_bytes(b"% evt 2.1\n% endianness little\n% geometry 64x32\n% end\n" + words.tobytes())
    data = words.view("<u4").reshape(-1, 2)[:, ::-1] if is_swapped else words
    path.write_bytes(f"% evt 2.1\n{said}% geometry 64x32\n% end\n".encode() + data.tobytes())
    with open_recording(plain) as wanted, open_recording(path) as recording:
        found, theirs = recording.read(0, recording.num_events), wanted.read(0, wanted.num_events)
        for axis in "xytp":
            np.testing.assert_array_equal(getattr(found, axis), getattr(theirs, axis))
        told = [remark.text for remark in recording.remarks if "halves" in remark.text]
    assert told == (["the halves of the file's words are swapped: so their times ascend"] if is_guess else [])


VGA, HD = "640×480", "1280×720"


@pytest.mark.parametrize(
    ("system", "size"), [(21, VGA), (28, VGA), (29, VGA), (34, VGA), (151, VGA), (26, HD), (49, HD)]
)
def test_a_system_id_tells_the_sensor_where_nothing_else_does(tmp_path: Path, system: int, size: str):
    content = evt2([(1000 * i, i, i, i % 2) for i in range(6)])
    path = tmp_path / "a.raw"
    path.write_bytes(content.replace(b"% geometry 64x32", f"% system_ID {system}".encode()))
    with open_recording(path) as recording:
        assert str(recording.sensor) == size
        told = [remark.text for remark in recording.remarks if "system_ID" in remark.text]
    assert told == [f"sensor {size}, that of system_ID {system}; the header names none: --assume overrules"]
