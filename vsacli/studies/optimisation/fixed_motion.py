"""A joint along a fixed motion: cost and bounds as functions of its stiffness at each instant."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from vsacli.actuators.limit_check import LimitCheck
from vsacli.base.arrays import FloatArray, IndexArray
from vsacli.base.flags import NEAR_SINGULAR_MARGIN
from vsacli.base.signals import STIFFNESS
from vsacli.compute.duals import Dual
from vsacli.dynamics.drive import Drive, driven_by
from vsacli.dynamics.limits import limit_checks
from vsacli.robot.joint import Joint
from vsacli.robot.parameters import apart
from vsacli.studies.optimisation.criteria import Criterion, Scale
from vsacli.studies.remedies.admissible_stiffness import Range
from vsacli.studies.remedies.motions import Load
from vsacli.studies.sensitivities.implicit import ImplicitSolution

CLEARANCE = 1e-6
"""Share of each bound by which a profile keeps clear of it, so that rounding crosses none."""

OF_MOTORS = ("phi", "dtheta", "tau_motor", "current", "voltage")
"""Variables with limits that depend on the stiffness."""


class FixedMotion:
    """The `Functions` of stiffness, its rate and its second derivative; and of a level, if the cost is one.

    Args:
        joint: the joint.
        load: what it carries, at all instants.
        admissible: its stiffness at them.
        criterion: what is minimised.
        scale: of the cost.
        reserve: share of each limit of the motors that is kept clear of.
    """

    def __init__(
        self,
        joint: Joint,
        load: Load,
        admissible: Range,
        criterion: Criterion,
        scale: Scale,
        reserve: float = 0.0,
    ) -> None:
        self.joint, self.load, self.admissible = joint, load, admissible
        self.criterion, self.scale, self._clearance = criterion, scale, CLEARANCE + reserve
        self.stiffness = float(np.median(load.command.commanded[STIFFNESS.key]))
        self._carrying = _made_to_carry(joint)
        self._limits = [check for check in limit_checks(joint) if check.variable in OF_MOTORS]

    @property
    def bound_names(self) -> list[str]:
        """What the first bounds are of, in words; those behind are of levels."""
        limits = [check.flag.quantity_of(check.motor) for check in self._limits for _ in finite_ends(check)]
        return ["lower end of the corridor", "upper end of the corridor", *limits]

    @property
    def further_bounds(self) -> int:
        """Number of bounds behind those of the stiffness itself."""
        return len(self.bound_names) - 2 + self.criterion.bound_count(self.joint)

    def __call__(
        self, rows: Sequence[Dual] | FloatArray, instants: IndexArray
    ) -> tuple[list[Any], list[Any]]:
        """Integrands of the cost, and bounds; see `Functions`."""
        driven = self.driven(rows[: STIFFNESS.orders], instants)
        level = rows[STIFFNESS.orders] if self.criterion.levels else None
        asked = (self.joint, driven, level, self.scale)
        low, high = (row[instants] for row in self.admissible)
        size = self.stiffness
        bounds = [(low - rows[0]) / size + CLEARANCE, (rows[0] - high) / size + CLEARANCE]
        bounds += self._limit_bounds(driven)
        return list(self.criterion.integrands(*asked)), [*bounds, *self.criterion.bounds(*asked)]

    def driven(self, rows: Sequence[Dual] | FloatArray, instants: IndexArray) -> Drive:
        """What the motors do with a stiffness and its derivatives."""
        load = self.load.at(instants).command
        commanded: dict[str, Any] = {**load.commanded, **dict(zip(STIFFNESS.names, rows, strict=True))}
        joint = self._carrying if isinstance(rows[0], Dual) else self.joint
        with np.errstate(all="ignore"):  # a step of the search may leave the corridor
            return driven_by(joint, load._replace(commanded=commanded), NEAR_SINGULAR_MARGIN)

    def _limit_bounds(self, driven: Drive) -> Iterator[Any]:
        """How far the motors are beyond their limits, relative to these."""
        of_joint: Mapping[str, Any] = driven.arrays()
        for check in self._limits:
            for sign, bound in finite_ends(check):
                size = abs(bound) or 1.0
                yield sign * (check.values(of_joint) - bound) / size + self._clearance


def finite_ends(check: LimitCheck) -> Iterator[tuple[float, float]]:
    """The ends of a range that bound anything, each with the direction that is outside."""
    yield from ((sign, end) for sign, end in zip((-1.0, 1.0), check.range, strict=True) if np.isfinite(end))


def _made_to_carry(joint: Joint) -> Joint:
    """The joint with an actuator that takes a stiffness that carries derivatives."""
    carrying, directions = apart(joint), STIFFNESS.orders + joint.actuator.motor_count
    implicit = ImplicitSolution(joint.actuator, carrying.actuator, directions)
    object.__setattr__(carrying.actuator, "solve", implicit.solve_within)
    return carrying
