"""What a look at the events of a paged file finds before it is opened: their order, their pixels, their polarity."""

from __future__ import annotations

import numpy as np
from jaxtyping import Integer, Shaped

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.base import Remarks, Request
from etnet.events.formats.columns import is_ordered
from etnet.events.formats.decode import Decoded
from etnet.events.formats.pixels import FEW, Reach, odd_pixels, placed
from etnet.events.formats.polarity import Coding, say_coding, say_unusual, signed_polarity, unusual_coding
from etnet.events.formats.stamp_order import StampOrder
from etnet.events.formats.wrapping_clock import WrappingClock


class Survey:
    """Takes pieces of a file in its order, all of it or some of it. `sensor`: stated or declared, if either is."""

    def __init__(self, request: Request, sensor: Sensor | None) -> None:
        self._request = request
        self._sensor = sensor
        self.order = StampOrder()
        self.reach = Reach()
        self._clock = WrappingClock()
        self._num_events = 0
        self._num_strays = 0
        self._first_stray = ""
        self._low, self._high, self._is_bool = np.inf, -np.inf, False

    def look(self, start: int, piece: Decoded) -> None:
        """Take in all columns of events from number `start` on."""
        request = self._request
        x, y, nowhere = placed(piece.x, piece.y, request.assume.pixels, request.name)
        is_stray = np.zeros(len(x), np.bool_) if nowhere is None else nowhere
        self.reach.look(*((x, y) if nowhere is None else (x[~nowhere], y[~nowhere])))
        if self._sensor is not None and len(x):
            is_stray = is_stray | (x >= self._sensor.width) | (y >= self._sensor.height)
        if is_stray.any() and not self._num_strays:
            i = int(np.argmax(is_stray))
            self._first_stray = f"event {start + i} is at ({piece.x[i]}, {piece.y[i]})"
        self._num_strays += int(np.count_nonzero(is_stray))
        self._num_events += len(x)
        self.look_at_polarity(piece.p)
        self.look_at_stamps(start, piece.t)

    def look_at_stamps(self, start: int, t: Integer[np.ndarray, " n"]) -> None:
        """Take in stamps (µs) from number `start` on."""
        if len(t) == 0:
            return
        whole = t.astype(np.int64, copy=False)
        ordered = is_ordered(whole)
        self._clock.unrolled(whole, ordered)
        self.order.look(whole, start, ordered)

    @property
    def is_turning(self) -> bool:
        """Whether the clock wraps."""
        return self._clock.turns > 0

    def look_at_polarity(self, values: Shaped[np.ndarray, " n"]) -> None:
        """Take in polarities."""
        self._is_bool = values.dtype.kind == "b"
        if values.dtype.kind in "biuf" and len(values):
            self._low, self._high = min(self._low, values.min().item()), max(self._high, values.max().item())

    @property
    def coding(self) -> Coding | None:
        """How polarity is written, where it is not 0/1 or −1/+1."""
        return unusual_coding(self._low, self._high)

    @property
    def has_few_strays(self) -> bool:
        """Whether some events lie beyond the sensor or nowhere, but no more than strays are."""
        return 0 < self._num_strays <= FEW * self._num_events or (self._sensor is None and self.reach.has_few_far)

    @property
    def has_strays(self) -> bool:
        """Whether any event lies beyond the sensor or nowhere."""
        return self._num_strays > 0

    def check_order(self) -> None:
        """An error if time runs back."""
        if not self.order.is_ordered:
            raise RecordingError(f"{self._request.name}: {self.order.fault()}")

    def check_strays(self) -> None:
        """An error if events lie where no pixel is."""
        if self._num_strays:
            beyond = "no pixel" if self._sensor is None else f"beyond {self._sensor}"
            odd = "" if self._sensor is None else odd_pixels(self.reach, self._sensor)
            raise RecordingError(
                f"{self._request.name}: {self._first_stray}, {beyond}, and so are {self._num_strays:,} of "
                f"{self._num_events:,}; state the size with --assume width=…,height=… or open it with --drop-outside"
                f"{odd and f'; {odd}'}"
            )

    def check_polarity(self, remarks: Remarks) -> None:
        """Say how polarity is written; an error where nobody knows what it means."""
        assume = self._request.assume
        if assume.polarity == "positive" or self._low > self._high:
            return
        if self.coding is not None:
            say_unusual(self.coding, remarks)
            return
        signed_polarity(np.array([self._low, self._high]), assume, self._request.name)
        say_coding(self._low, self._is_bool, remarks)
