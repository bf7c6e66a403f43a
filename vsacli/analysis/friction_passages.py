"""Smooth friction of links that changes its sign faster than the steps show, and what motors do meanwhile.

Motors of springs follow two derivatives of F tanh(q'/w), which are largest where q' is about w. A run whose
velocity passes through that between two steps does not see them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.units import TORQUE, time_text
from vsacli.base.variables import Block
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory

REACH = 3.0
"""Widths up to which friction still changes: tanh is within 0.5 % of its limit there."""

COARSE = 0.5
"""Widths by which the velocity may change from step to step, so that steps show all of it."""

LEVELS, HALVINGS = 25, 40
"""Velocities in a passage at which the motors are looked at, and halvings that find when each is."""

MOST = 200
"""Passages of a joint that are looked at, the fastest ones."""

MORE = 1.05
"""Times the largest torque at the steps, from which on more is told."""


class FrictionPassages:
    """The passages of a run; `add` blocks in order, then ask for the `notes`."""

    def __init__(self, robot: Robot) -> None:
        self._joints: list[tuple[int, Joint, float]] = [
            (index, joint, joint.friction.width)
            for index, joint in enumerate(robot.joints)
            if joint.friction is not None and joint.friction.width and any(joint.friction.coulomb)
        ]
        self._passages = [np.empty((0, 4)) for _ in self._joints]
        self._peaks = [0.0] * len(self._joints)
        self._time, self._dq = np.empty(0), np.empty((0, len(robot.joints)))

    def add(self, block: Block) -> None:
        """Merge consecutive steps."""
        time, dq = np.append(self._time, block.time), np.concatenate([self._dq, block.dq])
        self._time, self._dq = time[-1:], dq[-1:]
        for number, (index, _, width) in enumerate(self._joints):
            torques = np.abs(block.tau_motor[:, index])
            self._peaks[number] = np.max(torques, where=np.isfinite(torques), initial=self._peaks[number])
            before, after = dq[:-1, index], dq[1:, index]
            near = (np.minimum(abs(before), abs(after)) < REACH * width) | (before * after < 0)
            passed = near & (np.abs(after - before) > COARSE * width)
            found = np.stack([time[:-1], time[1:], before, after], axis=1)[passed]
            every = np.concatenate([self._passages[number], found])
            fastest = np.sort(np.argsort(-np.abs(every[:, 3] - every[:, 2]), kind="stable")[:MOST])
            self._passages[number] = every[fastest]

    def notes(self, trajectory: Trajectory, compute: Callable[[Motion], Block]) -> Iterator[str]:
        """What the steps do not show, a sentence for each joint."""
        for (index, joint, width), passages, peak in zip(
            self._joints, self._passages, self._peaks, strict=True
        ):
            if not passages.size:
                continue
            when = f"from t = {time_text(passages[0, 0])} on"
            what = f"{joint.name}: friction between the links changes its sign within a step or two {when}"
            remedy = "a larger rate shows them, a larger width makes them smaller"
            if not trajectory.known_between:
                yield f"{what}; what the motors do meanwhile is not known: {remedy}"
                continue
            torques = np.abs(compute(trajectory.at(_times(trajectory, passages, index, width))).tau_motor)
            torques = torques[:, index]
            most = float(np.max(torques, where=np.isfinite(torques), initial=0.0))
            if most > MORE * peak:
                sizes = f"{most:.3g} {TORQUE.unit(joint.type)} there, {peak:.3g} at the steps"
                yield f"{what}: motor torques reach {sizes}; {remedy}"


def _times(trajectory: Trajectory, passages: FloatArray, index: int, width: float) -> FloatArray:
    """When the velocity of a joint is at levels between -3 and 3 widths, within passages; by bisection."""
    early, late, before, after = np.repeat(passages, LEVELS, axis=0).T
    level = np.tile(width * np.linspace(-REACH, REACH, LEVELS), len(passages))
    level = np.clip(level, np.minimum(before, after), np.maximum(before, after))
    for _ in range(HALVINGS):
        middle = (early + late) / 2
        passed = (trajectory.at(middle).dq[:, index] - level) * (after - before) > 0
        early, late = np.where(passed, early, middle), np.where(passed, middle, late)
    return np.sort(late)
