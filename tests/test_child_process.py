"""A process that was started to do one thing does not outlive the one that started it."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

CHILD = "from etnet.child_process import end_with_parent; end_with_parent(); print(flush=True); input()"
PARENT = f"""
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", {CHILD!r}], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
child.stdout.readline()
print(child.pid, flush=True)
time.sleep(600)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="Linux alone tells a process that its parent has ended")
def test_a_child_ends_with_a_parent_that_is_killed():
    with subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True) as parent:
        status = Path(f"/proc/{int(parent.stdout.readline())}/stat")
        assert status.exists()
        parent.send_signal(signal.SIGKILL)
    ends = time.monotonic() + 60
    while status.exists() and status.read_text().rsplit(")", 1)[-1].split()[0] != "Z":
        assert time.monotonic() < ends
        time.sleep(0.05)
