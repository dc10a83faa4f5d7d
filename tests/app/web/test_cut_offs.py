"""An address whose pages are cut off waits longer and longer; others do not."""

from app.web.cut_offs import FREE, KEPT_ADDRESSES, LONGEST_QUEUE, CutOffs


def test_a_few_cost_nothing_and_many_cost_their_own_address_a_wait():
    now = [0.0]
    cut_offs = CutOffs(lambda: now[0])
    for _ in range(FREE):
        cut_offs.note("a")
        assert cut_offs.wait_of("a") == 0
    cut_offs.note("a")
    first, second = cut_offs.wait_of("a"), cut_offs.wait_of("a")
    assert 0 < first < second
    assert cut_offs.wait_of("b") == 0
    now[0] = 61.0
    assert cut_offs.wait_of("a") == 0


def test_nobody_waits_longer_than_the_queue():
    now = [0.0]
    cut_offs = CutOffs(lambda: now[0])
    for _ in range(1000):
        cut_offs.note("a")
    waits = [cut_offs.wait_of("a") for _ in range(100)]
    assert max(wait for wait in waits if wait is not None) <= LONGEST_QUEUE
    assert waits[-1] is None
    assert waits[:3] == [2.0, 4.0, 6.0]


def test_what_is_kept_of_addresses_is_bounded():
    cut_offs = CutOffs(lambda: 0.0)
    for i in range(3 * KEPT_ADDRESSES):
        for _ in range(FREE + 1):
            cut_offs.note(str(i))
        cut_offs.wait_of(str(i))
    assert len(cut_offs._by_address) == KEPT_ADDRESSES
    assert len(cut_offs._next) <= KEPT_ADDRESSES
