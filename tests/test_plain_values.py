"""Foreign JSON costs no more than it is long, and a value is its field's or is refused by name in one line."""

import json
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from etnet.plain_values import Bounds, PlainError, bounded_json, fitted, made_of

ROOT = Path(__file__).resolve().parents[1]
DEEP = 12
ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.sampled_from([10**400, "\ud800", b""]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner, max_size=4),
    max_leaves=8,
)


@dataclass(frozen=True)
class Part:
    share: float = field(default=0.5, metadata={"range": (0.0, 1.0)})
    word: str = field(default="a", metadata={"pattern": "[a-z]+", "longest": 5})


@dataclass(frozen=True)
class Other:
    count: int = 1

    def __post_init__(self):
        if self.count < 0:
            raise ValueError("a count is\nnot negative")


@dataclass(frozen=True)
class Whole:
    number: int
    scale: float = 1.0
    kinds: frozenset[int] = frozenset()
    pair: tuple[int, int] = (0, 0)
    parts: tuple[Part, ...] = ()
    mode: Literal["one", "two", 3] = "one"
    one_of: Part | Other | None = None
    named: Mapping[str, int] = field(default_factory=dict)


TYPES = [int, float, bool, str, int | None, tuple[int, ...], tuple[str, float], frozenset[int], Whole, Part | Other]


@pytest.mark.parametrize(
    "text",
    ['"' + '\\"' * 500_000, '["' * 500_000, '"\\' * 300_000, '{"a":"\\"' * 100_000, "\\" * 1_000_000, '"' * 999_999],
    ids=lambda text: text[:6],
)
def test_what_is_no_json_costs_what_its_length_costs(text):
    began = time.process_time()
    with pytest.raises(PlainError):
        bounded_json(text, 1 << 20)
    assert time.process_time() - began < 5


@pytest.mark.parametrize("value", [{"a": [1, 2.5, None, 'é\n"][']}, [[[]]], "]]]][[[[[[[[[[[[[[[[[[[", 7, {}])
def test_what_is_json_is_read_as_it_is(value):
    assert bounded_json(json.dumps(value), 1000, deepest=3) == value
    assert bounded_json(json.dumps(value, ensure_ascii=False).encode(), 1000) == value
    assert bounded_json(json.dumps(value).encode("utf-8-sig"), 1000) == value


@pytest.mark.parametrize("is_object", [True, False])
def test_depth_is_counted_outside_of_texts(is_object):
    start, end = ('{"[": ', "}") if is_object else ("[", "]")
    assert bounded_json(start * DEEP + "1" + end * DEEP, 1000)
    with pytest.raises(PlainError, match=f"more than {DEEP} deep"):
        bounded_json(start * (DEEP + 1) + "1" + end * (DEEP + 1), 1000)


def test_numbers_that_are_none_are_refused_or_nothing():
    for text in ("NaN", "-Infinity", "1e999", "[1, 1e999]"):
        with pytest.raises(PlainError):
            bounded_json(text, 100)
        assert bounded_json(text, 100, endless="none") in (None, [1, None])


@settings(deadline=None)
@given(ANYTHING, st.sampled_from(TYPES), st.sampled_from([Bounds(), Bounds(clamps=True, longest_list=2)]))
def test_a_value_fits_or_is_refused_in_one_line(value, hint, bounds):
    refused = ""
    try:
        found = fitted(hint, value, bounds)
    except PlainError as error:
        refused = str(error)
    else:
        assert fitted(hint, found, bounds) == found
    assert "\n" not in refused
    assert len(refused) < 400


def test_a_dataclass_is_made_of_all_its_kinds_of_fields():
    plain = {
        "number": 3, "scale": 2, "kinds": [1, 1, 2], "pair": [4, 5], "parts": [{"share": 0.25}], "mode": 3,
        "one_of": {"kind": "Other", "count": 2}, "named": {"a": 1},
    }  # fmt: skip
    made = made_of(Whole, plain)
    assert made == Whole(3, 2.0, frozenset({1, 2}), (4, 5), (Part(0.25),), 3, Other(2), {"a": 1})
    assert made_of(Whole, {"number": 3}) == Whole(3)


@pytest.mark.parametrize(
    ("plain", "said"),
    [
        ([], "a list; wanted a Whole"),
        ({}, "Whole lacks its field number"),
        ({"number": 1, "more": 2}, "Whole has no field 'more'"),
        ({"number": True}, "Whole.number is True; wanted a whole number"),
        ({"number": 1 << 63}, "Whole.number is 9223372036854775808; wanted a whole number"),
        ({"number": 10**5000}, "Whole.number is a whole number beyond all bounds"),
        ({"number": 1, "scale": "x"}, "Whole.scale is 'x'; wanted a number"),
        ({"number": 1, "scale": 10**400}, "Whole.scale is a whole number beyond all bounds; wanted a number"),
        ({"number": 1, "kinds": ["x"]}, "Whole.kinds is a list that holds 'x'; wanted a list"),
        ({"number": 1, "pair": [1]}, "Whole.pair is a list of 1 values; wanted 2"),
        ({"number": 1, "mode": "3"}, "Whole.mode is '3'; wanted 'one' or 'two' or 3"),
        ({"number": 1, "parts": [{"word": "A"}]}, "Part.word is 'A'; wanted a text"),
        ({"number": 1, "parts": [{"word": "aaaaaa"}]}, "Part.word is 'aaaaaa'; wanted a text"),
        ({"number": 1, "one_of": {"count": 1}}, "Whole.one_of is a dict; wanted a Part or a Other or null"),
        ({"number": 1, "one_of": {"kind": "Other", "count": -1}}, "a count is"),
        ({"number": 1, "named": {"a": None}}, "Whole.named is None; wanted a whole number"),
    ],
)
def test_what_does_not_fit_is_said_by_its_field(plain, said):
    with pytest.raises(PlainError, match=re.escape(said)):
        made_of(Whole, plain)


def test_numbers_come_to_the_nearer_end_where_their_field_or_the_bounds_say_so():
    assert made_of(Part, {"share": 7}) == Part(1.0)
    assert made_of(Part, {"share": -(10**400)}) == Part(0.0)
    near = Bounds(largest=100, clamps=True)
    assert made_of(Other, {"count": 10**9}, near) == Other(100)
    assert fitted(float, -1e9, near) == -100.0
    assert fitted(Part, Part(share=7.0), near) == Part(1.0)
    for endless in (float("nan"), float("inf")):
        with pytest.raises(PlainError):
            made_of(Part, {"share": endless}, near)


def test_nothing_reads_json_of_others_by_itself():
    """What a process of ours said, and what lies in a folder that is this user's alone, is no stranger's word."""
    own = {
        "etnet/plain_values.py", "etnet/playback/disk_cache.py", "etnet/nets/kept_choices.py", "etnet/training/log.py",
        "app/catalogue/limited.py", "app/demo_check.py",
    }  # fmt: skip
    sources = [path for package in ("etnet", "app") for path in (ROOT / package).rglob("*.py")]
    found = {str(path.relative_to(ROOT)) for path in sources if re.search(r"json\.loads?\(", path.read_text())}
    assert found == own
