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
        kept = frozenset(self.orders)
        self.variables = len(self.orders[0])
        self.zeroth = (0,) * self.variables
        self.degree = max(map(sum, kept))
        self._products = {
            (a, b): total for a in kept for b in kept if (total := _total(a, b)) in frozenset(kept)
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


def _total(a: Order, b: Order) -> Order:
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

    def _joined(self, other: Any, join: Callable[[Scalar, Scalar], Scalar]) -> Jet:
        theirs = self._lifted(other)
        orders = dict.fromkeys((*self._terms, *theirs))
        terms = {order: join(self._terms.get(order, 0), theirs.get(order, 0)) for order in orders}
        return Jet(self._truncation, terms)

    def _lifted(self, other: Any) -> Terms:
        return other._terms if isinstance(other, Jet) else {self._truncation.zeroth: other}

    def __add__(self, other: Any) -> Jet:
        return self._joined(other, add)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Jet:
        return self._joined(other, sub)

    def __rsub__(self, other: Any) -> Jet:
        return self._joined(other, lambda a, b: sub(b, a))

    def __neg__(self) -> Jet:
        return Jet(self._truncation, {order: mul(-1, term) for order, term in self._terms.items()})

    def __mul__(self, other: Any) -> Jet:
        return Jet(self._truncation, self._truncation.product(self._terms, self._lifted(other)))

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
            return _compose(_exponential, _compose(_logarithmic, self) * exponent)
        if not (float(exponent).is_integer() and abs(exponent) <= MOST_FACTORS):
            return _power(self, exponent)
        power = _whole_power(self, abs(int(exponent)))
        return power if exponent >= 0 else _reciprocal(power)

    def __rpow__(self, base: Any) -> Jet:
        return _compose(_exponential, self * np.log(base))

    def composed(self, outer: Iterator[Scalar]) -> Jet:
        """Return the composition with an outer function, from its Taylor coefficients at `value`."""
        zeroth = self._truncation.zeroth
        inner = Jet(self._truncation, {order: term for order, term in self._terms.items() if order != zeroth})
        result, power = Jet(self._truncation, {zeroth: next(outer)}), inner
        for coefficient in islice(outer, self._truncation.degree - 1):
            result, power = result + power * coefficient, power * inner
        last: Jet = power * next(outer)
        return result._joined(last, add)


def _whole_power(base: Jet, exponent: int) -> Jet:
    """Return an integer power by squaring, which is valid at zero, too."""
    result, square = base * 0 + 1, base
    while exponent:
        if exponent % 2:
            result = result * square
        exponent //= 2
        square = square * square if exponent else square
    return result


def _power(base: Jet, exponent: float) -> Jet:
    return base.composed(_binomial(np.power(base.value, exponent), base.value, exponent))


def _reciprocal(base: Jet) -> Jet:
    return base.composed(_binomial(np.divide(1.0, base.value), base.value, -1))


def _binomial(first: Scalar, value: Scalar, exponent: float) -> Iterator[Scalar]:
    """Yield the Taylor coefficients of a power of the value, from the power itself, without end."""
    coefficient = first
    for number in count():
        yield coefficient
        coefficient = coefficient * ((exponent - number) / (number + 1)) / value


def _exponential(value: Scalar) -> Iterator[Scalar]:
    first = np.exp(value)
    return (first / factorial(number) for number in count())


def _logarithmic(value: Scalar) -> Iterator[Scalar]:
    yield np.log(value)
    power = np.float64(-1)
    for number in count(1):
        power = power / -value
        yield power / number


def _sine(value: Scalar) -> Iterator[Scalar]:
    sine, cosine = np.sin(value), np.cos(value)
    derivatives = cycle((sine, cosine, -sine, -cosine))
    return (derivative / factorial(number) for number, derivative in enumerate(derivatives))


def _cosine(value: Scalar) -> Iterator[Scalar]:
    sine, cosine = np.sin(value), np.cos(value)
    derivatives = cycle((cosine, -sine, -cosine, sine))
    return (derivative / factorial(number) for number, derivative in enumerate(derivatives))


def _tangent(value: Scalar) -> Iterator[Scalar]:
    """Yield the series of tan by tan' = 1 + tan^2."""
    known = [np.tan(value)]
    for number in count(1):
        yield known[-1]
        squared = sum(a * b for a, b in zip(known, reversed(known), strict=True))
        known.append((squared + (number == 1)) / number)


def _square_root(value: Scalar) -> Iterator[Scalar]:
    return _binomial(np.sqrt(value), value, 0.5)


def _compose(function: Callable[[Scalar], Iterator[Scalar]], argument: Jet) -> Jet:
    return argument.composed(function(argument.value))


def _of_either(of_number: np.ufunc, function: Callable[[Scalar], Iterator[Scalar]]) -> Callable[[Any], Any]:
    return lambda argument: _compose(function, argument) if isinstance(argument, Jet) else of_number(argument)


FUNCTIONS: Mapping[str, Callable[[Any], Any]] = {
    "sin": _of_either(np.sin, _sine),
    "cos": _of_either(np.cos, _cosine),
    "tan": _of_either(np.tan, _tangent),
    "sqrt": _of_either(np.sqrt, _square_root),
    "exp": _of_either(np.exp, _exponential),
    "log": _of_either(np.log, _logarithmic),
}
"""Functions of jets and of numbers by their names in expressions."""
