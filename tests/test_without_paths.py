"""No folder and no name of this machine stands in what a page is told, whatever wrote the message."""

import errno
import os
import re
import string
import tempfile
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.catalogue.entries import Entry, under_its_name
from app.engine.failures import in_words
from etnet.errors import EtnetError, RecordingError
from etnet.without_paths import without_paths

LETTERS = string.ascii_letters + string.digits + "äßéñ_-+()&"
WORDS = st.text(LETTERS, min_size=4, max_size=12)
FOLDERS = st.lists(WORDS | st.lists(WORDS, min_size=2, max_size=4).map(" ".join), min_size=1, max_size=5)
OWN = "o'neil's"
POSIX = FOLDERS.map(lambda parts: ("/" + "/".join(parts) + "/", parts))
WINDOWS = st.tuples(st.sampled_from(["C:\\", "d:/", "\\\\server9\\"]), FOLDERS).map(
    lambda made: (made[0] + "\\".join(made[1]) + "\\", made[1])
)
MESSAGES = [
    "{}: cannot be read", "cannot read {}; give the path of a recording", "no such file: '{}'", 'is "{}" there?',
    "({})", "path={}", "read:{}", "file://{}", "either {} or {}", "a.raw: needs {}, which is not there",
]  # fmt: skip


@settings(deadline=None)
@given(POSIX | WINDOWS, st.sampled_from(MESSAGES))
def test_of_a_path_the_files_name_is_left(folder, message):
    path, parts = folder
    said = without_paths(message.replace("{}", f"{path}qqq.raw"))
    assert "qqq.raw" in said
    assert path.rstrip("/\\") not in said
    for part in parts:
        assert part not in said
    assert without_paths(said) == said


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("/home/me/My Films/a b.raw: is damaged", "a b.raw: is damaged"),
        (f"/home/{OWN}/a.raw", "a.raw"),
        ("'/home/me/x.h5'", "'x.h5'"),
        ("~/films/x.h5 is open", "x.h5 is open"),
        ("file:///srv/films/x.h5", "x.h5"),
        ("C:\\x.raw", "x.raw"),
        (r"[WinError 5] Access is denied: 'C:\\Users\\me\\x.raw'", "[WinError 5] Access is denied: 'x.raw'"),
        (r"\\nas\films\old ones\x.raw", "x.raw"),
        ("/data/one.raw, /data/two.raw and /data/three.raw", "one.raw, two.raw and three.raw"),
    ],
)
def test_paths_as_libraries_write_them(text, said):
    assert without_paths(text) == said


@pytest.mark.parametrize(
    "text",
    [
        "3/4 of the events and/or 16 px/s at 0.5 Hz/px",
        "https://example.org/a/b?c=d has it", "see docs/formats.md", "a.zip: inside/of it.txt is damaged",
        r"a\xff\xfe.raw: is no name", "10:30 / 11:30", "--roi 1,2,3,4", "events/xs lacks values", "", "/",
    ],
)  # fmt: skip
def test_what_is_no_folder_of_this_machine_stays(text):
    assert without_paths(text) == text


def test_a_folder_that_all_of_ours_lies_in_is_not_named_even_alone(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", "/home/somebody")
    monkeypatch.setattr(tempfile, "tempdir", "/scratch")
    assert without_paths("/home/somebody: is full. /scratch, too") == "…: is full. …, too"
    assert without_paths("/home/somebody/x.h5, /scratch/y.h5, /scratchy") == "x.h5, y.h5, /scratchy"


def test_the_name_of_this_machine_is_not_said(monkeypatch):
    monkeypatch.setattr("socket.gethostname", lambda: "gpu-17.lab.example")
    said = without_paths("GPU-17.lab.example and gpu-17 do not answer; gpu-170 and mygpu-17 are others")
    assert said == "this machine and this machine do not answer; gpu-170 and mygpu-17 are others"
    monkeypatch.setattr("socket.gethostname", lambda: "events")
    assert without_paths("no events") == "no events"


@pytest.mark.parametrize(
    "text", ["/a " * 50_000, "/" * 100_000, "C:\\" * 50_000, "/a b c d e f" * 20_000, "'" * 90_000]
)
def test_a_long_message_costs_little(text):
    began = time.process_time()
    without_paths(text)
    assert time.process_time() - began < 5


@settings(deadline=None)
@given(POSIX, st.sampled_from([OSError, ValueError, RecordingError, KeyError, RuntimeError]))
def test_a_failure_in_words_names_no_folder(folder, kind):
    path, parts = folder
    file = f"{path}qqq.raw"
    error = OSError(errno.EIO, os.strerror(errno.EIO), file) if kind is OSError else kind(f"{file}: is damaged")
    said = in_words(error, object())
    assert "qqq.raw" in said
    assert not any(part in said for part in parts)


@settings(deadline=None)
@given(POSIX, st.sampled_from(["data", "file", "upload"]))
def test_an_error_about_a_recording_names_no_folder(folder, kind):
    path, parts = folder
    entry = Entry("id", "my walk.raw", kind, "", Path(f"{path}qqq.raw"))
    said = str(under_its_name(EtnetError(f"{path}qqq.raw: is damaged ({path}other.txt is not there)"), entry))
    assert ("my walk.raw: is damaged" if kind == "upload" else "qqq.raw: is damaged") in said
    assert "other.txt" in said
    assert not any(re.search(re.escape(part), said) for part in parts)
