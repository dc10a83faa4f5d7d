"""Files that are written are whole or not there, and nothing is left beside them."""

import errno
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from etnet import files
from etnet.errors import EtnetError
from etnet.files import (
    claimed,
    in_megabytes,
    printable,
    replace_folder,
    replacing,
    sweep_unfinished,
    working_folder,
    write_atomically,
)


def test_a_file_takes_its_place_when_it_is_whole(tmp_path):
    write_atomically(tmp_path / "a.txt", b"first")
    with replacing(tmp_path / "a.txt", suffix=".txt") as beside:
        beside.write_bytes(b"second")
        assert (tmp_path / "a.txt").read_bytes() == b"first"
        assert beside.suffix == ".txt"
    assert (tmp_path / "a.txt").read_bytes() == b"second"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_after_an_error_the_former_file_stands_and_nothing_beside_it(tmp_path):
    write_atomically(tmp_path / "a.txt", b"first")

    def cut_off():
        with replacing(tmp_path / "a.txt") as beside:
            beside.write_bytes(b"half")
            raise KeyError

    with pytest.raises(KeyError):
        cut_off()
    assert (tmp_path / "a.txt").read_bytes() == b"first"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_what_a_library_makes_of_a_full_disk_is_the_disks_error(tmp_path):
    def write(slip):
        with replacing(tmp_path / "a"):
            try:
                raise slip
            finally:
                raise RuntimeError("unexpected pos 64 vs 0")

    with pytest.raises(EtnetError, match=r"a: cannot be written \(No space left"):
        write(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    for other in (KeyError("x"), OSError(errno.ENOENT, "not there")):
        with pytest.raises(RuntimeError, match="unexpected pos"):
            write(other)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_not_replaced(tmp_path):
    (tmp_path / "a").mkdir()
    with pytest.raises(EtnetError, match="no regular file"):
        write_atomically(tmp_path / "a", b"")


def test_what_a_killed_process_left_is_swept_and_what_a_living_one_writes_is_not(tmp_path):
    ended = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, check=True)
    left = tmp_path / f".a.npz.{int(ended.stdout)}-{files._node()}.0123abcd.unfinished"
    living = tmp_path / f".a.npz.{os.getpid()}-{files._node()}.0123abcd.unfinished"
    folder = left.with_name(f"{left.name}.rows")
    for each in (left, living, tmp_path / "other.unfinished"):
        each.write_bytes(b"half")
    folder.mkdir()
    (folder / "0.npy").write_bytes(b"half")
    sweep_unfinished(tmp_path)
    assert sorted(os.listdir(tmp_path)) == sorted([living.name, "other.unfinished"])


@pytest.mark.parametrize("mark", ["-0123abcd", ""])
def test_what_another_node_is_writing_is_swept_once_it_has_not_changed_for_a_day(tmp_path, mark):
    ended = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, check=True)
    file = tmp_path / f".a.npz.{int(ended.stdout)}{mark}.0123abcd.unfinished"
    folder = file.with_name(f"{file.name}.rows")
    file.write_bytes(b"half")
    folder.mkdir()
    (folder / "0.npy").write_bytes(b"half")
    before = sorted(os.listdir(tmp_path))
    sweep_unfinished(tmp_path)
    assert sorted(os.listdir(tmp_path)) == before
    a_day_ago = time.time() - 86_500
    for each in (file, folder):
        os.utime(each, (a_day_ago, a_day_ago))
    sweep_unfinished(tmp_path)
    assert os.listdir(tmp_path) == [folder.name]
    os.utime(folder / "0.npy", (a_day_ago, a_day_ago))
    sweep_unfinished(tmp_path)
    assert os.listdir(tmp_path) == []


def test_a_file_that_two_nodes_write_into_one_folder_is_left_to_its_own(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_node", lambda: "0123abcd")
    monkeypatch.setattr(files.os, "getpid", lambda: 1 << 30)
    with replacing(tmp_path / "a") as beside:
        beside.write_bytes(b"whole")
        monkeypatch.undo()
        sweep_unfinished(tmp_path)
    assert (tmp_path / "a").read_bytes() == b"whole"


@pytest.mark.parametrize("code", [errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP])
def test_a_file_system_without_locks_holds_nobody_up(tmp_path, monkeypatch, code):
    fcntl = pytest.importorskip("fcntl")

    def flock(*_):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(fcntl, "flock", flock)
    with claimed(tmp_path / ".claim") as is_ours:
        assert is_ours


def test_a_lock_that_fails_otherwise_is_an_error(tmp_path, monkeypatch):
    fcntl = pytest.importorskip("fcntl")

    def flock(*_):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(fcntl, "flock", flock)
    with pytest.raises(OSError, match=os.strerror(errno.EIO)), claimed(tmp_path / ".claim"):
        pass


def test_a_folder_is_made_beside_its_place_and_takes_it_whole(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "old").write_bytes(b"")
    with working_folder(tmp_path / "a") as work:
        (work / "made").mkdir()
        (work / "made" / "new").write_bytes(b"")
        replace_folder(work / "made", tmp_path / "a")
    assert os.listdir(tmp_path) == ["a"]
    assert os.listdir(tmp_path / "a") == ["new"]


def test_a_folder_that_a_killed_process_worked_in_is_swept(tmp_path):
    script = (
        "import os, signal, sys\nfrom pathlib import Path\nfrom etnet.files import working_folder\n"
        "with working_folder(Path(sys.argv[1])) as work:\n"
        "    (work / 'half').write_bytes(b'half')\n    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    subprocess.run([sys.executable, "-c", script, str(tmp_path / "a")], check=False)
    assert len(os.listdir(tmp_path)) == 1
    sweep_unfinished(tmp_path)
    assert os.listdir(tmp_path) == []


FULL = """
import resource, sys
from pathlib import Path
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
import numpy as np
from etnet.errors import EtnetError
from etnet.export.arrays import _opened
row = np.random.default_rng(0).normal(size=(100, 100)).astype(np.float32)
try:
    with _opened(Path(sys.argv[1]), 40, {}) as sink:
        for _ in range(40):
            sink("frames", row)
except EtnetError as error:
    print(error)
    sys.exit(1)
"""


@pytest.mark.parametrize("name", ["a.h5", "a.npz"])
def test_arrays_on_a_full_disk_are_one_line_and_exit_1_and_leave_nothing(tmp_path, name):
    ended = subprocess.run([sys.executable, "-c", FULL, str(tmp_path / name)], capture_output=True, text=True)
    assert ended.returncode == 1, ended.stderr[-2000:]
    assert ended.stdout.startswith(f"{name}: ")
    assert len(ended.stdout.splitlines()) == 1
    assert os.listdir(tmp_path) == []


def test_names_that_are_not_utf_8_are_shown_escaped():
    assert printable(Path(os.fsdecode(b"caf\xe9.raw"))) == "caf\\xe9.raw"
    assert printable("\ud800x") == "\\ud800x"
    assert printable("café.raw") == "café.raw"
    printable("\ud800\udce9").encode()


def test_sizes_are_in_megabytes_rounded_up():
    assert in_megabytes(0) == "0 kB"
    assert in_megabytes(1_240) == "1.3 kB"
    assert in_megabytes(1_000_000) == "1 MB"
    assert in_megabytes(256_000_001) == "256.1 MB"
