"""What the first lines of event text say, and which member of a zip or folder is the recording."""

from __future__ import annotations

import zipfile
from contextlib import suppress

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.open import Assumptions, open_recording
from tests.events.containers import all_events
from tests.strategies import make_events

EVENTS = make_events(200)
SIZE = Assumptions(width=20, height=12)


def rows_of(order: str = "t x y p", stamp="{:d}", clock=EVENTS.t, off: int = 0) -> str:
    columns = {"t": [stamp.format(t) for t in clock], "x": EVENTS.x, "y": EVENTS.y}
    columns["p"] = [1 if p > 0 else off for p in EVENTS.p]
    for mark in " ,;":
        if mark in order:
            return "".join(
                mark.join(map(str, row)) + "\n"
                for row in zip(*(columns[axis] for axis in order.split(mark)), strict=True)
            )
    raise AssertionError(order)


def texts_of(path, events=EVENTS, assume: Assumptions = SIZE) -> list[str]:
    """Its remarks, after its events were found to be what they should be."""
    with open_recording(path, assume=assume) as recording:
        for axis in ("x", "y", "t", "p"):
            np.testing.assert_array_equal(getattr(all_events(recording), axis), getattr(events, axis))
        return [remark.text for remark in recording.remarks]


SECONDS = (EVENTS.t - EVENTS.t[0]) / 1e6
FROM_ZERO = type(EVENTS)(EVENTS.x, EVENTS.y, EVENTS.t - EVENTS.t[0], EVENTS.p, EVENTS.sensor)


@pytest.mark.parametrize("header", ["", "t,x,y,p\n"])
@pytest.mark.parametrize("stamp", ["{:.12g}", "{:.9f}", "{:.18e}"])
def test_a_first_stamp_of_0_does_not_make_seconds_microseconds(header, stamp, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(header + rows_of("t,x,y,p", stamp, SECONDS))
    said = texts_of(path, FROM_ZERO)
    assert any("time unit s, because" in text for text in said)


@pytest.mark.parametrize("header", ["", "t,x,y,p\n"])
@pytest.mark.parametrize("stamp", ["{:d}", "{:.18e}", "{:.0e}"])
def test_whole_stamps_count_microseconds_however_they_are_printed(header, stamp, tmp_path):
    clock = FROM_ZERO.t if stamp != "{:.0e}" else 10 ** np.minimum(np.arange(200), 7)
    path = tmp_path / "a.csv"
    path.write_text(header + rows_of("t,x,y,p", stamp, clock))
    said = texts_of(path, type(EVENTS)(EVENTS.x, EVENTS.y, clock, EVENTS.p, EVENTS.sensor))
    assert any("time unit us, because" in text for text in said)


def test_a_stated_unit_wins_over_fractions(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text(rows_of(stamp="{:.1f}"))
    texts_of(path, assume=Assumptions(width=20, height=12, time_unit="us"))


@pytest.mark.parametrize("off", [0, -1])
@pytest.mark.parametrize("order", ["x,y,p,t", "x,y,t,p", "x y p t"])
def test_columns_without_names_are_told_by_what_they_hold_and_that_is_said(order, off, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(rows_of(order, off=off))
    for polarity in ("auto", "positive"):
        said = texts_of(path, assume=Assumptions(width=20, height=12, polarity=polarity))
        assert any("columns are " + ", ".join(order.replace(" ", ",").split(",")) in text for text in said)
        assert any("polarity is coded" in text for text in said) is (polarity == "auto")


def test_one_row_is_enough_to_tell_a_stamp_from_a_polarity(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("10,20,1,1000\n")
    with open_recording(path) as recording:
        assert all_events(recording).t.tolist() == [1000]


def test_further_columns_need_not_be_numbers_for_the_unit_to_be_judged(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,x,y,p,lens\n0,1,2,0,wide\n0.5,1,2,1,wide\n")
    with open_recording(path) as recording:
        assert all_events(recording).t.tolist() == [0, 500_000]


def test_numbers_beyond_all_measure_are_refused_in_one_line(tmp_path):
    path = tmp_path / "a.csv"
    for stamp in ("1e999999999999", "-1e99999", "1e-99999", "9" * 3000):
        path.write_text(f"{stamp} 1 2 0\n{stamp} 1 2 0\n")
        with suppress(RecordingError):
            open_recording(path).close()


def test_a_row_of_pixels_0_and_1_is_no_polarity(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("".join(f"{t} {t % 7} {t % 2} {t // 3 % 2}\n" for t in range(100)))
    with open_recording(path) as recording:
        assert all_events(recording).t.tolist() == list(range(100))


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
@pytest.mark.parametrize("order", ["t x y p", "t,x,y,p", "t;x;y;p"])
@pytest.mark.parametrize("first", ["", "20 12\n", "# made by hand\n"])
def test_separators_and_a_byte_order_mark_make_no_difference(mark, order, first, tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(mark + first.encode() + rows_of(order).encode())
    texts_of(path)


MEMBERS = {
    "rec.txt": rows_of().encode(),
    "rec.csv": ("t,x,y,p\n" + rows_of("t,x,y,p")).encode(),
    "rec.dat": b"% Data file containing CD events.\n% Version 2\n% Width 20\n% Height 12\n\x0c\x08"
    + np.stack([EVENTS.t, EVENTS.x | EVENTS.y.astype(int) << 14 | (EVENTS.p > 0).astype(int) << 28], 1)
    .astype("<u4")
    .tobytes(),
}
BESIDE = {
    "__MACOSX/._rec.txt": b"\0\5\x16\7 resource",
    "__MACOSX/one/._rec.raw": b"\0\5\x16\7 resource",
    "._rec.csv": b"\0\5\x16\7 resource",
    ".DS_Store": b"\0\0\0\1Bud1",
    "README.txt": b"Recorded at noon.\n",
    "calib.txt": b"1 2 3 4 5 6 7 8 9\n",
    "notes.csv": b"",
}


@pytest.mark.parametrize("name", list(MEMBERS))
def test_a_zip_of_one_recording_opens_with_anything_else_in_it(name, tmp_path):
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(name, MEMBERS[name])
        for beside, content in BESIDE.items():
            archive.writestr(beside, content)
    texts_of(path)


@pytest.mark.parametrize("name", ["rec.txt", "rec.csv"])
@pytest.mark.parametrize("wrapping", ["zip", "folder"])
def test_one_table_alone_opens_in_a_zip_or_a_folder(name, wrapping, tmp_path):
    path = tmp_path / "a"
    if wrapping == "folder":
        path.mkdir()
        (path / name).write_bytes(MEMBERS[name])
    else:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(name, MEMBERS[name])
    texts_of(path)


def test_two_recordings_in_a_zip_are_named(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.writestr("rec.txt", MEMBERS["rec.txt"])
        archive.writestr("rec.csv", MEMBERS["rec.csv"])
    with pytest.raises(RecordingError, match=r"holds rec.csv, rec.txt; unpack it"):
        open_recording(tmp_path / "a.zip")
