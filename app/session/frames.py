"""What the engine has answered to one visitor: the newest picture, how far the next one is, what went wrong."""

from __future__ import annotations

from dataclasses import replace

from app.engine.requests import Failed, FrameRequest, Ready, Reply, Working
from app.state.view_state import ViewState


class NewestFrames:
    """Folds replies in the order they come; those to a request of another playback are no news."""

    def __init__(self) -> None:
        self.request: FrameRequest | None = None
        self.ready: Ready | None = None
        self.working: Working | None = None
        self.failed: Failed | None = None

    def ask(self, request: FrameRequest) -> bool:
        """Note the newest request; whether it has to go to the engine."""
        if request == self.request:
            return False
        if self.request is None or request.recording_id != self.request.recording_id:
            # Another recording's picture says nothing here; another model's or precision's may stand in for a while.
            self.ready = None
        elif request.playback != self.request.playback and self.ready is not None:
            # Its badge and its window's number are those of what was asked before.
            self.ready = replace(self.ready, is_exact=False, is_former=True)
        is_changed = self.request is not None and self.ready is not None and request.change != self.ready.request.change
        if is_changed and self.ready is not None:
            # What is shown until the answer comes is not what the network, as it is changed now, gives.
            self.ready = replace(self.ready, is_exact=False)
        waits = Working(request, 0, 0, "computing with the change") if is_changed and not request.is_original else None
        self.request, self.working, self.failed = request, waits, None
        return True

    def take(self, reply: Reply) -> bool:
        """Fold one reply; whether anything changed."""
        if self.request is None or reply.request.playback != self.request.playback:
            return False
        match reply:
            case Ready():
                return self._take_ready(reply)
            case Working():
                if reply.request != self.request:
                    return False
                self.working = reply
            case Failed():
                if reply.request != self.request:
                    return False
                self.failed, self.working = reply, None
        return True

    @property
    def index(self) -> int | None:
        """The window of the newest finished picture; previews do not count."""
        return None if self.ready is None or self.ready.is_approximate else self.ready.request.index

    def shows(self, state: ViewState) -> bool:
        """Whether there is a picture, and with a pixel chosen what the network compared it with (or, of a network that
        compares nothing, the answer that it does not)."""
        if self.ready is None or state.query is None:
            return self.ready is not None
        request = self.ready.request
        return request.wants_attention and request.index == state.index and not self.ready.is_approximate

    def _take_ready(self, reply: Ready) -> bool:
        is_kept = self.ready is not None and (self._is_late(reply, self.ready) or _is_worse(reply, self.ready))
        is_answer = reply.request == self.request and not reply.is_approximate
        if not is_kept:
            self.ready = reply
        if is_answer:
            self.working = self.failed = None
        return is_answer or not is_kept

    def _is_late(self, reply: Ready, held: Ready) -> bool:
        """Whether what is asked for now is answered, and this answers what was asked before.

        A frame at hand comes at once, while the reply to the former request is still on its way through the mailbox.
        """
        request = self.request
        is_answered = (
            request is not None
            and not held.is_approximate
            and (held.request.playback, held.request.frame) == (request.playback, request.frame)
        )
        return is_answered and reply.request.frame != held.request.frame


def _is_worse(reply: Ready, held: Ready) -> bool:
    """Whether this is a preview of what is there exactly, or lacks the attention that is there."""
    is_same = (reply.request.playback, reply.request.frame) == (held.request.playback, held.request.frame)
    is_preview = reply.is_approximate and not held.is_approximate
    lacks_attention = reply.attention is None and held.attention is not None
    return is_same and (is_preview or lacks_attention)
