"""A websocket of our own beside viser's: how many are open at once, how fast they are read, how one is refused.

Its first message is one JSON text. The answers are JSON texts, too; {"refused": why} is the last one where it stands.
"""

from __future__ import annotations

import asyncio
import json
import logging
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Generic, TypeVar

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from app.web.guarded_connection import Rate
from etnet.errors import EtnetError
from etnet.plain_values import bounded_json

LONGEST_GREETING = 4096
"""Characters of the first message."""
GREETING = 10.0
"""Seconds in which a connection says what it wants."""
CLOSING = 1.0
"""Seconds that a page which was refused has for ending the connection itself."""
RATE, BURST = 400.0, 800.0
"""Messages a second of one connection that are read, and how many may come at once."""

Known = TypeVar("Known")
"""What a greeting was recognised as."""

_log = logging.getLogger(__name__)


class Line:
    """One connection to an endpoint."""

    def __init__(self, connection: ServerConnection) -> None:
        self._connection = connection
        self._rate = Rate(RATE, BURST)

    async def hear(self, seconds: float) -> str | bytes:
        """The next message.

        Raises:
            TimeoutError: none came within `seconds`.
            ConnectionClosed: the page has gone.
        """
        await self._rate.wait()
        return await asyncio.wait_for(self._connection.recv(), seconds)

    async def greeting(self) -> Mapping[str, Any]:
        """The first message.

        Raises:
            TimeoutError: none came in time.
            ValueError: it is not one JSON object of bounded size.
        """
        text = await self.hear(GREETING)
        said = bounded_json(text, LONGEST_GREETING) if isinstance(text, str) else None
        if not isinstance(said, dict):
            raise ValueError("no JSON object")
        return said

    async def say(self, **words: Any) -> None:
        """One JSON text to the page."""
        await self._connection.send(json.dumps(words))

    async def refuse(self, why: str) -> None:
        """Say why, and end the connection, whether its page listens or not."""
        _log.info("a connection was refused: %s", why)
        try:
            async with asyncio.timeout(CLOSING):
                await self.say(refused=why)
                await self._connection.close(1008)
        except (TimeoutError, ConnectionClosed):
            self._connection.transport.abort()


class Endpoint(ABC, Generic[Known]):
    """Serves such connections, on the server's event loop."""

    most_connections: ClassVar[int]
    """At once, of all visitors together; who was not recognised takes no place among them."""
    crowded: ClassVar[str]
    """What one more is told."""

    def __init__(self) -> None:
        self._num_open = 0

    async def __call__(self, connection: ServerConnection) -> None:
        """Serve one connection to its end."""
        line = Line(connection)
        try:
            known = await self.recognise(line)
        except ConnectionClosed:
            return
        except EtnetError as error:
            await line.refuse(str(error))
            return
        if self._num_open >= self.most_connections:
            await line.refuse(self.crowded)
            return
        self._num_open += 1
        try:
            await self.serve(line, known)
        except ConnectionClosed:
            pass
        finally:
            self._num_open -= 1

    @abstractmethod
    async def recognise(self, line: Line) -> Known:
        """Hear the greeting and find what its ticket is for.

        Raises:
            EtnetError: nothing; the page is told.
            ConnectionClosed: it has gone.
        """

    @abstractmethod
    async def serve(self, line: Line, known: Known) -> None:
        """What this endpoint is for. A connection that closes may raise through it."""
