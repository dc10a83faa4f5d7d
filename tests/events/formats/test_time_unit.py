"""The unit of stamps is the usual one, unless only another one makes a recording of them; what was taken is said."""

import pytest

from etnet.events.assumptions import Assumptions
from etnet.events.formats.base import Remarks
from etnet.events.formats.time_unit import Evidence, judged_unit

PIXELS = 346 * 260


def judge(first, last, num_events=2000, fractions=False, usual=None, num_pixels=PIXELS, assume=None):
    remarks = Remarks()
    evidence = Evidence(num_events, first, last, num_pixels, fractions)
    return judged_unit(evidence, assume or Assumptions(), remarks, usual, "its layout"), remarks.kept


@pytest.mark.parametrize(
    ("first", "last", "fractions", "usual", "unit"),
    [
        (0, 80_000, False, None, "us"),  # 80 ms
        (0.0, 0.08, True, None, "s"),
        (1_461_581_614.98, 1_461_581_615.06, True, None, "s"),
        (1.6e15, 1.6e15 + 80_000, False, None, "us"),
        (1.6e18, 1.6e18 + 8e7, False, None, "ns"),
        (137, 2_999_000_137, False, None, "ns"),  # simulators' ns from 0
        (0.137, 2_999_000.137, True, None, "us"),  # floats of µs
        (100.0, 80_060.0, False, "s", "us"),  # µs under the names of a layout that counts seconds
        (100.5, 80_060.5, True, "s", "us"),
        (0, 1_000_000_000, False, None, "us"),  # 1,000 s of a busy camera
    ],
)
def test_a_unit_that_makes_a_recording_is_taken(first, last, fractions, usual, unit):
    num_events = 10_000_000 if last == 1_000_000_000 else 2000
    taken, remarks = judge(first, last, num_events, fractions, usual)
    assert taken == unit
    assert (not remarks) == (usual == unit)
    assert all("--time-unit overrules" in remark.text for remark in remarks)


def test_a_stated_unit_is_never_judged():
    taken, remarks = judge(0, 1e12, assume=Assumptions(time_unit="s"))
    assert (taken, [remark.text for remark in remarks]) == ("s", ["time unit s, as stated"])


def test_where_no_unit_makes_a_recording_that_is_advised():
    taken, remarks = judge(0, 10**16, num_events=2000)
    assert taken == "us"
    assert remarks[-1].kind == "advice"
    assert "--time-unit" in remarks[-1].text


def test_few_events_and_one_stamp_say_nothing_of_the_unit():
    assert judge(0, 5_000_000, num_events=5)[0] == "us"
    assert judge(7, 7, num_events=5000)[0] == "us"
    assert judge(7.0, 7.0, num_events=5000, usual="s")[0] == "s"


def test_a_sparse_recording_in_seconds_with_fractions_stays_one():
    assert judge(0.013, 10.5, num_events=2500, fractions=True)[0] == "s"
