from app.engine.queue import RequestQueue
from tests.app.fakes import request


def quiet(reply):
    pass


def served(book):
    order = []
    while (turn := book.next_turn()) is not None:
        order.append((turn.visitor, turn.request.index))
        book.settle(turn)
    return order


def test_a_newer_request_replaces_the_older():
    book = RequestQueue()
    for index in range(9):
        book.put("ada", request(index), quiet)
    assert book.num_waiting == 1
    assert served(book) == [("ada", 8)]


def test_visitors_take_turns_however_often_one_asks():
    book = RequestQueue()
    order = []
    for index in range(6):
        for visitor in ("eager", "eager", "calm", "shy"):
            book.put(visitor, request(index), quiet)
        turn = book.next_turn()
        order.append(turn.visitor)
        book.settle(turn)
    assert sorted(order[:3]) == ["calm", "eager", "shy"]
    assert order[:3] == order[3:]


def test_an_unfinished_request_stays_but_goes_behind_the_others():
    book = RequestQueue()
    book.put("ada", request(1), quiet)
    book.put("bob", request(2), quiet)
    first = book.next_turn()
    assert book.others_wait(first)
    assert book.next_turn().visitor != first.visitor
    assert book.next_turn() is first
    assert first.num_turns == 2


def test_a_replaced_request_cannot_be_settled():
    book = RequestQueue()
    book.put("ada", request(1), quiet)
    turn = book.next_turn()
    book.put("ada", request(2), quiet)
    assert not book.is_wanted(turn)
    assert not book.settle(turn)
    assert served(book) == [("ada", 2)]


def test_the_same_request_asked_again_is_a_new_one():
    book = RequestQueue()
    book.put("ada", request(1), quiet)
    turn = book.next_turn()
    book.put("ada", request(1), quiet)
    assert not book.is_wanted(turn)


def test_who_left_leaves_nothing_behind():
    book = RequestQueue()
    book.put("ada", request(1), quiet)
    book.drop("ada")
    assert book.next_turn() is None
    assert book.last_turns() == []


def test_the_last_request_is_remembered_after_it_was_served():
    book = RequestQueue()
    book.put("ada", request(3), quiet)
    book.settle(book.next_turn())
    assert [turn.request.index for turn in book.last_turns()] == [3]
