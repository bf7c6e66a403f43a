"""Dual numbers: arrays that carry their derivatives along, so that the text of a computation differentiates.

Forward mode of automatic differentiation (Griewank & Walther, Evaluating Derivatives, 2nd ed., chapter 3):
each function of NumPy's that a kernel uses is applied to the values, and its derivative to the tangents. What
does not depend on a parameter stays an ordinary array and costs nothing more. Derivatives are exact to
rounding. Choices (`np.where`, comparisons, `np.maximum`) are made by the values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.compute.control_flow import cell_of, cell_on


class Dual(NDArrayOperatorsMixin):
    """Values and their derivatives in some directions, by the protocols of NumPy (NEP 13 and 18).

    Attributes:
        value: the values, of any shape.
        tangent: their derivatives, (directions, *shape of the values).
    """

    def __init__(self, value: Any, tangent: FloatArray) -> None:
        self.value = np.asarray(value, dtype=float)
        self.tangent = tangent

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if method != "__call__" or options:
            raise NotImplementedError(f"numpy.{ufunc.__name__}.{method} carries no derivatives along")
        if ufunc in FREQUENT:
            return FREQUENT[ufunc](*inputs)
        values = [value_of(each) for each in inputs]
        if ufunc in FLAT:
            return ufunc(*values)
        if ufunc not in SLOPES:
            raise NotImplementedError(f"numpy.{ufunc.__name__} carries no derivatives along")
        result = ufunc(*values)
        return Dual(result, _chained(SLOPES[ufunc](result, *values), inputs, result.ndim))

    def __array_function__(
        self, function: Callable[..., Any], _types: Any, arguments: tuple[Any, ...], options: dict[str, Any]
    ) -> Any:
        if function in ALIKE:
            return function(*map(value_of, arguments), **options)
        if function not in ARRANGED:
            raise NotImplementedError(f"numpy.{function.__name__} carries no derivatives along")
        return ARRANGED[function](*arguments, **options)

    # What the recursion is made of, without the way through NumPy's protocol: a fifth of its time.

    def __add__(self, other: Any) -> Dual:
        return _sum_of(self, other)

    def __sub__(self, other: Any) -> Dual:
        return _difference_of(self, other)

    def __mul__(self, other: Any) -> Dual:
        return _product_of(self, other)

    def __rmul__(self, other: Any) -> Dual:
        return _product_of(self, other)

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.tangent)

    def __getitem__(self, index: Any) -> Dual:
        places = index if isinstance(index, tuple) else (index,)
        return Dual(self.value[index], self.tangent[(slice(None), *places)])

    def __len__(self) -> int:
        return len(self.value)

    def __bool__(self) -> bool:
        """Whether it is more than nothing: a zero that a parameter may change is not left out."""
        return bool(self.value) or bool(np.any(self.tangent))

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the values."""
        return self.value.shape

    @property
    def ndim(self) -> int:
        """Of the values."""
        return self.value.ndim

    @property
    def size(self) -> int:
        """Of the values."""
        return self.value.size

    @property
    def T(self) -> Dual:  # noqa: N802  (NumPy's name)
        """As of an array."""
        return Dual(self.value.T, np.moveaxis(self.tangent.T, -1, 0))

    def sum(self, axis: int) -> Dual:
        """As of an array."""
        return _sum(self, axis)


def seeds(values: Sequence[Any], directions: int, first: int = 0) -> list[Dual]:
    """Values as dual numbers, each array with a direction of its own, from the direction `first` on."""
    return [_seed(np.asarray(value, dtype=float), directions, first + at) for at, value in enumerate(values)]


def _seed(value: FloatArray, directions: int, direction: int) -> Dual:
    tangent = np.zeros((directions, *value.shape))
    tangent[direction] = 1.0
    return Dual(value, tangent)


def value_of(array: Any) -> Any:
    """The values of an array, dual or not."""
    return array.value if isinstance(array, Dual) else array


def tangent_of(array: Any, directions: int, shape: tuple[int, ...]) -> FloatArray:
    """The derivatives of an array, (directions, *shape); zero if it is an ordinary one."""
    if not isinstance(array, Dual):
        return np.zeros((directions, *shape))
    return np.broadcast_to(_spread(array.tangent, len(shape)), (directions, *shape))


def _spread(tangent: FloatArray, dimensions: int) -> FloatArray:
    """A tangent that can be broadcast with values of more dimensions."""
    missing = dimensions - (tangent.ndim - 1)
    if not missing:
        return tangent
    return tangent.reshape(tangent.shape[0], *[1] * missing, *tangent.shape[1:])


def _sum_of(first: Any, second: Any) -> Dual:
    """A sum; what has no tangent adds nothing to it."""
    if not isinstance(first, Dual):
        first, second = second, first
    if not isinstance(second, Dual):
        value = first.value + second
        return Dual(value, _spread(first.tangent, value.ndim))
    value = first.value + second.value
    return Dual(value, _spread(first.tangent, value.ndim) + _spread(second.tangent, value.ndim))


def _difference_of(first: Any, second: Any) -> Dual:
    """A difference."""
    if not isinstance(second, Dual):
        value = first.value - second
        return Dual(value, _spread(first.tangent, value.ndim))
    value = value_of(first) - second.value
    tangent = _spread(second.tangent, np.ndim(value))
    if not isinstance(first, Dual):
        return Dual(value, -tangent)
    return Dual(value, _spread(first.tangent, value.ndim) - tangent)


def _product_of(first: Any, second: Any) -> Dual:
    """A product, by Leibniz's rule."""
    if not isinstance(first, Dual):
        first, second = second, first
    if not isinstance(second, Dual):
        value = first.value * second
        return Dual(value, _spread(first.tangent, value.ndim) * second)
    value = first.value * second.value
    tangent = _spread(first.tangent, value.ndim) * second.value
    return Dual(value, tangent + _spread(second.tangent, value.ndim) * first.value)


def _chained(slopes: Sequence[Callable[[], Any]], inputs: Sequence[Any], dimensions: int) -> FloatArray:
    """The chain rule: the sum of slope times tangent over the inputs that have one."""
    terms: list[FloatArray] = [
        slope() * _spread(each.tangent, dimensions)
        for slope, each in zip(slopes, inputs, strict=True)
        if isinstance(each, Dual)
    ]
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total


@cell_on.register
def _(position: Dual, count: int) -> IndexArray:
    """Cells are chosen by the values."""
    return cell_of(position.value, count)


Slopes = Callable[..., Sequence[Callable[[], Any]]]
"""From the result and the operands of a function: its derivative by each operand, computed if needed."""

SLOPES: Mapping[np.ufunc, Slopes] = {
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
"""The functions of NumPy that carry derivatives along."""

FREQUENT: Mapping[np.ufunc, Callable[[Any, Any], Dual]] = {
    np.add: _sum_of,
    np.subtract: _difference_of,
    np.multiply: _product_of,
}
"""Functions without the detour by slopes."""

FLAT = frozenset(
    {
        *(np.less, np.less_equal, np.greater, np.greater_equal, np.equal, np.not_equal),
        *(np.isfinite, np.isnan, np.isinf, np.sign, np.signbit, np.floor, np.ceil, np.rint),
    }
)
"""Functions whose results do not change with their operands, but for jumps."""

ALIKE = frozenset({np.zeros_like, np.ones_like, np.empty_like, np.shape, np.ndim, np.searchsorted})
"""Functions whose results are shapes and places, which do not change with what numbers are."""


def _where(condition: Any, a: Any, b: Any) -> Dual:
    value = np.where(condition, value_of(a), value_of(b))
    tangents = (
        _spread(each.tangent, value.ndim) if isinstance(each, Dual) else np.zeros((1, *[1] * value.ndim))
        for each in (a, b)
    )
    return Dual(value, np.where(condition, *tangents))


def _clip(values: Any, low: Any, high: Any) -> Any:
    return np.minimum(np.maximum(values, low), high)


def _joined(function: Callable[..., Any]) -> Callable[..., Dual]:
    """Stacking or concatenating, for which all parts must have tangents."""

    def joined(arrays: Sequence[Any], axis: int = 0) -> Dual:
        directions = next(len(each.tangent) for each in arrays if isinstance(each, Dual))
        value = function([value_of(each) for each in arrays], axis=axis)
        tangents = [tangent_of(each, directions, np.shape(value_of(each))) for each in arrays]
        return Dual(value, function(tangents, axis=axis if axis < 0 else axis + 1))

    return joined


def _broadcast_to(array: Dual, shape: tuple[int, ...]) -> Dual:
    value = np.broadcast_to(array.value, shape)
    return Dual(value, tangent_of(array, len(array.tangent), shape))


def _full_like(array: Any, fill: Any) -> Any:
    shape = np.shape(value_of(array))
    return _broadcast_to(fill, shape) if isinstance(fill, Dual) else np.full(shape, fill)


def _sum(array: Dual, axis: int) -> Dual:
    return Dual(np.sum(array.value, axis=axis), np.sum(array.tangent, axis=axis if axis < 0 else axis + 1))


ARRANGED: Mapping[Callable[..., Any], Callable[..., Any]] = {
    np.where: _where,
    np.clip: _clip,
    np.stack: _joined(np.stack),
    np.concatenate: _joined(np.concatenate),
    np.broadcast_to: _broadcast_to,
    np.full_like: _full_like,
    np.sum: _sum,
}
"""Functions that arrange or choose entries."""
