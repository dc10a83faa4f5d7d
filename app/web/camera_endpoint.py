"""Where a visitor's camera comes in: a websocket of its own beside viser's, behind the same guard.

The page says whose it is, as one JSON text {"ticket": …}, and is answered {"go": [width, height]}. Then it sends grey
frames of exactly that size, one at a time: the next only after {"got": number}, so that the newest frame wins and
nothing queues. Texts in between are what the sliders say. {"over": true} or {"refused": why} end it.
"""

from __future__ import annotations

import asyncio
import math
import time
from typing import ClassVar

import numpy as np
from websockets.exceptions import ConnectionClosed

from app.catalogue.mirror import SENSOR, Mirror, MirrorError, Mirrors
from app.web.endpoint import Endpoint, Line
from etnet.errors import EtnetError
from etnet.plain_values import bounded_json

PATH = "/camera"
LONGEST_TEXT = 500
"""Characters of a text."""
SILENCE = 10.0
"""Seconds without a frame after which the camera counts as gone."""
SHORTEST = 1 / 30
"""Seconds from frame to frame; what comes faster is left out."""


class CameraEndpoint(Endpoint[Mirror]):
    """Lets cameras in for a server; the pixels look on in workers."""

    most_connections: ClassVar[int] = 16
    crowded: ClassVar[str] = "many cameras are on; try again in a minute"

    def __init__(self, mirrors: Mirrors) -> None:
        super().__init__()
        self._mirrors = mirrors

    async def recognise(self, line: Line) -> Mirror:
        """The mirror that a ticket is for."""
        return self._mirrors.of(await _ticket(line))

    async def serve(self, line: Line, known: Mirror) -> None:
        """Look through one camera."""
        mirror = known
        try:
            await asyncio.to_thread(mirror.begin)
        except MirrorError as error:
            await line.refuse(str(error))
            return
        try:
            trouble = await _look(line, mirror)
        except ConnectionClosed:
            await asyncio.to_thread(mirror.end)
            raise
        except BaseException:
            mirror.end()  # the loop is being stopped: no worker is to be had any more
            raise
        # It waits for the thread that looks on, and everybody else would wait with it.
        await asyncio.to_thread(mirror.end, trouble)


async def _ticket(line: Line) -> str:
    try:
        return str((await line.greeting())["ticket"])
    except TimeoutError:
        raise MirrorError("nothing was said about the camera; load the page again") from None
    except (ValueError, TypeError, KeyError):
        raise MirrorError("what was said about the camera cannot be understood; load the page again") from None


async def _look(line: Line, mirror: Mirror) -> str:
    """Look on until it is over; why it ended early, or ""."""
    try:
        await line.say(go=[SENSOR.width, SENSOR.height])
        await _take(line, mirror)
        await line.say(over=True)
    except EtnetError as error:
        await line.refuse(str(error))
        return str(error)
    return ""


async def _take(line: Line, mirror: Mirror) -> None:
    num_frames, came_at, heard_at = 0, 0.0, time.monotonic()
    while not mirror.is_over:
        try:
            message = await line.hear(max(heard_at + SILENCE - time.monotonic(), 0.0))
        except TimeoutError:
            raise MirrorError(f"no picture came from the camera for {SILENCE:.0f} s") from None
        if isinstance(message, str):
            _set(mirror, message)  # words alone do not keep a camera on
            continue
        if len(message) != SENSOR.num_pixels:
            raise MirrorError(f"a picture of {len(message):,} bytes came; wanted {SENSOR.num_pixels:,}: load the page")
        num_frames, heard_at = num_frames + 1, time.monotonic()
        if heard_at - came_at >= SHORTEST:
            came_at = heard_at
            grey = np.frombuffer(message, np.uint8).reshape(SENSOR.height, SENSOR.width)
            await asyncio.to_thread(mirror.show, grey)
        await line.say(got=num_frames)


def _set(mirror: Mirror, text: str) -> None:
    """What the sliders say; what cannot be understood changes nothing."""
    try:
        said = bounded_json(text, LONGEST_TEXT)
        sensitivity, noise = float(said["contrast"]), float(said["noise"])
    except (ValueError, TypeError, KeyError, OverflowError):
        return
    if math.isfinite(sensitivity) and math.isfinite(noise):
        mirror.set(sensitivity, noise)
