"""The parts of a ROS 2 folder are one recording, in the order in which they were recorded."""

from __future__ import annotations

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.open import open_recording
from tests.events.containers import all_events
from tests.events.formats.test_ros import event_array, store_of, write_database
from tests.strategies import make_events

NUM_PARTS = 12
EVENTS = make_events(10 * NUM_PARTS)
LISTED = "rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n{}  duration:\n    nanoseconds: 1\n"


def write_folder(folder, names) -> None:
    folder.mkdir(exist_ok=True)
    store = store_of(True)
    for number, name in enumerate(names):
        part = EVENTS[10 * number : 10 * number + 10]
        write_database(folder / name, [event_array(part, store, True)])


def listed(*names: str) -> str:
    return LISTED.format("".join(f"    - {name}\n" for name in names))


def assert_in_order(folder) -> list[str]:
    with open_recording(folder) as recording:
        np.testing.assert_array_equal(all_events(recording).t, EVENTS.t)
        np.testing.assert_array_equal(all_events(recording).x, EVENTS.x)
        return [remark.text for remark in recording.remarks]


@pytest.mark.parametrize("metadata", [None, "{[}:", "\x00", "relative_file_paths: 7\n", listed("../../secret.db3")])
def test_twelve_parts_come_in_the_order_of_their_numbers(metadata, tmp_path):
    write_folder(tmp_path / "bag", [f"rec_2026_11_27_{number}.db3" for number in range(NUM_PARTS)])
    if metadata is not None:
        (tmp_path / "bag" / "metadata.yaml").write_text(metadata)
    assert_in_order(tmp_path / "bag")


@pytest.mark.parametrize("form", ["{}", '"{}"', "'{}'", "bag/{}", "./{}"])
def test_the_recorders_list_of_parts_wins_over_their_names(form, tmp_path):
    names = [f"part_{'zyxwvutsrqpo'[number]}.db3" for number in range(NUM_PARTS)]
    write_folder(tmp_path / "bag", names)
    (tmp_path / "bag" / "metadata.yaml").write_text(listed(*(form.format(name) for name in names)))
    assert_in_order(tmp_path / "bag")


def test_parts_the_list_lacks_and_parts_that_lack_are_told(tmp_path):
    names = [f"rec_{number}.db3" for number in range(NUM_PARTS)]
    write_folder(tmp_path / "bag", names)
    write_database(tmp_path / "bag" / "copy.db3", [event_array(EVENTS[:10], store_of(True), True)])
    (tmp_path / "bag" / "metadata.yaml").write_text(listed(*names, "rec_12.db3", "/etc/rec_13.db3"))
    said = assert_in_order(tmp_path / "bag")
    assert any("copy.db3" in text and "left out" in text for text in said)
    assert any("2 parts" in text and "rec_12.db3" in text for text in said)


def test_a_part_that_is_a_link_out_of_the_folder_is_refused(tmp_path):
    write_folder(tmp_path / "bag", ["rec_0.db3"])
    (tmp_path / "bag" / "rec_0.db3").rename(tmp_path / "secret.db3")
    (tmp_path / "bag" / "rec_0.db3").symlink_to(tmp_path / "secret.db3")
    with pytest.raises(RecordingError, match="leads out of the folder"):
        open_recording(tmp_path / "bag")
