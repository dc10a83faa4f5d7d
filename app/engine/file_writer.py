"""A thread that writes one file while the engine goes on: how far it is, how it is ended, what went wrong."""

from __future__ import annotations

from collections.abc import Callable
from threading import Thread

from etnet.errors import Cancelled


class Writer:
    """Begins at once. `work` is given this writer, to tell how far it is and to hear whether it is stopped.

    It has a thread of its own and not one that is used again: what `work` sets for its thread (torch's number of
    threads) ends with it. `release` lets a `work` go that waits for an answer.
    """

    def __init__(
        self, work: Callable[[Writer], object], name: str, release: Callable[[], object] | None = None
    ) -> None:
        self.share = 0.0
        self.is_stopped = False
        self._release = release
        self._failure: BaseException | None = None
        self._thread = Thread(target=self._run, args=(work,), daemon=True, name=name)
        self._thread.start()

    def note(self, share: float) -> None:
        """Called by `work` between two pieces; raises `Cancelled` when the file is not wanted any more."""
        self.share = share
        if self.is_stopped:
            raise Cancelled("this file is not wanted any more")

    @property
    def is_done(self) -> bool:
        """Whether it has ended, well or not."""
        return not self._thread.is_alive()

    def wait(self, seconds: float) -> None:
        """Until it ends, so long at most."""
        self._thread.join(seconds)

    def raise_failure(self) -> None:
        """What went wrong, if anything did."""
        if self._failure is not None:
            raise self._failure

    def stop(self) -> None:
        """End it between two pieces, and wait for that."""
        self.is_stopped = True
        if not self.is_done:
            if self._release is not None:
                self._release()
            self._thread.join()

    def _run(self, work: Callable[[Writer], object]) -> None:
        try:
            work(self)
        except BaseException as error:  # told to the one who ordered it, on the engine's thread
            self._failure = error
