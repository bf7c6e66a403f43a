"""Flags of samples of joints and tools: enums for result files, reports and documentation."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping
from functools import reduce
from operator import and_, or_
from typing import Self

import numpy as np

from vsacli.base.arrays import FLAG_TYPE, BoolArray, FlagArray, FloatArray
from vsacli.base.errors import InputError

SINGULAR_MARGIN = 1e-9
"""Relative margin that counts as zero: deflections are accurate to about 1e-16/margin, so to 1e-7 here."""

MIN_MARGIN = 0.01
"""Relative margin to a critical point below which a sample is near-singular; the paper's runs keep 3 %."""


class SampleFlag(enum.IntFlag):
    """A bit of a variable of flags, with its meaning and, if it marks a limit, the bounded quantity.

    Attributes:
        meaning: description of the finding, a clause.
        quantity: quantity over the limit, to be followed by the number of the motor if it is a motor's; None
            if the bit does not mark a limit.
    """

    meaning: str
    quantity: str | None

    def __new__(cls, bit: int, meaning: str, quantity: str | None) -> Self:
        """Return a bit with its attributes."""
        flag = int.__new__(cls, bit)
        flag._value_ = bit
        flag.meaning, flag.quantity = meaning, quantity
        return flag

    @property
    def label(self) -> str:
        """Lower-case name, as in `flag_meanings` and the report."""
        return str(self.name).lower()

    def quantity_of(self, motor: int | None) -> str:
        """Return the quantity over the limit in words, with the number of its motor, if any."""
        return f"{self.quantity}" if motor is None else f"{self.quantity} {motor}"


class Flag(SampleFlag):
    """Bits of the variable `flags`, each with its meaning and, if it marks a limit, the bounded quantity."""

    INFEASIBLE = 1, "the springs cannot carry the elastic torque, or not at this stiffness", None
    SINGULAR = (
        2,
        "the decoupling matrix is singular: deflection rates and motor torques are undefined",
        None,
    )
    NEAR_SINGULAR = 4, "the relative margin to a singular decoupling matrix is below the threshold", None
    SLACK = 8, "a tendon, which can only pull, would have to push", None
    DEFLECTION_LIMIT = 16, "a transmission is deflected beyond its max_deflection", "deflection of spring"
    MOTOR_TORQUE_LIMIT = 32, "a motor torque exceeds max_torque", "joint-side torque of motor"
    MOTOR_VELOCITY_LIMIT = 64, "a motor velocity exceeds max_velocity", "joint-side velocity of motor"
    POSITION_LIMIT = 128, "the commanded position leaves the joint's range", "position"
    VELOCITY_LIMIT = 256, "the commanded velocity exceeds the joint's limit", "velocity"
    STIFFNESS_LIMIT = 512, "the commanded stiffness leaves the joint's allowed range", "stiffness"
    INTERNAL_INSTABILITY = (
        1024,
        (
            "the internal motion of a damped transmission is unstable: deviations from the computed "
            "motion would grow"
        ),
        None,
    )
    CURRENT_LIMIT = 2048, "a motor current exceeds max_current", "current of motor"
    VOLTAGE_LIMIT = 4096, "a motor voltage exceeds max_voltage", "voltage of motor"
    DAMPING_LIMIT = 8192, "the commanded damping leaves the range of the damper", "damping"
    NOT_FINITE = (
        16384,
        (
            "a motor variable is infinite or undefined, because a value it is computed from is, or is "
            "too large"
        ),
        None,
    )


class ToolFlag(SampleFlag):
    """Bits of the variable `tool_flags`, as `Flag` of joints."""

    STATIC_INSTABILITY = (
        1,
        "statically unstable: with the motors held, the links buckle under gravity and the wrenches",
        None,
    )
    TOOL_STIFFNESS_LIMIT = (
        2,
        "the stiffness of the tool in its softest direction is below min_stiffness",
        "stiffness in the softest direction",
    )


FLAG_BITS: Mapping[str, type[SampleFlag]] = {"flags": Flag, "tool_flags": ToolFlag}
"""Bits of each variable of flags, by its name."""


def labeled_flag(label: str) -> SampleFlag | None:
    """Return the flag with this label; None if there is none."""
    labeled = (bits.__members__.get(label.upper()) for bits in FLAG_BITS.values())
    return next((flag for flag in labeled if flag is not None), None)


LIMITS = reduce(or_, (flag for flag in Flag if flag.quantity is not None))
"""All bits that mark an exceeded limit."""


def has_flag(flags: FlagArray, bits: SampleFlag) -> BoolArray:
    """Return where any of the bits is set."""
    is_set: BoolArray = (flags & FLAG_TYPE(bits)) != 0
    return is_set


def flags_where(flag: SampleFlag, mask: BoolArray) -> FlagArray:
    """Return an array with the bit set where the condition holds, else 0."""
    return mask.astype(FLAG_TYPE) * FLAG_TYPE(flag)


def finite(arrays: Iterable[FloatArray]) -> BoolArray:
    """Return where all arrays, which have one shape, are finite."""
    return reduce(and_, map(np.isfinite, arrays))


def not_finite_flags(mask: BoolArray) -> FlagArray:
    """Set NOT_FINITE with INFEASIBLE, so that code that checks only INFEASIBLE also stops there."""
    return flags_where(Flag.NOT_FINITE | Flag.INFEASIBLE, mask)


def check_min_margin(min_margin: float) -> None:
    """Refuse a minimum margin that is not above `SINGULAR_MARGIN` and below 1.

    Raises:
        InputError: with the allowed interval.
    """
    if not SINGULAR_MARGIN < min_margin < 1:
        raise InputError.one(
            f"the minimum margin must lie between {SINGULAR_MARGIN:g} and 1, e.g. 0.01, not {min_margin:g}"
        )
