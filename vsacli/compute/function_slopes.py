"""Derivatives of NumPy's elementwise functions by their operands."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

Slopes = Callable[..., Sequence[Callable[[], Any]]]
"""Function from result and operands of a function to its derivatives by each operand, computed if needed."""

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

FLAT = frozenset(
    {
        *(np.less, np.less_equal, np.greater, np.greater_equal, np.equal, np.not_equal),
        *(np.isfinite, np.isnan, np.isinf, np.sign, np.signbit, np.floor, np.ceil, np.rint),
    }
)
"""Functions whose results do not change with their operands, but for jumps."""
