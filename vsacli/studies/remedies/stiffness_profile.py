"""The stiffness profile of a joint nearest to the commanded one with which every step is accepted."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.robot.joint import Joint
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError, stiffness_text
from vsacli.studies.remedies.admissible_stiffness import (
    admissible_stiffness,
    checked_range,
    variable_stiffness_actuator,
)
from vsacli.studies.remedies.motions import Load
from vsacli.studies.remedies.nearest_spline import DEGREE, Bounds, NoSplineError, nearest_spline

MARGIN_FACTORS = (1, 2, 4, 8)
"""Multiples of the margin tried where motor limits refuse the nearest profile: torques grow with 1/margin."""

SMOOTHING_FACTORS = (1, 2, 4, 8)
"""Multiples of the smoothing time tried likewise: torques grow with the second derivative."""

CLEARANCE = 1e-6
"""Share of the largest change by which a profile keeps clear of its bounds, so that rounding crosses none."""


@dataclass(frozen=True, eq=False)
class Change:
    """What is added to the stiffness of a joint.

    Attributes:
        time: (instants,) in s.
        rows: the change, its rate and its second derivative, (3, instants), N m/rad (N/m) per s^k.
    """

    time: FloatArray
    rows: FloatArray

    @classmethod
    def constant(cls, time: FloatArray, value: float) -> Change:
        """A change that is the same at every instant."""
        rows = np.zeros((3, len(time)))
        rows[0] = value
        return cls(time, rows)

    @property
    def rms(self) -> float:
        """Root of the mean square over time, N m/rad (N/m)."""
        from scipy.integrate import trapezoid

        duration = self.time[-1] - self.time[0]
        return math.sqrt(float(trapezoid(self.rows[0] ** 2, self.time)) / duration)


def nearest_change(acceptance: Acceptance, joint: Joint, load: Load, constant: float | None) -> Change:
    """The C2 change of least mean square, smoothed a little, that mends a joint; or the constant, if nearer.

    Where the limits of the motors refuse it, the nearest of some that are smoother and keep further away from
    the ends of the corridor.

    Args:
        acceptance: the rule.
        joint: the joint, at least one of whose steps is refused.
        load: its steps and instants between them, all of which are to be accepted.
        constant: the constant that mends the joint, if there is one.

    Raises:
        ImpossibleError: with the reason.
    """
    _check_possible(acceptance, joint, load)
    nearest, *others = product(MARGIN_FACTORS, SMOOTHING_FACTORS)
    change = _change(acceptance, joint, load, *nearest)
    tried = [change] if constant is None else [change, Change.constant(load.time, constant)]
    if not _accepted(acceptance, joint, load, change):
        tried += [_change(acceptance, joint, load, *factors) for factors in others]
    accepted = [each for each in tried if each is not None and _accepted(acceptance, joint, load, each)]
    if not accepted:
        raise ImpossibleError(_reason(acceptance, joint, load, change))
    return min(accepted, key=lambda each: each.rms)


def _check_possible(acceptance: Acceptance, joint: Joint, load: Load) -> None:
    """Refuse what no stiffness can mend."""
    low, high = checked_range(acceptance, joint, load)
    worst = int((low - high).argmax())
    if low[worst] > high[worst]:
        raise ImpossibleError(
            f"{joint.name} needs at least {stiffness_text(joint, low[worst])} at t = {load.time[worst]:.3f} s"
            f", but its limits of stiffness and deflection allow at most {high[worst]:.6g}"
        )


def _change(
    acceptance: Acceptance, joint: Joint, load: Load, margins: float, smoothings: float
) -> Change | None:
    """The nearest change for multiples of margin and smoothing time, or None if no spline does."""
    near_singular = margins * acceptance.near_singular
    if near_singular >= 1:
        return None
    admissible = admissible_stiffness(joint, load.command, near_singular)
    asked = load.command.commanded["stiffness"]
    bounds = _narrowed(load.time, admissible.low - asked, admissible.high - asked)
    if np.any(bounds.low > bounds.high):
        return None
    if not bounds.excluding_zero.any():
        return Change.constant(load.time, 0.0)
    try:
        # a piece between two steps is what a file with all derivatives at the steps says of the time between
        spline = nearest_spline(bounds, smoothings * _smoothing_time(joint, load), load.time[load.steps])
    except NoSplineError:
        return None
    return Change(load.time, np.stack([spline(load.time, nu=order) for order in range(DEGREE)]))


def _narrowed(time: FloatArray, low: FloatArray, high: FloatArray) -> Bounds:
    """Bounds a little narrower, unless that would leave nothing between them."""
    clearance = CLEARANCE * max(low.max(), -high.min(), 0.0)
    middle = (low + high) / 2
    wide = high - low > 2 * clearance
    return Bounds(time, np.where(wide, low + clearance, middle), np.where(wide, high - clearance, middle))


def _smoothing_time(joint: Joint, load: Load) -> float:
    """sqrt(B/sigma): the motors follow slower changes with little torque of inertia; at least three steps."""
    inertia = max(motor.inertia for motor in variable_stiffness_actuator(joint).motors)
    resonance = math.sqrt(inertia / float(load.command.commanded["stiffness"].min()))
    step = float(np.median(np.diff(load.time[load.steps])))
    return min(max(resonance, 3 * step), float(load.time[-1] - load.time[0]))


def _accepted(acceptance: Acceptance, joint: Joint, load: Load, change: Change | None) -> bool:
    return change is not None and not acceptance.refused_steps(joint, load.changed(*change.rows)).any()


def _reason(acceptance: Acceptance, joint: Joint, load: Load, change: Change | None) -> str:
    if change is None:
        return f"what {joint.name} may have is too narrow, or changes too fast, for a smooth profile"
    reason = acceptance.reason(joint, load.changed(*change.rows))
    return f"none that was tried keeps every limit of {joint.name}; with the nearest, {reason}"
