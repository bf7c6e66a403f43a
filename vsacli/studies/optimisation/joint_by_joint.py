"""The cheapest stiffness along a fixed motion, along which joints do not depend on each other."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.texts import as_name
from vsacli.robot.joint import Joint
from vsacli.studies.optimisation.checks import chosen_joints, confirmed
from vsacli.studies.optimisation.countdown import Countdown
from vsacli.studies.optimisation.criteria import Criterion
from vsacli.studies.optimisation.joint_costs import asked_cost, asked_stiffness, cost
from vsacli.studies.optimisation.optimum import JointOptimum, Optimum
from vsacli.studies.optimisation.periods import periods, rests
from vsacli.studies.optimisation.spline_space import SplineSpace
from vsacli.studies.optimisation.stiffness import Profile, StiffnessSearch
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError
from vsacli.studies.remedies.admissible_stiffness import joint_loads
from vsacli.studies.remedies.changed_stiffness import with_changed_stiffness
from vsacli.studies.remedies.motions import Load
from vsacli.studies.remedies.task import STEPS
from vsacli.trajectory.trajectory import Trajectory

STRICTER = (0.0, 0.001, 0.01)
"""Shares by which the rule is stricter, one after the other: what has the margin at the steps may fall short
of it between them."""


def cheapest_stiffness(
    what: Optimum,
    trajectory: Trajectory,
    criterion: Criterion,
    seed: int,
    progress: Callable[[int], object],
) -> Optimum:
    """The best stiffness of all joints, confirmed by a run."""
    for share in STRICTER:
        acceptance = Acceptance(what.robot, what.margin).stricter(share)
        search = CheapestStiffness(acceptance, trajectory, criterion, seed, progress)
        try:
            joints, best = search.best()
        except ImpossibleError as error:
            return replace(what, reasons=error.reasons)
        if confirmed(what, best):
            return replace(what, joints=joints, trajectory=best)
    return replace(what, reasons=("what keeps every limit at the steps exceeds one between them",))


class CheapestStiffness:
    """A search for the best stiffness of all joints."""

    def __init__(
        self,
        acceptance: Acceptance,
        trajectory: Trajectory,
        criterion: Criterion,
        seed: int,
        progress: Callable[[int], object],
    ) -> None:
        self._acceptance, self._trajectory, self._criterion = acceptance, trajectory, criterion
        self._seed, self._progress = seed, progress
        self._rests = rests(trajectory)

    def best(self) -> tuple[dict[str, JointOptimum], Trajectory]:
        """What was found for each joint, by name, and the trajectory with it.

        Raises:
            ImpossibleError: with the reason of each joint for which nothing was found.
        """
        robot = self._acceptance.robot
        chosen, reasons = chosen_joints(robot), list(self._reasons_of_others())
        joints, changes = {}, {}
        for index, load in zip(chosen, joint_loads(robot, self._trajectory, chosen), strict=True):
            joint = robot.joints[index]
            try:
                joints[joint.name], rows = self._of_joint(joint, load)
            except ImpossibleError as error:
                reasons += error.reasons
                continue
            changes[index] = (rows - asked_stiffness(load))[:, STEPS]
        if reasons:
            raise ImpossibleError(*reasons)
        best = copy(with_changed_stiffness(self._trajectory, changes))
        best.name = as_name(f"{self._trajectory.name}-{self._criterion.name}")
        return joints, best

    def _reasons_of_others(self) -> Sequence[str]:
        """What is wrong with joints that have no stiffness to choose."""
        robot = self._acceptance.robot
        others = [index for index in range(len(robot.joints)) if index not in chosen_joints(robot)]
        loads = joint_loads(robot, self._trajectory, others)
        reasons = [
            self._acceptance.reason(robot.joints[index], load)
            for index, load in zip(others, loads, strict=True)
        ]
        return [reason for reason in reasons if reason]

    def _of_joint(self, joint: Joint, load: Load) -> tuple[JointOptimum, FloatArray]:
        """What was found, and stiffness, rate and second derivative at all instants, (3, instants)."""
        count = 0 if self._rests else periods(load)
        criterion = type(self._criterion)(repeating=count > 0)
        period = load.at(slice(0, (len(load.time) - 1) // max(count, 1) + 1))
        spaces = SplineSpace.periodic if count else SplineSpace.at_rest
        bar = Countdown(self._progress)
        search = StiffnessSearch(self._acceptance, joint, period, criterion, spaces, self._seed, bar.count)
        constant, best = search.best_constant(), search.best()
        bar.finish()
        rows = _repeated(best, max(count, 1))
        optimum = JointOptimum(
            before=asked_cost(joint, load, criterion),
            constant=math.nan
            if constant is None
            else cost(joint, load, criterion, _repeated(constant, max(count, 1))),
            after=cost(joint, load, criterion, rows),
            unit=criterion.quantity.unit(joint.type),
            found=best.found,
            starts=best.starts,
            agreeing=best.agreeing,
            bounding=best.bounding,
        )
        return optimum, rows


def _repeated(profile: Profile, count: int) -> FloatArray:
    """A profile passed several times."""
    return np.concatenate([np.tile(profile.rows[:, :-1], count), profile.rows[:, -1:]], axis=1)
