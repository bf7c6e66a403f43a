"""What is traced of NumPy's functions computes what NumPy computes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from samples.programs import carry_out, traced
from samples.traced_functions import ELEMENTWISE, NODES, SPECIAL, operands

from vsacli.compute.tracing import Symbol, Tape, TracedArray
from vsacli.compute.tracing.python_functions import StateFunction


@pytest.mark.parametrize("name", ELEMENTWISE)
def test_functions_mean_what_they_mean_in_numpy(name: str) -> None:
    function, (x, y) = ELEMENTWISE[name], operands()
    (found,) = carry_out(traced(function, 2), [x, y])
    with np.errstate(all="ignore"):
        expected = function(x, y)
    np.testing.assert_array_equal(found, expected)
    if expected.dtype.kind == "f":
        np.testing.assert_array_equal(np.signbit(found), np.signbit(expected))


BINARY = [
    *(np.add, np.subtract, np.multiply, np.divide, np.maximum, np.minimum, np.arctan2, np.hypot, np.copysign),
    *(np.less, np.less_equal, np.greater, np.greater_equal, np.equal, np.not_equal, np.power),
]


@pytest.mark.parametrize("ufunc", BINARY, ids=lambda ufunc: ufunc.__name__)
def test_a_constant_beside_a_value_is_simplified_only_if_the_result_is_the_same(ufunc: np.ufunc) -> None:
    """But for the sign of a zero: x + 0 is traced as x, also where x is -0."""

    def with_constants(x: Any) -> Any:
        sides = [ufunc(x, constant) for constant in SPECIAL], [ufunc(constant, x) for constant in SPECIAL]
        return [result for side in sides for result in side]

    x, _ = operands()
    with np.errstate(all="ignore"):
        expected = with_constants(x)
    for found, right in zip(carry_out(traced(with_constants, 1), [x]), expected, strict=True):
        np.testing.assert_array_equal(np.broadcast_to(found, right.shape), right)


@pytest.mark.parametrize("ufunc", BINARY, ids=lambda ufunc: ufunc.__name__)
def test_the_order_of_operands_counts(ufunc: np.ufunc) -> None:
    """An operation that was traced is taken for another only if it is the same."""
    x, y = operands()
    found = carry_out(traced(lambda x, y: [ufunc(x, y), ufunc(y, x)], 2), [x, y])
    with np.errstate(all="ignore"):
        np.testing.assert_array_equal(found, [ufunc(x, y), ufunc(y, x)])


@pytest.mark.parametrize(("exponent", "units"), [(3, 2), (4, 2), (1.5, 2)])
def test_powers_by_products_are_off_by_rounding_alone(exponent: float, units: int) -> None:
    """Each product or root rounds by half a unit in the last place, NumPy's power by one."""
    x = np.abs(operands()[0][len(SPECIAL) ** 2 :])
    (found,) = carry_out(traced(lambda x: x**exponent, 1), [x])
    np.testing.assert_array_max_ulp(found, x**exponent, units)


ARRAYS: dict[str, Callable[[Any, Any], Any]] = {
    "stack": lambda x, y: np.stack([x, y, x]),
    "stack with constants": lambda x, y: np.stack([x, np.full_like(x, 3.0), y]),
    "concatenate": lambda x, y: np.concatenate([x, y]),
    "sum over an axis": lambda x, y: np.stack([x, y]).sum(axis=0),
    "index": lambda x, y: np.stack([x, y])[1],
    "slice": lambda x, y: np.stack([x, y, x])[::2],
    "negative index": lambda x, y: np.stack([x, y])[-1] - x,
    "rows of ones": lambda x, y: np.stack([np.ones_like(x), np.zeros_like(y)]) * x,
    "a constant matrix": lambda x, y: np.array([[1.0, 2.0], [0.0, -1.0]]) @ np.stack([x, y]),
    "broadcast": lambda x, y: np.array([[2.0], [3.0]]) * np.stack([x, y]),
    "truths of a shape": lambda x, _y: np.where(np.ones_like(x, dtype=bool), x, 0.0),
    "clip of a stack": lambda x, y: np.clip(np.stack([x, y]), 0.0, x),
}


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_are_arranged_as_by_numpy(name: str) -> None:
    function = ARRAYS[name]
    x, y = np.random.default_rng(1).normal(size=(2, 5))
    for k in range(5):
        program = traced(function, 2)
        found = np.array([np.ravel(value)[0] for value in carry_out(program, [x[k : k + 1], y[k : k + 1]])])
        np.testing.assert_array_equal(found, np.ravel(function(x[k : k + 1], y[k : k + 1])))


def test_entries_are_written_in_place() -> None:
    tape = Tape()
    (x,) = tape.inputs(1)
    row = TracedArray(tape, [x])
    target = np.zeros_like(np.stack([row, row]))
    target[1] = 2 * row
    target[0], kept = row, target.copy()
    (first, second, zero) = carry_out(
        tape.program([*target.cells.ravel(), kept.cells[0].item()]), [np.array([3.0])]
    )
    assert (first, second, zero) == (3, 6, 0)
    assert len(target) == 2
    assert target.shape == (2, 1)
    assert (target.ndim, target.size, target.T.shape) == (2, 2, (1, 2))


@pytest.fixture
def row() -> TracedArray:
    tape = Tape()
    return TracedArray(tape, tape.inputs(1))


UNKNOWN = "what is known only when the program runs cannot decide what is recorded"


def test_a_decision_on_a_value_is_refused(row: TracedArray) -> None:
    with pytest.raises(NotImplementedError, match=UNKNOWN):
        bool(row > 0)
    with pytest.raises(NotImplementedError, match=UNKNOWN):
        row[row > 0]
    with pytest.raises(NotImplementedError, match=UNKNOWN):
        row[row > 0] = 1.0


def test_a_value_does_not_become_a_number(row: TracedArray) -> None:
    numbers = np.zeros(1)
    with pytest.raises(TypeError, match="an array of numbers cannot take in"):
        np.add(row, 1.0, out=numbers)
    for number_of in (float, hash):
        with pytest.raises(NotImplementedError, match="known only when the program runs"):
            number_of(row)


@pytest.mark.parametrize(
    ("use", "reason"),
    [
        (lambda x: np.sort(x), "numpy.sort cannot be recorded"),
        (lambda x: np.median(x), "numpy.median cannot be recorded"),
        (lambda x: np.sin.at(x, 0), "numpy.sin cannot be recorded in this way"),
        (lambda x: np.spacing(x), "the operation spacing cannot be recorded"),
        (lambda x: np.searchsorted(NODES, x), "side='right' only"),
        (lambda x: x.astype(np.int64), "no conversion"),
        (lambda x: np.where(x > 0, np.uint32(1), np.uint32(2)), "set or not"),
        (lambda x: (x > 0) + x, "different kinds"),
        (lambda x: (x > 0) * 2.0, "truth"),
        (lambda x: np.searchsorted(NODES, x, side="right") * 0.5, "whole"),
    ],
)
def test_what_cannot_be_recorded_is_refused_by_name(
    use: Callable[[Any], Any], reason: str, row: TracedArray
) -> None:
    with pytest.raises(NotImplementedError, match=reason):
        use(row)


def test_values_of_two_programs_do_not_meet(row: TracedArray) -> None:
    with pytest.raises(NotImplementedError, match="a value of another program"):
        row + TracedArray(other := Tape(), other.inputs(1))


def test_nothing_is_added_to_a_program() -> None:
    tape = Tape()
    x, y = tape.inputs(2)
    program = tape.program([x + y])
    with pytest.raises(RuntimeError, match="its program is made"):
        x * y
    assert len(program.operations) == 1


def test_constants_are_computed_at_once() -> None:
    tape = Tape()
    constant = TracedArray(tape, [2.0])
    assert np.sin(constant * 3 + 1).cells.item() == math.sin(7)
    assert bool(constant > 1)
    assert np.where(constant > 1, 5.0, 6.0).cells.item() == 5
    assert tape.program([]).operations == ()


def test_an_operation_is_recorded_once_and_only_if_needed() -> None:
    tape = Tape()
    x, y = tape.inputs(2)
    product = x * y
    assert y * x is product
    assert isinstance(product, Symbol)
    np.sin(TracedArray(tape, [product]))
    assert tape.program([product]).operations == (product,)


def test_a_program_computes_numbers_rows_and_becomes_part_of_another() -> None:
    tape = Tape()
    x, y = tape.inputs(2)
    function = StateFunction(tape.program([x * y - 1, x.sin(), 4.0]))
    single, rows = np.array([0.3, 2.0]), np.array([[0.3, 2.0], [0.5, -1.0]])
    np.testing.assert_array_equal(function(single), [0.3 * 2 - 1, math.sin(0.3), 4])
    np.testing.assert_array_equal(function(rows)[0], function(single))

    program = traced(lambda a, b: function(np.concatenate([a + b, b])), 2)
    found = carry_out(program, [rows[:, 0], rows[:, 1]])
    expected = function(np.column_stack([rows.sum(axis=1), rows[:, 1]])).T
    np.testing.assert_array_equal(np.stack(np.broadcast_arrays(*found)), expected)


def test_a_name_is_free_only_when_no_expression_reads_it_any_more() -> None:
    tape = Tape()
    x, y = tape.inputs(2)
    product = x * y  # has a name, as it is used twice
    later = product + x  # is written where it is used, behind what follows
    other = product * y
    square = other * other
    function = StateFunction(tape.program([square * later - other]))
    np.testing.assert_array_equal(function(np.array([2.0, 3.0])), [18.0**2 * 8 - 18])


def test_many_values_with_few_names_are_those_of_numbers() -> None:
    def combine(*inputs: Any) -> list[Any]:
        draw, values = np.random.default_rng(0), list(inputs)
        for _ in range(300):
            first, second = (values[-place] for place in draw.integers(1, min(len(values), 40) + 1, 2))
            values.append((first + second, first - 2 * second, np.sin(first) * second)[draw.integers(3)])
        return values[-5:]

    tape, numbers = Tape(), [0.3, -1.2, 0.7, 2.1]
    function = StateFunction(tape.program(combine(*tape.inputs(4))))
    # The sine of Python's module may differ from NumPy's by a rounding error.
    np.testing.assert_allclose(function(np.array(numbers)), combine(*numbers), rtol=1e-12)
