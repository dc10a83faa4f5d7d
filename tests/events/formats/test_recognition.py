"""A file is what it holds, whatever it is called."""

from __future__ import annotations

import gzip

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.open import Assumptions, open_recording
from tests.events.containers import all_events
from tests.events.formats.test_other_layouts import event_utils_file, forty_bits
from tests.events.formats.test_prophesee import evt2, evt21
from tests.strategies import make_events

EVENTS = make_events(200)
COLUMNS = (EVENTS.t, EVENTS.x, EVENTS.y, (EVENTS.p > 0).astype(int))
ROWS = list(zip(*(column.tolist() for column in COLUMNS), strict=True))
NAMES = ("a.bin", "a.dat", "a.raw", "a.txt", "a.csv", "a.h5", "a.mat", "a.zip", "a.bag", "a")


def dat(header: str) -> bytes:
    table = np.array([(t, x | y << 14 | p << 28) for t, x, y, p in ROWS], "<u4")
    content = header.encode() + b"\x0c\x08"
    # One more comment makes it a whole number of five bytes, as an N-MNIST file is.
    filler = "% " + "." * ((-len(content) - table.nbytes - 3) % 5) + "\n"
    return filler.encode() + content + table.tobytes()


def kinds(folder) -> dict[str, bytes]:
    text = "".join(f"{t} {x} {y} {p}\n" for t, x, y, p in ROWS).encode()
    return {
        "event_utils HDF5": event_utils_file(folder / "source.h5", flow=False).read_bytes(),
        "Prophesee DAT 2": dat("% Data file containing CD events.\n% Version 2\n% Width 20\n% Height 12\n"),
        "Prophesee EVT2": evt2(ROWS),
        "Prophesee EVT2.1": evt21(ROWS),
        "RPG text": text,
        "CSV": b"t x y p\n" + text,
        "RPG text in gzip": gzip.compress(text),
        "AEDAT 2.0": b"#!AER-DAT2.0\r\n" + np.array([(y << 8 | x << 1, t) for t, x, y, _ in ROWS], ">u4").tobytes(),
    }


@pytest.mark.parametrize("name", NAMES)
def test_what_a_file_says_of_itself_wins_over_its_name(name, tmp_path):
    for kind, content in kinds(tmp_path).items():
        path = tmp_path / name
        path.write_bytes(content)
        with open_recording(path, assume=Assumptions(width=512, height=256)) as recording:
            assert kind in recording.format
            assert recording.num_events == len(EVENTS)
            assert np.ptp(all_events(recording).t) == np.ptp(EVENTS.t)


def test_a_dat_header_that_says_nothing_is_known_by_its_records(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(dat("% Date 2014-01-01 00:00:00\n"))
    with open_recording(path, assume=Assumptions(width=512, height=512)) as recording:
        assert recording.format == "Prophesee DAT 1"


def test_five_byte_events_are_what_is_left_for_a_bin_file(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(forty_bits(EVENTS))
    with open_recording(path) as recording:
        np.testing.assert_array_equal(all_events(recording).t, EVENTS.t)
        assert any("five-byte events" in remark.text for remark in recording.remarks)
    (tmp_path / "a.xyz").write_bytes(forty_bits(EVENTS))
    with pytest.raises(RecordingError, match="no known format"):
        open_recording(tmp_path / "a.xyz")
