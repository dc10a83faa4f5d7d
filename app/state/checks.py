"""One kit of checks for everything a page, a link or a browser's storage says: it is a stranger's word.

A value is checked against the type of the dataclass field that it is for. `number`, `whole`, `text` and `passing` make
fields that say more than their type does. Nothing here raises anything but ValueError.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import MISSING, Field, field, fields, is_dataclass, replace
from functools import lru_cache
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from etnet import plain_values
from etnet.errors import EtnetError

LONGEST_TEXT = 500
"""Characters of one text."""
LONGEST_JSON = 20_000
"""Characters of JSON that are looked at."""
DEEPEST_JSON = 12
LONGEST_LIST = 64
LARGEST_WHOLE = 1 << 62
Checked = TypeVar("Checked")


def number(default: float, low: float, high: float) -> Any:
    """A field for a number between `low` and `high`; a value outside is brought to the nearer end."""
    return field(default=default, metadata={"range": (low, high)})


def whole(default: int | None, low: int, high: int) -> Any:
    """A field for a whole number between `low` and `high`; a value outside is brought to the nearer end."""
    return field(default=default, metadata={"range": (low, high)})


def text(default: str, pattern: str = "", longest: int = LONGEST_TEXT) -> Any:
    """A field for a text of at most `longest` characters that matches `pattern` as a whole."""
    return field(default=default, metadata={"pattern": pattern, "longest": longest})


def passing(default: Any = MISSING, default_factory: Any = MISSING, can_be_set: bool = False) -> Any:
    """A field that neither a browser nor a link keeps, and that no page may set by name unless it `can_be_set`."""
    metadata = {"passes": True, "can_be_set": can_be_set}
    if default_factory is not MISSING:
        return field(default_factory=default_factory, metadata=metadata)
    return field(default=default, metadata=metadata)


def is_passing(entry: Field[Any]) -> bool:
    """Whether a field is one of `passing`."""
    return bool(entry.metadata.get("passes"))


def checked(kind: type, name: str, value: object) -> Any:
    """`value` as the field `name` of a dataclass takes it.

    Raises:
        ValueError: there is no such field, or the value does not fit.
    """
    for entry in fields(kind):
        if entry.name == name and (entry.metadata.get("can_be_set") or not is_passing(entry)):
            return _fit(_hints(kind)[name], value, entry.metadata)
    raise ValueError(f"{kind.__name__} has no field {str(name)[:40]!r} that can be set")


def with_word(slice_: Checked, name: str, word: str) -> Checked:
    """A slice with one field set from a word of our own HTML: "True", "3", "0.5", "none", or a word of its list.

    Raises:
        ValueError: the word does not fit.
    """
    kind: Any = type(slice_)
    if not any(entry.name == name for entry in fields(kind)):
        raise ValueError(f"{kind.__name__} has no field {name[:40]!r}")
    hint = _hints(kind)[name]
    return replace(slice_, **{name: checked(kind, name, _read(hint, word))})  # pyright: ignore[reportArgumentType]


def to_plain(value: object) -> Any:
    """A frozen dataclass as values of JSON, without what passes and without what is at its default."""
    if is_dataclass(value) and not isinstance(value, type):
        plain: dict[str, Any] = {"kind": type(value).__name__} if _is_member_of_union(type(value)) else {}
        for entry in fields(value):
            held = getattr(value, entry.name)
            if not is_passing(entry) and not _is_default(entry, held):
                plain[entry.name] = to_plain(held)
        return plain
    if isinstance(value, list | tuple | set | frozenset):
        return [to_plain(part) for part in value]
    return value


def restored(default: Checked, stored: object) -> tuple[Checked, tuple[str, ...]]:
    """`default` with every stored field that is sound, and the names of those that are not."""
    if not isinstance(stored, Mapping):
        return default, ("all of it",)
    sound: dict[str, Any] = {}
    refused: list[str] = []
    passing_by = {entry.name for entry in fields(type(default)) if is_passing(entry)}  # pyright: ignore[reportArgumentType]
    for name, value in stored.items():
        if name in passing_by:
            refused.append(str(name))
            continue
        try:
            sound[str(name)] = checked(type(default), str(name), value)
        except (ValueError, EtnetError):
            refused.append(str(name)[:40])
    return replace(default, **sound), tuple(refused)  # pyright: ignore[reportArgumentType]


def bounded_json(text_: str, longest: int = LONGEST_JSON) -> Any:
    """Foreign JSON of bounded length, depth and numbers.

    Raises:
        ValueError: too long, too deep, not JSON, or a number that no field of ours takes.
    """
    return plain_values.bounded_json(text_, longest, DEEPEST_JSON)


@lru_cache(maxsize=64)
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)


def _fit(hint: Any, value: object, metadata: Mapping[str, Any]) -> Any:
    origin = get_origin(hint)
    if origin is Literal:
        if not isinstance(value, str) or value not in get_args(hint):
            raise ValueError(f"{str(value)[:40]!r} is not one of {', '.join(map(str, get_args(hint)))}")
        return value
    if origin in (Union, UnionType):
        return _fit_union(get_args(hint), value, metadata)
    if origin is tuple:
        return _fit_tuple(get_args(hint), value)
    if is_dataclass(hint):
        return _fit_dataclass(hint, value)
    return _fit_plain(hint, value, metadata)


def _fit_plain(hint: Any, value: object, metadata: Mapping[str, Any]) -> Any:
    low, high = metadata.get("range", (-LARGEST_WHOLE, LARGEST_WHOLE))
    if hint is bool and isinstance(value, bool):
        return value
    if hint is int and isinstance(value, int) and not isinstance(value, bool):
        return min(max(value, low), high)
    if hint is float and isinstance(value, int | float) and not isinstance(value, bool) and not _is_endless(value):
        return float(min(max(value, low), high))
    if hint is str and isinstance(value, str) and len(value) <= metadata.get("longest", LONGEST_TEXT):
        value.encode()  # half a surrogate pair can be said in JSON, but no page can be sent with it
        pattern = metadata.get("pattern", "")
        if not pattern or re.fullmatch(pattern, value):
            return value
    raise ValueError(f"{str(value)[:40]!r} does not fit")


def _is_endless(value: float) -> bool:
    """Whether a number is NaN or infinite; a whole number never is, however large."""
    return isinstance(value, float) and not math.isfinite(value)


def _fit_union(members: tuple[Any, ...], value: object, metadata: Mapping[str, Any]) -> Any:
    if value is None and NoneType in members:
        return None
    kinds = [member for member in members if is_dataclass(member)]
    if isinstance(value, Mapping) and len(kinds) > 1:
        kinds = [kind for kind in kinds if getattr(kind, "__name__", "") == value.get("kind")]
    rest = [member for member in members if member is not NoneType and not is_dataclass(member)]
    for member in (*kinds, *rest):
        try:
            return _fit(member, value, metadata)
        except ValueError:
            continue
    raise ValueError(f"{str(value)[:40]!r} does not fit")


def _fit_tuple(members: tuple[Any, ...], value: object) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple) or len(value) > LONGEST_LIST:
        raise ValueError("not a short list")
    if len(members) == 2 and members[1] is Ellipsis:
        return tuple(_fit(members[0], part, {}) for part in value)
    if len(value) != len(members):
        raise ValueError(f"wanted {len(members)} values, got {len(value)}")
    return tuple(_fit(member, part, {}) for member, part in zip(members, value, strict=True))


def _fit_dataclass(kind: Any, value: object) -> Any:
    if isinstance(value, kind):
        value = {entry.name: getattr(value, entry.name) for entry in fields(kind)}
    if not isinstance(value, Mapping):
        raise ValueError(f"not a {kind.__name__}")
    known = {entry.name: entry for entry in fields(kind)}
    foreign = set(value) - set(known) - {"kind"}
    if foreign:
        raise ValueError(f"{kind.__name__} has no field {str(min(map(str, foreign)))[:40]!r}")
    sound = {
        name: _fit(_hints(kind)[name], part, known[name].metadata) for name, part in value.items() if name in known
    }
    try:
        return kind(**sound)
    except (TypeError, EtnetError) as error:
        raise ValueError(str(error)) from error


def _read(hint: Any, word: str) -> object:
    """A word as the type wants it; what cannot be read stays a word and is refused by its check."""
    members = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    if word == "none" and NoneType in members:
        return None
    if bool in members and word in ("True", "False"):
        return word == "True"
    for kind in (int, float):
        if kind in members and len(word) <= 20:
            try:
                return kind(word)
            except ValueError:
                continue
    return word


def _is_default(entry: Field[Any], held: object) -> bool:
    if entry.default is not MISSING:
        return bool(held == entry.default)
    return entry.default_factory is not MISSING and bool(held == entry.default_factory())


def _is_member_of_union(kind: type) -> bool:
    """Window policies say which one they are."""
    from etnet.windows import Policy

    return kind in get_args(Policy)
