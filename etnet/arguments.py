"""Arguments → configuration; a misspelt option or kind is answered by one line with the one that was meant."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Sequence
from contextlib import redirect_stdout, suppress
from difflib import get_close_matches
from io import StringIO
from typing import Any

import tyro


def parsed(kind: Any, program: str, arguments: Sequence[str], default: Any = None, beside: Sequence[str] = ()) -> Any:
    """The configuration of class `kind`; `beside` names options that are taken out of the arguments before.

    Ends the process with exit code 2 where the arguments are none, as `--help` ends it with 0.
    """
    given = list(arguments)
    more = {} if default is None else {"default": default}
    if not {"-h", "--help"} & set(given):
        try:
            return tyro.cli(kind, prog=program, args=given, console_outputs=False, **more)
        except SystemExit:
            _answer_misspelt(program, given, [*_options_of(kind, more), *beside])
    return tyro.cli(kind, prog=program, args=given, **more)


def told_misspelt(program: str, what: str, got: str, known: Iterable[str], otherwise: str) -> int:
    """One line with the nearest of what is known, or where all of it is told; returns the exit code."""
    bare = {name.removeprefix("--"): name for name in known}
    near = get_close_matches(got.removeprefix("--"), bare, 1, 0.65)
    hint = f"did you mean {bare[near[0]]}?" if near else otherwise
    print(f"{program}: no {what} is called {got}; {hint}", file=sys.stderr)
    return 2


def _answer_misspelt(program: str, given: Sequence[str], known: Sequence[str]) -> None:
    """Of the first option that does not exist; nothing where all of them do."""
    names = [argument.partition("=")[0].replace("_", "-") for argument in given if argument.startswith("--")]
    wrong = next((name for name in names if name not in known), None)
    if wrong is not None and wrong != "--":
        plain = program.partition(" [")[0]
        is_denied = wrong.startswith("--no-")
        likely = [name for name in known if name.startswith("--no-") == is_denied]
        raise SystemExit(told_misspelt(plain, "option", wrong, likely, f"{plain} --help lists them"))


def _options_of(kind: Any, more: dict[str, Any]) -> list[str]:
    """The long names of all options, as the help lists them: each begins a line of its own."""
    told = StringIO()
    with redirect_stdout(told), suppress(SystemExit):
        tyro.cli(kind, args=["--help"], **more)
    plain = re.sub(r"\x1b\[[0-9;]*m", "", told.getvalue())
    lines = re.findall(r"^[^\w-]*(-.*)$", plain, re.MULTILINE)
    return [name for line in lines for name in re.findall(r"--[a-z][a-z0-9-]*", re.split(r"  +", line)[0])]
