"""The rule that a suggestion has to satisfy: every step keeps the margin and no limit is exceeded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from vsacli.actuators.reach import excess, has, limit_flags, margin
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import BoolArray, FlagArray, FloatArray
from vsacli.base.flags import LIMITS, Flag
from vsacli.dynamics.drive import Drive, drive
from vsacli.dynamics.inverse import command_of, compute_block, elastic_torques, usual_block
from vsacli.dynamics.limits import limit_checks
from vsacli.robot.model import Joint, Robot
from vsacli.studies.remedies.clauses import corridor_reason, limit_reason
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory


@dataclass(frozen=True)
class Acceptance:
    """When a step of a robot is accepted: a margin of at least `near_singular`, and every limit kept."""

    robot: Robot
    near_singular: float

    def refused(self, motion: Motion) -> BoolArray:
        """The steps that are not accepted, (samples, joints)."""
        block = compute_block(self.robot, motion, self.near_singular)
        return self._refused(block.flags, block.stiffness, block.stiffness_lower, block.stiffness_upper)

    def refused_along(self, trajectory: Trajectory) -> Iterator[tuple[Motion, BoolArray]]:
        """All steps of a trajectory, block by block, and which of them are not accepted."""
        samples = usual_block(len(self.robot.joints))
        for start in range(0, trajectory.samples, samples):
            motion = trajectory.block(start, start + samples)
            yield motion, self.refused(motion)

    def refused_joints(self, trajectory: Trajectory) -> BoolArray:
        """The joints with any step that is not accepted, (joints,)."""
        blocks = [np.any(refused, axis=0) for _, refused in self.refused_along(trajectory)]
        joints: BoolArray = np.any(blocks, axis=0)
        return joints

    def refused_commands(self, joint: Joint, command: Command) -> BoolArray:
        """The steps of one joint that are not accepted, (samples,)."""
        driven = drive(joint, command, self.near_singular)
        return self._refused(driven.flags, command.stiffness, driven.stiffness_lower, driven.stiffness_upper)

    def reasons(self, motion: Motion) -> tuple[str, ...]:
        """For each joint that is not accepted throughout, the worst that is wrong with it."""
        commanded = {**motion.variables(), **elastic_torques(self.robot, motion)}
        found = (
            self.reason(joint, motion.time, command_of(index, commanded))
            for index, joint in enumerate(self.robot.joints)
        )
        return tuple(reason for reason in found if reason)

    def reason(self, joint: Joint, time: FloatArray, command: Command) -> str:
        """The worst that is wrong with the steps of one joint, in a clause; empty if they are accepted."""
        driven = drive(joint, command, self.near_singular)
        computed = {**command._asdict(), **driven._asdict()}
        return self._reach_reason(joint, time, command, driven) or _limit_reason(joint, time, computed)

    def _refused(
        self, flags: FlagArray, stiffness: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> BoolArray:
        short = margin(stiffness, lower, upper) < self.near_singular
        refused: BoolArray = short | has(flags, Flag.INFEASIBLE | LIMITS)
        return refused

    def _reach_reason(self, joint: Joint, time: FloatArray, command: Command, driven: Drive) -> str:
        gap = margin(command.stiffness, driven.stiffness_lower, driven.stiffness_upper)
        gap[np.isnan(gap)] = np.inf
        gap[has(driven.flags, Flag.INFEASIBLE) & np.isnan(driven.stiffness_lower)] = -np.inf
        step = int(gap.argmin())
        if gap[step] >= self.near_singular:
            return ""
        return corridor_reason(
            joint,
            time[step],
            command.stiffness[step],
            driven.stiffness_lower[step] / (1 - self.near_singular),
            driven.stiffness_upper[step] / (1 + self.near_singular),
        )


def path_reason(joint: Joint, time: FloatArray, command: Command) -> str:
    """A limit that the motion itself exceeds, whatever the stiffness, in a clause; empty if there is none."""
    return _limit_reason(joint, time, {"q": command.q, "dq": command.dq})


def _limit_reason(joint: Joint, time: FloatArray, computed: Mapping[str, FloatArray]) -> str:
    """The first kind of limit that is exceeded, of those on variables that were computed."""
    for check in limit_checks(joint):
        if check.variable in computed:
            rows = computed[check.variable]
            values = rows if check.motor is None else rows[check.motor - 1]
            if limit_flags(check, values).any():
                step = int(np.nanargmax(excess(values, check.range)))
                return limit_reason(joint, time[step], check, values[step])
    return ""
