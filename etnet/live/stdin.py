"""Events over standard input, to its end."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.live.address import PIECE, Address, check_stated, is_ready, words
from etnet.live.layouts import EVENT_STREAM_HEAD, LayoutName, WrongBytes, decoder_of, event_stream_sensor
from etnet.live.source import Packet, WithoutSettings


@dataclass(eq=False)
class InputStream(WithoutSettings):
    """Standard input, to its end."""

    address: Address
    stated: Sensor | None = None
    layout: LayoutName = "es"
    file: BinaryIO | None = None
    is_stopped: Callable[[], bool] = lambda: False
    """Asked while the header is waited for."""
    sensor: Sensor = field(init=False)

    def __post_init__(self) -> None:
        check_stated(self.address, self.layout, self.stated)
        self._number = (self.file or sys.stdin.buffer).fileno()
        if self.layout == "es":
            try:
                self.sensor = event_stream_sensor(self._head())
            except WrongBytes as error:
                raise RecordingError(
                    f"{self.name}: {error}; state --layout and --sensor if it is another layout"
                ) from error
        elif self.stated is not None:
            self.sensor = self.stated

    @property
    def name(self) -> str:
        """Standard input."""
        return "stdin"

    @property
    def format(self) -> str:
        """The layout."""
        return f"{words(self.layout)} from standard input"

    def packets(self, is_stopped: Callable[[], bool]) -> Iterator[Packet]:
        """What comes, until it ends."""
        decoder = decoder_of(self.layout, self.sensor)
        while not is_stopped():
            if not is_ready(self._number):
                yield Packet(Events.empty(self.sensor))
                continue
            content = os.read(self._number, PIECE)
            if not content:
                return
            try:
                events = decoder.decode(content)
            except WrongBytes as error:
                raise RecordingError(f"{self.name}: wrong bytes ({error}); nothing after them can be read") from error
            yield Packet(events, decoder.until)

    def _head(self) -> bytes:
        """The first bytes, no more; fewer where the input ends."""
        head = b""
        while len(head) < EVENT_STREAM_HEAD:
            if self.is_stopped():
                raise RecordingError(f"{self.name}: stopped before any events came")
            if not is_ready(self._number):
                continue
            more = os.read(self._number, EVENT_STREAM_HEAD - len(head))
            if not more:
                break
            head += more
        return head

    def close(self) -> None:
        """Standard input is the program's."""
