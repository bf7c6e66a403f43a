"""Derivatives of functions of several variables: truncated power series, computed along with the values.

A jet stores the Taylor coefficients of a function at a point, up to requested orders. Coefficients are
numbers, NumPy arrays or arrays of symbols, so that the same code computes values or is traced; coefficients
that are zero at every point are not stored and cost nothing. A. Griewank & A. Walther, Evaluating
Derivatives, 2nd ed. (2008), chapter 13.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import count, cycle, islice
from math import factorial, prod
from typing import Any

import numpy as np

from vsacli.compute.vector import Scalar, add, is_zero, mul, sub

Order = tuple[int, ...]
"""Number of differentiations over each variable."""

Terms = Mapping[Order, Scalar]

MOST_FACTORS = 1000
"""Largest integer exponent whose power is computed by products, so that it is valid at zero."""


class Truncation:
    """Set of derivatives that jets store, closed under fewer differentiations.

    Attributes:
        variables: Number of variables.
        orders: Orders of the derivatives, the lower ones first.
        degree: Largest number of differentiations.
        zeroth: Order of the function itself.
    """

    def __init__(self, orders: Iterable[Order]) -> None:
        self.orders = tuple(sorted(set(orders), key=lambda order: (sum(order), order)))
        order_set = frozenset(self.orders)
        self.variables = len(self.orders[0])
        self.zeroth = (0,) * self.variables
        self.degree = max(map(sum, order_set))
        self._products = {
            (a, b): order_sum
            for a in order_set
            for b in order_set
            if (order_sum := _sum_of_orders(a, b)) in frozenset(order_set)
        }

    def product(self, first: Terms, second: Terms) -> dict[Order, Scalar]:
        """Return the coefficients of a product."""
        terms: dict[Order, Scalar] = {}
        for a, left in first.items():
            for b, right in second.items():
                order = self._products.get((a, b))
                if order is not None:
                    terms[order] = add(terms.get(order, 0), mul(left, right))
        return terms

    def linear(self, value: Scalar, slopes: Sequence[int]) -> Jet:
        """Return a linear function of the variables, such as one of them, by its value and its slopes."""
        units = [
            tuple(int(axis == other) for other in range(self.variables)) for axis in range(self.variables)
        ]
        return Jet(self, {self.zeroth: value, **dict(zip(units, slopes, strict=True))})


def _sum_of_orders(a: Order, b: Order) -> Order:
    return tuple(map(sum, zip(a, b, strict=True)))


class Jet:
    """A function at a point with its derivatives; + - * / and powers combine jets, and jets with numbers."""

    __slots__ = ("_terms", "_truncation")
    __array_ufunc__ = None  # so that NumPy numbers defer to the operators below

    def __init__(self, truncation: Truncation, terms: Terms) -> None:
        self._truncation = truncation
        self._terms = {order: term for order, term in terms.items() if not is_zero(term)}

    @property
    def value(self) -> Scalar:
        """Value of the function."""
        return self._terms.get(self._truncation.zeroth, 0)

    def derivative(self, order: Order) -> Scalar:
        """Return a derivative; the number zero if it vanishes at every point."""
        return mul(prod(map(factorial, order)), self._terms.get(order, 0))

    def _combine_terms(self, other: Any, operation: Callable[[Scalar, Scalar], Scalar]) -> Jet:
        other_terms = self._terms_of(other)
        orders = dict.fromkeys((*self._terms, *other_terms))
        terms = {order: operation(self._terms.get(order, 0), other_terms.get(order, 0)) for order in orders}
        return Jet(self._truncation, terms)

    def _terms_of(self, other: Any) -> Terms:
        return other._terms if isinstance(other, Jet) else {self._truncation.zeroth: other}

    def __add__(self, other: Any) -> Jet:
        return self._combine_terms(other, add)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Jet:
        return self._combine_terms(other, sub)

    def __rsub__(self, other: Any) -> Jet:
        return self._combine_terms(other, lambda a, b: sub(b, a))

    def __neg__(self) -> Jet:
        return Jet(self._truncation, {order: mul(-1, term) for order, term in self._terms.items()})

    def __mul__(self, other: Any) -> Jet:
        return Jet(self._truncation, self._truncation.product(self._terms, self._terms_of(other)))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Jet:
        if isinstance(other, Jet):
            quotient: Jet = self * _reciprocal(other)
            return quotient
        return Jet(self._truncation, {order: term / other for order, term in self._terms.items()})

    def __rtruediv__(self, other: Any) -> Jet:
        return Jet(
            self._truncation, {order: mul(term, other) for order, term in _reciprocal(self)._terms.items()}
        )

    def __pow__(self, exponent: Any) -> Jet:
        if isinstance(exponent, Jet):
            return _compose_series(_exponential_series, _compose_series(_logarithm_series, self) * exponent)
        if not (float(exponent).is_integer() and abs(exponent) <= MOST_FACTORS):
            return _real_power(self, exponent)
        power = _power_by_squaring(self, abs(int(exponent)))
        return power if exponent >= 0 else _reciprocal(power)

    def __rpow__(self, base: Any) -> Jet:
        return _compose_series(_exponential_series, self * np.log(base))

    def composed(self, outer: Iterator[Scalar]) -> Jet:
        """Return the composition with an outer function, from its Taylor coefficients at `value`."""
        zeroth = self._truncation.zeroth
        inner = Jet(self._truncation, {order: term for order, term in self._terms.items() if order != zeroth})
        result, power = Jet(self._truncation, {zeroth: next(outer)}), inner
        for coefficient in islice(outer, self._truncation.degree - 1):
            result, power = result + power * coefficient, power * inner
        last: Jet = power * next(outer)
        return result._combine_terms(last, add)


def _power_by_squaring(base: Jet, exponent: int) -> Jet:
    """Return an integer power by squaring, which is valid at zero, too."""
    result, square = base * 0 + 1, base
    while exponent:
        if exponent % 2:
            result = result * square
        exponent //= 2
        square = square * square if exponent else square
    return result


def _real_power(base: Jet, exponent: float) -> Jet:
    return base.composed(_power_series(np.power(base.value, exponent), base.value, exponent))


def _reciprocal(base: Jet) -> Jet:
    return base.composed(_power_series(np.divide(1.0, base.value), base.value, -1))


def _power_series(zeroth: Scalar, value: Scalar, exponent: float) -> Iterator[Scalar]:
    """Yield the Taylor coefficients of a power of the value, from the power itself, without end."""
    coefficient = zeroth
    for degree in count():
        yield coefficient
        coefficient = coefficient * ((exponent - degree) / (degree + 1)) / value


def _exponential_series(value: Scalar) -> Iterator[Scalar]:
    exponential = np.exp(value)
    return (exponential / factorial(degree) for degree in count())


def _logarithm_series(value: Scalar) -> Iterator[Scalar]:
    yield np.log(value)
    power = np.float64(-1)
    for degree in count(1):
        power = power / -value
        yield power / degree


def _sine_series(value: Scalar) -> Iterator[Scalar]:
    sine, cosine = np.sin(value), np.cos(value)
    derivatives = cycle((sine, cosine, -sine, -cosine))
    return (derivative / factorial(degree) for degree, derivative in enumerate(derivatives))


def _cosine_series(value: Scalar) -> Iterator[Scalar]:
    sine, cosine = np.sin(value), np.cos(value)
    derivatives = cycle((cosine, -sine, -cosine, sine))
    return (derivative / factorial(degree) for degree, derivative in enumerate(derivatives))


def _tangent_series(value: Scalar) -> Iterator[Scalar]:
    """Yield the series of tan by tan' = 1 + tan^2."""
    coefficients = [np.tan(value)]
    for degree in count(1):
        yield coefficients[-1]
        square = sum(a * b for a, b in zip(coefficients, reversed(coefficients), strict=True))
        coefficients.append((square + (degree == 1)) / degree)


def _square_root_series(value: Scalar) -> Iterator[Scalar]:
    return _power_series(np.sqrt(value), value, 0.5)


def _compose_series(series: Callable[[Scalar], Iterator[Scalar]], argument: Jet) -> Jet:
    return argument.composed(series(argument.value))


def _for_jet_or_number(ufunc: np.ufunc, series: Callable[[Scalar], Iterator[Scalar]]) -> Callable[[Any], Any]:
    return lambda argument: (
        _compose_series(series, argument) if isinstance(argument, Jet) else ufunc(argument)
    )


FUNCTIONS: Mapping[str, Callable[[Any], Any]] = {
    "sin": _for_jet_or_number(np.sin, _sine_series),
    "cos": _for_jet_or_number(np.cos, _cosine_series),
    "tan": _for_jet_or_number(np.tan, _tangent_series),
    "sqrt": _for_jet_or_number(np.sqrt, _square_root_series),
    "exp": _for_jet_or_number(np.exp, _exponential_series),
    "log": _for_jet_or_number(np.log, _logarithm_series),
}
"""Functions of jets and of numbers by their names in expressions."""
