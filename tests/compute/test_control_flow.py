"""Loops and branches over samples: each sample runs as if it were alone."""

from __future__ import annotations

import numpy as np

from vsacli.compute.control_flow import Values, repeat, where_needed


def halve(state: Values, constants: Values) -> tuple[Values, np.ndarray]:
    """Count how often a number is halved until it is below a bound."""
    (number, count), (bound,) = state, constants
    return (number / 2, count + 1), number / 2 < bound


def test_each_sample_takes_its_own_number_of_steps():
    number, bound = np.array([1.0, 1000.0, 3.0, 1e6]), np.array([1.0, 1.0, 2.0, 5.0])
    halved, count = repeat(halve, (number, np.zeros(4)), (bound,), 100)
    expected = np.floor(np.log2(number / bound)) + 1
    np.testing.assert_array_equal(count, expected)
    np.testing.assert_array_equal(halved, number / 2**expected)


def test_a_sample_that_is_done_stays_as_it_is_while_others_go_on():
    def count_up(state: Values, constants: Values) -> tuple[Values, np.ndarray]:
        (count,), (target,) = state, constants
        return (count + 1,), count + 1 == target

    target = np.array([1.0, 9.0, 9.0, 2.0, 7.0, 9.0, 9.0])
    (count,) = repeat(count_up, (np.zeros(7),), (target,), 100)
    np.testing.assert_array_equal(count, target)


def test_no_sample_takes_more_steps_than_the_limit():
    halved, count = repeat(halve, (np.array([8.0, 1e9]), np.zeros(2)), (np.ones(2),), 4)
    np.testing.assert_array_equal(count, [4, 4])
    np.testing.assert_array_equal(halved, [0.5, 1e9 / 16])


def test_shape_is_kept_and_input_untouched():
    number = np.arange(1.0, 13.0).reshape(3, 4)
    before = number.copy()
    halved, _ = repeat(halve, (number, np.zeros((3, 4))), (np.ones((3, 4)),), 10)
    assert halved.shape == (3, 4)
    np.testing.assert_array_equal(number, before)


def test_function_is_computed_where_needed_only():
    seen = []

    def root(x):
        seen.append(x.copy())
        return (np.sqrt(x),)

    x = np.array([4.0, -1.0, 9.0])
    (found,) = where_needed(x > 0, root, (x,), (x,))
    np.testing.assert_array_equal(found, [2, -1, 3])
    np.testing.assert_array_equal(seen, [[4, 9]])
    assert where_needed(x > 100, root, (x,), (x,))[0] is x
    assert len(seen) == 1
