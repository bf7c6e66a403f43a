"""3-vectors of arbitrary scalars with + - *, in which exact zeros and ones cost nothing.

A component is a number, a NumPy row of samples, a complex number, a fraction or a symbol. The Python integers
0, 1 and -1 are exact constants: products and sums with them are folded instead of computed, so that the same
code is efficient for every geometry, without a conditional on values.
"""

from __future__ import annotations

import math
import sys
from functools import singledispatch
from numbers import Rational
from typing import Any, NamedTuple

import numpy as np

Scalar = Any
"""Any type with + - * among its instances and with Python integers."""


@singledispatch
def exact(number: Scalar) -> Scalar:
    """Return a constant that folds as a Python integer, and any other scalar as it is."""
    is_number = isinstance(number, float | int | complex | Rational)
    return int(number) if is_number and number in (0, 1, -1) else number


def is_zero(number: Scalar) -> bool:
    """Return whether a scalar is the constant zero; rows and symbols stand for other numbers."""
    return isinstance(number, float | int) and number == 0


def trigonometric(name: str, angle: Scalar) -> Scalar:
    """Return `cos` or `sin` of an angle, exactly zero at multiples of pi/2 although pi itself is rounded."""
    return trigonometric_of(angle, name)


@singledispatch
def trigonometric_of(angle: Scalar, name: str) -> Scalar:
    """Return `trigonometric` for scalars without a registered case."""
    return getattr(np, name)(angle)


@trigonometric_of.register
def _(angle: float | int, name: str) -> Scalar:
    number: float = getattr(math, name)(angle)
    return 0 if abs(number) <= sys.float_info.epsilon * max(1.0, abs(angle)) else exact(number)


def add(a: Scalar, b: Scalar) -> Scalar:
    """Return the sum a + b."""
    if type(a) is int and a == 0:
        return b
    if type(b) is int and b == 0:
        return a
    return a + b


def sub(a: Scalar, b: Scalar) -> Scalar:
    """Return the difference a - b."""
    if type(b) is int and b == 0:
        return a
    if type(a) is int and a == 0:
        return -b
    return a - b


def mul(a: Scalar, b: Scalar) -> Scalar:
    """Return the product a b."""
    if type(a) is int:
        return _integer_multiple(a, b)
    if type(b) is int:
        return _integer_multiple(b, a)
    return a * b


def _integer_multiple(factor: int, a: Scalar) -> Scalar:
    if factor == 0:
        return 0
    if factor == 1:
        return a
    return -a if factor == -1 else factor * a


class Vector(NamedTuple):
    """Components in one frame; `+` and `-` act on vectors, `*` on a vector and a scalar on its right."""

    x: Scalar
    y: Scalar
    z: Scalar

    def __add__(self, other: Vector) -> Vector:  # type: ignore[override]
        return Vector(add(self.x, other.x), add(self.y, other.y), add(self.z, other.z))

    def __sub__(self, other: Vector) -> Vector:
        return Vector(sub(self.x, other.x), sub(self.y, other.y), sub(self.z, other.z))

    def __mul__(self, factor: Scalar) -> Vector:
        return Vector(mul(self.x, factor), mul(self.y, factor), mul(self.z, factor))

    def dot(self, other: Vector) -> Scalar:
        """Return the inner product."""
        return add(add(mul(self.x, other.x), mul(self.y, other.y)), mul(self.z, other.z))


ZERO, ONES = Vector(0, 0, 0), Vector(1, 1, 1)


def cross(a: Vector, b: Vector, along: Vector = ONES) -> Vector:
    """Return the vector product a x b; with `along`, only what an inner product with it needs."""
    return Vector(
        0 if _is_exact_zero(along.x) else sub(mul(a.y, b.z), mul(a.z, b.y)),
        0 if _is_exact_zero(along.y) else sub(mul(a.z, b.x), mul(a.x, b.z)),
        0 if _is_exact_zero(along.z) else sub(mul(a.x, b.y), mul(a.y, b.x)),
    )


def _is_exact_zero(a: Scalar) -> bool:
    return type(a) is int and a == 0


class SymmetricTensor(NamedTuple):
    """Six entries of a symmetric 3x3 tensor."""

    xx: Scalar
    yy: Scalar
    zz: Scalar
    xy: Scalar
    xz: Scalar
    yz: Scalar

    def times(self, v: Vector) -> Vector:
        """Return the tensor applied to a vector."""
        return Vector(
            add(add(mul(self.xx, v.x), mul(self.xy, v.y)), mul(self.xz, v.z)),
            add(add(mul(self.xy, v.x), mul(self.yy, v.y)), mul(self.yz, v.z)),
            add(add(mul(self.xz, v.x), mul(self.yz, v.y)), mul(self.zz, v.z)),
        )


class Rotation(NamedTuple):
    """R = Rz(theta) Rx(alpha) of a Denavit-Hartenberg row: frame-k components to frame k-1."""

    cos_theta: Scalar
    sin_theta: Scalar
    cos_alpha: Scalar
    sin_alpha: Scalar

    def apply(self, v: Vector) -> Vector:
        """Return R v."""
        y = sub(mul(self.cos_alpha, v.y), mul(self.sin_alpha, v.z))
        return Vector(
            sub(mul(self.cos_theta, v.x), mul(self.sin_theta, y)),
            add(mul(self.sin_theta, v.x), mul(self.cos_theta, y)),
            add(mul(self.sin_alpha, v.y), mul(self.cos_alpha, v.z)),
        )

    def undo(self, v: Vector) -> Vector:
        """Return R^T v."""
        y = sub(mul(self.cos_theta, v.y), mul(self.sin_theta, v.x))
        return Vector(
            add(mul(self.cos_theta, v.x), mul(self.sin_theta, v.y)),
            add(mul(self.cos_alpha, y), mul(self.sin_alpha, v.z)),
            sub(mul(self.cos_alpha, v.z), mul(self.sin_alpha, y)),
        )


class Matrix(NamedTuple):
    """A 3x3 matrix, by its rows."""

    x: Vector
    y: Vector
    z: Vector

    def times(self, v: Vector) -> Vector:
        """Return the matrix applied to a vector."""
        return Vector(self.x.dot(v), self.y.dot(v), self.z.dot(v))

    def transposed(self) -> Matrix:
        """Return the transpose, the inverse of a rotation."""
        return Matrix(*(Vector(*column) for column in zip(self.x, self.y, self.z, strict=True)))
