"""Who opens an HDF5 file while it is recorded leaves the commit that is at work to its writer."""

from __future__ import annotations

import threading

import pytest

from etnet.events.formats.hdf5 import journal
from etnet.events.open import open_recording
from etnet.live.hdf5_writer import Hdf5Writer
from tests.live.sources import make_events, same
from tests.strategies import SMALL

EVENTS = make_events(3000)


class _Commits:
    """A writer of which `within` is called in the midst of the next commit, once its journal is there."""

    def __init__(self, path, within, monkeypatch):
        self.writer = Hdf5Writer(path, SMALL, "a camera")
        self._within = within
        self._plain, self._commit, self._is_committing = journal._write_all, self.writer._raw.commit, False
        monkeypatch.setattr(journal, "_write_all", self._write)
        monkeypatch.setattr(self.writer._raw, "commit", self._begin)

    def _begin(self):
        self._is_committing = True
        self._commit()

    def _write(self, file, content, place):
        if self._is_committing:
            self._is_committing = False
            self._within()
        self._plain(file, content, place)

    def add(self, start, stop):
        self.writer.add_events(EVENTS[start:stop])
        self.writer.flush()

    def goes_on(self, path, start):
        """The rest of the recording, and that all of it is there."""
        self._within = lambda: None
        self.add(start, 3000)
        self.writer.close()
        with open_recording(path) as recording:
            assert same(recording.read(0, 3000), EVENTS)


def test_a_commit_of_a_writer_that_lives_is_not_played(tmp_path, monkeypatch):
    path, seen = tmp_path / "live.h5", []
    monkeypatch.setattr(journal, "_PATIENCE", 0.05)

    def opens():
        seen.append((journal.journal_of(path).is_file(), journal.restore(path), journal.journal_of(path).is_file()))

    commits = _Commits(path, opens, monkeypatch)
    commits.add(0, 1000)
    assert seen == [(True, False, True)]
    assert not journal.journal_of(path).exists()
    commits.goes_on(path, 1000)


def test_a_reader_waits_for_the_commit_and_plays_nothing_of_it_afterwards(tmp_path, monkeypatch):
    path, found = tmp_path / "live.h5", []
    monkeypatch.setattr(journal, "_PATIENCE", 60.0)
    is_waiting = threading.Event()
    lock = journal._lock

    def told(file, is_shared):
        try:
            lock(file, is_shared)
        except BlockingIOError:
            is_waiting.set()
            raise

    monkeypatch.setattr(journal, "_lock", told)
    reader = threading.Thread(target=lambda: found.append(journal.restore(path)))

    def opens():
        reader.start()
        assert is_waiting.wait(60)

    commits = _Commits(path, opens, monkeypatch)
    commits.add(0, 1000)
    reader.join(60)
    assert found == [False]
    commits.goes_on(path, 1000)


def test_a_journal_that_somebody_removed_does_not_end_the_recording(tmp_path, monkeypatch):
    path = tmp_path / "live.h5"
    commits = _Commits(path, journal.journal_of(path).unlink, monkeypatch)
    commits.add(0, 1000)
    commits.goes_on(path, 1000)


def test_a_journal_that_is_gone_by_the_time_it_is_locked_is_of_a_commit_that_ended(tmp_path, monkeypatch):
    path = tmp_path / "live.h5"
    path.write_bytes(b"later")
    journal.journal_of(path).write_bytes(b"whatever")
    lock = journal._lock

    def late(file, is_shared):
        journal.journal_of(path).unlink()
        lock(file, is_shared)

    monkeypatch.setattr(journal, "_lock", late)
    monkeypatch.setattr(journal, "_play", lambda *_: pytest.fail("it was played"))
    assert not journal.restore(path)
