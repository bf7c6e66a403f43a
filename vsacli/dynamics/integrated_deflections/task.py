"""What is asked of the joints at any time, and whether deflections can be integrated there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.laws.pair import PairSolution
from vsacli.actuators.reach import reach_flags
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FloatArray
from vsacli.base.flags import Flag, has
from vsacli.dynamics.inverse import command_of, elastic_torques
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

REASONS = (
    "",
    "its decoupling matrix becomes singular",
    "its stiffness leaves the range that its springs can reach",
    "the integration cannot go on",
)
FOLLOWED, SINGULAR, UNREACHABLE, STALLED = range(len(REASONS))


def integrable(joint: Joint) -> bool:
    """Whether deflections of a joint can be integrated by (19); with a damper beside they are already."""
    return joint.actuator.integrable and joint.damper_at("transmission") is None


class Task:
    """A robot and what it is asked to do; deflections are (joints, 2, samples).

    Attributes:
        trajectory: what it is asked to do.
        joints: those whose deflections can be integrated.
    """

    def __init__(self, robot: Robot, trajectory: Trajectory) -> None:
        self.trajectory = trajectory
        self._robot = robot
        self._actuators = {
            index: joint.actuator for index, joint in enumerate(robot.joints) if integrable(joint)
        }
        self.joints = tuple(self._actuators)

    def roots(self, joints: tuple[int, ...], time: FloatArray) -> FloatArray:
        """Roots of (14) of some joints."""
        return np.stack(
            [_root(actuator, command).deflections for actuator, command in self._commands(joints, time)]
        )

    def rates(self, joints: tuple[int, ...], time: FloatArray, phi: FloatArray) -> FloatArray:
        """Rates of the deflections of some joints, (19)."""
        return np.stack(
            [
                actuator.deflection_rates(of_joint, command)
                for (actuator, command), of_joint in zip(self._commands(joints, time), phi, strict=True)
            ]
        )

    def hindrances(self, joints: tuple[int, ...], time: FloatArray, phi: FloatArray) -> npt.NDArray[np.intp]:
        """Why the deflections of some joints cannot be integrated there: indices into `REASONS`."""
        return np.stack(
            [
                _hindrances(actuator, command, of_joint)
                for (actuator, command), of_joint in zip(self._commands(joints, time), phi, strict=True)
            ]
        )

    def _commands(self, joints: tuple[int, ...], time: FloatArray) -> Iterator[tuple[Actuator, Command]]:
        """What is asked of some joints, from one pass of the recursion."""
        motion = self.trajectory.at(time)
        commanded = {**motion.variables(), **elastic_torques(self._robot, motion)}
        for joint in joints:
            yield self._actuators[joint], command_of(joint, commanded)


def _root(actuator: Actuator, command: Command) -> PairSolution:
    return actuator.solve(command.tau_e, command.commanded["stiffness"], command.q)


def _hindrances(actuator: Actuator, command: Command, phi: FloatArray) -> npt.NDArray[np.intp]:
    """Singular is, too, where det A has another sign than on the joint's branch: it was zero on the way."""
    solution = _root(actuator, command)
    flags = reach_flags(command.commanded["stiffness"], solution)
    here, on_branch = (np.sign(actuator.determinant(each, command.q)) for each in (phi, solution.deflections))
    singular = has(flags, Flag.SINGULAR) | (here != on_branch)
    return np.where(has(flags, Flag.INFEASIBLE), UNREACHABLE, np.where(singular, SINGULAR, FOLLOWED))
