"""ROS 2 recordings in SQLite (.db3), read without running anything that the file defines.

A file may hold views and computed columns, whose queries never end, under the names that are read: plain tables alone
are taken, and every statement is stopped when it works for long without a row.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np

from etnet.errors import RecordingError
from etnet.events.formats.bounds import MAX_BLOCK, at_most
from etnet.events.formats.ros.containers import MOST_TOPICS, Contents, Message

_LOOK = 10_000
"""Instructions of SQLite's machine between two looks."""

_MOST_LOOKS = 20_000
"""Looks without a row after which a statement is given up: some seconds."""

_MOST_MESSAGES = 1 << 27
_LONGEST_VALUE = 1_000_000_000
"""Bytes; SQLite itself takes no more."""
_COLUMNS = {"topics": ("id", "name", "type"), "messages": ("id", "topic_id", "timestamp", "data")}


class _Watch:
    """Counts the work since the last row, and passes on a wish to stop."""

    def __init__(self, contents: Contents) -> None:
        self._contents = contents
        self._looks = 0
        self.fraction = 0.0
        self.stopped_by: BaseException | None = None

    def __call__(self) -> bool:
        """Whether SQLite is to stop; what is raised here would be lost, so it is kept."""
        self._looks += 1
        if self._looks > _MOST_LOOKS:
            self.stopped_by = RecordingError("a query that does not end")
            return True
        try:
            self._contents.tick(self.fraction)
        except BaseException as wish:
            self.stopped_by = wish
            return True
        return False

    def has_a_row(self) -> None:
        """The statement gave a row."""
        self._looks = 0


def read_database(path: Path, contents: Contents) -> Iterator[Message]:
    """The wanted messages in the order of their stamps."""
    # A URI with mode=ro and immutable=1 writes no journal beside the file.
    uri = f"{path.resolve().as_uri()}?mode=ro&immutable=1"
    watch = _Watch(contents)
    with closing(sqlite3.connect(uri, uri=True)) as database:
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(at_most(MAX_BLOCK), _LONGEST_VALUE))
        database.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
        database.set_progress_handler(watch, _LOOK)
        try:
            database.execute("PRAGMA trusted_schema = OFF")
            _check_tables(database, path.name)
            yield from _messages(database, contents, watch)
        except sqlite3.Error as slip:
            if isinstance(watch.stopped_by, RecordingError):
                raise RecordingError(f"{path.name}: holds {watch.stopped_by}; it is no recorder's file") from slip
            if watch.stopped_by is not None:
                raise watch.stopped_by from None
            raise


def _check_tables(database: sqlite3.Connection, name: str) -> None:
    for table, columns in _COLUMNS.items():
        found = database.execute("SELECT type, sql FROM sqlite_master WHERE name = ?", (table,)).fetchall()
        is_plain = len(found) == 1 and found[0][0] == "table" and "VIRTUAL" not in str(found[0][1])[:200].upper()
        if not is_plain:
            what = "holds no table" if not found else "holds something else than a plain table under the name"
            raise RecordingError(f"{name}: {what} {table}; wanted a recording of rosbag2 with {' and '.join(_COLUMNS)}")
        # The seventh column of this pragma is 2 or 3 where a value is computed.
        there = {row[1]: row[6] for row in database.execute(f"PRAGMA table_xinfo({table})")}
        odd = [column for column in columns if there.get(column, 1) != 0]
        if odd:
            raise RecordingError(f"{name}: its table {table} has no plain column {odd[0]}; it is no rosbag2 recording")


def _messages(database: sqlite3.Connection, contents: Contents, watch: _Watch) -> Iterator[Message]:
    topics: dict[int, tuple[str, str]] = {}
    for number, topic, kind in database.execute("SELECT id, name, type FROM topics LIMIT ?", (MOST_TOPICS + 1,)):
        if contents.note(str(topic), str(kind)):
            topics[number] = (str(topic), str(kind))
    order = _order(database, watch)
    for done, number in enumerate(order.tolist(), 1):
        row = database.execute("SELECT topic_id, data FROM messages WHERE id = ?", (number,)).fetchone()
        watch.has_a_row()
        watch.fraction = done / len(order)
        if row is not None and row[0] in topics:
            yield Message(*topics[row[0]], bytes(row[1]), watch.fraction, is_cdr=True)


def _order(database: sqlite3.Connection, watch: _Watch) -> np.ndarray:
    """The numbers of all messages by their stamps: sorted here, where they take 16 bytes each."""
    parts: list[np.ndarray] = []
    cursor = database.execute("SELECT id, timestamp FROM messages LIMIT ?", (_MOST_MESSAGES,))
    while rows := cursor.fetchmany(1 << 14):
        watch.has_a_row()
        parts.append(np.array(rows, np.int64))
    table = np.concatenate([np.empty((0, 2), np.int64), *parts])
    return table[np.lexsort((table[:, 0], table[:, 1])), 0]
