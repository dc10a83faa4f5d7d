"""What the engine has answered to one visitor: the newest picture, how far the next one is, what went wrong."""

from __future__ import annotations

from dataclasses import replace

from app.view_state import ViewState
from app.wishes import Failed, Ready, Reply, Wish, Working


class Answers:
    """Folds replies in the order they come; those to a wish of another playback are no news."""

    def __init__(self) -> None:
        self.wish: Wish | None = None
        self.ready: Ready | None = None
        self.working: Working | None = None
        self.failed: Failed | None = None

    def ask(self, wish: Wish) -> bool:
        """Note the newest wish; whether it has to go to the engine."""
        if wish == self.wish:
            return False
        if self.wish is None or wish.recording_id != self.wish.recording_id:
            # Another recording's picture says nothing here; another model's or precision's may stand in for a while.
            self.ready = None
        is_changed = self.wish is not None and self.ready is not None and wish.change != self.ready.wish.change
        if is_changed and self.ready is not None:
            # What is on show until the answer comes is not what the network, as it is changed now, gives.
            self.ready = replace(self.ready, is_exact=False)
        waits = Working(wish, 0, 0, "computing with the change") if is_changed and not wish.is_original else None
        self.wish, self.working, self.failed = wish, waits, None
        return True

    def take(self, reply: Reply) -> bool:
        """Fold one reply; whether anything changed."""
        if self.wish is None or reply.wish.playback != self.wish.playback:
            return False
        match reply:
            case Ready():
                return self._take_ready(reply)
            case Working():
                if reply.wish != self.wish:
                    return False
                self.working = reply
            case Failed():
                if reply.wish != self.wish:
                    return False
                self.failed, self.working = reply, None
        return True

    @property
    def index(self) -> int | None:
        """The window of the newest finished picture; previews do not count."""
        return None if self.ready is None or self.ready.is_approximate else self.ready.wish.index

    def shows(self, state: ViewState) -> bool:
        """Whether there is a picture, and with a pixel chosen what the network compared it with (or, of a network that
        compares nothing, the answer that it does not)."""
        if self.ready is None or state.query is None:
            return self.ready is not None
        wish = self.ready.wish
        return wish.wants_attention and wish.index == state.index and not self.ready.is_approximate

    def _take_ready(self, reply: Ready) -> bool:
        held, wish = self.ready, self.wish
        is_worse = (
            held is not None
            and held.wish.playback == reply.wish.playback
            and held.wish.index == reply.wish.index
            and not held.is_approximate
            and reply.is_approximate
        )
        if is_worse:
            return False
        self.ready = reply
        if reply.wish == wish and not reply.is_approximate:
            self.working = self.failed = None
        return True
