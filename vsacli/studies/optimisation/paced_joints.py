"""Bounds of joints along a path, as functions of the pace, and of their stiffness if that varies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.base.signals import STIFFNESS
from vsacli.compute.duals import Dual
from vsacli.dynamics.drive import Drive, driven_by
from vsacli.dynamics.limits import limit_checks
from vsacli.robot.joint import Joint
from vsacli.robot.parameters import apart
from vsacli.studies.optimisation.criteria import NO_COST, UNSCALED, Criterion, Scale
from vsacli.studies.optimisation.fixed_motion import finite_ends
from vsacli.studies.optimisation.paced_motion import PACE_ORDERS, PacedMotion
from vsacli.studies.sensitivities.implicit import ImplicitSolution

CLEARANCE = 1e-4
"""Share of each bound by which a motion keeps clear of it at the instants that are looked at, for what lies
between them: with 4000 of them a hardening spring's motor exceeded its limit by 2e-5 there."""

FASTEST = 0.02
"""Least pace: fifty times as fast as commanded, more than which the units are more likely to be wrong."""

NOT_OF_THE_PACE = ("q", "damping")
"""Variables with limits that no pace changes; nor that of a stiffness that does not vary."""


class Pace:
    """The `Functions` of the pace itself: time, and bounds on it.

    Args:
        held: where the motion rests on its way, (instants,): it shall not rest for a shorter time.
        duration: by which time is scaled, s.
    """

    def __init__(self, held: BoolArray, duration: float) -> None:
        self._held, self._duration = held, duration

    def __call__(
        self, rows: Sequence[Dual] | FloatArray, instants: IndexArray
    ) -> tuple[list[Any], list[Any]]:
        """Time, and how far the pace is below what it may be."""
        return [rows[0] / self._duration], [least_pace(self._held)[instants] - rows[0]]


def least_pace(held: BoolArray) -> FloatArray:
    """As fast as is tried, (instants,), and as commanded where the motion rests on its way."""
    return np.where(held, 1.0, FASTEST)


class PacedJoint:
    """The `Functions` of the pace, of a stiffness if it varies, both with their derivatives, and of a level.

    Args:
        motion: of all joints.
        index: of the joint.
        near_singular: the margin.
        criterion: what it costs.
        share: that its cost has in that of all joints.
        reserve: share of each limit that is kept clear of besides `CLEARANCE`.
        varied: whether the stiffness varies.

    Attributes:
        criterion: what it costs.
        scale: of that cost.
    """

    def __init__(
        self,
        motion: PacedMotion,
        index: int,
        near_singular: float,
        criterion: Criterion = NO_COST,
        scale: Scale = UNSCALED,
        share: float = 1.0,
        reserve: float = 0.0,
        *,
        varied: bool = False,
    ) -> None:
        self._motion, self._index, self._near_singular = motion, index, near_singular
        self.criterion, self.scale, self._share = criterion, scale, share
        self._clearance = CLEARANCE + reserve
        self._joint = motion.robot.joints[index]
        self._carrying = _made_to_carry(self._joint)
        fixed = NOT_OF_THE_PACE if varied else (*NOT_OF_THE_PACE, STIFFNESS.key)
        self._checks = [check for check in limit_checks(self._joint) if check.variable not in fixed]
        self._chosen = STIFFNESS.key in self._joint.actuator.commanded

    @property
    def name(self) -> str:
        """Of the joint."""
        return self._joint.name

    @property
    def bound_names(self) -> list[str]:
        """What the first bounds are of, in words; those behind are of levels."""
        ends = ["lower end of the corridor", "upper end of the corridor"] if self._chosen else []
        return ends + [
            check.flag.quantity_of(check.motor) for check in self._checks for _ in finite_ends(check)
        ]

    @property
    def bound_count(self) -> int:
        """Number of bounds."""
        return len(self.bound_names) + self.criterion.bound_count(self._joint)

    def weights(self, s: FloatArray) -> FloatArray:
        """What each integrand of the cost counts at each instant, (integrands, instants)."""
        return self._share * self.criterion.weights(s)

    def __call__(
        self, rows: Sequence[Dual] | FloatArray, instants: IndexArray
    ) -> tuple[list[Any], list[Any]]:
        """Integrands of the cost over the path, and the bounds; see `Functions`."""
        behind = len(rows) - self.criterion.levels
        pace, stiffness, level = list(rows[:PACE_ORDERS]), list(rows[PACE_ORDERS:behind]), rows[behind:]
        with np.errstate(all="ignore"):  # a step of the search may leave the corridor
            command = self._motion.commands(pace, instants)[self._index]
            if len(stiffness):
                rates = self._motion.stiffness_rates(pace, stiffness)
                asked = dict(zip(STIFFNESS.names, rates, strict=True))
                command = command._replace(commanded={**command.commanded, **asked})
            joint = self._carrying if isinstance(pace[0], Dual) else self._joint
            driven = driven_by(joint, command, self._near_singular)
            bounds = [*self._corridor(driven), *self._limits({**command.arrays(), **driven.arrays()})]
            costed = (self._joint, driven, level[0] if len(level) else None, self.scale)
            integrands = list(self.criterion.integrands(*costed))
            for index in self.criterion.over_time:  # dt = pace ds
                integrands[index] = integrands[index] * pace[0]
        return integrands, [*bounds, *self.criterion.bounds(*costed)]

    def _corridor(self, driven: Drive) -> Iterator[Any]:
        if self._chosen:
            margin = self._near_singular
            yield driven.stiffness_lower / ((1 - margin) * driven.stiffness) - 1 + CLEARANCE
            unbounded = np.isinf(driven.stiffness_upper)
            upper = np.where(unbounded, 1.0, driven.stiffness_upper) / ((1 + margin) * driven.stiffness)
            yield np.where(unbounded, -1.0, 1 + CLEARANCE - upper)

    def _limits(self, of_joint: Any) -> Iterator[Any]:
        for check in self._checks:
            for sign, bound in finite_ends(check):
                size = abs(bound) or 1.0
                yield sign * (check.values(of_joint) - bound) / size + self._clearance


def _made_to_carry(joint: Joint) -> Joint:
    """The joint with an actuator whose corridor and deflections carry derivatives, too."""
    carrying = apart(joint)
    directions = PACE_ORDERS + STIFFNESS.orders + joint.actuator.motor_count
    if joint.actuator.sprung:
        implicit = ImplicitSolution(joint.actuator, carrying.actuator, directions)
        object.__setattr__(carrying.actuator, "solve", implicit.solve)
    return carrying
