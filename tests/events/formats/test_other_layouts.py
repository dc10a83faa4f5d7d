"""Layouts for which no real file is at hand, written by other libraries or by their definition."""

from __future__ import annotations

import gzip
import json
import lzma
import struct
import time
import zipfile

import h5py
import numpy as np
import pytest
import scipy.io

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.formats import bounds
from etnet.events.formats.aedat import aedat2
from etnet.events.open import Assumptions, open_recording
from tests.events.containers import all_events, assert_same_events
from tests.strategies import make_events

EVENTS = make_events(200)


def assert_holds(recording, events=EVENTS) -> None:
    assert_same_events(all_events(recording), events)
    np.testing.assert_array_equal(all_events(recording).t, events.t)


@pytest.mark.parametrize("form", ["columns", "struct", "struct 1-based", "v7.3"])
def test_matlab_files_of_both_kinds(form, tmp_path):
    shift = 1 if "1-based" in form else 0
    table = {"x": EVENTS.x + shift, "y": EVENTS.y + shift, "ts": EVENTS.t.astype(float), "p": EVENTS.p.astype(float)}
    path = tmp_path / "a.mat"
    if form == "v7.3":
        with h5py.File(path, "w", userblock_size=512) as file:
            for name, column in table.items():
                file[f"TD/{name}"] = column.reshape(1, -1)
        with path.open("r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    else:
        scipy.io.savemat(path, table if form == "columns" else {"TD": table})
    with open_recording(path, assume=Assumptions(width=20, height=12)) as recording:
        assert_holds(recording)


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("t,x,y,p", "{t},{x},{y},{p}"),
        ("x,y,polarity,timestamp_us", "{x},{y},{p},{t}"),
        ("# timestamp[us] x y polarity", "{t} {x} {y} {p}"),
        ('"time_s";"x";"y";"p";"extra"', "{s};{x};{y};{p};7"),
        ("on\tx\ty\tt", "{p}\t{x}\t{y}\t{t}"),
    ],
)
def test_tables_with_a_header_in_any_order(header, row, tmp_path):
    columns = zip(EVENTS.t.tolist(), EVENTS.x.tolist(), EVENTS.y.tolist(), (EVENTS.p > 0).tolist(), strict=True)
    rows = [row.format(t=t, s=f"{t / 1e6:.6f}", x=x, y=y, p=int(p)) for t, x, y, p in columns]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([header, *rows]))
    with open_recording(path, assume=Assumptions(width=20, height=12)) as recording:
        assert recording.format == "CSV"
        assert_holds(recording)


@pytest.mark.parametrize("wrapping", ["gz", "xz", "zip with the size", "zip of a raw file"])
def test_wrapped_recordings(wrapping, tmp_path):
    rows = "".join(
        f"{t / 1e6:.6f} {x} {y} {p:d}\n" for t, x, y, p in zip(EVENTS.t, EVENTS.x, EVENTS.y, EVENTS.p > 0, strict=True)
    )
    path = tmp_path / "events.txt"
    if wrapping == "gz":
        path = tmp_path / "events.txt.gz"
        path.write_bytes(gzip.compress(rows.encode()))
    elif wrapping == "xz":
        path = tmp_path / "events.txt.xz"
        path.write_bytes(lzma.compress(rows.encode()))
    else:
        path = tmp_path / "events.zip"
        with zipfile.ZipFile(path, "w") as archive:
            if wrapping == "zip with the size":
                archive.writestr("slow.txt", "20 12\n" + rows)
            else:
                np.save(tmp_path / "a.npy", np.zeros(1))
                archive.writestr("one/recording.bin", forty_bits(EVENTS))
    with open_recording(path, assume=Assumptions(width=20, height=12)) as recording:
        assert_holds(recording)


def forty_bits(events: Events) -> bytes:
    words = zip(events.x.tolist(), events.y.tolist(), events.p.tolist(), events.t.tolist(), strict=True)
    return b"".join(struct.pack(">BBI", x, y, (int(p > 0) << 23 | t) << 8)[:5] for x, y, p, t in words)


def test_davis_aedat2_keeps_events_and_tells_of_the_rest(tmp_path):
    words = b""
    for i, (x, y, t, p) in enumerate(zip(EVENTS.x, EVENTS.y, EVENTS.t, EVENTS.p, strict=True)):
        row = 180 - 1 - int(y)
        words += struct.pack(">II", row << 22 | 240 - 1 - int(x) << 12 | int(p > 0) << 11, int(t))
        if i % 10 == 0:
            words += struct.pack(">II", 1 << 31 | 1 << 10, int(t)) + struct.pack(">II", 1 << 10, int(t))
    path = tmp_path / "a.aedat"
    path.write_bytes(b"#!AER-DAT2.0\r\n# AEChip: eu.seebetter.ini.chips.davis.Davis240C\r\n" + words)
    with open_recording(path) as recording:
        assert str(recording.sensor) == "240×180"
        assert_holds(recording)
        assert recording.ground_truth is None
        assert any("20 pictures" in remark.text for remark in recording.remarks)
        assert len(recording.triggers) == 20


@pytest.mark.parametrize("stated", [None, (346, 260), (200, 150)])
def test_aedat2_of_no_named_chip_is_turned_at_the_stated_size(stated, tmp_path):
    x, y = np.arange(100), np.arange(100) + 10
    width, height = stated or (240, 180)
    words = np.stack([y << 22 | x << 12, np.arange(100)], 1)
    path = tmp_path / "a.aedat"
    path.write_bytes(b"#!AER-DAT2.0\r\n" + words.astype(">u4").tobytes())
    with open_recording(path, assume=Assumptions(*(stated or ()))) as recording:
        np.testing.assert_array_equal(all_events(recording).x, width - 1 - x)
        np.testing.assert_array_equal(all_events(recording).y, height - 1 - y)
        told = [remark.text for remark in recording.remarks if "sensor" in remark.text]
    judged = "sensor 240×180: the header names no chip and the addresses fit it; --assume overrules"
    assert told == [judged if stated is None else f"sensor {stated[0]}×{stated[1]}, as stated"]


def test_aedat2_that_names_its_chip_says_so_where_another_size_is_stated(tmp_path):
    path = tmp_path / "a.aedat"
    path.write_bytes(b"#!AER-DAT2.0\r\n# AEChip: Davis240C\r\n" + struct.pack(">II", 10 << 22, 0))
    with open_recording(path, assume=Assumptions(width=346, height=260)) as recording:
        assert all_events(recording).y.tolist() == [249]
        assert "sensor 346×260, as stated; the file says 240×180" in [remark.text for remark in recording.remarks]


JAER = "#!AER-DAT2.0\r\n# AEChip: eu.seebetter.ini.chips.davis.Davis346blue\r\n"
SETTINGS = '#<entry key="DAVIS240C.bias" value="1"/>\r\n'


@pytest.mark.parametrize("num_lines", [0, 1, 10_000])
def test_the_line_with_the_chip_counts_and_not_the_settings_of_others_however_many(num_lines, tmp_path):
    # The data begins with the byte of "#".
    words = struct.pack(">II", ord("#") << 24, 7) + struct.pack(">II", 259 << 22 | 345 << 12, 8)
    path = tmp_path / "a.aedat"
    path.write_bytes((JAER + num_lines * SETTINGS).encode() + words)
    with open_recording(path) as recording:
        assert str(recording.sensor) == "346×260"
        found = all_events(recording)
    assert (found.x.tolist(), found.y.tolist(), found.t.tolist()) == ([345, 0], [259 - 140, 0], [7, 8])


def test_a_header_without_the_line_names_its_chip_anywhere(tmp_path):
    path = tmp_path / "a.aedat"
    path.write_bytes(("#!AER-DAT2.0\r\n" + SETTINGS).encode() + struct.pack(">II", 10 << 22, 0))
    with open_recording(path) as recording:
        assert str(recording.sensor) == "240×180"


def test_a_header_without_end_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(aedat2, "_LONGEST_HEADER", 1000)
    path = tmp_path / "a.aedat"
    path.write_bytes((JAER + 100 * SETTINGS).encode() + struct.pack(">II", 10 << 22, 0))
    with pytest.raises(RecordingError, match=r"header.*more than 0\.001 MB"):
        open_recording(path)


def test_aedat_3_0_is_refused_by_its_name(tmp_path):
    path = tmp_path / "a.aedat"
    path.write_bytes(b"#!AER-DAT3.0\r\n#Format: RAW\r\n#Source 1: DAVIS240C\r\n" + bytes(100))
    with pytest.raises(RecordingError, match=r"AEDAT 3\.0.*3\.1 is read: save it"):
        open_recording(path)


def test_a_32_bit_clock_that_begins_anew_goes_on(tmp_path):
    t = 2**32 - 500 + np.arange(1000)
    records = np.zeros((1000, 2), "<u4")
    records[:, 0] = t % 2**32
    (tmp_path / "a.dat").write_bytes(
        b"% Data file containing CD events.\n% Version 2\n% Width 20\n% Height 12\n\x0c\x08" + records.tobytes()
    )
    (tmp_path / "a.aedat").write_bytes(b"#!AER-DAT2.0\r\n" + records[:, ::-1].astype(">u4").tobytes())
    for name in ("a.dat", "a.aedat"):
        with open_recording(tmp_path / name) as recording:
            np.testing.assert_array_equal(all_events(recording).t, t)
            assert any("every 71.6 minutes" in remark.text for remark in recording.remarks)


def test_npy_tables_tell_their_columns_by_their_values(tmp_path):
    for order in ("txyp", "xytp"):
        table = np.stack([getattr(EVENTS, axis).astype(np.float64) for axis in order], 1)
        table[:, order.index("t")] /= 1e6
        np.save(tmp_path / "a.npy", table)
        with open_recording(tmp_path / "a.npy", assume=Assumptions(width=20, height=12)) as recording:
            assert_holds(recording)


def event_utils_file(path, flow: bool = True):
    with h5py.File(path, "w") as file:
        file["events/xs"], file["events/ys"] = EVENTS.x.astype("i2"), EVENTS.y.astype("i2")
        file["events/ts"], file["events/ps"] = EVENTS.t / 1e6, EVENTS.p > 0
        file.attrs["sensor_resolution"] = (12, 20)
        for i in range(3):
            file[f"images/image{i:09d}"] = np.full((12, 20, 3), (10, 20, 40 * i), np.uint8)
            file[f"images/image{i:09d}"].attrs["timestamp"] = i / 100
            file[f"images/image{i:09d}"].attrs["type"] = "color_bgr"
            if flow and i:
                file[f"flow/flow{i - 1:09d}"] = np.full((2, 12, 20), i, np.float32)
                file[f"flow/flow{i - 1:09d}"].attrs["timestamp"] = i / 100
    return path


def test_colour_pictures_become_luminance_and_flow_is_found_by_its_stamp(tmp_path):
    with open_recording(event_utils_file(tmp_path / "a.h5")) as recording:
        assert_holds(recording)
        truth = recording.ground_truth
        expected = (10 * 0.114 + 20 * 0.587 + 80 * 0.299) / 255
        np.testing.assert_allclose(truth.read_frame(2), expected, rtol=1e-5)
        seconds = (truth.stamps[2] - truth.stamps[1]) / 1e6
        np.testing.assert_allclose(truth.read_flow(2), 2 * seconds, rtol=1e-6)  # the layout stores pixels a second
        with pytest.raises(RecordingError, match="no flow"):
            truth.read_flow(0)


def test_links_out_of_an_hdf5_file_are_refused(tmp_path):
    event_utils_file(tmp_path / "target.h5")
    for kind in ("external", "soft", "storage", "virtual"):
        path = tmp_path / f"{kind}.h5"
        with h5py.File(path, "w") as file:
            for axis in ("ys", "ts", "ps"):
                file[f"events/{axis}"] = np.arange(200)
            if kind == "external":
                file["events/xs"] = h5py.ExternalLink("target.h5", "/events/xs")
            elif kind == "soft":
                file["events/xs"] = h5py.SoftLink("/events/ys")
            elif kind == "storage":
                file.create_dataset("events/xs", (200,), "u1", external=[(str(tmp_path / "target.h5"), 0, 200)])
            else:
                layout = h5py.VirtualLayout((200,), "i2")
                layout[:] = h5py.VirtualSource(tmp_path / "target.h5", "events/xs", (200,))
                file.create_virtual_dataset("events/xs", layout)
        with pytest.raises(RecordingError, match=r"link|another file"):
            open_recording(path)


def test_links_out_of_a_folder_are_refused(tmp_path):
    secret = tmp_path / "secret.txt"
    secret.write_text("0.1 1 1 1\n")
    folder = tmp_path / "recording"
    folder.mkdir()
    (folder / "events.txt").symlink_to(secret)
    with pytest.raises(RecordingError, match="leads out of the folder"):
        open_recording(folder)


def test_bombs_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(bounds, "FREE_SIZE", 1 << 20)
    (tmp_path / "a.txt.gz").write_bytes(gzip.compress(bytes(4 << 20), 9))
    with pytest.raises(RecordingError, match="bomb"):
        open_recording(tmp_path / "a.txt.gz")
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("events.txt", bytes(4 << 20))
    with pytest.raises(RecordingError, match="bomb"):
        open_recording(tmp_path / "a.zip")


def test_an_evreal_folder_is_mapped_and_a_broken_one_named(tmp_path):
    np.save(tmp_path / "events_ts.npy", EVENTS.t / 1e6)
    np.save(tmp_path / "events_xy.npy", np.stack([EVENTS.x, EVENTS.y], 1))
    with pytest.raises(RecordingError, match=r"events_p\.npy is missing"):
        open_recording(tmp_path)
    np.save(tmp_path / "events_p.npy", EVENTS.p > 0)
    (tmp_path / "metadata.json").write_text(json.dumps({"sensor_resolution": [12, 20]}))
    with open_recording(tmp_path) as recording:
        assert recording.sensor == Sensor(20, 12)
        assert_holds(recording)


@pytest.mark.parametrize(
    "content",
    ["{", "[" * 200_000, '{"a": ' + "1" * 6000 + "}", '"' + '\\"' * 500_000, '"%s"' % ("x" * (5 << 20)), "\x00"],
)
def test_a_metadata_file_that_is_no_json_is_refused_in_one_line_and_at_once(content, tmp_path):
    np.save(tmp_path / "events_ts.npy", EVENTS.t / 1e6)
    np.save(tmp_path / "events_xy.npy", np.stack([EVENTS.x, EVENTS.y], 1))
    np.save(tmp_path / "events_p.npy", EVENTS.p > 0)
    (tmp_path / "metadata.json").write_text(content)
    began = time.process_time()
    with pytest.raises(RecordingError, match=r"metadata\.json") as refusal:
        open_recording(tmp_path)
    assert time.process_time() - began < 5
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 300


@pytest.mark.parametrize("locking", [None, False])
def test_an_hdf5_file_may_be_open_elsewhere_in_the_same_process(locking, tmp_path):
    path = event_utils_file(tmp_path / "a.h5")
    with h5py.File(path, "r", locking=locking), open_recording(path) as recording:
        assert_holds(recording)
    with open_recording(path) as recording, h5py.File(path, "r") as file:
        assert len(file["events/xs"]) == recording.num_events


def test_the_marks_of_nmnists_clock_move_what_comes_after_them(tmp_path):
    rows = [(1, 2, 100), (3, 4, 8000), (0, 240, 8192), (5, 6, 10), (0, 240, 0), (7, 8, 20)]
    content = b"".join(struct.pack(">BBI", x, y, (1 << 23 | t) << 8)[:5] for x, y, t in rows)
    (tmp_path / "a.bin").write_bytes(content)
    with open_recording(tmp_path / "a.bin") as recording:
        events = all_events(recording)
        assert events.t.tolist() == [100, 8000, 8192 + 10, 2 * 8192 + 20]
        assert events.x.tolist() == [1, 3, 5, 7]
        assert any("2 marks" in remark.text for remark in recording.remarks)
