"""Pages that visitors take home: each at an address that nobody can guess, for a while, and all within a cap."""

from __future__ import annotations

import secrets
import time
from collections import OrderedDict
from threading import Lock

PATH = "/home/"
LIVES = 1800.0
"""Seconds for which a link works."""
LARGEST = 96 << 20
"""Bytes of all pages together; the oldest go."""
MOST_LINKS = 500
"""Addresses that work at once."""


class Homes:
    """In memory alone; nothing lists what is here. Safe from every thread."""

    def __init__(self, largest: int = LARGEST, lives: float = LIVES) -> None:
        self._largest, self._lives = largest, lives
        self._held: OrderedDict[str, tuple[float, bytes]] = OrderedDict()
        self._lock = Lock()

    def put(self, page: bytes) -> str:
        """Keep a page; the path by which it is fetched."""
        path = f"{PATH}{secrets.token_urlsafe(18)}"
        with self._lock:
            self._held[path] = (time.monotonic() + self._lives, page)
            self._sweep()
        return path

    def get(self, path: str) -> bytes | None:
        """The page at a path; `None` where there is none, or none any more."""
        if not path.startswith(PATH):
            return None
        with self._lock:
            self._sweep()
            held = self._held.get(path)
        return None if held is None else held[1]

    @property
    def nbytes(self) -> int:
        """Bytes that are held."""
        with self._lock:
            self._sweep()
            return self._weight()

    def _sweep(self) -> None:
        now = time.monotonic()
        for path in [path for path, (ends, _) in self._held.items() if ends <= now]:
            del self._held[path]
        while self._held and (self._weight() > self._largest or len(self._held) > MOST_LINKS):
            self._held.popitem(last=False)

    def _weight(self) -> int:
        """A page that several visitors took home lies here once, under an address for each."""
        return sum({id(page): len(page) for _, page in self._held.values()}.values())
