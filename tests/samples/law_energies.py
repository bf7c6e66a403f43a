"""A spring of each law, with its energy as a formula of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import sympy

from samples.springs import measured
from vsacli import laws

Energy = Callable[[Any], Any]
"""Of the deflection, in sympy's functions."""


class Sample(NamedTuple):
    """A law, and the energy of the spring that it describes."""

    law: laws.SpringLaw
    energy: Energy


def _four_bar(phi: Any) -> Any:
    return 30 * (sympy.asin(1.4 * sympy.sin(phi / 2)) - phi / 2) ** 2 / 2


_DEFLECTIONS = np.linspace(-0.6, 0.6, 25)

SAMPLES = {
    "cubic": Sample(laws.Cubic(k=60, k_c=900), lambda phi: 30 * phi**2 + 225 * phi**4),
    "polynomial": Sample(
        laws.Polynomial(c1=50, c3=300, c7=4e4), lambda phi: 25 * phi**2 + 75 * phi**4 + 5000 * phi**8
    ),
    "sinh": Sample(laws.Sinh(k=5, a=8), lambda phi: 5 * (sympy.cosh(8 * phi) - 1) / 8),
    "exponential": Sample(laws.Exponential(c=4, a=6), lambda phi: 4 * ((sympy.exp(6 * phi) - 1) / 6 - phi)),
    "quadratic": Sample(laws.Quadratic(k=300), lambda phi: 100 * phi**3),
    "four_bar": Sample(laws.FourBar(k=30, ratio=1.4), _four_bar),
    "table": Sample(  # the curve through exact torques of a cubic is that cubic
        measured(_DEFLECTIONS, 60 * _DEFLECTIONS + 900 * _DEFLECTIONS**3),
        lambda phi: 30 * phi**2 + 225 * phi**4,
    ),
}
