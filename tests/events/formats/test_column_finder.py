"""Events are found wherever they lie in HDF5, npz, npy and MATLAB files, and what else could be events is named."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import scipy.io

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.column_names import column_keys, named_axis
from etnet.events.open import Assumptions, open_recording
from tests.events.containers import all_events, assert_same_events
from tests.strategies import make_events

EVENTS = make_events(300)
OTHER = make_events(300, seed=1)
SIZE = Assumptions(width=20, height=12)


def columns(names=("x", "y", "t", "p"), events=EVENTS) -> dict[str, np.ndarray]:
    x, y, t, p = names
    return {x: events.x, y: events.y, t: events.t, p: (events.p > 0).astype("u1")}


def records(names=("x", "y", "t", "p")) -> np.ndarray:
    table = np.empty(len(EVENTS), [(names[0], "u2"), (names[1], "u2"), (names[2], "i8"), (names[3], "?")])
    for name, column in columns(names).items():
        table[name] = column
    return table


def table(order="txyp", dtype="i8") -> np.ndarray:
    return np.stack([columns()[axis] for axis in order], 1).astype(dtype)


def holds_events(path, assume=SIZE) -> str:
    """Its remarks, after its events were found to be right."""
    with open_recording(path, assume=assume) as recording:
        found = all_events(recording)
        assert_same_events(found, EVENTS)
        np.testing.assert_array_equal(found.t, EVENTS.t)
        return "\n".join(map(str, recording.remarks))


def save_h5(path, tree: dict, attributes: dict | None = None):
    with h5py.File(path, "w") as file:
        for name, value in tree.items():
            file[name] = value
        file.attrs.update(attributes or {})
    return path


LAYOUTS = {
    "root": lambda: columns(),
    "M3ED": lambda: (
        {f"prophesee/left/{k}": v for k, v in columns().items()}
        | {f"prophesee/right/{k}": v for k, v in columns(events=OTHER).items()}
    ),
    "long names": lambda: {f"events/{k}": v for k, v in columns(("x", "y", "timestamp", "polarity")).items()},
    "plural": lambda: {f"event/{k}": v for k, v in columns(("xs", "ys", "ts", "ps")).items()},
    "nested": lambda: {f"a/b/dvs/{k}": v for k, v in columns(("x_pos", "y_pos", "t_us", "pol")).items()},
    "pairs": lambda: {"events/xy": np.stack([EVENTS.x, EVENTS.y], 1), "events/t": EVENTS.t, "events/p": EVENTS.p},
    "records": lambda: {"events": records()},
    "records with long names": lambda: {"data/cd": records(("x", "y", "timestamp", "polarity"))},
    "v2e": lambda: {"events": table("txyp", "u4")},
    "on its side": lambda: {"events": table("xytp").T.copy()},
    "one row": lambda: {k: v.reshape(1, -1) for k, v in columns().items()},
    "EM beside": lambda: (
        {f"TD/{k}": v for k, v in columns().items()} | {f"EM/{k}": v for k, v in columns(events=OTHER).items()}
    ),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_hdf5_columns_records_and_tables_are_found_in_any_group(layout, tmp_path):
    said = holds_events(save_h5(tmp_path / "a.h5", LAYOUTS[layout]() | {"imu/t": np.arange(7), "poses": np.eye(4)}))
    if layout == "M3ED":
        assert "events are in prophesee/left" in said
        assert "prophesee/right looks like events, too; left out" in said
    if layout == "EM beside":
        assert "events are in TD" in said


@pytest.mark.parametrize(
    ("beside", "attributes"),
    [
        ({"events/width": 33, "events/height": 22}, {}),
        ({"width": [33], "height": [22]}, {}),
        ({"events/calib/resolution": [33, 22]}, {}),
        ({}, {"sensor_resolution": (22, 33)}),
        ({}, {"width": 33, "height": 22}),
        ({}, {"geometry": "33x22"}),
    ],
)
def test_the_size_that_stands_nearest_to_the_events_is_taken(beside, attributes, tmp_path):
    tree = {f"events/{k}": v for k, v in columns(("x", "y", "t", "pol")).items()}
    with open_recording(save_h5(tmp_path / "a.h5", tree | beside, attributes)) as recording:
        assert recording.sensor == Sensor(33, 22)


def test_a_size_that_no_sensor_has_is_refused_before_anything_is_made_of_it(tmp_path):
    path = save_h5(tmp_path / "a.h5", columns(), {"sensor_resolution": (65_536, 65_536)})
    with pytest.raises(RecordingError, match="--max-pixels"):
        open_recording(path)


def test_a_refusal_lists_what_is_there_two_levels_deep(tmp_path):
    path = save_h5(tmp_path / "a.h5", {"ovc/left/data": np.zeros(3), "ovc/ts": np.zeros(3), "pose": np.eye(4)})
    with pytest.raises(RecordingError, match=r"ovc \(left, ts\), pose \(4, 4\)"):
        open_recording(path)


def test_columns_that_are_only_declared_are_a_bomb(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name in "xytp":
            file.create_dataset(name, (10**11,), "i8", chunks=(1 << 16,), compression="gzip")
    with pytest.raises(RecordingError, match="bomb"):
        open_recording(tmp_path / "a.h5")


def test_a_t_offset_that_the_stamps_have_in_them_is_not_added(tmp_path):
    start = 1_650_000_000_000_000
    for stored, remark in ((EVENTS.t + start, True), (EVENTS.t, False)):
        tree = {f"events/{k}": v for k, v in columns().items()} | {"events/t": stored, "t_offset": start}
        with open_recording(save_h5(tmp_path / "a.h5", tree | {"ms_to_idx": np.zeros(1)}), assume=SIZE) as recording:
            assert recording.span.start == start + EVENTS.t[0]
            assert any("t_offset" in said.text for said in recording.remarks) is remark


@pytest.mark.parametrize("word", ["ns", b"nanoseconds", np.bytes_(b"ns")])
@pytest.mark.parametrize("block", [0, 512])
def test_the_unit_that_a_text_beside_the_columns_names_is_taken(word, block, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w", userblock_size=block) as file:
        for name, value in {**columns(), "t": EVENTS.t * 1000, "time_unit": word}.items():
            file[f"events/{name}"] = value
    assert "time unit" not in holds_events(tmp_path / "a.h5")


@pytest.mark.parametrize("is_damaged", [False, True])
def test_a_text_that_is_too_long_for_a_unit_is_not_read(is_damaged, tmp_path):
    path, word = tmp_path / "a.h5", "ns" if is_damaged else "ns" + " " * 100
    save_h5(path, {**columns(), "time_unit": word})
    if is_damaged:
        with h5py.File(path) as file:
            place = file["time_unit"].id.get_offset()
        content = bytearray(path.read_bytes())
        assert content[place : place + 4] == b"\2\0\0\0"
        content[place : place + 4] = b"\xff\xff\xff\xff"
        path.write_bytes(content)
    assert "time unit us, because" in holds_events(path)


NUMPY = {
    "arr_0.npz": lambda path: np.savez(path, table("xytp")),
    "events.npz": lambda path: np.savez(path, events=table("xypt")),
    "records.npz": lambda path: np.savez_compressed(path, event_data=records()),
    "columns.npz": lambda path: np.savez(path, **columns(("x_pos", "y_pos", "timestamp", "polarity"))),
    "meta.npz": lambda path: np.savez(path, **columns(), meta=np.array({"a": 1}, object)),
    "records.npy": lambda path: np.save(path, records(("x", "y", "timestamp", "polarity"))),
    "table.npy": lambda path: np.save(path, table("txyp", "f8")),
}


@pytest.mark.parametrize("name", NUMPY)
def test_numpy_files_of_every_shape_are_found(name, tmp_path):
    NUMPY[name](tmp_path / name)
    holds_events(tmp_path / name)


@pytest.mark.parametrize("order", ["txyp", "xytp", "xypt", "tpxy", "pxyt", "ptxy"])
@pytest.mark.parametrize("off", [0, -1])
def test_four_columns_are_told_by_their_values_in_any_order(order, off, tmp_path):
    stored = columns() | {"p": np.where(EVENTS.p > 0, 1, off)}
    np.save(tmp_path / "a.npy", np.stack([stored[axis].astype("i8") for axis in order], 1))
    said = holds_events(tmp_path / "a.npy")
    assert f"the four columns are {', '.join(order)}" in said


@pytest.mark.parametrize("name", ["a.npy", "a.npz"])
def test_python_objects_are_named_and_not_loaded(name, tmp_path):
    held = {axis: np.array(column.tolist(), object) for axis, column in columns().items()}
    if name == "a.npy":
        np.save(tmp_path / name, np.array(held, object), allow_pickle=True)
    else:
        np.savez(tmp_path / name, allow_pickle=True, **held)
    with pytest.raises(RecordingError, match="Python objects, which are not loaded"):
        open_recording(tmp_path / name)


def test_boxes_are_no_events(tmp_path):
    boxes = np.zeros(3, [("t", "u8"), ("x", "f4"), ("y", "f4"), ("w", "f4"), ("h", "f4"), ("class_id", "u1")])
    np.save(tmp_path / "a.npy", boxes)
    with pytest.raises(RecordingError, match="boxes"):
        open_recording(tmp_path / "a.npy")


@pytest.mark.parametrize("kind", ["EVIMO2", "EVREAL in whole µs", "plain"])
def test_a_folder_of_npy_columns_is_one_recording(kind, tmp_path):
    prefix = {"EVIMO2": "dataset_events_", "EVREAL in whole µs": "events_", "plain": ""}[kind]
    stamps = EVENTS.t / 1e6 if kind == "EVIMO2" else EVENTS.t
    np.save(tmp_path / f"{prefix}{'ts' if 'EVREAL' in kind else 't'}.npy", stamps)
    np.save(tmp_path / f"{prefix}xy.npy", np.stack([EVENTS.x, EVENTS.y], 1))
    np.save(tmp_path / f"{prefix}p.npy", EVENTS.p > 0)
    holds_events(tmp_path)


MATRICES = {
    "matrix": lambda: {"events": table("xytp", "f8")},
    "struct": lambda: {"TD": columns(("x", "y", "ts", "p"))},
    "EM first": lambda: {"EM": columns(("x", "y", "ts", "p"), OTHER), "TD": columns(("x", "y", "ts", "p"))},
    "struct in struct": lambda: {"data": {"dvs": columns(("x", "y", "timeStamp", "polarity")), "info": 3.0}},
}


@pytest.mark.parametrize("layout", MATRICES)
def test_matlab_structs_and_matrices_are_found_and_td_comes_before_em(layout, tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", MATRICES[layout]())
    said = holds_events(tmp_path / "a.mat")
    assert ("EM (exposure measurements" in said) is (layout == "EM first")


def test_polarity_of_one_and_two_means_off_and_on_in_every_container(tmp_path):
    stored = columns() | {"p": np.where(EVENTS.p > 0, 2, 1)}
    np.savez(tmp_path / "a.npz", **stored)
    save_h5(tmp_path / "a.h5", stored)
    scipy.io.savemat(tmp_path / "a.mat", stored)
    np.savetxt(tmp_path / "a.csv", np.stack([stored[k] for k in "txyp"], 1), "%d", ",", header="t,x,y,p", comments="")
    for name in ("a.npz", "a.h5", "a.mat", "a.csv"):
        assert "polarity 1/2 was read as OFF/ON" in holds_events(tmp_path / name)


NAMES = {
    "x": ["x", "XS", "x_pos", "events_x", "x (px)", "xaddr", "dataset_events_x"],
    "y": ["y", "ys", "Y", "pixel_y"],
    "t": ["t", "ts", "timestamp [us]", "Time (s)", "event_timestamp", "TimeStamp", "t_ns", "timestampns", "time_stamp"],
    "p": ["p", "pol", "Polarity", "is_on", "events_p"],
    None: ["", "w", "frame_ts", "class_id", "t_offset", "ms_to_idx", "px", "0"],
}


@pytest.mark.parametrize("axis", NAMES)
def test_names_are_known_in_any_spelling_and_others_are_not(axis):
    for name in NAMES[axis]:
        named = named_axis(name)
        assert (None if named is None else named[0]) == axis, name


def test_a_unit_in_the_name_of_the_time_is_read():
    units = {"t_us": "us", "timestamp [ns]": "ns", "Time (s)": "s", "t(ms)": "ms", "timestamp": None, "ts": None}
    assert {name: named_axis(name)[1] for name in units} == units


def test_of_several_names_for_one_axis_the_plainest_is_taken():
    assert column_keys(["xs", "events_x", "x", "y", "timestamp", "t", "p", "on"]) == {k: k for k in "xytp"}
    assert column_keys(["x", "y", "t"]) is None
