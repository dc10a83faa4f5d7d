"""Files as people save them by themselves: each opens as what it is, or is refused in one line that says what to do."""

from __future__ import annotations

import zipfile
from itertools import permutations

import cv2
import h5py
import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.open import Assumptions, open_recording
from tests.events.containers import all_events
from tests.strategies import make_events

COUNT = 1500
EVENTS = make_events(COUNT, sensor=Sensor(346, 260))
X, Y, P = EVENTS.x.copy(), EVENTS.y.copy(), EVENTS.p
X[:3], Y[:3] = (0, 345, 0), (0, 259, 1)
T = 500 + 40 * np.arange(COUNT, dtype=np.int64)
IS_ON = (P > 0).astype(np.uint8)
SIDES = (("x", X), ("y", Y), ("t", T), ("p", IS_ON))
STARTS = [0, 20_000, 40_000, 59_000]


def opened(path, **assumed) -> tuple[np.ndarray, str]:
    """The stamps, and all that was said; the other columns are those that went in."""
    with open_recording(path, assume=Assumptions(**assumed)) as recording:
        events = all_events(recording)
        np.testing.assert_array_equal(events.x, X)
        np.testing.assert_array_equal(events.y, Y)
        np.testing.assert_array_equal(events.p, P)
        return events.t, "\n".join(map(str, recording.remarks))


def refused(path, **assumed) -> str:
    with pytest.raises(RecordingError) as refusal:
        open_recording(path, assume=Assumptions(**assumed)).close()
    assert "\n" not in str(refusal.value)
    return str(refusal.value)


def save_npz(path, t=T, x=X, y=Y, p=IS_ON, **more):
    np.savez(path, x=x, y=y, t=t, p=p, **more)
    return path


def save_csv(path, t=T, head="t,x,y,p", end="\n", encoding="utf-8"):
    rows = [f"{a},{x},{y},{p}" for a, x, y, p in zip(t.tolist(), X, Y, IS_ON, strict=True)]
    path.write_bytes((end.join([head, *rows]) + end).encode(encoding))
    return path


@pytest.mark.parametrize("bits", [16, 24, 31, 34])
@pytest.mark.parametrize("form", ["npz", "csv"])
def test_clocks_of_other_widths_go_on_too(tmp_path, bits, form):
    later = T + (1 << bits) - 30_000
    wrapped = later % (1 << bits)
    path = tmp_path / f"a.{form}"
    t, said = opened(save_npz(path, wrapped) if form == "npz" else save_csv(path, wrapped))
    np.testing.assert_array_equal(t, later)
    assert f"the {bits}-bit stamps wrap" in said


@pytest.mark.parametrize("head", ["t,x,y,p", "t_ns,x,y,p", None])
def test_32_bits_of_nanoseconds_wrap_every_four_seconds(tmp_path, head):
    later = T * 1000 + (1 << 32) - 30_000_000
    wrapped = later % (1 << 32)
    npz, csv = tmp_path / "a.npz", tmp_path / "a.csv"
    t, said = opened(save_npz(npz, wrapped.astype("u4")) if head is None else save_csv(csv, wrapped, head))
    np.testing.assert_array_equal(t, np.rint(later / 1000))
    assert "the 32-bit stamps wrap (every 4.3 s)" in said


@pytest.mark.parametrize("form", ["npz", "csv"])
def test_rows_from_last_to_first_are_not_taken_for_a_little_disorder(tmp_path, form):
    path = tmp_path / f"a.{form}"
    path = save_npz(path, T[::-1]) if form == "npz" else save_csv(path, T[::-1])
    assert "the rows are in reverse; open it with --sort" in refused(path)


def test_packets_that_run_back_within_themselves_are_a_clock_and_can_be_sorted(tmp_path):
    path = save_npz(tmp_path / "a.npz", T.reshape(-1, 100)[:, ::-1].ravel())
    assert "by up to 3960 µs; open it with --sort" in refused(path)
    with open_recording(path, assume=Assumptions(sort=True)) as recording:
        np.testing.assert_array_equal(all_events(recording).t, T)


def test_sorting_two_recordings_into_one_is_told_loudly(tmp_path):
    path = save_npz(tmp_path / "a.npz", np.tile(T[: COUNT // 2], 2))
    with open_recording(path, assume=Assumptions(sort=True)) as recording:
        assert any("sorting mixed them" in remark.text for remark in recording.remarks if remark.kind == "advice")


@pytest.mark.parametrize(("stored", "unit"), [(T / 1000, "ms"), ((T / 1000).astype("f4"), "ms"), (T / 1e6, "s")])
def test_fractions_of_thousandths_are_ms_where_they_make_no_seconds(tmp_path, stored, unit):
    t, said = opened(save_npz(tmp_path / "a.npz", stored))
    np.testing.assert_array_equal(t, T)
    assert f"time unit {unit}" in said


def test_ms_since_1970_are_no_microseconds(tmp_path):
    epoch = 1_700_000_000_000
    t, _ = opened(save_npz(tmp_path / "a.npz", epoch + T // 1000))
    np.testing.assert_array_equal(t, (epoch + T // 1000) * 1000)


@pytest.mark.parametrize(
    "order", ["".join(order) for order in permutations("txyp") if order.index("x") < order.index("y")]
)
@pytest.mark.parametrize("time", [T, T / 1e6, T[::-1]])
def test_the_columns_of_a_table_are_told_in_any_order(tmp_path, order, time):
    columns = {"t": time, "x": X, "y": Y, "p": IS_ON}
    np.save(tmp_path / "a.npy", np.stack([columns[axis] for axis in order], 1))
    t, _ = opened_in_any_order(tmp_path / "a.npy")
    np.testing.assert_array_equal(t, T)


def opened_in_any_order(path) -> tuple[np.ndarray, str]:
    with open_recording(path, assume=Assumptions(sort=True)) as recording:
        assert recording.sensor == Sensor(346, 260)
        return all_events(recording).t, ""


@pytest.mark.parametrize("order", ["txyp", "xytp", "xypt"])
def test_four_arrays_without_names_are_told_by_their_values(tmp_path, order):
    columns = {"t": T, "x": X, "y": Y, "p": P}
    np.savez(tmp_path / "a.npz", *(columns[axis] for axis in order))
    t, said = opened(tmp_path / "a.npz")
    np.testing.assert_array_equal(t, T)
    assert f"the four columns are {', '.join(order)}, judged by their values" in said


def test_of_columns_behind_the_word_for_a_side_the_left_ones_are_taken(tmp_path):
    sides = {f"{side}_{axis}": value for side in ("right", "left") for axis, value in SIDES}
    np.savez(tmp_path / "a.npz", **sides)
    _, said = opened(tmp_path / "a.npz")
    assert "events are in left" in said
    assert "right looks like events, too" in said


def test_polarity_of_a_picture_is_told(tmp_path):
    _, said = opened(save_npz(tmp_path / "a.npz", p=IS_ON * np.uint8(255)))
    assert "polarity 0/255 was read as OFF/ON" in said


def test_a_few_pixels_that_no_sensor_has_cost_only_themselves(tmp_path):
    x = X.copy()
    x[7] = 65_535
    with open_recording(save_npz(tmp_path / "a.npz", x=x)) as recording:
        assert (recording.num_events, recording.sensor) == (COUNT - 1, Sensor(346, 260))
        assert "1 events beyond the sensor 346×260, up to (65535, 259), were left out" in str(recording.remarks)


def test_a_known_size_tells_why_events_lie_beyond_it(tmp_path):
    size = {"width": 346, "height": 260}
    few = np.flatnonzero((X + Y) % 2 == 0)
    x, y = X[few] % 345 + 1, Y[few] % 259 + 1
    x[:4], y[:4] = 346, 260
    with open_recording(save_npz(tmp_path / "a.npz", T[few], x, y, IS_ON[few], **size)) as recording:
        assert any("--pixels from1" in remark.text for remark in recording.remarks if remark.kind == "advice")
    assert "--pixels from1" in refused(save_npz(tmp_path / "c.npz", x=X + 1, y=Y + 1, **size))
    path = save_npz(tmp_path / "b.npz", x=Y, y=X, **size)
    assert "x and y may be swapped, for the events fit 260×346: --assume width=260,height=346" in refused(path)


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("\tx\ty\tt\tp", "{i}\t{x}\t{y}\t{t}\t{p}"),
        ("sep=;\nt;x;y;p", "{t};{x};{y};{p}"),
        ("t,x,y,p,", "{t},{x},{y},{p},"),
        ("'t','x','y','p'", "'{t}','{x}','{y}','{p}'"),
        ("Timestamp (µs);x;y;p", "{t};{x};{y};{p}"),
        ("# width=346\n# height=260\n// mine\nx,y,p,t", "{x},{y},{p},{t}"),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_heads_of_spreadsheets_and_scripts_are_understood(tmp_path, head, row, encoding):
    columns = zip(T, X, Y, IS_ON, strict=True)
    rows = [row.format(i=i, t=t, x=x, y=y, p=p) for i, (t, x, y, p) in enumerate(columns)]
    (tmp_path / "a.csv").write_bytes(("\n".join([head, *rows, "// end"]) + "\n").encode(encoding))
    t, _ = opened(tmp_path / "a.csv")
    np.testing.assert_array_equal(t, T)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"t x y p\n1 2 3 up\n", 'line 2 reads "1 2 3 up"'),
        ("t,x,y,p\n".encode("utf-16-le") * 20, "UTF-16"),
        (b'{"t": [1, 2], "x": [3]}', "JSON"),
        (b"1,2,3\n4,5,6\n", 'text that begins with "1,2,3"'),
        (b"\n<!doctype html><html>", "a web page"),
        (b"\x80\x04\x95abc" * 9, "a pickle"),
        (b"PAR1abc\x00" * 9, "Parquet"),
    ],
)
def test_what_is_no_recording_is_called_by_its_name(tmp_path, content, said):
    (tmp_path / "a.txt").write_bytes(content)
    assert said in refused(tmp_path / "a.txt")


def save_pieces(folder, t=T):
    (folder / "events").mkdir(parents=True)
    for number in range(3):
        part = slice(number * COUNT // 3, (number + 1) * COUNT // 3)
        save_npz(folder / f"events/{number:06d}.npz", t[part], X[part], Y[part], IS_ON[part])
    return folder


def test_pieces_in_a_zip_are_one_recording_with_their_pictures(tmp_path):
    folder = save_pieces(tmp_path / "seq")
    (folder / "images").mkdir()
    for number in range(4):
        cv2.imwrite(str(folder / f"images/{number:06d}.png"), np.full((260, 346), 99, np.uint8))
    (folder / "images/timestamp.txt").write_text("\n".join(map(str, STARTS)))
    with zipfile.ZipFile(tmp_path / "seq.zip", "w") as archive:
        for path in sorted(folder.rglob("*.*")):
            archive.write(path, f"seq/{path.relative_to(folder)}")
    t, _ = opened(tmp_path / "seq.zip")
    np.testing.assert_array_equal(t, T)
    with open_recording(tmp_path / "seq.zip") as recording:
        assert recording.ground_truth is not None
        assert recording.ground_truth.stamps.tolist() == STARTS


def test_a_clock_may_wrap_between_two_pieces(tmp_path):
    later = T + (1 << 32) - int(T[COUNT // 3])
    t, said = opened(save_pieces(tmp_path / "seq", (later % (1 << 32)).astype("u4")))
    np.testing.assert_array_equal(t, later)
    assert "stamps wrap" in said


def test_of_several_recordings_in_a_folder_none_is_chosen_in_silence(tmp_path):
    for name in ("a", "b"):
        (tmp_path / "evreal" / name).mkdir(parents=True)
        for column, values in (("ts", T / 1e6), ("xy", np.stack([X, Y], 1)), ("p", IS_ON)):
            np.save(tmp_path / "evreal" / name / f"events_{column}.npy", values)
    assert "holds a/, b/; name one" in refused(tmp_path / "evreal")
    (tmp_path / "two").mkdir()
    save_csv(tmp_path / "two/events.csv")
    with h5py.File(tmp_path / "two/events.h5", "w") as file:
        for axis, values in zip("xytp", (X, Y, T, IS_ON), strict=True):
            file[f"events/{axis}"] = values
    assert "holds events.csv, events.h5; name one of them" in refused(tmp_path / "two")


@pytest.mark.parametrize(
    ("shape", "low", "high"), [((260, 346), -1.0, 1.0), ((1, 260, 346), 0.0, 255.0), ((3, 260, 346), 0.0, 1.0)]
)
def test_frames_of_networks_are_grey_pictures_of_the_sensors_size(tmp_path, shape, low, high):
    rng = np.random.default_rng(0)
    pictures = rng.uniform(low, high, (4, *shape)).astype(np.float32)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for axis, values in zip("xytp", (X, Y, T, IS_ON), strict=True):
            file[f"events/{axis}"] = values
        file["frames"], file["frames_ts"] = pictures, STARTS
    with open_recording(tmp_path / "a.h5") as recording:
        assert recording.ground_truth is not None
        frame = recording.ground_truth.read_frame(2)
    assert frame.shape == (260, 346)
    assert frame.mean() == pytest.approx(0.5, abs=0.02)


def test_pictures_without_stamps_are_told(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for axis, values in zip("xytp", (X, Y, T, IS_ON), strict=True):
            file[f"events/{axis}"] = values
        file["frames"] = np.zeros((4, 26, 34), np.uint8)
    _, said = opened(tmp_path / "a.h5")
    assert "pictures in frames (4×26×34) have no stamps beside them" in said
