"""What moves inside the damped transmissions of a robot along a trajectory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from vsacli.actuators.damped_springs import DampedSprings, InternalMotion
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.signals import DAMPING
from vsacli.dynamics.integrated_deflections.integration import Pieces
from vsacli.dynamics.internal_motion.march import FIRST_CELLS, LOST, March, Marched
from vsacli.dynamics.inverse import Stop, command_of, elastic_torques
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class InternalMotions:
    """The motion inside each damped transmission; joints whose damping is zero all the time have none.

    Attributes:
        joints: indices of those that have one.
        stops: for each of these whose motion ends before the trajectory does, where.
    """

    joints: tuple[int, ...]
    stops: Mapping[int, Stop]
    _marched: Mapping[int, Marched] = field(repr=False)

    @property
    def breakpoints(self) -> FloatArray:
        """Ends of the pieces, from the first step on, s: short where what moves inside dies away."""
        ends = [each.phi.ends for each in self._marched.values() if each.phi is not None]
        return np.unique(np.concatenate([np.zeros(0), *ends]))

    def at(self, elapsed: FloatArray) -> dict[int, InternalMotion]:
        """The motion of each joint at times from the first step on; NaN from a stop on."""
        return {joint: self._at(joint, elapsed) for joint in self.joints}

    def _at(self, joint: int, elapsed: FloatArray) -> InternalMotion:
        marched = self._marched[joint]
        if marched.phi is None or marched.rates is None:
            none = np.full_like(elapsed, np.nan)
            return InternalMotion(np.stack((none, none)), none, none)
        gone = (elapsed >= marched.end) & (marched.reason is not None)
        phi, rates = (np.where(gone, np.nan, each.at(elapsed)) for each in (marched.phi, marched.rates))
        return InternalMotion(phi, *rates)


def internal_motions(robot: Robot, trajectory: Trajectory) -> InternalMotions:
    """Integrate what moves inside the damped transmissions of a robot, from the first step to the last.

    The smooth functions of the trajectory count; derivatives given with samples play no part.
    """
    first, trajectory = trajectory.start, trajectory.from_zero()
    joints = damped_joints(robot, trajectory)
    demand = _Demand(robot, trajectory)
    evenly = np.linspace(0.0, trajectory.duration, FIRST_CELLS + 1)
    ends = np.union1d(evenly, Pieces.of(trajectory, 0.0).ends)
    springs = {index: DampedSprings(robot.joints[index].actuator) for index in joints}
    marched = {}
    with np.errstate(all="ignore"):  # a trial step may leave the range of a law
        for index in joints:
            begin = springs[index].equilibrium(demand.of(index, ends[:1]), robot.joints[index].damper_start)
            march = March(springs[index], partial(demand.of, index))
            started = not np.isnan(begin[0]).any()
            marched[index] = march.through(ends, begin) if started else Marched(None, None, 0.0, LOST)
    stops = {
        index: Stop(first + each.end, each.reason)
        for index, each in marched.items()
        if each.reason is not None
    }
    return InternalMotions(joints, stops, marched)


def damped_joints(robot: Robot, trajectory: Trajectory) -> tuple[int, ...]:
    """The joints with a damper parallel to their springs that is not at zero all the time."""
    chosen = [index for index, joint in enumerate(robot.joints) if joint.damper_at("transmission")]
    if not chosen:
        return ()
    damping = trajectory.block(0, 1).commanded[DAMPING.key][0]
    return tuple(index for index in chosen if damping[index])


def refuse_damped_transmissions(robot: Robot, trajectory: Trajectory, work: str) -> None:
    """Refuse what looks at steps one by one, where a step depends on all before.

    Args:
        robot: the robot.
        trajectory: fitted to the robot.
        work: what refuses, a plural.

    Raises:
        InputError: a transmission is damped.
    """
    names = ", ".join(robot.joint_names[index] for index in damped_joints(robot, trajectory))
    if names:
        raise InputError.one(
            f"{work} do not know transmissions with a damper ({names}): what moves inside depends on the "
            "whole motion; set their damping to 0, or move the dampers between the links"
        )


class _Demand:
    """What joints are asked to do; times that were asked for before are remembered."""

    def __init__(self, robot: Robot, trajectory: Trajectory) -> None:
        self._robot, self._trajectory = robot, trajectory
        self._known: dict[bytes, Mapping[str, FloatArray]] = {}

    def of(self, joint: int, time: FloatArray) -> Command:
        key = time.tobytes()
        if key not in self._known:
            motion = self._trajectory.at(time)
            self._known[key] = {**motion.variables(), **elastic_torques(self._robot, motion)}
        return command_of(joint, self._known[key])
