"""Dual numbers: arrays that carry their derivatives along, so that a kernel computes derivatives as it is.

Forward mode of automatic differentiation (Griewank & Walther, Evaluating Derivatives, 2nd ed., chapter 3):
each NumPy function that a kernel uses is applied to the values, and its derivative to the tangents. A number
stores only the tangents of parameters that it depends on, so that one run with all parameters costs no more
than the affected operations. Derivatives are exact to rounding. Choices (`np.where`, comparisons,
`np.maximum`) are made by the values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.compute.control_flow import cell_of, cell_on
from vsacli.compute.vector import Scalar, add, exact, mul, sub, trigonometric, trigonometric_of

Tangents = Mapping[int, Any]
"""Derivatives by direction, arrays that broadcast to the shape of the value; zero in other directions."""


class Dual(NDArrayOperatorsMixin):
    """Values with their derivatives in some directions, by the protocols of NumPy (NEP 13 and 18).

    Attributes:
        value: Values, of any shape; exact constants of `compute.vector` fold.
        tangents: Their derivatives by direction.
    """

    def __init__(self, value: Any, tangents: Tangents) -> None:
        self.value = value
        self.tangents = tangents

    @classmethod
    def of(cls, value: Any, derivatives: FloatArray) -> Dual:
        """Return a dual from the derivatives in all directions, (directions, *shape of the values)."""
        return cls(value, {direction: row for direction, row in enumerate(derivatives) if row.any()})

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if method != "__call__" or options:
            raise NotImplementedError(f"numpy.{ufunc.__name__}.{method} carries no derivatives along")
        if ufunc in ARITHMETIC_OPERATORS:
            return ARITHMETIC_OPERATORS[ufunc](*inputs)
        values = [value_of(operand) for operand in inputs]
        if ufunc in PIECEWISE_CONSTANT:
            return ufunc(*values)
        if ufunc not in PARTIAL_DERIVATIVES:
            raise NotImplementedError(f"numpy.{ufunc.__name__} carries no derivatives along")
        result = ufunc(*values)
        return Dual(result, _chain_rule(PARTIAL_DERIVATIVES[ufunc](result, *values), inputs))

    def __array_function__(
        self, function: Callable[..., Any], _types: Any, arguments: tuple[Any, ...], options: dict[str, Any]
    ) -> Any:
        if function in SHAPE_FUNCTIONS:
            return function(*map(value_of, arguments), **options)
        if function not in ARRANGING_FUNCTIONS:
            raise NotImplementedError(f"numpy.{function.__name__} carries no derivatives along")
        return ARRANGING_FUNCTIONS[function](*arguments, **options)

    # Operators of the recursion, without NumPy's protocol: a fifth of the time.

    def __add__(self, other: Any) -> Dual:
        return _sum_of(self, other)

    def __sub__(self, other: Any) -> Dual:
        return _difference_of(self, other)

    def __mul__(self, other: Any) -> Dual:
        return _product_of(self, other)

    def __rmul__(self, other: Any) -> Dual:
        return _product_of(self, other)

    def __neg__(self) -> Dual:
        return Dual(-self.value, _scaled_tangents(self.tangents, -1))

    def __getitem__(self, index: Any) -> Dual:
        return self._map_entries(lambda array: array[index])

    def __len__(self) -> int:
        return len(self.value)

    def __bool__(self) -> bool:
        """Return whether value or a tangent is nonzero: a zero that a parameter may change is no zero."""
        return bool(self.value) or any(np.any(tangent) for tangent in self.tangents.values())

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the values."""
        return np.shape(self.value)

    @property
    def ndim(self) -> int:
        """Dimensions of the values."""
        return np.ndim(self.value)

    @property
    def size(self) -> int:
        """Size of the values."""
        return np.size(self.value)

    @property
    def T(self) -> Dual:  # noqa: N802  (NumPy's name)
        """Transpose."""
        return self._map_entries(np.transpose)

    def sum(self, axis: int) -> Dual:
        """Return the sum along an axis."""
        return self._map_entries(lambda array: np.sum(array, axis=axis))

    def _map_entries(self, function: Callable[[FloatArray], FloatArray]) -> Dual:
        """Return the dual whose entries are chosen, moved or added up."""
        tangents = {
            direction: function(_broadcast_tangent(tangent, self.shape))
            for direction, tangent in self.tangents.items()
        }
        return Dual(function(self.value), tangents)


def seeds(values: Sequence[Any], first: int = 0) -> list[Dual]:
    """Return values as dual numbers, each array with its own direction, from the direction `first` on."""
    return [Dual(value, {first + index: 1}) for index, value in enumerate(values)]


def value_of(array: Any) -> Any:
    """Return the values of an array, dual or not."""
    return array.value if isinstance(array, Dual) else array


def tangent_of(array: Any, directions: int, shape: tuple[int, ...]) -> FloatArray:
    """Return the derivatives of an array, (directions, *shape); zero for an ordinary array."""
    derivatives = np.zeros((directions, *shape))
    for direction, tangent in tangents_of(array).items():
        derivatives[direction] = tangent
    return derivatives


def tangents_of(array: Any) -> Tangents:
    """Return the derivatives of an array by direction; empty for an ordinary array."""
    return array.tangents if isinstance(array, Dual) else {}


def _broadcast_tangent(tangent: Any, shape: tuple[int, ...]) -> FloatArray:
    return tangent if np.shape(tangent) == shape else np.broadcast_to(tangent, shape)


def _sum_of(first: Any, second: Any) -> Dual:
    """Return a sum; operands without tangent add nothing to its tangents."""
    if not isinstance(second, Dual):
        return Dual(add(first.value, second), first.tangents)
    if not isinstance(first, Dual):
        return Dual(add(first, second.value), second.tangents)
    return Dual(add(first.value, second.value), _sum_of_tangents(first.tangents, second.tangents))


def _difference_of(first: Any, second: Any) -> Dual:
    if not isinstance(second, Dual):
        return Dual(sub(first.value, second), first.tangents)
    tangents = dict(tangents_of(first))
    for direction, tangent in second.tangents.items():
        tangents[direction] = tangents[direction] - tangent if direction in tangents else -tangent
    return Dual(sub(value_of(first), second.value), tangents)


def _product_of(first: Any, second: Any) -> Dual:
    """Return a product, by Leibniz's rule."""
    if not isinstance(second, Dual):
        return Dual(mul(first.value, second), _scaled_tangents(first.tangents, second))
    if not isinstance(first, Dual):
        return Dual(mul(first, second.value), _scaled_tangents(second.tangents, first))
    a, b = first.value, second.value
    return Dual(
        mul(a, b), _sum_of_tangents(_scaled_tangents(first.tangents, b), _scaled_tangents(second.tangents, a))
    )


def _sum_of_tangents(first: Tangents, second: Tangents) -> Tangents:
    if not (first and second):
        return first or second
    total = dict(first)
    for direction, tangent in second.items():
        total[direction] = total[direction] + tangent if direction in total else tangent
    return total


def _scaled_tangents(tangents: Tangents, factor: Scalar) -> Tangents:
    """Return tangents times an array, or times a constant that folds."""
    if type(factor) is not int:
        return {direction: tangent * factor for direction, tangent in tangents.items()}
    if factor == 1:
        return tangents
    return {direction: mul(factor, tangent) for direction, tangent in tangents.items()} if factor else {}


def _chain_rule(partials: Sequence[Callable[[], Any]], inputs: Sequence[Any]) -> Tangents:
    """Return the chain rule: the sum of slope times tangent over the inputs that have one."""
    total: Tangents = {}
    for partial, operand in zip(partials, inputs, strict=True):
        if isinstance(operand, Dual):
            total = _sum_of_tangents(total, _scaled_tangents(operand.tangents, partial()))
    return total


@exact.register
def _(number: Dual) -> Dual:
    """Return a dual whose value folds, whatever its derivatives."""
    return Dual(exact(number.value), number.tangents)


@trigonometric_of.register
def _(angle: Dual, name: str) -> Dual:
    cos, sin = (trigonometric(function, angle.value) for function in ("cos", "sin"))
    value, slope = (cos, -sin) if name == "cos" else (sin, cos)
    return Dual(value, _scaled_tangents(angle.tangents, slope))


@cell_on.register
def _(position: Dual, count: int) -> IndexArray:
    """Choose cells by the values."""
    return cell_of(position.value, count)


Partials = Callable[..., Sequence[Callable[[], Any]]]
"""Function from result and operands of a function to its derivatives by each operand, computed if needed."""

PARTIAL_DERIVATIVES: Mapping[np.ufunc, Partials] = {
    np.divide: lambda r, _a, b: (lambda: 1.0 / b, lambda: -r / b),
    np.power: lambda r, a, b: (lambda: b * a ** (b - 1.0), lambda: r * np.log(a)),
    np.negative: lambda _r, _a: (lambda: -1.0,),
    np.positive: lambda _r, _a: (lambda: 1.0,),
    np.absolute: lambda _r, a: (lambda: np.sign(a),),
    np.square: lambda _r, a: (lambda: 2.0 * a,),
    np.sqrt: lambda r, _a: (lambda: 0.5 / r,),
    np.reciprocal: lambda r, _a: (lambda: -r * r,),
    np.exp: lambda r, _a: (lambda: r,),
    np.expm1: lambda r, _a: (lambda: r + 1.0,),
    np.log: lambda _r, a: (lambda: 1.0 / a,),
    np.log1p: lambda _r, a: (lambda: 1.0 / (1.0 + a),),
    np.sin: lambda _r, a: (lambda: np.cos(a),),
    np.cos: lambda _r, a: (lambda: -np.sin(a),),
    np.tan: lambda r, _a: (lambda: 1.0 + r * r,),
    np.arcsin: lambda _r, a: (lambda: 1.0 / np.sqrt(1.0 - a * a),),
    np.arccos: lambda _r, a: (lambda: -1.0 / np.sqrt(1.0 - a * a),),
    np.arctan: lambda _r, a: (lambda: 1.0 / (1.0 + a * a),),
    np.arctan2: lambda _r, a, b: (lambda: b / (a * a + b * b), lambda: -a / (a * a + b * b)),
    np.hypot: lambda r, a, b: (lambda: a / r, lambda: b / r),
    np.sinh: lambda _r, a: (lambda: np.cosh(a),),
    np.cosh: lambda _r, a: (lambda: np.sinh(a),),
    np.tanh: lambda r, _a: (lambda: 1.0 - r * r,),
    np.arcsinh: lambda _r, a: (lambda: 1.0 / np.sqrt(1.0 + a * a),),
    np.maximum: lambda _r, a, b: (lambda: 1.0 * (a >= b), lambda: 1.0 * (a < b)),
    np.minimum: lambda _r, a, b: (lambda: 1.0 * (a <= b), lambda: 1.0 * (a > b)),
    np.copysign: lambda r, a, _b: (lambda: np.sign(a) * np.sign(r), lambda: 0.0),
}
"""Derivatives of NumPy functions."""

PIECEWISE_CONSTANT = frozenset(
    {
        *(np.less, np.less_equal, np.greater, np.greater_equal, np.equal, np.not_equal),
        *(np.isfinite, np.isnan, np.isinf, np.sign, np.signbit, np.floor, np.ceil, np.rint),
    }
)
"""Functions that are piecewise constant."""

ARITHMETIC_OPERATORS: Mapping[np.ufunc, Callable[[Any, Any], Dual]] = {
    np.add: _sum_of,
    np.subtract: _difference_of,
    np.multiply: _product_of,
}
"""Frequent functions, computed without `PARTIAL_DERIVATIVES`."""

SHAPE_FUNCTIONS = frozenset({np.zeros_like, np.ones_like, np.empty_like, np.shape, np.ndim, np.searchsorted})
"""Functions whose results are shapes and indices, which have no derivatives."""


def _where_of_duals(condition: Any, a: Any, b: Any) -> Dual:
    value = np.where(condition, value_of(a), value_of(b))
    return Dual(
        value, {direction: np.where(condition, *pair) for direction, pair in _tangents_by_direction((a, b))}
    )


def _clip_duals(values: Any, low: Any, high: Any) -> Any:
    return np.minimum(np.maximum(values, low), high)


def _joining_function(function: Callable[..., Any]) -> Callable[..., Dual]:
    """Wrap stacking or concatenating, for which all parts need tangents."""

    def joined(arrays: Sequence[Any], axis: int = 0) -> Dual:
        value = function([value_of(array) for array in arrays], axis=axis)
        shapes = [np.shape(value_of(array)) for array in arrays]
        tangents = {
            at: function(
                [_broadcast_tangent(*array) for array in zip(tangents_of_arrays, shapes, strict=True)],
                axis=axis,
            )
            for at, tangents_of_arrays in _tangents_by_direction(arrays)
        }
        return Dual(value, tangents)

    return joined


def _tangents_by_direction(arrays: Sequence[Any]) -> Iterator[tuple[int, list[Any]]]:
    """Yield each direction in which one of several arrays has a tangent, with those of all of them."""
    tangents = [tangents_of(array_tangents) for array_tangents in arrays]
    for direction in dict.fromkeys(
        tangent_direction for array_tangents in tangents for tangent_direction in array_tangents
    ):
        yield direction, [array_tangents.get(direction, 0.0) for array_tangents in tangents]


def _broadcast_dual(array: Dual, shape: tuple[int, ...]) -> Dual:
    return Dual(np.broadcast_to(array.value, shape), array.tangents)


def _full_like_dual(array: Any, fill: Any) -> Any:
    shape = np.shape(value_of(array))
    return _broadcast_dual(fill, shape) if isinstance(fill, Dual) else np.full(shape, fill)


ARRANGING_FUNCTIONS: Mapping[Callable[..., Any], Callable[..., Any]] = {
    np.where: _where_of_duals,
    np.clip: _clip_duals,
    np.stack: _joining_function(np.stack),
    np.concatenate: _joining_function(np.concatenate),
    np.broadcast_to: _broadcast_dual,
    np.full_like: _full_like_dual,
    np.sum: Dual.sum,
}
"""Functions that arrange or choose entries."""
