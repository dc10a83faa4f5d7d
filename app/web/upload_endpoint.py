"""Where files come in: a websocket of its own beside viser's, behind the same guard, straight to disk.

The page says who it is, what the file is called and how large it is, as one JSON text; then it sends the bytes in
messages of at most `CHUNK`, no more than `AHEAD` beyond what was acknowledged. The answers are JSON: {"go": CHUNK},
{"got": bytes}, {"done": id}, or {"refused": why}. Too large a message ends the connection before it is held.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import ClassVar

from app.catalogue.uploads import Uploads
from app.catalogue.visitor_uploads import Transfer, UploadError, VisitorUploads
from app.web.endpoint import Endpoint, Line

PATH = "/upload"
CHUNK = 256 << 10
LARGEST_BITS = 63
"""Of the size of a file, in bytes."""
SILENCE = 30.0
"""Seconds without a byte after which a transfer is given up."""


@dataclass(frozen=True, slots=True)
class Announced:
    """A file that a page wants to send: to which desk, its name and bytes."""

    desk: VisitorUploads
    name: str
    size: int


class UploadEndpoint(Endpoint[Announced]):
    """Lets files in for a server; what touches the disk runs in workers."""

    most_connections: ClassVar[int] = 32
    """Each may hold a few chunks in memory."""
    crowded: ClassVar[str] = "many files are on their way; try again in a minute"

    def __init__(self, uploads: Uploads) -> None:
        super().__init__()
        self._uploads = uploads

    async def recognise(self, line: Line) -> Announced:
        """What a page says of its file, and the desk that its ticket is for."""
        ticket, name, size = await _greeting(line)
        return Announced(self._uploads.desk_of(ticket), name, size)

    async def serve(self, line: Line, known: Announced) -> None:
        """Take one file."""
        try:
            transfer = await asyncio.to_thread(known.desk.begin, known.name, known.size)
        except UploadError as error:
            await line.refuse(str(error))
            return
        why = f"{transfer.title}: the transfer was cut off; send it again"
        try:
            arrived = await _take(line, transfer)
            await line.say(done=arrived)
        except UploadError as error:
            why = str(error)
            await line.refuse(why)
        finally:
            # In the end, too, when the loop is being stopped: then no worker is to be had any more.
            transfer.abort(why)


async def _greeting(line: Line) -> tuple[str, str, int]:
    try:
        said = await line.greeting()
        size = int(said["size"])
        if size.bit_length() > LARGEST_BITS:
            raise ValueError("no file is as large")
        return str(said["ticket"]), str(said["name"]), size
    except TimeoutError:
        raise UploadError("nothing was said about the file; load the page again") from None
    except (ValueError, TypeError, KeyError, OverflowError):
        raise UploadError("what was said about the file cannot be understood; load the page again") from None


async def _take(line: Line, transfer: Transfer) -> str:
    await line.say(go=CHUNK)
    while transfer.received < transfer.size:
        try:
            chunk = await line.hear(SILENCE)
        except TimeoutError:
            raise UploadError(f"{transfer.title}: nothing came for {SILENCE:.0f} s; send it again") from None
        if not isinstance(chunk, bytes):
            raise UploadError(f"{transfer.title}: words came where its bytes were expected; load the page again")
        if not chunk:  # it would be time won for nothing, again and again
            raise UploadError(f"{transfer.title}: a message without bytes came; send it again")
        await asyncio.to_thread(transfer.take, chunk)
        await line.say(got=transfer.received)
    await _nothing_more(line, transfer)
    return await asyncio.to_thread(transfer.finish)


async def _nothing_more(line: Line, transfer: Transfer) -> None:
    """The page says that this was all: a page that sends on has declared too little."""
    try:
        last = await line.hear(SILENCE)
    except TimeoutError:
        raise UploadError(f"{transfer.title}: its end was not confirmed; send it again") from None
    if isinstance(last, bytes) and last:
        transfer.take(last)  # raises: this is beyond the declared size
