"""Where files come in: a websocket of its own beside viser's, behind the same guard, straight to disk.

The page says who it is, what the file is called and how large it is, as one JSON text; then it sends the bytes in
messages of at most `CHUNK`, no more than `AHEAD` beyond what was acknowledged. The answers are JSON: {"go": CHUNK},
{"got": bytes}, {"done": id}, or {"refused": why}. Too large a message ends the connection before it is held.
"""

from __future__ import annotations

import asyncio
import json
import logging

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from app.catalogue.uploads import Uploads
from app.catalogue.visitor_uploads import Transfer, UploadError
from etnet.plain_values import bounded_json

PATH = "/upload"
CHUNK = 256 << 10
LONGEST_GREETING = 4096
"""Characters of the text that a transfer begins with."""
GREETING = 10.0
"""Seconds in which a connection says what it wants."""
SILENCE = 30.0
"""Seconds without a byte after which a transfer is given up."""
CLOSING = 1.0
"""Seconds that a page which was refused has for ending the connection itself."""
MOST_CONNECTIONS = 32
"""At once, of all visitors together: each may hold a few chunks in memory."""

_log = logging.getLogger(__name__)


class UploadEndpoint:
    """Lets files in for a server; all of it runs on the server's event loop, what touches the disk in workers."""

    def __init__(self, uploads: Uploads) -> None:
        self._uploads = uploads
        self._num_open = 0

    async def __call__(self, connection: ServerConnection) -> None:
        """Serve one connection to its end."""
        if self._num_open >= MOST_CONNECTIONS:
            await _refuse(connection, "many files are on their way; try again in a minute")
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
            ticket, name, size = await _greeting(connection)
            desk = self._uploads.desk_of(ticket)
            transfer = await asyncio.to_thread(desk.begin, name, size)
        except UploadError as error:
            await _refuse(connection, str(error))
            return
        why = f"{transfer.title}: the transfer was cut off; send it again"
        try:
            arrived = await _take(connection, transfer)
            await connection.send(json.dumps({"done": arrived}))
        except UploadError as error:
            why = str(error)
            await _refuse(connection, why)
        finally:
            # In the end, too, when the loop is being stopped: then no worker is to be had any more.
            transfer.abort(why)


async def _greeting(connection: ServerConnection) -> tuple[str, str, int]:
    try:
        text = await asyncio.wait_for(connection.recv(), GREETING)
    except TimeoutError:
        raise UploadError("nothing was said about the file; load the page again") from None
    try:
        if not isinstance(text, str):
            raise ValueError
        said = bounded_json(text, LONGEST_GREETING)
        return str(said["ticket"]), str(said["name"]), int(said["size"])
    except (ValueError, TypeError, KeyError, OverflowError):
        raise UploadError("what was said about the file cannot be understood; load the page again") from None


async def _take(connection: ServerConnection, transfer: Transfer) -> str:
    await connection.send(json.dumps({"go": CHUNK}))
    while transfer.received < transfer.size:
        try:
            chunk = await asyncio.wait_for(connection.recv(), SILENCE)
        except TimeoutError:
            raise UploadError(f"{transfer.title}: nothing came for {SILENCE:.0f} s; send it again") from None
        if not isinstance(chunk, bytes):
            raise UploadError(f"{transfer.title}: words came where its bytes were expected; load the page again")
        await asyncio.to_thread(transfer.take, chunk)
        await connection.send(json.dumps({"got": transfer.received}))
    await _nothing_more(connection, transfer)
    return await asyncio.to_thread(transfer.finish)


async def _nothing_more(connection: ServerConnection, transfer: Transfer) -> None:
    """The page says that this was all: a page that sends on has declared too little."""
    try:
        last = await asyncio.wait_for(connection.recv(), SILENCE)
    except TimeoutError:
        raise UploadError(f"{transfer.title}: its end was not confirmed; send it again") from None
    if isinstance(last, bytes) and last:
        transfer.take(last)  # raises: this is beyond the declared size


async def _refuse(connection: ServerConnection, why: str) -> None:
    _log.info("a file was refused: %s", why)
    await connection.send(json.dumps({"refused": why}))
    try:
        await asyncio.wait_for(connection.close(1008), CLOSING)
    except TimeoutError:
        connection.transport.abort()  # it goes on sending, and is not read any more
