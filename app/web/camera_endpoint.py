"""Where a visitor's camera comes in: a websocket of its own beside viser's, behind the same guard.

The page says whose it is, as one JSON text {"ticket": …}, and is answered {"go": [width, height]}. Then it sends grey
frames of exactly that size, one at a time: the next only after {"got": number}, so that the newest frame wins and
nothing queues. Texts in between are what the sliders say. {"over": true} or {"refused": why} end it.
"""

from __future__ import annotations

import asyncio
import json
import logging
import math
import time

import numpy as np
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from app.catalogue.mirror import SENSOR, Mirror, MirrorError, Mirrors
from etnet.errors import EtnetError
from etnet.plain_values import bounded_json

PATH = "/camera"
LONGEST_TEXT = 500
"""Characters of a text."""
GREETING = 10.0
"""Seconds in which a connection says whose it is."""
SILENCE = 10.0
"""Seconds without a frame after which the camera counts as gone."""
SHORTEST = 1 / 30
"""Seconds from frame to frame; what comes faster is left out."""
MOST_CONNECTIONS = 16

_log = logging.getLogger(__name__)


class CameraEndpoint:
    """Lets cameras in for a server; all of it runs on the server's event loop, the pixels look on in workers."""

    def __init__(self, mirrors: Mirrors) -> None:
        self._mirrors = mirrors
        self._num_open = 0

    async def __call__(self, connection: ServerConnection) -> None:
        """Serve one connection to its end."""
        if self._num_open >= MOST_CONNECTIONS:
            await _refuse(connection, "many cameras are on; try again in a minute")
            return
        self._num_open += 1
        try:
            await self._serve(connection)
        except ConnectionClosed:
            pass
        finally:
            self._num_open -= 1

    async def _serve(self, connection: ServerConnection) -> None:
        try:
            mirror = self._mirrors.of(await _ticket(connection))
            await asyncio.to_thread(mirror.begin)
        except MirrorError as error:
            await _refuse(connection, str(error))
            return
        trouble = ""
        try:
            await connection.send(json.dumps({"go": [SENSOR.width, SENSOR.height]}))
            await _take(connection, mirror)
            await connection.send(json.dumps({"over": True}))
        except EtnetError as error:
            trouble = str(error)
            await _refuse(connection, trouble)
        finally:
            mirror.end(trouble)


async def _ticket(connection: ServerConnection) -> str:
    try:
        text = await asyncio.wait_for(connection.recv(), GREETING)
        if not isinstance(text, str):
            raise ValueError
        return str(bounded_json(text, LONGEST_TEXT)["ticket"])
    except TimeoutError:
        raise MirrorError("nothing was said about the camera; load the page again") from None
    except (ValueError, TypeError, KeyError):
        raise MirrorError("what was said about the camera cannot be understood; load the page again") from None


async def _take(connection: ServerConnection, mirror: Mirror) -> None:
    num_frames, came_at = 0, 0.0
    while not mirror.is_over:
        try:
            message = await asyncio.wait_for(connection.recv(), SILENCE)
        except TimeoutError:
            raise MirrorError(f"no picture came from the camera for {SILENCE:.0f} s") from None
        if isinstance(message, str):
            _set(mirror, message)
            continue
        if len(message) != SENSOR.num_pixels:
            raise MirrorError(f"a picture of {len(message):,} bytes came; wanted {SENSOR.num_pixels:,}: load the page")
        num_frames += 1
        if time.monotonic() - came_at >= SHORTEST:
            came_at = time.monotonic()
            grey = np.frombuffer(message, np.uint8).reshape(SENSOR.height, SENSOR.width)
            await asyncio.to_thread(mirror.show, grey)
        await connection.send(json.dumps({"got": num_frames}))


def _set(mirror: Mirror, text: str) -> None:
    """What the sliders say; what cannot be understood changes nothing."""
    try:
        said = bounded_json(text, LONGEST_TEXT)
        sensitivity, noise = float(said["contrast"]), float(said["noise"])
    except (ValueError, TypeError, KeyError, OverflowError):
        return
    if math.isfinite(sensitivity) and math.isfinite(noise):
        mirror.set(sensitivity, noise)


async def _refuse(connection: ServerConnection, why: str) -> None:
    _log.info("a camera was refused: %s", why)
    await connection.send(json.dumps({"refused": why}))
    await connection.close(1008)
