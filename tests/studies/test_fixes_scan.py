"""The smallest accepted whole number, found at few samples and checked at all."""

import numpy as np
import pytest

from vsacli.studies.search.cutting_planes import first_accepted, scanned_numbers, smallest_accepted

STRIDES = range(0, 100, 10)


def first(rule, numbers=(*STRIDES, 99)):
    """The first accepted number, and the numbers that were asked for."""
    asked = []

    def accepts(tried):
        for number in tried:
            asked.append(number)
            yield rule(number)

    return first_accepted(accepts, numbers), asked


def smallest(thresholds, numbers=(*STRIDES, 99)):
    """The smallest number that is at least the threshold of each sample, if it is below their end."""
    low, high = np.array(thresholds).T

    def refuse(tried, samples):
        for number in tried:
            yield ((number < low[samples]) | (number > high[samples]))[np.newaxis]

    return smallest_accepted(refuse, len(low), numbers)


@pytest.mark.parametrize("threshold", [0, 1, 9, 10, 11, 57, 98, 99])
def test_smallest_of_a_monotone_rule_is_found(threshold):
    assert first(lambda n: n >= threshold)[0] == threshold


def test_first_number_is_taken_if_it_is_accepted():
    assert first(lambda _: True, [7, 20]) == (7, [7])


@pytest.mark.parametrize("numbers", [range(0, 100, 10), [0], []])
def test_none_is_accepted(numbers):
    assert first(lambda _: False, numbers) == (None, list(numbers))


def test_first_accepted_window_wins_over_later_ones():
    assert first(lambda n: 33 <= n <= 45 or n >= 70)[0] == 33


def test_what_few_samples_miss_is_scanned_again():
    everywhere = [(20, 200)] * 1000
    assert smallest(everywhere) == 20
    assert smallest([*everywhere[:501], (47, 200), *everywhere[:498]]) == 47


def test_a_check_at_all_samples_may_leave_nothing():
    everywhere = [(20, 200)] * 1000
    assert smallest([*everywhere[:501], (0, 10), *everywhere[:498]]) is None


@pytest.mark.parametrize("base", [0, 5000, -5000])
def test_scanned_numbers_differ_by_a_share_of_their_sums_with_the_base(base):
    numbers = np.array(scanned_numbers(100, 4900, 0.01, base))
    assert (numbers[0], numbers[-1]) == (100, 4900)
    sums = np.abs(base + numbers)
    ratios = np.maximum(sums[1:] / sums[:-1], sums[:-1] / sums[1:])
    assert np.all(np.diff(sums[:-1]) * np.sign(base + 1) > 0)
    assert np.all(np.abs(np.diff(sums)) <= 0.01 * sums[:-1] + 1)  # whole numbers
    assert ratios.max() < 1.03


def test_no_numbers_are_scanned_below_the_first():
    assert scanned_numbers(5, 4, 0.01) == []
    assert scanned_numbers(5, 5, 0.01) == [5]
