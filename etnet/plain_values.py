"""Foreign JSON, bounded before it is parsed; and frozen dataclasses made of it, each value checked by its type.

All that a file, a link, a browser's storage or a page says in JSON comes in by `bounded_json` and is fitted here. A
dataclass's field may say more than its type by its metadata: `range` (low, high; a number outside is brought to the
nearer end), `pattern` (of a whole text) and `longest` (characters).
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import lru_cache
from types import MappingProxyType, NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from etnet.errors import EtnetError

DEEPEST = 12
MOST_DIGITS = 20
LONGEST_TEXT = 500
LONGEST_LIST = 1 << 20
LARGEST_WHOLE = 1 << 62
# A string that is not closed reaches to the end, so that no text is gone through twice.
_TOKENS = re.compile(r'"[^"\\]*(?:\\.[^"\\]*)*"?|[\[\]{}]', re.DOTALL)
_NOTHING: Mapping[str, Any] = MappingProxyType({})
Made = TypeVar("Made")


class PlainError(EtnetError, ValueError):
    """A value that does not fit where it stands."""


class _PlacedError(PlainError):
    """One that says itself where."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """How much a value may be, where its field does not say."""

    largest: int = LARGEST_WHOLE
    """Of a whole number, on both sides of 0."""
    longest_list: int = LONGEST_LIST
    clamps: bool = False
    """Numbers beyond are brought to the nearer end, and values that are dataclasses already are looked through, too."""


ANY_SIZE = Bounds()


def bounded_json(
    text: str | bytes, longest: int, deepest: int = DEEPEST, endless: Literal["refused", "none"] = "refused"
) -> Any:
    """Foreign JSON of bounded length, depth and numbers; numbers are finite, texts can be encoded.

    `endless`: infinities and NaN, which are no JSON but are written by many, are refused or become `None`.

    Raises:
        PlainError: too long, too deep, not JSON, or a number that no field takes.
    """
    if len(text) > longest:
        raise PlainError(f"holds {len(text):,} characters of JSON; wanted at most {longest:,}")
    try:
        plain = text.decode(json.detect_encoding(text)) if isinstance(text, bytes) else text
        if _is_deeper(plain, deepest):
            raise PlainError(f"is nested more than {deepest} deep")
        refuse = endless == "refused"
        value = json.loads(
            plain,
            parse_int=_whole,
            parse_float=_finite if refuse else _finite_or_none,
            parse_constant=_refuse if refuse else lambda word: None,
        )
        json.dumps(value, ensure_ascii=False).encode()
    except PlainError:
        raise
    except (ValueError, RecursionError, OverflowError, MemoryError) as error:
        raise PlainError(f"is no JSON that can be read ({str(error)[:80]})") from None
    return value


def made_of(kind: type[Made], plain: object, bounds: Bounds = ANY_SIZE) -> Made:
    """A frozen dataclass from plain values: lists become tuples or sets. What is left out has its default.

    Raises:
        PlainError: a field is missing, foreign, or does not fit.
    """
    if not isinstance(plain, Mapping):
        raise PlainError(f"{_short(plain)}; wanted a {kind.__name__}")
    known = {entry.name: entry for entry in fields(kind)}  # pyright: ignore[reportArgumentType]
    # One of several kinds says which one it is.
    values = {name: value for name, value in plain.items() if name != "kind" or value != kind.__name__}
    if (foreign := next((name for name in values if name not in known), None)) is not None:
        raise _PlacedError(f"{kind.__name__} has no field {_short(foreign)}")
    for entry in known.values():
        if entry.name not in values and entry.default is MISSING and entry.default_factory is MISSING:
            raise _PlacedError(f"{kind.__name__} lacks its field {entry.name}")
    hints = hints_of(kind)
    for name, value in values.items():
        try:
            values[name] = fitted(hints[name], value, bounds, known[name].metadata)
        except _PlacedError:
            raise
        except PlainError as error:
            raise _PlacedError(f"{kind.__name__}.{name} is {error}") from None
    try:
        return kind(**values)
    except (EtnetError, TypeError, ValueError, ArithmeticError) as error:
        raise _PlacedError((str(error).splitlines() or [type(error).__name__])[0][:300]) from None


def fitted(hint: Any, value: object, bounds: Bounds = ANY_SIZE, said: Mapping[str, Any] = _NOTHING) -> Any:
    """A plain value as a type takes it; `said`: what its field says beside the type.

    Raises:
        PlainError: it does not fit.
    """
    origin = get_origin(hint)
    if origin is Literal:
        if any(type(value) is type(choice) and value == choice for choice in get_args(hint)):
            return value
        raise PlainError(f"{_short(value)}; wanted {_wanted(hint, bounds)}")
    if origin in (Union, UnionType):
        return _of_any(hint, value, bounds, said)
    if origin in (tuple, frozenset):
        return _of_list(hint, value, bounds)
    if origin is not None and issubclass(origin, Mapping):
        return _of_mapping(hint, value, bounds)
    if is_dataclass(hint):
        if not isinstance(value, hint):  # pyright: ignore[reportArgumentType]
            return made_of(hint, value, bounds)  # pyright: ignore[reportArgumentType]
        plain = {entry.name: getattr(value, entry.name) for entry in fields(hint)}
        return made_of(hint, plain, bounds) if bounds.clamps else value  # pyright: ignore[reportArgumentType]
    found = _of_plain(hint, value, bounds, said)
    if found is None:
        raise PlainError(f"{_short(value)}; wanted {_wanted(hint, bounds)}")
    return found


@lru_cache(maxsize=256)
def hints_of(kind: type) -> dict[str, Any]:
    """The types of a dataclass's fields."""
    return get_type_hints(kind)


def _of_plain(hint: Any, value: object, bounds: Bounds, said: Mapping[str, Any]) -> bool | int | float | str | None:
    """A number, a word or a flag; `None` where it does not fit."""
    if hint is bool:
        return value if isinstance(value, bool) else None
    if hint is str:
        return value if isinstance(value, str) and _is_fine(value, said) else None
    if not isinstance(value, int | float) or isinstance(value, bool):
        return None
    if isinstance(value, float) and (hint is int or not math.isfinite(value)):
        return None
    low, high = said.get("range", (-bounds.largest, bounds.largest))
    if hint is int or "range" in said or bounds.clamps:
        near = min(max(value, low), high)
        is_taken = near == value or "range" in said or bounds.clamps
        return (near if hint is int else float(near)) if is_taken and hint in (int, float) else None
    try:
        return float(value) if hint is float else None
    except OverflowError:
        return None


def _is_fine(text: str, said: Mapping[str, Any]) -> bool:
    if len(text) > said.get("longest", LONGEST_TEXT):
        return False
    try:
        text.encode()  # half a surrogate pair can be said in JSON, but nothing can be sent or written with it
    except UnicodeEncodeError:
        return False
    pattern = said.get("pattern", "")
    return not pattern or re.fullmatch(pattern, text) is not None


def _of_any(hint: Any, value: object, bounds: Bounds, said: Mapping[str, Any]) -> Any:
    members = get_args(hint)
    if value is None and NoneType in members:
        return None
    kinds = [member for member in members if is_dataclass(member)]
    if isinstance(value, Mapping) and len(kinds) > 1:
        kinds = [kind for kind in kinds if getattr(kind, "__name__", "") == value.get("kind")]
    rest = [member for member in members if member is not NoneType and not is_dataclass(member)]
    tried: list[PlainError] = []
    for member in (*kinds, *rest):
        try:
            return fitted(member, value, bounds, said)
        except PlainError as error:
            tried.append(error)
    if len(tried) == 1:
        raise tried[0]
    raise PlainError(f"{_short(value)}; wanted {_wanted(hint, bounds)}")


def _of_list(hint: Any, value: object, bounds: Bounds) -> Any:
    origin, members = get_origin(hint), get_args(hint)
    is_set = origin is frozenset
    is_list = isinstance(value, list | tuple) or (is_set and isinstance(value, frozenset))
    if not isinstance(value, list | tuple | frozenset) or not is_list or len(value) > bounds.longest_list:
        raise PlainError(f"{_short(value)}; wanted {_wanted(hint, bounds)}")
    if is_set or (len(members) == 2 and members[1] is Ellipsis):
        try:
            return origin(fitted(members[0], part, bounds) for part in value)  # pyright: ignore[reportOptionalCall]
        except _PlacedError:
            raise
        except PlainError as error:
            held = str(error).partition(";")[0]
            raise PlainError(f"a list that holds {held}; wanted {_wanted(hint, bounds)}") from None
    if len(value) != len(members):
        raise PlainError(f"a list of {len(value)} values; wanted {len(members)}")
    return tuple(fitted(member, part, bounds) for member, part in zip(members, value, strict=True))


def _of_mapping(hint: Any, value: object, bounds: Bounds) -> dict[Any, Any]:
    if not isinstance(value, Mapping) or len(value) > bounds.longest_list:
        raise PlainError(f"{_short(value)}; wanted {_wanted(hint, bounds)}")
    of_name, of_part = get_args(hint)
    return {fitted(of_name, name, bounds): fitted(of_part, part, bounds) for name, part in value.items()}


def _is_deeper(text: str, deepest: int) -> bool:
    depth = 0
    for token in _TOKENS.finditer(text):
        sign = text[token.start()]
        depth += sign in "[{"
        depth -= sign in "]}"
        if depth > deepest:
            return True
    return False


def _whole(digits: str) -> int:
    if len(digits) > MOST_DIGITS:
        raise PlainError(f"holds a whole number of {len(digits)} digits; wanted at most {MOST_DIGITS}")
    return int(digits)


def _finite(digits: str) -> float:
    value = float(digits[:400])
    if not math.isfinite(value):
        raise PlainError(f"holds the number {digits[:20]}, which is none that can be reckoned with")
    return value


def _finite_or_none(digits: str) -> float | None:
    value = float(digits[:400])
    return value if math.isfinite(value) else None


def _refuse(word: str) -> float:
    raise PlainError(f"holds {word}, which is no number of JSON")


def _wanted(hint: Any, bounds: Bounds) -> str:
    """A type in words."""
    origin, members = get_origin(hint), get_args(hint)
    if origin is Literal:
        return " or ".join(map(repr, members))
    if origin in (Union, UnionType):
        return " or ".join(_wanted(member, bounds) for member in members)
    if origin is frozenset or (origin is tuple and members[-1] is Ellipsis):
        return f"a list of at most {bounds.longest_list}, each {_wanted(members[0], bounds)}"
    if origin is tuple:
        return f"a list of {len(members)}"
    if origin is not None:
        return "an object"
    whole = "a whole number" if bounds.largest == LARGEST_WHOLE else f"a whole number up to {bounds.largest}"
    names = {int: whole, float: "a number", bool: "true or false", str: "a text", NoneType: "null"}
    return names.get(hint, f"a {getattr(hint, '__name__', hint)}")


def _short(value: object) -> str:
    """A plain value, cut; of anything else what it is."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) >= 10**40:
        return "a whole number beyond all bounds"  # to write it down may not be allowed
    return repr(value)[:60] if isinstance(value, str | int | float | bool | NoneType) else f"a {type(value).__name__}"
