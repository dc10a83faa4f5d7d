"""Whatever is kept, found and forgotten: never more than the budget, and what was used last stays."""

from hypothesis import given
from hypothesis import strategies as st

from etnet.byte_cache import ByteCache

acts = st.lists(
    st.tuples(st.sampled_from(["keep", "find", "forget", "budget"]), st.integers(0, 9), st.integers(0, 60)), max_size=60
)


@given(acts, st.integers(0, 2))
def test_a_slow_twin_holds_the_same(acts, fewest):
    cache: ByteCache[int, str] = ByteCache(100, overhead=0, fewest=fewest)
    budget, twin = 100, []  # (key, value, size), the least recently used first
    for act, key, size in acts:
        held = next((entry for entry in twin if entry[0] == key), None)
        if act == "find":
            assert cache.find(key) == (None if held is None else held[1])
            if held is not None:
                twin = [entry for entry in twin if entry[0] != key] + [held]
            continue
        if act == "forget":
            cache.forget(lambda of, key=key: of == key)
        twin = [entry for entry in twin if entry[0] != key] if act in ("keep", "forget") else twin
        if act == "keep":
            cache.keep(key, f"{key} {size}", size)
            twin += [(key, f"{key} {size}", size)] if size <= budget or fewest else []
        if act == "budget":
            budget = size
            cache.set_budget(budget)
        while len(twin) > fewest and sum(entry[2] for entry in twin) > budget:
            twin.pop(0)
        assert cache.keys() == tuple(entry[0] for entry in twin)
        assert cache.values() == tuple(entry[1] for entry in twin)
        assert cache.nbytes == sum(entry[2] for entry in twin)
        assert len(cache) == len(twin)


def test_what_is_held_is_not_made_again():
    cache: ByteCache[str, list] = ByteCache(1000)
    first = cache.get("a", lambda: [1])
    assert cache.get("a", lambda: [2]) is first
    cache.forget(lambda key: key == "a")
    assert cache.get("a", lambda: [3]) == [3]


def test_the_store_never_grows_past_its_budget():
    store = ByteCache(10_000)
    for i in range(100):
        assert store.text(i, lambda i=i: str(i) * 500).startswith(str(i))
    assert store.nbytes <= 10_000
    assert 0 < len(store) < 100
    assert store.text("large", lambda: "x" * 20_000) == "x" * 20_000
    assert store.nbytes <= 10_000


def test_the_store_weighs_a_text_by_the_memory_it_takes():
    plain, with_a_dash = ByteCache(100_000), ByteCache(100_000)
    plain.text(0, lambda: "x" * 10_000)
    with_a_dash.text(0, lambda: "x" * 9_999 + "–")
    assert 10_000 <= plain.nbytes < 10_600
    assert 20_000 <= with_a_dash.nbytes < 20_600
