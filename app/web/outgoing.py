"""What goes to a page is text that can be sent, whatever a file or a visitor called something.

Python holds a name that is not UTF-8 as lone surrogates, which no message can carry; viser raises at it in the task
that serves the page, and ends it. Names are escaped where they come in; this is the net below.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import msgspec
from viser.infra import _infra

from etnet.files import printable


def encode(content: Any) -> bytes:
    """As msgspec's, with texts escaped where one of them cannot be sent."""
    try:
        return msgspec.msgpack.encode(content)
    except UnicodeEncodeError:
        return msgspec.msgpack.encode(escaped(content))


def escaped(content: Any) -> Any:
    """The same values, with every text in them such that it can be sent."""
    if isinstance(content, str):
        return printable(content)
    if isinstance(content, dict):
        return {escaped(name): escaped(value) for name, value in content.items()}
    if isinstance(content, list | tuple):
        return type(content)(escaped(value) for value in content)
    return content


def escape_outgoing() -> None:
    """Let viser's producers of messages encode by `encode`."""
    _infra.msgspec = SimpleNamespace(  # pyright: ignore[reportAttributeAccessIssue, reportPrivateImportUsage]
        msgpack=SimpleNamespace(encode=encode, decode=msgspec.msgpack.decode)
    )
