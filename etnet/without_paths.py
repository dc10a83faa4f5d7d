"""Messages in which files are named, and neither folders nor this machine are: what strangers may read."""

from __future__ import annotations

import re
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path

from etnet.files import cache_folder

_SIGN = r"(?:[^{ends}\s:'\"]|(?<=\w)'(?=\w))"
_WORD = r"(?:[^{ends}\s:;,'\"]|(?<=\w)'(?=\w))"
# A folder's name, with single spaces in it where no sentence could be meant.
_PART = rf"(?:{_SIGN}+|{_WORD}+(?: {_WORD}+){{{{1,4}}}})"
_HERE, _THERE = _PART.format(ends="/"), _PART.format(ends=r"/\\")
_FOLDERS = re.compile(
    rf"(?<!\w)file:/+(?:{_HERE}/+)*"
    rf"|(?<![\w./~])~?/(?:{_HERE}/+)+"
    rf"|(?<!\w)[A-Za-z]:[/\\]+(?:{_THERE}[/\\]+)*"
    rf"|(?<![\w\\])\\\\+(?:{_THERE}\\+)+"
)


def without_paths(text: str) -> str:
    """The message with the names of files alone: folders are left out, as the name of this machine is.

    A folder that is meant itself cannot be told from a file; those that everything of ours lies in are known.
    """
    for folder in _known_folders():
        text = re.sub(rf"(?<![\w./]){re.escape(folder)}(?![\w/\\-]|\.\w)", "…", text)
    text = _FOLDERS.sub("", text)
    for name in _names_of_machine():
        text = re.sub(rf"(?<![\w.-]){re.escape(name)}(?![\w-])", "this machine", text, flags=re.IGNORECASE)
    return text


def _known_folders() -> list[str]:
    found = {tempfile.gettempdir(), str(cache_folder())}
    for ask in (Path.home, Path.cwd):
        try:
            found.add(str(ask()))
        except (OSError, RuntimeError):
            continue  # a user without a home, a folder that is gone
    return sorted((folder for folder in found if len(folder) > 1), key=len, reverse=True)


def _names_of_machine() -> Iterator[str]:
    """Its names that are no word of a sentence, the longest first."""
    full = socket.gethostname()
    for name in (full, full.partition(".")[0]):
        if len(name) > 2 and re.search(r"[\d.-]", name):
            yield name
