"""`etnet COMMAND …`: exit code 0 done, 1 a named failure, 2 usage."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.metadata import version
from typing import Any

from etnet.arguments import parsed, told_misspelt
from etnet.errors import EtnetError

_COMMANDS: dict[str, tuple[str, str]] = {
    "reconstruct": ("etnet.cli.reconstruct", "Reconstruct"),
    "record": ("etnet.cli.record", "Record"),
    "inspect": ("etnet.cli.inspect", "Inspect"),
    "convert-events": ("etnet.cli.convert_events", "ConvertEvents"),
    "cut": ("etnet.cli.cut", "Cut"),
    "convert": ("etnet.cli.convert", "Convert"),
    "simulate": ("etnet.cli.simulate", "Simulate"),
    "train": ("etnet.cli.train", "Train"),
    "evaluate": ("etnet.cli.evaluate", "Evaluate"),
    "sample": ("etnet.cli.sample", "Sample"),
    "export": ("etnet.cli.export", "Export"),
    "replay": ("etnet.cli.replay", "Replay"),
    "cache": ("etnet.cli.cache", "Cache"),
}
"""Command → the module that holds it, and its configuration's class (a module with a `parse` of its own needs none)."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; what it raises on purpose becomes one line."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    if not arguments or arguments[0] in ("-h", "--help"):
        print(_help())
        return 0 if arguments else 2
    if arguments[0] in ("--version", "-V"):
        print(f"etnet {version('etnet')}")
        return 0
    if arguments[0] not in _COMMANDS:
        return told_misspelt("etnet", "command", arguments[0], _COMMANDS, f"there are these:\n\n{_help()}")
    arguments = one_vocabulary(arguments)
    module_name, class_name = _COMMANDS[arguments[0]]
    module = import_module(module_name)

    def configuration() -> Any:
        program = f"etnet {arguments[0]}"
        if hasattr(module, "parse"):
            return module.parse(arguments[1:], program)
        return parsed(getattr(module, class_name), program, arguments[1:])

    return guarded(lambda: module.run(configuration()), "etnet")


def one_vocabulary(arguments: Sequence[str]) -> list[str]:
    """`--roi` is `--region`, and takes four numbers or one word: 40 20 240 180, or 40,20,240,180."""
    plain: list[str] = []
    for argument in arguments:
        name, is_given, value = argument.partition("=")
        if name in ("--roi", "--region"):
            plain += ["--region", *(value.split(",") if is_given else [])]
        elif plain and plain[-1] == "--region" and "," in argument:
            plain += argument.split(",")
        else:
            plain.append(argument)
    return plain


def guarded(command: Callable[[], int], program: str) -> int:
    """Run a command; a failure with a name is printed as one line and gives exit code 1."""
    try:
        return command()
    except EtnetError as error:
        print(f"{program}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"{program}: stopped", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"{program}: {error.filename or 'a file'}: {error.strerror or error}", file=sys.stderr)
        return 1


def _help() -> str:
    lines = ["usage: etnet COMMAND [OPTIONS]   (etnet COMMAND --help tells the options)", ""]
    for name, (module_name, _) in _COMMANDS.items():
        summary = (import_module(module_name).__doc__ or "").strip().partition(": ")[2].splitlines()[0]
        lines.append(f"  {name:<15} {summary[:1].upper()}{summary[1:]}")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
