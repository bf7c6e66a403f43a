"""Computing ahead: order, overlap, what is raised, and that no thread is left behind."""

from __future__ import annotations

import threading

import pytest

from vsacli.base.background import ahead

SECONDS = 10.0
"""After which a test is taken to hang."""


def threads_ahead() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name.startswith("vsacli-ahead")]


@pytest.mark.parametrize("count", [0, 1, 5])
def test_items_come_in_their_order(count: int):
    assert list(ahead(str, range(count))) == [*map(str, range(count))]
    assert not threads_ahead()


def test_the_next_item_is_computed_while_the_caller_has_one():
    begun = [threading.Event() for _ in range(4)]

    def begin(number: int) -> int:
        begun[number].set()
        return -number

    coming = ahead(begin, range(4))
    for number in range(3):
        assert next(coming) == -number
        assert begun[number + 1].wait(SECONDS)
        assert not any(event.is_set() for event in begun[number + 2 :])  # one ahead, no more
    coming.close()


def test_what_is_raised_comes_after_the_items_before_it():
    coming = ahead(lambda item: 6 // item, [1, 2, 0])
    assert [next(coming), next(coming)] == [6, 3]
    with pytest.raises(ZeroDivisionError):
        next(coming)
    assert not threads_ahead()


def test_nothing_is_left_of_what_is_given_up():
    """The item that is being computed is waited for: nobody would wait for it later."""
    going_on, ended = threading.Event(), threading.Event()

    def compute(item: int) -> int:
        if item > 1:
            going_on.wait(SECONDS)
            ended.set()
        return item

    coming = ahead(compute, [1, 2, 3])
    assert next(coming) == 1
    threading.Timer(0.05, going_on.set).start()
    coming.close()
    assert ended.is_set()
    assert not threads_ahead()
