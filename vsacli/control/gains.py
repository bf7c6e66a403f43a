"""The linear control (32), its gains from the poles of (33), and optional integral action."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.documents.source import Source


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
    """Compute (32a) or (32b): v = d^r desired + K_{r-1} e^(r-1) + ... + K_0 e + K_I integral(e).

    The error is e = desired - actual.

    Args:
        desired: commanded signal and its derivatives up to order r, each ([samples,] joints).
        actual: actual signal and its derivatives up to order r - 1, each ([samples,] joints).
        gains: gains K_0, ..., K_{r-1}, (joints, r) or (1, r).
        integral_gain: gain K_I, (joints,) or (1,).
        integral: time integral of the error, ([samples,] joints).
    """
    control = desired[-1] + integral_gain * integral
    for reference, measured, gain in zip(desired, actual, gains.T, strict=False):
        control = control + gain * (reference - measured)
    return control


POSITION_ORDER = 4
"""Order of (33a): motor torques act on the fourth derivative of q."""

RIGID_ORDER = 2
"""Order of the position error of a robot without springs, (3)."""

STIFFNESS_ORDER = 2
"""Order of (33b)."""


@dataclass(frozen=True)
class Gains:
    """Coefficients of the error dynamics e^(r) + ... + K1 e' + K0 e + KI integral(e) = 0 of each joint.

    Attributes:
        position: gains K0, K1, ... of (33a), (joints, r), or (1, r) for the same in all joints, 1/s^(r-k).
            The order r is 4, or 2 for a robot without springs.
        stiffness: gains K_sigma0, K_sigma1 of (33b), (joints, 2) or (1, 2), 1/s^(2-k).
        position_integral: gain KI of the position, (joints,) or (1,), 1/s^(r+1); 0 for no integral action.
        stiffness_integral: gain KI of the stiffness, (joints,) or (1,), 1/s^3; 0 for no integral action.
        sources: files that the poles were read from.

    Raises:
        InputError: a polynomial is not Hurwitz.
    """

    position: FloatArray
    stiffness: FloatArray
    position_integral: FloatArray
    stiffness_integral: FloatArray
    sources: tuple[Source, ...] = ()

    def __post_init__(self) -> None:
        for name in ("position", "stiffness"):
            for joint, row in enumerate(
                zip(getattr(self, name), getattr(self, f"{name}_integral"), strict=True)
            ):
                _check_hurwitz(f"{name} gains, row {joint}", *row)

    @classmethod
    def from_poles(cls, position: npt.ArrayLike, stiffness: npt.ArrayLike = (-1.0, -1.0)) -> Gains:
        """Return gains that give the errors these poles; one pole more than the order adds integral action.

        Args:
            position: poles of the position error, 1/s: 4 (2 for a robot without springs), or 5 (3) with
                integral action; (poles,) for the same in all joints, or (joints, poles).
            stiffness: poles of the stiffness error, 1/s: 2, or 3 with integral action; without effect at
                joints whose stiffness is not commanded.

        Raises:
            InputError: the number of poles is wrong, or a pole is unstable or complex without its conjugate.
        """
        position_gains, position_integral = _error_coefficients("position", position, {2, 3, 4, 5})
        stiffness_gains, stiffness_integral = _error_coefficients("stiffness", stiffness, {2, 3})
        return cls(position_gains, stiffness_gains, position_integral, stiffness_integral)

    @property
    def order(self) -> int:
        """Order r of the position error."""
        return int(self.position.shape[1])

    @property
    def integrates(self) -> bool:
        """Whether there is integral action."""
        return bool(np.any(self.position_integral) or np.any(self.stiffness_integral))

    def check_fit(self, joints: int, order: int) -> None:
        """Raise an error if the gains do not fit a robot.

        Raises:
            InputError: the number of joints or the order of the position error differs.
        """
        if self.order != order:
            raise InputError.one(
                f"this robot needs {order} poles of the position error ({order + 1} with integral action), "
                f"not {self.order}"
            )
        for name in ("position", "stiffness"):
            count = len(getattr(self, name))
            if count not in (1, joints):
                raise InputError.one(f"there are {name} gains of {count} joints, but the robot has {joints}")


def _error_coefficients(name: str, poles: npt.ArrayLike, counts: set[int]) -> tuple[FloatArray, FloatArray]:
    """Return rows K0, K1, ..., and the KI of each row."""
    pole_rows = np.atleast_2d(np.asarray(poles, dtype=np.complex128))
    if pole_rows.ndim != 2 or pole_rows.shape[1] not in counts:
        expected = ", ".join(map(str, sorted(counts)))
        raise InputError.one(f"expected {expected} poles of the {name} error, found {pole_rows.shape[-1]}")
    for pole in pole_rows.ravel():
        check_stable(name, pole)
    polynomials = [np.poly(row) for row in pole_rows]
    for row, polynomial in zip(pole_rows.tolist(), polynomials, strict=True):
        if np.iscomplexobj(polynomial):
            pole = next(
                candidate for candidate in row if row.count(candidate) > row.count(candidate.conjugate())
            )
            missing = pole_text(pole.conjugate())
            reason = f"the complex pole {pole_text(pole)} of the {name} error has no conjugate"
            raise InputError.one(f"{reason}; add {missing}")
    rows = np.array(polynomials)[:, :0:-1]
    return (rows[:, 1:], rows[:, 0]) if rows.shape[1] % 2 else (rows, np.zeros(len(rows)))


def check_stable(name: str, pole: complex) -> None:
    """Raise an error if a pole is unstable.

    Raises:
        InputError: its real part is not negative.
    """
    if not pole.real < 0:
        suggestion = f", e.g. {pole_text(complex(-pole.real, pole.imag))}" if pole.real > 0 else ""
        subject = f"{pole_text(pole)} of the {name} error"
        raise InputError.one(f"the pole {subject} is unstable; its real part must be negative{suggestion}")


def pole_text(pole: complex) -> str:
    """Return a pole as users write it."""
    return f"{pole:g}" if pole.imag else f"{pole.real:g}"


def _check_hurwitz(name: str, gains: FloatArray, integral: float) -> None:
    coefficients = [1.0, *gains[::-1], *([integral] if integral else [])]
    worst = max(np.roots(coefficients).real)
    if not worst < 0:
        raise InputError.one(
            f"the {name} are unstable: a root of their polynomial (33) has the real part {worst:.3g}"
        )
