"""Nothing is sent faster than it is painted, and nobody who paints nothing is waited for for ever."""

from hypothesis import given
from hypothesis import strategies as st

from app.session.push_pace import INTERVAL, LONGEST_WAIT, MOST_AHEAD, PushPace


def test_what_is_no_browser_is_sent_thirty_pushes_a_second():
    pace = PushPace()
    assert pace.wait(100.0) == 0
    for number in range(1, 9):
        now = 100 + number * INTERVAL
        assert pace.wait(now) == 0
        assert pace.sent(now) == number
        assert abs(pace.wait(now) - INTERVAL) < 1e-9


def test_a_browser_that_has_not_painted_is_waited_for_and_a_tab_in_the_background_is_not_forgotten():
    pace = PushPace()
    pace.painted(pace.sent(0.0))
    for number in range(MOST_AHEAD):
        assert pace.wait(1.0 + number) == 0
        pace.sent(1.0 + number)
    last = float(MOST_AHEAD)
    assert pace.wait(last + INTERVAL) > 0
    assert pace.wait(last + LONGEST_WAIT) == 0
    pace.painted(2)
    assert pace.wait(last + INTERVAL) == 0


@given(st.lists(st.one_of(st.integers(-5, 60), st.none()), max_size=80))
def test_whatever_a_page_says_the_next_push_is_never_further_off_than_the_longest_wait(said):
    pace, now, ahead, painted = PushPace(), 0.0, 0, None
    for number in said:
        if number is None:
            wait = pace.wait(now)
            assert 0 <= wait <= LONGEST_WAIT + 1e-9
            now += wait
            ahead = pace.sent(now)
        else:
            pace.painted(number)
            painted = max(number, painted or 0) if 0 < number <= ahead else painted
    is_behind = painted is not None and ahead - painted >= MOST_AHEAD
    assert pace.wait(now) <= (LONGEST_WAIT if is_behind else INTERVAL) + 1e-9
