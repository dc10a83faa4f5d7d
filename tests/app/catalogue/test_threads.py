"""Threads are used again, and what their work held is let go."""

import ctypes
import gc
import threading
import weakref

import cv2
import numpy as np
import pytest

from app.catalogue.threads import InOrder, ThreadPool


def follow_one_another(pool, num, work):
    for number in range(num):
        assert pool.start(work, f"work {number}").wait(10)
        settle(pool)


def settle(pool):
    """Wait until the thread that has done its work waits for more: it does so a moment after the work has ended."""
    moment = threading.Event()
    for _ in range(1000):
        if pool._idle:
            return
        moment.wait(0.001)
    raise AssertionError("nobody waits for work")


def test_work_that_comes_one_after_the_other_is_done_by_one_thread_under_its_own_name():
    pool, seen = ThreadPool(), []
    follow_one_another(pool, 20, lambda: seen.append((threading.get_ident(), threading.current_thread().name)))
    assert len({thread for thread, _ in seen}) == 1
    assert [name for _, name in seen] == [f"work {number}" for number in range(20)]


def test_work_that_comes_at_once_is_done_at_once_and_no_more_threads_wait_than_may():
    pool, together = ThreadPool(most_idle=2), threading.Barrier(6)
    ends = [pool.start(lambda: together.wait(10), f"together {number}") for number in range(5)]
    assert not any(end.is_set() for end in ends)
    together.wait(10)
    assert all(end.wait(10) for end in ends)
    settle(pool)
    assert len(pool._idle) <= 2


def test_what_the_work_held_is_let_go_when_it_has_ended():
    class Page:
        def draw(self):
            pass

    pool, page = ThreadPool(), Page()
    gone = weakref.ref(page)
    assert pool.start(page.draw, "page").wait(10)
    settle(pool)
    del page
    assert gone() is None


def test_work_that_fails_says_so_where_threads_do_and_the_next_is_done(monkeypatch):
    told = []
    monkeypatch.setattr(threading, "excepthook", lambda args: told.append((args.thread.name, str(args.exc_value))))
    pool, done = ThreadPool(), threading.Event()

    def broken():
        raise OSError("no space left on device")

    assert pool.start(broken, "broken").wait(10)
    assert pool.start(done.set, "next").wait(10)
    assert done.is_set()
    assert told == [("broken", "no space left on device")]


def handed_out():
    """Bytes that glibc has handed out and not got back."""

    class Mallinfo(ctypes.Structure):
        _fields_ = [(name, ctypes.c_size_t) for name in ("a", "b", "c", "d", "mapped", "e", "f", "used", "free", "g")]

    asked = getattr(ctypes.CDLL(None), "mallinfo2", None)
    if asked is None:
        pytest.skip("only glibc tells what it has handed out")
    asked.restype = Mallinfo
    told = asked()
    return told.used + told.mapped


def test_visits_that_draw_leave_nothing_of_their_threads():
    pool, grey = ThreadPool(), np.zeros((30, 40), np.uint8)

    def draw():
        cv2.cvtColor(cv2.resize(grey, (80, 60)), cv2.COLOR_GRAY2RGB)

    follow_one_another(pool, 50, draw)
    gc.collect()
    before = handed_out()
    follow_one_another(pool, 400, draw)
    gc.collect()
    assert (handed_out() - before) / 400 < 200  # a thread of its own each would leave 880


def test_what_is_asked_in_order_is_done_in_order_whatever_fails_and_is_bounded():
    done, gate, last = [], threading.Event(), threading.Event()
    work = InOrder("settings", most=60)
    assert work.start(lambda: gate.wait(10))
    while work._waiting:
        assert not gate.is_set()

    def fails():
        raise OSError("the camera has gone")

    assert all(
        work.start((lambda number=number: done.append(number)) if number != 7 else fails) for number in range(59)
    )
    assert work.start(last.set)
    assert not work.start(lambda: done.append("too much"))
    gate.set()
    assert last.wait(10)
    assert done == [number for number in range(59) if number != 7]
    assert work.start(last.clear)
