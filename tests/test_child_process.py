"""A process that was started to do one thing does not outlive the one that started it."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from etnet.events.write import write_recording
from tests.app.stand_ins import recording

ON_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="Linux alone tells a process that its parent has ended")
ROOT = Path(__file__).parents[1]

CHILD = "from etnet.child_process import end_with_parent; end_with_parent(); print(flush=True); input()"
PARENT = f"""
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", {CHILD!r}], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
child.stdout.readline()
print(child.pid, flush=True)
time.sleep(600)
"""


@ON_LINUX
def test_a_child_ends_with_a_parent_that_is_killed():
    with subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True) as parent:
        status = Path(f"/proc/{int(parent.stdout.readline())}/stat")
        assert status.exists()
        parent.send_signal(signal.SIGKILL)
    until(lambda: has_ended(status))


def until(condition, step=0.05):
    ends = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < ends
        time.sleep(step)


def has_ended(status):
    """Of a process by its /proc/…/stat; one that nobody waits for stays as a zombie."""
    with contextlib.suppress(FileNotFoundError, ProcessLookupError):
        return status.read_text().rsplit(")", 1)[-1].split()[0] == "Z"
    return True


@contextlib.contextmanager
def started(code, folder, **environment):
    """A process that runs `code` and may start others; it is killed in the end."""
    settings = {**os.environ, "PYTHONPATH": str(ROOT), "ETNET_CACHE": str(folder / "cache"), "TMPDIR": str(folder)}
    settings |= environment
    with subprocess.Popen([sys.executable, "-c", code], env=settings, stdout=subprocess.PIPE, text=True) as parent:
        try:
            yield parent
        finally:
            parent.kill()


def children_of(process):
    with contextlib.suppress(FileNotFoundError, ProcessLookupError):
        tasks = Path(f"/proc/{process}/task").iterdir()
        return [int(word) for task in tasks for word in (task / "children").read_text().split()]
    return []


def killed_while_its_child_stands_still(parent, is_at_work):
    """The child is stopped, so that it ends by being killed alone, and not by what it reads or writes."""
    until(lambda: any(map(is_at_work, children_of(parent.pid))), step=0.002)
    child = next(filter(is_at_work, children_of(parent.pid)))
    os.kill(child, signal.SIGSTOP)
    parent.kill()
    until(lambda: has_ended(Path(f"/proc/{child}/stat")))


def runs(script, library):
    """Whether a process runs a script and is so far that it has loaded a library; it took its limits before."""

    def look(process):
        with contextlib.suppress(OSError):
            # Before it runs anything of its own a child is a copy of its parent.
            is_script = script in Path(f"/proc/{process}/cmdline").read_text()
            return is_script and library in Path(f"/proc/{process}/maps").read_text()
        return False

    return look


@ON_LINUX
def test_the_reader_of_a_matlab_file_ends_with_a_process_that_is_killed(tmp_path):
    columns = {name: np.zeros(100_000) for name in ("x", "y", "ts", "p")}
    scipy.io.savemat(tmp_path / "a.mat", columns)
    code = f"from etnet.events.open import open_recording; open_recording({str(tmp_path / 'a.mat')!r})"
    with started(code, tmp_path) as parent:
        killed_while_its_child_stands_still(parent, runs("matlab_child", "/scipy/"))  # numpy has a libscipy_openblas


@ON_LINUX
def test_the_reader_of_a_visitors_file_ends_with_a_viewer_that_is_killed(tmp_path):
    write_recording(recording(num_events=100_000), tmp_path / "a.csv")
    code = f"""
from pathlib import Path
from app.catalogue.opening_apart import open_apart
from etnet.events.assumptions import NOTHING_ASSUMED
open_apart(Path({str(tmp_path / "a.csv")!r}), NOTHING_ASSUMED, 1 << 26, lambda share: None, lambda: True)
"""
    with started(code, tmp_path) as parent:
        killed_while_its_child_stands_still(parent, runs("opening_child", "numpy"))


@ON_LINUX
def test_pip_ends_with_a_process_that_is_killed(tmp_path):
    code = "from etnet.events.samples import SLIDER_DEPTH, fetch; fetch(SLIDER_DEPTH)"
    with socket.create_server(("127.0.0.1", 0)) as index:
        index.settimeout(60)
        address = f"http://127.0.0.1:{index.getsockname()[1]}/simple"
        with started(code, tmp_path, PIP_INDEX_URL=address, PIP_NO_INDEX="0", PIP_CONFIG_FILE=os.devnull) as parent:
            asking, _ = index.accept()  # pip asks, and is never answered
            with asking:
                asking.settimeout(60)
                while b"\r\n\r\n" not in asking.recv(65_536):
                    pass
                parent.kill()
                with contextlib.suppress(ConnectionResetError):
                    assert asking.recv(65_536) == b""
