"""The JSON in a weights file's metadata: bounded before it is parsed, checked before it is used. Needs no torch."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from etnet.errors import ModelError, WeightsError

MAX_CHARACTERS = 1 << 20
MAX_DEPTH = 32
MAX_DIGITS = 18
MAX_COUNT = 65_536
"""Largest whole number in a configuration: wider layers than this were never built."""

_STRINGS = re.compile(r'"(?:[^"\\]|\\.)*"')

Config = TypeVar("Config")


def parse_object(text: str, what: str) -> dict[str, Any]:
    """The JSON object in `text`; numbers that are not finite become `None`. Raises WeightsError, in one line."""
    if len(text) > MAX_CHARACTERS:
        raise WeightsError(f"{what}: holds {len(text)} characters; wanted at most {MAX_CHARACTERS}")
    if _depth(text) > MAX_DEPTH:
        raise WeightsError(f"{what}: is nested more than {MAX_DEPTH} deep")
    try:
        value = json.loads(text, parse_int=_whole, parse_float=_finite, parse_constant=lambda name: None)
    except (ValueError, RecursionError) as error:
        raise WeightsError(f"{what}: is no JSON that can be read ({_first_line(error)})") from None
    if not isinstance(value, dict):
        raise WeightsError(f"{what}: is a {type(value).__name__}, wanted a JSON object")
    return value


def config_of_plain(config_type: type[Config], plain: Mapping[str, Any], what: str) -> Config:
    """A configuration from plain values, each checked against its field's type. Raises WeightsError, in one line."""
    hints = get_type_hints(config_type)
    known = {field.name for field in fields(config_type)}  # pyright: ignore[reportArgumentType]
    unknown = next((name for name in plain if name not in known), None)
    if unknown is not None:
        raise WeightsError(f"{what}: {config_type.__name__} has no field {unknown[:60]!r}")
    values = {}
    for name, value in plain.items():
        values[name] = tuple(value) if isinstance(value, list) else value
        if not _fits(values[name], hints[name]):
            raise WeightsError(
                f"{what}: {config_type.__name__}.{name} is {_short(value)}; wanted {_words(hints[name])}"
            )
    try:
        return config_type(**values)
    except (ModelError, ArithmeticError) as error:
        raise WeightsError(f"{what}: its configuration does not fit ({_first_line(error)})") from None


def _fits(value: object, hint: Any) -> bool:
    if get_origin(hint) is Literal:
        return value in get_args(hint) if isinstance(value, str) else False
    if get_origin(hint) is tuple:
        return isinstance(value, tuple) and len(value) <= MAX_DEPTH and all(_fits(v, get_args(hint)[0]) for v in value)
    if hint is int:
        return isinstance(value, int) and not isinstance(value, bool) and abs(value) <= MAX_COUNT
    if hint is float:
        return isinstance(value, (int, float)) and not isinstance(value, bool)
    return isinstance(value, hint)


def _words(hint: Any) -> str:
    if get_origin(hint) is Literal:
        return " or ".join(repr(choice) for choice in get_args(hint))
    if get_origin(hint) is tuple:
        return f"a list of at most {MAX_DEPTH}, each {_words(get_args(hint)[0])}"
    names = {int: f"a whole number up to {MAX_COUNT}", float: "a number", bool: "true or false"}
    return names.get(hint, f"a {hint.__name__}")


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}…"


def _depth(text: str) -> int:
    depth = deepest = 0
    for character in _STRINGS.sub("", text):
        if character in "[{":
            depth += 1
            deepest = max(deepest, depth)
        elif character in "]}":
            depth -= 1
    return deepest


def _whole(digits: str) -> int:
    if len(digits) > MAX_DIGITS:
        raise ValueError(f"a whole number of {len(digits)} digits; wanted at most {MAX_DIGITS}")
    return int(digits)


def _finite(digits: str) -> float | None:
    value = float(digits)
    return value if math.isfinite(value) else None


def _first_line(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]
