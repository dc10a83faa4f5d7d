"""The JSON in a weights file's metadata: bounded before it is parsed, checked before it is used. Needs no torch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from etnet.errors import WeightsError
from etnet.plain_values import Bounds, PlainError, bounded_json, made_of

MAX_CHARACTERS = 1 << 20
MAX_DEPTH = 32
OF_A_CONFIG = Bounds(largest=65_536, longest_list=32)
"""Wider and deeper layers than this were never built."""

Config = TypeVar("Config")


def parse_object(text: str, what: str) -> dict[str, Any]:
    """The JSON object in `text`; numbers that are not finite become `None`. Raises WeightsError, in one line."""
    try:
        value = bounded_json(text, MAX_CHARACTERS, MAX_DEPTH, endless="none")
    except PlainError as error:
        raise WeightsError(f"{what}: {error}") from None
    if not isinstance(value, dict):
        raise WeightsError(f"{what}: is a {type(value).__name__}, wanted a JSON object")
    return value


def config_of_plain(config_type: type[Config], plain: Mapping[str, Any], what: str) -> Config:
    """A configuration from plain values, each checked against its field's type. Raises WeightsError, in one line."""
    try:
        return made_of(config_type, plain, OF_A_CONFIG)
    except PlainError as error:
        raise WeightsError(f"{what}: {error}") from None
