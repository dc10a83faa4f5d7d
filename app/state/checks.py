"""What a page, a link or a browser's storage says is a stranger's word: it is checked by the field that it is for.

`number`, `whole`, `text` and `passing` make fields that say more than their type does; `etnet.plain_values` looks at
the values. Nothing here raises anything but ValueError.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, Field, field, fields, is_dataclass, replace
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin

from etnet import plain_values
from etnet.errors import EtnetError
from etnet.plain_values import LONGEST_TEXT, Bounds, fitted, hints_of

LONGEST_JSON = 20_000
"""Characters of JSON that are looked at."""
DEEPEST_JSON = 12
OF_A_PAGE = Bounds(longest_list=64, clamps=True)
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
            return fitted(hints_of(kind)[name], value, OF_A_PAGE, entry.metadata)
    raise ValueError(f"{kind.__name__} has no field {str(name)[:40]!r} that can be set")


def with_word(slice_: Checked, name: str, word: str) -> Checked:
    """A slice with one field set from a word of our own HTML: "True", "3", "0.5", "none", or a word of its list.

    Raises:
        ValueError: the word does not fit.
    """
    kind: Any = type(slice_)
    if not any(entry.name == name for entry in fields(kind)):
        raise ValueError(f"{kind.__name__} has no field {name[:40]!r}")
    hint = hints_of(kind)[name]
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
