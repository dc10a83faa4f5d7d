"""Numbers out of text are those of decimal arithmetic, by the fast way and by the patient one."""

from __future__ import annotations

from decimal import ROUND_HALF_EVEN, Decimal

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from etnet.errors import RecordingError
from etnet.events.formats.text.rows import Columns, parse_rows

SECONDS = Columns(0, 1, 2, 3)
MICROS = Columns(0, 1, 2, 3, 4, "us")


def decimal_micros(token: str) -> int:
    """The slow twin: exact decimal arithmetic."""
    return int((Decimal(token) * 10**6).to_integral_value(ROUND_HALF_EVEN))


def parse(lines: list[str], columns: Columns = SECONDS):
    return parse_rows("\n".join(lines).encode() + b"\n", columns, "test.txt", 1)


digits = st.text("0123456789", min_size=1, max_size=16)
seconds = st.builds(lambda whole, part: f"{whole}.{part}", st.text("0123456789", min_size=1, max_size=11), digits)


@given(tokens=st.lists(seconds, min_size=1, max_size=20))
@example(["0.0000005", "0.0000015", "0.00000150000001", "13.582596999000002", "1468939802.003811", "0.9999995"])
def test_seconds_become_microseconds_exactly_and_half_goes_to_even(tokens):
    rows = parse([f"{token} 1 2 0" for token in tokens])
    assert rows.t.tolist() == [decimal_micros(token) for token in tokens]


@given(
    table=st.lists(
        st.tuples(st.integers(0, 10**17), st.integers(0, 65_535), st.integers(0, 65_535), st.sampled_from([-1, 0, 1])),
        min_size=1,
        max_size=30,
    )
)
def test_whole_numbers_are_read_as_they_stand(table):
    rows = parse([" ".join(map(str, row)) for row in table], MICROS)
    assert list(zip(rows.t.tolist(), rows.x.tolist(), rows.y.tolist(), rows.p.tolist(), strict=True)) == table


@pytest.mark.parametrize(
    "row", ["1.5e-3 1 2 0", "  0.0015\t1,2   0 ", "0.0015 1.0 2.0 0.0", "+.0015 1 2 0", "# a\n0.0015 1 2 0"]
)
def test_unusual_spellings_go_the_patient_way_with_the_same_result(row):
    rows = parse(["0.001000 5 6 1", row, "0.002 7 8 -1"])
    assert rows.t.tolist() == [1000, 1500, 2000]
    assert rows.x.tolist() == [5, 1, 7]
    assert rows.y.tolist() == [6, 2, 8]
    assert rows.p.tolist() == [1, 0, -1]


def test_a_sign_and_a_2_in_one_block_stay_what_they_are():
    assert parse(["0.1 1 2 -1", "0.2 3 4 2", "0.3 5 6 1"]).p.tolist() == [-1, 2, 1]


@given(tokens=st.lists(st.integers(0, 99_999), min_size=1, max_size=20))
def test_short_numbers_beside_long_ones_are_read_as_they_stand(tokens):
    rows = parse([f"0.5 {token} {token % 1000} 1" for token in tokens])
    assert rows.x.tolist() == tokens
    assert rows.y.tolist() == [token % 1000 for token in tokens]


def test_windows_line_ends_and_other_separators_make_no_difference():
    plain = parse_rows(b"0.5 1 2 1\n0.6 3 4 0\n", SECONDS, "a", 1)
    for other in (
        b"0.5 1 2 1\r\n0.6 3 4 0\r\n",
        b"0.5,1,2,1\n0.6,3,4,0\n",
        b"0.5\t1\t2\t1\n0.6;3;4;0\n",
        b"0.5 1 2 1\n0.6 3 4 0",
    ):
        found = parse_rows(other, SECONDS, "a", 1)
        np.testing.assert_array_equal(found.t, plain.t)
        np.testing.assert_array_equal(found.y, plain.y)


def test_columns_may_stand_in_any_order():
    rows = parse_rows(b"7 8 1 0.25 99\n9 10 0 0.5 99\n", Columns(3, 0, 1, 2, 5), "a", 1)
    assert rows.t.tolist() == [250_000, 500_000]
    assert (rows.x.tolist(), rows.y.tolist(), rows.p.tolist()) == ([7, 9], [8, 10], [1, 0])


@pytest.mark.parametrize(
    "row", ["nan 1 2 0", "inf 1 2 0", "0.1 1 2", "0.1 1 2 0 4", "0.1 x 2 0", "0.1 1.5 2 0", "1e40 1 2 0"]
)
def test_a_bad_line_is_named(row):
    with pytest.raises(RecordingError, match=r"test\.txt: line 2"):
        parse(["0.1 1 2 0", row])


@pytest.mark.parametrize("column", range(4))
@pytest.mark.parametrize("rounds", [False, True])
def test_a_number_with_a_large_exponent_is_never_written_out(column, rounds):
    row = ["0.1", "1", "2", "0"]
    row[column] = "1e999999"
    with pytest.raises(RecordingError, match=r"test\.txt: line 2"):
        parse(["0.1 1 2 0", " ".join(row)], Columns(0, 1, 2, 3, rounds=rounds))


def test_the_largest_stamps_are_read_in_every_unit():
    for unit, token in (("us", "4e18"), ("ns", "4e21"), ("s", "4e12"), ("ms", "4e15")):
        assert parse([f"{token} 1 2 0"], Columns(0, 1, 2, 3, 4, unit)).t.tolist() == [4 * 10**18]
