"""Pages to take home: found by whoever was given the address, gone in time, and never too many."""

from app.catalogue.homes import MOST_LINKS, PATH, Homes


def test_a_page_is_found_by_its_own_address_alone():
    homes = Homes()
    one, other = homes.put(b"one"), homes.put(b"other")
    assert (homes.get(one), homes.get(other)) == (b"one", b"other")
    assert homes.get(PATH) is None
    assert homes.get(one[:-1]) is None
    assert len(one) > len(PATH) + 20
    assert one != other


def test_links_expire(monkeypatch):
    now = [1000.0]
    monkeypatch.setattr("app.catalogue.homes.time.monotonic", lambda: now[0])
    homes = Homes(lives=60)
    path = homes.put(b"page")
    now[0] += 59
    assert homes.get(path) == b"page"
    now[0] += 2
    assert homes.get(path) is None
    assert homes.nbytes == 0


def test_space_is_capped_and_the_oldest_go():
    homes = Homes(largest=100)
    paths = [homes.put(bytes(40)) for _ in range(4)]
    assert homes.nbytes <= 100
    assert [homes.get(path) is not None for path in paths] == [False, False, True, True]


def test_a_page_that_many_take_home_is_counted_once_and_each_has_an_address_of_their_own():
    homes, page = Homes(largest=100), bytes(60)
    paths = [homes.put(page) for _ in range(5)]
    assert homes.nbytes == 60
    assert len(set(paths)) == 5
    assert all(homes.get(path) is page for path in paths)


def test_addresses_are_bounded_and_the_oldest_go():
    homes, page = Homes(), b"page"
    paths = [homes.put(page) for _ in range(MOST_LINKS + 3)]
    assert [path for path in paths if homes.get(path) is None] == paths[:3]
