"""torch is imported around the drawing of pages, and in the end whatever happens."""

import gc
import sys
import threading
import time

import pytest

from app.engine import gentle_import
from app.engine.gentle_import import GentleImport


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Three modules that count as the network's."""
    for name in ("first", "second", "third"):
        (tmp_path / f"torch_{name}.py").write_text("")
        monkeypatch.delitem(sys.modules, f"torch_{name}", raising=False)
    monkeypatch.syspath_prepend(tmp_path)


def importing(gentle, done):
    with gentle.imports():
        import torch_first  # noqa: F401

        done.set()


def test_while_nobody_comes_nothing_waits(package):
    done = threading.Event()
    importing(GentleImport(), done)
    assert done.is_set()
    assert not [finder for finder in sys.meta_path if isinstance(finder, gentle_import._Waiting)]


@pytest.mark.parametrize("begins", [True, False], ids=["a page has come", "a page may come"])
def test_an_import_waits_until_a_page_has_asked_for_its_frame(package, monkeypatch, begins):
    monkeypatch.setattr(gentle_import, "PAUSE", 20.0)
    monkeypatch.setattr(gentle_import, "MOST_PAUSES", 20.0)
    gentle, done = GentleImport(coming=0.0 if begins else 20.0), threading.Event()
    if begins:
        gentle.page_begins()
    thread = threading.Thread(target=importing, args=(gentle, done))
    thread.start()
    assert not done.wait(0.1)
    gentle.page_asks()
    assert done.wait(10)
    thread.join()


def test_a_crowd_cannot_keep_the_network_away(package, monkeypatch):
    monkeypatch.setattr(gentle_import, "MOST_PAUSES", 0.05)
    gentle = GentleImport()
    began = time.monotonic()
    for _ in range(20):
        gentle.page_begins()
        gentle.wait()
    assert time.monotonic() - began < 5


def test_other_threads_import_what_they_need_while_it_waits(tmp_path, monkeypatch):
    monkeypatch.setattr(gentle_import, "PAUSE", 20.0)
    monkeypatch.setattr(gentle_import, "MOST_PAUSES", 20.0)
    gentle, done = GentleImport(), threading.Event()
    sys.page_begins = gentle.page_begins
    (tmp_path / "torch_outer.py").write_text("import sys\nsys.page_begins()\nimport torch_inner\n")
    (tmp_path / "torch_inner.py").write_text("")
    (tmp_path / "a_pages_own.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)

    def importing_outer():
        with gentle.imports():
            import torch_outer  # noqa: F401

            done.set()

    thread = threading.Thread(target=importing_outer)
    thread.start()
    assert not done.wait(0.2)
    began = time.monotonic()
    import a_pages_own  # noqa: F401

    assert time.monotonic() - began < 5
    assert not done.is_set()
    gentle.page_asks()
    thread.join(10)
    assert done.is_set()
    del sys.page_begins


def test_garbage_is_looked_for_again_after_an_import_that_failed():
    def fails():
        with gentle_import._without_collecting():
            assert not gc.isenabled()
            raise ImportError

    assert gc.isenabled()
    with pytest.raises(ImportError):
        fails()
    assert gc.isenabled()
