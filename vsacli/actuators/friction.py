"""Dry friction of motors and joints: Coulomb's law, sharp at zero velocity or smoothed over a width.

With v the velocity, the torque is F s(v) + F_o, F one of two sizes by the direction of v. The shape s is the
sign of v (below, such friction is "sharp"), or tanh(v/w) with the width w ("smooth").
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray, stack_constants
from vsacli.compute.vector import is_zero
from vsacli.documents.fields import NON_NEGATIVE, NumberWithUnit, PairOf, number, value
from vsacli.documents.record_checks import DeclaredRecord, construct_unchecked

REST = 1e-10
"""Largest speed, rad/s (m/s), that counts as rest. At the ends of rest-to-rest motions of the bundled robots,
rounding leaves 1e-13. At 1e-10 a turn takes two thousand years."""


@dataclass(frozen=True)
class Friction(DeclaredRecord):
    """Dry friction: a torque against the motion that hardly depends on its velocity."""

    coulomb: tuple[float, float] = value(
        PairOf(NumberWithUnit(units.TORQUE), dim="direction"),
        "Coulomb friction, or a list of two: for negative and for positive velocity",
        check=NON_NEGATIVE,
    )
    offset: float = number(units.TORQUE, "constant torque, independent of the velocity", default=0.0)
    width: float = number(
        units.VELOCITY,
        "width w of the sign change tanh(velocity/w); 0 for the sign function",
        check=NON_NEGATIVE,
        default=0.0,
    )

    @staticmethod
    def example(joint_type: str) -> dict[str, float]:
        """Return plausible values of the fields, for a new robot file."""
        return {"coulomb": 0.5 if joint_type == "revolute" else 5, "width": 0.01}

    @property
    def sharp(self) -> bool:
        """Whether the torque at rest is undetermined."""
        return is_zero(self.width) and not all(map(is_zero, self.coulomb))

    def geared(self, ratio: float) -> Friction:
        """Return the friction on the joint side of a gear whose shaft turns `ratio` times.

        It is not checked: values were checked on the shaft, or are duals.
        """
        backward, forward = self.coulomb
        is_reversed = backward is not forward and ratio < 0
        geared = {
            "coulomb": tuple(abs(ratio) * coulomb for coulomb in self.coulomb[:: -1 if is_reversed else 1]),
            "offset": ratio * self.offset + 0.0,  # without the sign of zero
            "width": self.width / abs(ratio),
        }
        return construct_unchecked(Friction, geared)


NO_FRICTION = Friction(coulomb=(0.0, 0.0))


class FrictionLaws(NamedTuple):
    """Friction of several motors or joints; arrays that broadcast with their velocities.

    Attributes:
        backward, forward: Sizes of Coulomb friction while the velocity is negative, and positive.
        offset: Torque that is added.
        width: Width of the change of sign, 0 for the sign function.
    """

    backward: FloatArray
    forward: FloatArray
    offset: FloatArray
    width: FloatArray

    @classmethod
    def of(cls, frictions: Sequence[Friction | None]) -> FrictionLaws | None:
        """Return the laws, one per entry on the last axis; None if no entry has friction."""
        law_rows = cls.over_samples(frictions)
        return law_rows and cls(*(values[:, 0] for values in law_rows))

    @classmethod
    def over_samples(cls, frictions: Sequence[Friction | None]) -> FrictionLaws | None:
        """Return the laws, one per entry on the first axis, before an axis of samples; see `of`."""
        if not any(frictions):
            return None
        entries = [friction or NO_FRICTION for friction in frictions]
        constants = [(*law.coulomb, law.offset, law.width) for law in entries]
        return cls(*map(stack_constants, zip(*constants, strict=True)))

    @property
    def sharp(self) -> BoolArray:
        """Whether the torque at rest is undetermined."""
        sharp: BoolArray = (self.width == 0) & (self.backward + self.forward > 0)
        return sharp

    @property
    def sticks(self) -> bool:
        """Whether any friction is sharp; a width that is a symbol counts as positive."""
        with suppress(NotImplementedError):
            return bool(np.any(self.sharp))
        return False

    def torque(self, velocity: FloatArray, direction: FloatArray | None = None) -> FloatArray:
        """Return the friction at velocities; sharp friction at rest is the offset alone.

        Args:
            velocity: Velocity, rad/s (m/s), any shape that broadcasts with the laws.
            direction: Direction of motion for sharp friction, -1, 0 or 1; that of the velocity if None, and
                where it is NaN.
        """
        sign = sign_of_motion(velocity)
        if direction is not None:
            sign = np.where(np.isnan(direction), sign, direction)
        tanh = np.tanh(velocity / np.where(self.width > 0, self.width, 1.0))
        return self._coulomb_friction(velocity, sign) * np.where(self.width > 0, tanh, sign) + self.offset

    def direction_beyond(self, torque: FloatArray) -> FloatArray:
        """Return 1 where a torque exceeds the holding friction, -1 where it is below its negative, else 0."""
        excess_torque = torque - self.offset
        direction = np.where(
            excess_torque > self.forward, 1.0, np.where(excess_torque < -self.backward, -1.0, 0.0)
        )
        return np.where(self.sharp, direction, 0.0)

    def power(self, velocity: FloatArray, acceleration: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return power and rate of smooth friction, offset included; of sharp friction, of the offset."""
        width = np.where(self.width > 0, self.width, 1.0)
        tanh = np.tanh(velocity / width)
        coulomb = np.where(self.width > 0, self._coulomb_friction(velocity, tanh), 0.0)
        torque = coulomb * tanh + self.offset
        return torque * velocity, (torque + coulomb * (1 - tanh * tanh) / width * velocity) * acceleration

    def _coulomb_friction(self, velocity: FloatArray, sign: FloatArray) -> FloatArray:
        """Return the Coulomb friction: by the direction if sharp, else by the velocity."""
        return np.where(np.where(self.width > 0, velocity, sign) < 0, self.backward, self.forward)


def sign_of_motion(velocity: FloatArray) -> FloatArray:
    """Return -1, 0 or 1; 0 at rest, and where the velocity is NaN."""
    return np.where(np.abs(velocity) > REST, np.where(velocity < 0, -1.0, 1.0), 0.0)
