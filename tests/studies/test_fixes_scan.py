"""Scan, bisection and confirmation on whole numbers."""

from dataclasses import dataclass, field

import pytest

from vsacli.studies.search.scans import smallest_confirmed


@dataclass
class Numbers:
    """Candidates judged by two rules: one for the watched steps, one for all."""

    watched: object
    everywhere: object = None
    step: int = 10
    asked: list[int] = field(default_factory=list)

    def stride(self, number):
        assert number >= 0
        return self.step

    def accepts(self, number):
        self.asked.append(number)
        return self.watched(number)

    def confirms(self, number):
        rule = self.everywhere or self.watched
        if rule(number):
            return True
        self.watched = rule
        return False


@pytest.mark.parametrize("threshold", [0, 1, 9, 10, 11, 57, 99, 100])
def test_smallest_of_a_monotone_rule_is_found(threshold):
    assert smallest_confirmed(Numbers(lambda n: n >= threshold), 0, 100) == threshold


def test_first_number_is_taken_if_it_is_accepted():
    numbers = Numbers(lambda _: True)
    assert smallest_confirmed(numbers, 7, 100) == 7
    assert numbers.asked == [7]


@pytest.mark.parametrize(("start", "stop"), [(0, 100), (0, 0), (5, 4)])
def test_none_is_accepted(start, stop):
    numbers = Numbers(lambda _: False)
    assert smallest_confirmed(numbers, start, stop) is None
    assert max(numbers.asked, default=None) == (stop if start <= stop else None)


def test_first_accepted_window_wins_over_later_ones():
    assert smallest_confirmed(Numbers(lambda n: 33 <= n <= 45 or n >= 70), 0, 100) == 33


def test_last_stride_ends_at_the_last_number():
    assert smallest_confirmed(Numbers(lambda n: n >= 98), 0, 99) == 98


def test_what_the_watched_steps_miss_is_scanned_again():
    numbers = Numbers(lambda n: n >= 20, everywhere=lambda n: 47 <= n <= 60)
    assert smallest_confirmed(numbers, 0, 100) == 47


def test_confirmation_may_leave_nothing():
    assert smallest_confirmed(Numbers(lambda n: n >= 20, everywhere=lambda _: False), 0, 100) is None
