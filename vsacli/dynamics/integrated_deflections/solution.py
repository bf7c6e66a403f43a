"""The deflections of a whole robot along a trajectory."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.base.arrays import FloatArray
from vsacli.dynamics.integrated_deflections.integration import Integration, Pieces, by_joint
from vsacli.dynamics.integrated_deflections.task import REASONS, Task
from vsacli.dynamics.inverse import Stop
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from scipy.integrate import OdeSolution

TOLERANCE = 1e-12
"""Relative error admitted in an integration step; the drift is about as large."""


@dataclass(frozen=True)
class _Way:
    """Deflections of some joints over a part of the trajectory."""

    joints: list[int]
    solution: OdeSolution

    def deflections(self, time: FloatArray) -> FloatArray:
        """(joints, 2, samples)."""
        return by_joint(self.solution(time))


@dataclass(frozen=True)
class IntegratedDeflections:
    """Deflections along a trajectory, as `integrate_deflections` found them.

    Attributes:
        stops: for each joint, where its way ends before the trajectory does.
    """

    stops: tuple[Stop | None, ...]
    _ways: tuple[_Way, ...] = field(repr=False)
    _start: float

    def at(self, time: FloatArray) -> FloatArray:
        """Deflections of all joints at any times of the span, (joints, 2, samples).

        NaN from a stop on, and at joints whose stiffness is not commanded.
        """
        phi = np.full((len(self.stops), 2, len(time)), np.nan)
        elapsed = time - self._start
        for way in self._ways:
            here = (way.solution.t_min <= elapsed) & (elapsed <= way.solution.t_max)
            if here.any():
                for joint, deflections in zip(way.joints, way.deflections(elapsed[here]), strict=True):
                    phi[joint][:, here] = deflections
        for joint, stop in enumerate(self.stops):
            if stop is not None:
                phi[joint, :, time >= stop.time] = np.nan
        return phi


def integrate_deflections(
    robot: Robot, trajectory: Trajectory, tolerance: float = TOLERANCE
) -> IntegratedDeflections:
    """Integrate phi' = A(phi)^-1 (tau_e', sigma') (19) from the root of (14) at the first step.

    The smooth functions of the trajectory count; derivatives given with samples play no part. The integration
    of a joint ends where A becomes singular or its stiffness cannot be reached; the other joints go on. Only
    kinds of actuator that are `integrable` have deflections to integrate.

    Args:
        robot: the robot.
        trajectory: what it is asked to do.
        tolerance: relative error admitted in an integration step, at least 1e-13.
    """
    first, trajectory = trajectory.start, trajectory.from_zero()
    task = Task(robot, trajectory)
    if not task.joints:
        return IntegratedDeflections((None,) * trajectory.joints, (), first)
    time, end = trajectory.times.span
    pieces = Pieces.of(trajectory, tolerance)
    phi = np.full((trajectory.joints, SIDES, 1), np.nan)
    phi[list(task.joints)] = task.roots(task.joints, np.array([time]))
    hindrances = task.hindrances(task.joints, np.array([time]), phi[list(task.joints)])[:, 0]
    found = zip(task.joints, hindrances.tolist(), strict=True)
    stops = {joint: Stop(first + time, REASONS[reason]) for joint, reason in found if reason}
    ways = []
    while time < end and len(stops) < len(task.joints):
        going = [joint for joint in task.joints if joint not in stops]
        integration = Integration(task, tuple(going), pieces, time, phi[going, :, 0])
        if integration.times[-1] > time:
            time = integration.times[-1]
            ways.append(_Way(going, integration.solution()))
            phi[going] = ways[-1].deflections(np.array([time]))
        stops |= {joint: Stop(first + time, reason) for joint, reason in integration.stopped.items()}
    return IntegratedDeflections(tuple(map(stops.get, range(trajectory.joints))), tuple(ways), first)
