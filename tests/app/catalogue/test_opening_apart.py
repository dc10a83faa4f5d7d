"""A stranger's file is opened in a process of its own: its cost is limited, and what goes wrong is one sentence."""

import json
import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.catalogue import opening_apart
from app.catalogue.child_process import end, started
from app.catalogue.entries import Entry
from app.catalogue.opening_apart import open_apart
from app.catalogue.plain_tables import read_tables, write_tables
from app.catalogue.recordings import Catalogue
from app.config import ViewerConfig
from etnet.errors import Cancelled, EtnetError
from etnet.events.assumptions import NOTHING_ASSUMED
from etnet.events.open import open_recording
from etnet.events.recording import Inertial
from etnet.events.triggers import Triggers
from etnet.events.write import write_recording
from tests.app.stand_ins import recording

LARGEST = 64 << 20


def children():
    """Processes that this one started and that still run."""
    return Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text().split()


def opened(path, **more):
    shares = []
    settings = {"progress": shares.append, "is_wanted": lambda: True, **more}
    apart = open_apart(path, NOTHING_ASSUMED, settings.pop("largest", LARGEST), **settings)
    return apart.path, apart.remarks, shares


def test_the_events_frames_and_remarks_are_the_files(tmp_path):
    write_recording(recording(), tmp_path / "a.csv")
    out, remarks, shares = opened(tmp_path / "a.csv")
    with open_recording(tmp_path / "a.csv") as plain, open_recording(out) as apart:
        there, here = plain.read(0, plain.num_events), apart.read(0, apart.num_events)
        for column in "xytp":
            assert np.array_equal(getattr(there, column), getattr(here, column))
        assert set(map(str, plain.remarks)) <= set(map(str, remarks))
    assert shares[-1] == 1


def test_triggers_and_motion_come_through(tmp_path):
    triggers = Triggers(np.array([5, 5, 900], np.int64), np.array([0, 3, 0], np.int16), np.array([1, -1, 0], np.int8))
    motion = Inertial(
        np.arange(4, dtype=np.int64) * 100, np.full((4, 3), 0.5, np.float32), np.eye(4, 3, dtype=np.float32)
    )
    write_tables(triggers, motion, tmp_path / "a.h5")
    seen, moved = read_tables(tmp_path / "a.h5")
    for there, here in ((triggers, seen), (motion, moved)):
        assert all(np.array_equal(getattr(there, name), getattr(here, name)) for name in there.__dataclass_fields__)
    assert read_tables(tmp_path / "none.h5") == (None, None)


@pytest.mark.parametrize(
    ("what", "content"),
    [
        ("triggers", b"\0" * 12), ("triggers", np.array([9, 0], "<i8").tobytes() + b"\0" * 6), ("motion", b"\xff" * 64),
        ("triggers", b"\x05" * 11),
    ],
)  # fmt: skip
def test_a_table_that_makes_no_sense_is_left_out(tmp_path, what, content):
    (tmp_path / f"a.{what}").write_bytes(content)
    assert read_tables(tmp_path / "a.h5") == (None, None)


def test_a_damaged_file_is_refused_as_everywhere_and_leaves_no_process(tmp_path):
    (tmp_path / "a.csv").write_text("no events\n")
    with pytest.raises(EtnetError, match=r"a\.csv") as refusal:
        opened(tmp_path / "a.csv")
    assert "\n" not in str(refusal.value)
    assert children() == []


@pytest.mark.parametrize(
    ("child", "why"),
    [
        ("import os; os.abort()", "ended the process"),
        ("import sys; sys.exit(3)", "ended the process"),
        ("while True: pass", "more computing"),
        ("x = bytearray(1 << 40)", "ended the process"),
        ("print('{' * 90_000)\nprint('[1]')\nprint('{\"failed\": \"a.csv: no\"}')\nraise SystemExit(1)", "a.csv: no"),
    ],
)
def test_a_crash_or_a_limit_is_one_sentence(tmp_path, monkeypatch, child, why):
    head = "import json, sys; sys.path.insert(0, '')\nimport resource\ntold = json.loads(sys.stdin.readline())\n"
    limits = (
        "resource.setrlimit(resource.RLIMIT_CPU, (1, 2))\nresource.setrlimit(resource.RLIMIT_AS, (1 << 33, 1 << 33))\n"
    )
    (tmp_path / "child.py").write_text(f"{head}{limits}{child}\n")
    (tmp_path / "a.csv").write_text("")
    monkeypatch.setattr(opening_apart.opening_child, "__file__", str(tmp_path / "child.py"))
    with pytest.raises(EtnetError, match=why):
        opened(tmp_path / "a.csv")
    assert children() == []


LIMITS = """
import json, resource
from app.catalogue.limited import told_and_limited
told_and_limited()
names = ("RLIMIT_AS", "RLIMIT_CPU", "RLIMIT_FSIZE", "RLIMIT_CORE")
print(json.dumps([resource.getrlimit(getattr(resource, name))[0] for name in names]))
"""


def test_a_process_that_reads_a_strangers_file_has_its_limits(tmp_path):
    (tmp_path / "child.py").write_text(LIMITS)
    child = started(str(tmp_path / "child.py"), {"seconds": opening_apart.SECONDS, "bytes": 12_345}, tmp_path)
    try:
        assert json.loads(child.stdout.read()) == [3 << 30, 60, 12_345, 0]
    finally:
        end(child)
        child.stdout.close()


def test_it_ends_with_its_visitor(tmp_path):
    write_recording(recording(num_events=200_000), tmp_path / "a.csv")
    began = time.monotonic()
    with pytest.raises(Cancelled):
        opened(tmp_path / "a.csv", is_wanted=lambda: time.monotonic() - began < 0.3)
    assert time.monotonic() - began < 3
    assert children() == []


def test_what_unpacks_to_too_much_is_refused(tmp_path):
    write_recording(recording(num_events=200_000), tmp_path / "a.csv")
    with pytest.raises(EtnetError, match=r"^a\.csv: unpacks to more"):
        opened(tmp_path / "a.csv", largest=100_000)
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


def test_nothing_is_left_of_one_that_its_visitors_account_stops(tmp_path):
    write_recording(recording(num_events=200_000), tmp_path / "a.csv")

    def is_wanted():
        if any(path.name != "a.csv" for path in tmp_path.iterdir()):
            raise EtnetError("no room")
        return True

    with pytest.raises(EtnetError, match="no room"):
        opened(tmp_path / "a.csv", is_wanted=is_wanted)
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]
    assert children() == []


@pytest.mark.parametrize("is_open", [True, False])
def test_the_catalogue_opens_uploads_apart_where_others_come_in(tmp_path, is_open):
    config = ViewerConfig(public_url="http://show.example", uploads=16) if is_open else ViewerConfig()
    pulses = Triggers(np.array([9, 90_000], np.int64), np.array([0, 2], np.int16), np.array([1, -1], np.int8))
    write_recording(replace(recording(), triggers=pulses, ground_truth=None), tmp_path / "key.raw")
    catalogue = Catalogue(config)
    try:
        catalogue.take_in(Entry("upload-1", "mine.raw", "upload", "", tmp_path / "key.raw"))
        found = catalogue.open("upload-1")
        assert found.name == "mine"
        assert found.num_events == 6000
        assert found.triggers.channels.tolist() == [0, 2]
        assert found.triggers.edges.tolist() == [1, -1]
        assert not any("not written" in str(remark) for remark in found.remarks)
        assert (tmp_path / "key.opened.h5").exists() == is_open
        assert "key" not in " ".join(map(str, found.remarks))
    finally:
        catalogue.close()
