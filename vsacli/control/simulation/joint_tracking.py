"""Tracking of one joint in a simulation: deviations from the command, limits, energy, goal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from vsacli.analysis.report_text import short_number
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.flags import Flag
from vsacli.base.json_records import Stored, named
from vsacli.base.units import POSITION, STIFFNESS, TORQUE, units_of
from vsacli.dynamics.energy import JointEnergy
from vsacli.dynamics.limits import OFF_TARGET, Finding

_EXPECTED_TOLERANCE = "expected a number in rad (m) such as 0.01, or a share of each joint's range such as 2%"


@dataclass(frozen=True)
class GoalTolerance:
    """Largest position error at the end of a run with which a joint counts as on target.

    Attributes:
        share: relative part, as a share of the range over which the joint is commanded, from 0 to 1.
        absolute: absolute part, added so that a resting joint may also have an error, rad (m).

    Raises:
        InputError: a part is negative or not finite, both are zero, or the share exceeds 1.
    """

    share: float = 0.01
    absolute: float = 1e-3

    def __post_init__(self) -> None:
        if not (0 <= self.share <= 1 and 0 <= self.absolute < math.inf and self.share + self.absolute > 0):
            parts = f"share={self.share:g} and absolute={self.absolute:g}"
            raise InputError.one(
                f"a goal tolerance must be positive and finite, its share at most 1: not {parts}"
            )

    @classmethod
    def from_text(cls, user_text: str) -> GoalTolerance:
        """Parse a tolerance: `2%` of each joint's range plus the default absolute part, or rad (m).

        Raises:
            InputError: the text is neither, or out of range.
        """
        text = user_text.strip()
        try:
            number = float(text.removesuffix("%"))
        except ValueError:
            raise InputError.one(f"{_EXPECTED_TOLERANCE}, found {user_text!r}") from None
        share = text.endswith("%")
        try:
            return cls(share=number / 100) if share else cls(0.0, number)
        except InputError:
            bounds = "from 0 % to 100 % of a joint's range" if share else "positive and finite"
            raise InputError.one(f"the goal tolerance must be {bounds}, not {text}") from None

    def of(self, commanded_range: float) -> float:
        """Return the tolerance of a joint commanded over a range, rad (m)."""
        return self.share * commanded_range + self.absolute


@dataclass(frozen=True)
class Deviation(Stored):
    """Deviation of a simulated value from its command: largest, its time (s), last; NaN if undefined."""

    peak: float
    time: float
    final: float

    @classmethod
    def of(cls, time: FloatArray, error: FloatArray) -> Deviation:
        """Return the deviation with these errors, (samples,), at times."""
        if np.isnan(error).all():
            return cls(np.nan, np.nan, np.nan)
        worst = int(np.nanargmax(np.abs(error)))
        return cls(float(abs(error[worst])), float(time[worst]), float(error[-1]))

    def after(self, earlier: Deviation) -> Deviation:
        """Return the deviation over both this block of a run and the earlier ones."""
        if self.peak > earlier.peak or math.isnan(earlier.peak):
            return self
        return replace(earlier, final=self.final)


@dataclass(frozen=True)
class JointTracking(Stored):
    """The findings of a simulation at one joint.

    Attributes:
        name: name of the joint.
        type: type of the joint, "revolute" or "prismatic".
        q: deviation of the position, rad (m).
        stiffness: deviation of the stiffness, N m/rad (N/m).
        peak_tau_motor: largest |torque| that motors 1 and 2 exerted, N m (N).
        samples_over_limit: number of samples at which a limit is exceeded.
        worst: worst excess of each limit, by its name.
        energy: work of the motors, elastic energy, co-contraction.
        tolerance: largest error of q at the end, rad (m); NaN in reports of versions without it.
    """

    name: str
    type: str
    q: Deviation
    stiffness: Deviation
    peak_tau_motor: tuple[float, float]
    samples_over_limit: int
    worst: dict[str, Finding]
    energy: JointEnergy
    tolerance: float = math.nan

    shape: ClassVar = {
        **named("name", "type"),
        "q_error": "q",
        "tolerance": "tolerance",
        "stiffness_error": "stiffness",
        "peak": {"tau_motor": "peak_tau_motor"},
        "samples": {"over_limit": "samples_over_limit"},
        **named("worst", "energy"),
    }

    @property
    def unit(self) -> str:
        """Unit of the position and its errors."""
        return POSITION.unit(self.type)

    @property
    def off_course(self) -> bool:
        """Whether q at the end is further from the command than the tolerance."""
        return abs(self.q.final) > self.tolerance


def tracking_rows(joints: Sequence[JointTracking], ideal: Sequence[Deviation] = ()) -> list[tuple[str, ...]]:
    """Return a table of errors and peaks, below its header with units.

    Args:
        joints: findings of each joint.
        ideal: deviation of q of each joint in the same run with feedback of the full state; none or all.
    """
    types = [joint.type for joint in joints]
    position, stiffness, torque = (units_of(quantity, types) for quantity in (POSITION, STIFFNESS, TORQUE))
    header = (
        "joint",
        f"q error peak / end\n{position}",
        f"stiffness error peak / end\n{stiffness}",
        f"peak motor 1 / 2\n{torque}"
        + (", saturated" if any(SATURATED in joint.worst for joint in joints) else ""),
    )
    if not ideal:
        return [header, *map(_tracking_row, joints)]
    pairs = zip(joints, ideal, strict=True)
    return [
        (*header, f"q error with full state\n{position}"),
        *((*_tracking_row(a), _peak_and_final(b)) for a, b in pairs),
    ]


def _tracking_row(joint: JointTracking) -> tuple[str, ...]:
    motors = " / ".join(error_text(peak) for peak in joint.peak_tau_motor if not math.isnan(peak))
    return (joint.name, *map(_peak_and_final, (joint.q, joint.stiffness)), motors)


def _peak_and_final(deviation: Deviation) -> str:
    if math.isnan(deviation.peak):
        return "-"
    return f"{error_text(deviation.peak)} / {error_text(deviation.final)}"


SATURATED, AS_COMMANDED = Flag.MOTOR_TORQUE_LIMIT.label, "as commanded; the motor saturates at the limit"
"""Kind of findings on torques, with the reason why they exceed those of the table."""

SMALLEST_ERROR = 1e-12
"""Magnitude below which an error or torque is shown as 0: rounding of values near 1."""


def error_text(value: float) -> str:
    """Return a number as reports show it: with two digits if it is small, 0 if it is rounding."""
    if math.isnan(value):
        return "-"
    return short_number(value) if abs(value) >= 10 else "0" if abs(value) < SMALLEST_ERROR else f"{value:.2g}"


def tracking_findings(joints: Sequence[JointTracking], complete: bool) -> Iterator[tuple[int, Finding]]:
    """Yield the limits that joints exceed and, of a complete run, how far off target they end, by joint."""
    for index, joint in enumerate(joints):
        for kind, worst in joint.worst.items():
            yield index, replace(worst, advice=AS_COMMANDED) if kind == SATURATED else worst
        if complete and joint.off_course:
            error, tolerance = joint.q.final, math.copysign(joint.tolerance, joint.q.final)
            yield index, Finding(OFF_TARGET, math.nan, error, tolerance, joint.unit, joint=joint.name)
