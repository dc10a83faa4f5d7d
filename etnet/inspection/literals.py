"""Frozen values as Python that makes them again."""

from __future__ import annotations

import ast
from dataclasses import MISSING, fields, is_dataclass

_MODULES = {
    "Assumptions": "assumptions",
    "View": "opened_as",
    "Cleaning": "denoise",
    "Region": "mass",
    "Feature": "features",
}
"""Classes that a snippet reaches through their module; the others are public names of the library."""


def code(value: object) -> str:
    """An expression that gives `value`: fields at their default are left out, sets are sorted."""
    if is_dataclass(value) and not isinstance(value, type):
        name = type(value).__name__
        called = f"{_MODULES[name]}.{name}" if name in _MODULES else name
        given = {field.name: getattr(value, field.name) for field in fields(value)
                 if field.default is MISSING or getattr(value, field.name) != field.default}  # fmt: skip
        first = [entry.name for entry in fields(value) if entry.default is MISSING]
        return call(called, *(given.pop(name) for name in first), **given)
    if isinstance(value, frozenset):
        return f"frozenset({{{', '.join(code(item) for item in sorted(value))}}})" if value else "frozenset()"
    if isinstance(value, tuple):
        return f"({', '.join(code(item) for item in value)}{',' if len(value) == 1 else ''})"
    if isinstance(value, str) and not isinstance(value, Verbatim):
        plain = repr(value)[1:-1]
        return f'"{plain}"' if plain == value and '"' not in value else repr(value)
    return repr(value)


class Verbatim(str):
    """A piece of code, put into a call as it stands."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


def call(function: str, *arguments: object, **named: object) -> str:
    """A call as Python; an argument that is a name already is given as `Verbatim`."""
    parts = [code(argument) for argument in arguments] + [f"{name}={code(value)}" for name, value in named.items()]
    return f"{function}({', '.join(parts)})"


def names_in(text: str) -> frozenset[str]:
    """Every name that some lines use."""
    return frozenset(node.id for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Name))
