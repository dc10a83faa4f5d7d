"""Event text whose first line names the columns, in any order, with any further columns."""

from __future__ import annotations

from etnet.events.assumptions import TimeUnit
from etnet.events.formats.base import Remarks
from etnet.events.formats.column_names import NAMES
from etnet.events.formats.text.layout import Layout, judged_unit, sampled_rows
from etnet.events.formats.text.rows import Columns

_UNITS: tuple[tuple[str, TimeUnit], ...] = (
    ("us", "us"),
    ("µs", "us"),
    ("micro", "us"),
    ("ns", "ns"),
    ("nano", "ns"),
    ("ms", "ms"),
    ("milli", "ms"),
    ("sec", "s"),
)


def named_layout(head: bytes, remarks: Remarks, stated: TimeUnit | None) -> Layout | None:
    """Columns by the names in the first line; None where it names none."""
    header = _header(head)
    if header is None:
        return None
    tokens, skipped = header
    places = _places(tokens) or {}
    unit = _unit(tokens, places["t"], head[skipped:], remarks, stated)
    columns = Columns(places["t"], places["x"], places["y"], places["p"], len(tokens), unit)
    return Layout(columns, skipped, 1)


def names_columns(head: bytes) -> bool:
    """Whether the first line does."""
    return _header(head) is not None


def _header(head: bytes) -> tuple[list[str], int] | None:
    """The names in the first line, which may be a comment, and the bytes up to the first row."""
    line, newline, _ = head.partition(b"\n")
    names = line.lstrip(b"#% \xef\xbb\xbf").decode("utf-8", "replace").lower()
    for mark in ",;\t":
        names = names.replace(mark, " ")
    tokens = [token.strip('"\r') for token in names.split()]
    if not newline or len(tokens) < 4 or _places(tokens) is None:
        return None
    return tokens, len(line) + 1


def _places(tokens: list[str]) -> dict[str, int] | None:
    plain = [token.split("(")[0].split("[")[0] for token in tokens]
    stems = [_without_unit(token) for token in plain]
    places = {}
    for axis, names in NAMES.items():
        fitting = [
            i for i, (token, stem) in enumerate(zip(plain, stems, strict=True)) if token in names or stem in names
        ]
        if len(fitting) != 1:
            return None
        places[axis] = fitting[0]
    return places


def _without_unit(token: str) -> str:
    for ending in ("_us", "_ns", "_ms", "_s", "_µs"):
        if token.endswith(ending):
            return token.removesuffix(ending)
    return token


def _named_unit(token: str) -> TimeUnit | None:
    tail = token.replace("timestamp", "")
    if tail.endswith(("_s", "(s)", "[s]")):
        return "s"
    return next((unit for mark, unit in _UNITS if mark in tail), None)


def _unit(tokens: list[str], place: int, rest: bytes, remarks: Remarks, stated: TimeUnit | None) -> TimeUnit:
    named = _named_unit(tokens[place])
    if named is None or stated is not None:
        return judged_unit([row[place] for row in sampled_rows(rest, len(tokens))], remarks, stated)
    remarks.detected(f'stamps count {named}: their column is called "{tokens[place]}"')
    return named
