"""Foreign JSON, bounded before it is parsed; and frozen dataclasses made of it, each value checked by its type."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from functools import lru_cache
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from etnet.errors import EtnetError

DEEPEST = 12
MOST_DIGITS = 20
LONGEST_TEXT = 500
LONGEST_LIST = 1 << 20
LARGEST_WHOLE = 1 << 62
_STRING = re.compile(r'"(?:[^"\\]|\\.)*"', re.DOTALL)
_BRACKETS = re.compile(r"[\[\]{}]")
Made = TypeVar("Made")


class PlainError(EtnetError, ValueError):
    """A value that does not fit where it stands."""


def bounded_json(text: str | bytes, longest: int, deepest: int = DEEPEST) -> Any:
    """Foreign JSON of bounded length, depth and numbers; numbers are finite, texts can be encoded.

    Raises:
        PlainError: too long, too deep, not JSON, or a number that no field takes.
    """
    if len(text) > longest:
        raise PlainError(f"{len(text):,} characters of JSON, at most {longest:,} are read")
    try:
        plain = text.decode() if isinstance(text, bytes) else text
        depth = found = 0
        for bracket in _BRACKETS.finditer(_STRING.sub("", plain)):
            depth += 1 if bracket[0] in "[{" else -1
            found = max(found, depth)
        if found > deepest:
            raise PlainError(f"JSON of more than {deepest} levels")
        value = json.loads(plain, parse_int=_whole, parse_float=_finite, parse_constant=_refuse)
        json.dumps(value, ensure_ascii=False).encode()
    except PlainError:
        raise
    except (ValueError, RecursionError, OverflowError, MemoryError) as error:
        raise PlainError(f"no JSON that can be read ({str(error)[:80]})") from None
    return value


def made_of(kind: type[Made], plain: object) -> Made:
    """A frozen dataclass from plain values: lists become tuples or sets. What is left out has its default.

    Raises:
        PlainError: a field is missing, foreign, or does not fit.
    """
    if not isinstance(plain, Mapping):
        raise PlainError(f"wanted a {kind.__name__}, got {_short(plain)}")
    known = {entry.name: entry for entry in fields(kind)}  # pyright: ignore[reportArgumentType]
    if (foreign := next((name for name in plain if name not in known), None)) is not None:
        raise PlainError(f"{kind.__name__} has no field {_short(foreign)}")
    for entry in known.values():
        if entry.name not in plain and entry.default is MISSING and entry.default_factory is MISSING:
            raise PlainError(f"{kind.__name__} lacks its field {entry.name}")
    hints = _hints(kind)
    values = {}
    for name, value in plain.items():
        try:
            values[name] = fitted(hints[name], value)
        except PlainError as error:
            raise PlainError(f"{kind.__name__}.{name}: {error}") from None
    try:
        return kind(**values)
    except PlainError:
        raise
    except (EtnetError, TypeError, ValueError, ArithmeticError) as error:
        raise PlainError(str(error)[:300]) from None


def fitted(hint: Any, value: object) -> Any:
    """A plain value as a type takes it.

    Raises:
        PlainError: it does not fit.
    """
    origin = get_origin(hint)
    if origin is Literal:
        if any(type(value) is type(choice) and value == choice for choice in get_args(hint)):
            return value
        raise PlainError(f"{_short(value)} is not one of {', '.join(map(str, get_args(hint)))}")
    if origin in (Union, UnionType):
        return _of_any(get_args(hint), value)
    if origin in (tuple, frozenset):
        return _of_list(origin, get_args(hint), value)
    if origin is not None and issubclass(origin, Mapping):
        return _of_mapping(get_args(hint), value)
    if is_dataclass(hint):
        if isinstance(value, hint):  # pyright: ignore[reportArgumentType]  made of plain values already
            return value
        return made_of(hint, value)  # pyright: ignore[reportArgumentType]
    if hint is bool and isinstance(value, bool):
        return value
    if hint is int and isinstance(value, int) and not isinstance(value, bool) and abs(value) <= LARGEST_WHOLE:
        return value
    if hint is float and isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if hint is str and isinstance(value, str) and len(value) <= LONGEST_TEXT:
        return value
    raise PlainError(f"{_short(value)} is no {getattr(hint, '__name__', hint)}")


def _of_any(members: tuple[Any, ...], value: object) -> Any:
    if value is None and NoneType in members:
        return None
    for member in members:
        if member is not NoneType:
            try:
                return fitted(member, value)
            except PlainError:
                continue
    raise PlainError(f"{_short(value)} does not fit")


def _of_list(origin: Any, members: tuple[Any, ...], value: object) -> Any:
    if not isinstance(value, list | tuple | frozenset) or len(value) > LONGEST_LIST:
        raise PlainError(f"{_short(value)} is no list")
    if origin is frozenset or (len(members) == 2 and members[1] is Ellipsis):
        return origin(fitted(members[0], part) for part in value)
    if len(value) != len(members):
        raise PlainError(f"wanted {len(members)} values, got {len(value)}")
    return tuple(fitted(member, part) for member, part in zip(members, value, strict=True))


def _of_mapping(members: tuple[Any, ...], value: object) -> dict[Any, Any]:
    if not isinstance(value, Mapping):
        raise PlainError(f"{_short(value)} is no object")
    return {fitted(members[0], name): fitted(members[1], part) for name, part in value.items()}


@lru_cache(maxsize=128)
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)


def _whole(digits: str) -> int:
    if len(digits) > MOST_DIGITS:
        raise PlainError(f"a number of {len(digits):,} digits")
    return int(digits)


def _finite(digits: str) -> float:
    value = float(digits[:400])
    if not math.isfinite(value):
        raise PlainError(f"the number {digits[:20]}, which is none that can be reckoned with")
    return value


def _refuse(word: str) -> float:
    raise PlainError(f"{word}, which is no number of JSON")


def _short(value: object) -> str:
    return repr(value)[:40] if isinstance(value, str | int | float | bool | NoneType) else f"a {type(value).__name__}"
