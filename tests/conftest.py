"""What holds for all tests: annotations are enforced, and the run says how many real recordings it read."""

import atexit
import os
import sys
from collections import Counter

# Before torch is loaded. Exactness holds for one number of threads, and an engine that a test starts with another
# number changes the matrix library's for the whole process.
os.environ["OMP_NUM_THREADS"] = os.environ["MKL_NUM_THREADS"] = "1"

import hypothesis
import pytest
from jaxtyping import install_import_hook

from tests import typecheck
from tests.real_data import DATA

# Shapes and types of every annotated function below are checked at each call.
install_import_hook(
    [
        "etnet.events",
        "etnet.inspection",
        "etnet.live",
        "etnet.nets",
        "etnet.playback",
        "etnet.reconstruction",
        "etnet.simulation",
    ],
    f"{typecheck.__name__}.enforced",
)

# A busy machine is no failure.
hypothesis.settings.register_profile("whatever it takes", deadline=None)
hypothesis.settings.load_profile("whatever it takes")

_sessions: list[pytest.Session] = []


@atexit.register  # before all others, so that it is the last to run
def _leave() -> None:
    """End as the viewer does, which waits for no thread that computes: an interpreter torn down under one may crash."""
    for session in _sessions:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(int(session.exitstatus))


_real: Counter[str] = Counter()
_left_out: Counter[str] = Counter()


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Count the tests that read real recordings, and those that were left out for want of one."""
    if report.when == "call" or report.skipped:
        # An expected failure is called skipped too; it did read its recording.
        if "real" in report.keywords and not hasattr(report, "wasxfail"):
            _real[report.outcome] += 1
        if report.skipped and isinstance(report.longrepr, tuple):
            _left_out[report.longrepr[2].removeprefix("Skipped: ")] += 1


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """One line for the real recordings, one for each reason to leave tests out."""
    terminalreporter.write_line(f"real recordings: {_real['passed']} tests read them, {_real['skipped']} could not")
    for reason, count in sorted(_left_out.items()):
        terminalreporter.write_line(f"left out: {count} × {reason}")


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Where the recordings are at hand, none of their tests may be left out; in CI no browser test either."""
    _sessions.append(session)
    if session.exitstatus != 0:
        return
    if DATA.is_dir() and _real["skipped"]:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
    if os.environ.get("CI") == "true" and any("chromium" in reason for reason in _left_out):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
