"""The linear control (32) and the integrals it may act on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vsacli.base.arrays import FloatArray


class Integral(NamedTuple):
    """Time integrals of the errors q_d - q and sigma_d - sigma, each ([samples,] joints)."""

    q: FloatArray
    stiffness: FloatArray


def linear_control(
    desired: Sequence[FloatArray],
    actual: Sequence[FloatArray],
    gains: FloatArray,
    integral_gain: FloatArray,
    integral: FloatArray,
) -> FloatArray:
    """Linear control (32a) or (32b): v = d^r desired + K_{r-1} e^(r-1) + ... + K_0 e + K_I integral(e).

    The error is e = desired - actual.

    Args:
        desired: the commanded signal and its derivatives up to order r, each ([samples,] joints).
        actual: the same as it is, up to order r - 1.
        gains: K_0, ..., K_{r-1}, (joints, r) or (1, r).
        integral_gain: K_I, (joints,) or (1,).
        integral: of the error.
    """
    control = desired[-1] + integral_gain * integral
    for wanted, found, gain in zip(desired, actual, gains.T, strict=False):
        control = control + gain * (wanted - found)
    return control
