"""The trajectory with which a cost is least, among those that the robot can execute."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.flags import NEAR_SINGULAR_MARGIN, check_near_singular
from vsacli.base.signals import STIFFNESS
from vsacli.base.texts import as_name
from vsacli.dynamics.drive import drive
from vsacli.dynamics.internal_motion import refuse_damped_transmissions
from vsacli.dynamics.inverse import fitted
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.studies.optimisation.criteria import CRITERIA, Criterion
from vsacli.studies.optimisation.optimum import JointOptimum, Optimum, TimingOptimum
from vsacli.studies.optimisation.periods import periods, rests
from vsacli.studies.optimisation.retimed import retimed
from vsacli.studies.optimisation.spline_space import SplineSpace
from vsacli.studies.optimisation.stiffness import Profile, StiffnessSearch
from vsacli.studies.optimisation.timing import TimingSearch
from vsacli.studies.remedies.acceptance import Acceptance, ImpossibleError
from vsacli.studies.remedies.admissible_stiffness import joint_loads
from vsacli.studies.remedies.changed_stiffness import with_changed_stiffness
from vsacli.studies.remedies.motions import Load
from vsacli.studies.remedies.smallest_changes import STRICTER
from vsacli.studies.remedies.suggestions import Remedy
from vsacli.studies.remedies.task import STEPS, Task
from vsacli.trajectory.trajectory import Trajectory

TIME, TIMING, BOTH = "time", "timing", "both"
"""What is minimised, and what varies, where it is not the stiffness alone."""

BETWEEN = 10
"""Times the steps of a run that confirms a pace between them."""

SEARCHES = 10
"""Searches of a joint: a constant, some starts, finer and finer splines; not all of them may be needed."""


def optimize(
    robot: Robot,
    trajectory: Trajectory,
    minimize: str = "torque",
    vary: str = "stiffness",
    *,
    margin: float = NEAR_SINGULAR_MARGIN,
    seed: int = 0,
    progress: Callable[[int], object] = lambda _: None,
) -> Optimum:
    """The stiffness with which a motion costs least, or its fastest timing, within all limits.

    A stiffness profile is four times continuously differentiable. Its first two derivatives vanish at both
    ends, unless the motion repeats itself: then so does the profile. A timing passes the same path at another
    pace. What is found is a local optimum.

    Args:
        robot: the robot.
        trajectory: for this robot.
        minimize: "torque" (rms of the motor torques), "energy" (that the motors spend), "copper" (heat in
            their windings) or "peak" (of the motor torques), of each joint by itself; or "time".
        vary: "stiffness"; for "time" it is "timing", or "both".
        margin: min(sigma - lower, upper - sigma)/sigma that every step shall have.
        seed: of the starts that are drawn.
        progress: is told how many further searches are done, of those that `searches` tells.

    Raises:
        InputError: the trajectory is not for the robot, something that is needed is not given, or the two
            words do not go together.
    """
    trajectory = fitted(robot, trajectory)
    check_near_singular(margin)
    refuse_damped_transmissions(robot, trajectory, "optimisations")
    if minimize == TIME:
        varied = varied_with_timing(robot, trajectory, vary)
        what = Optimum(robot, trajectory.name, minimize, "duration", vary, margin)
        return _fastest(what, trajectory, varied, seed, progress)
    if vary != STIFFNESS.key:
        raise InputError.one(f"{vary!r} varies for the sake of time; minimise {TIME!r}, or vary 'stiffness'")
    criterion = checked_criterion(robot, minimize)
    what = Optimum(robot, trajectory.name, minimize, criterion.words, vary, margin)
    return _cheapest(what, trajectory, criterion, seed, progress)


def searches(robot: Robot, minimize: str) -> int:
    """How many searches an optimisation may take."""
    return SEARCHES if minimize == TIME else SEARCHES * len(chosen_joints(robot))


def _cheapest(
    what: Optimum,
    trajectory: Trajectory,
    criterion: Criterion,
    seed: int,
    progress: Callable[[int], object],
) -> Optimum:
    """The best stiffness of all joints, confirmed by a run."""
    for share in STRICTER:
        acceptance = Acceptance(what.robot, what.margin).stricter(share)
        search = _Search(acceptance, trajectory, criterion, seed, progress)
        try:
            joints, best = search.best()
        except ImpossibleError as error:
            return replace(what, reasons=error.reasons)
        if _confirmed(what, best):
            return replace(what, joints=joints, trajectory=best)
    return replace(what, reasons=("what keeps every limit at the steps exceeds one between them",))


def _fastest(
    what: Optimum,
    trajectory: Trajectory,
    varied: Sequence[int],
    seed: int,
    progress: Callable[[int], object],
) -> Optimum:
    """The fastest pace, confirmed by a run, and by one with ten times as many steps."""
    bar = _Countdown(progress)
    search = TimingSearch(what.robot, trajectory, what.margin, varied, seed, bar.count)
    try:
        found = search.fastest()
    except ImpossibleError as error:
        return replace(what, reasons=error.reasons)
    bar.finish()
    name = as_name(f"{trajectory.name}-{TIME}")
    best, between = (
        retimed(trajectory, found.pace, found.stiffness, name, refined) for refined in (1, BETWEEN)
    )
    if not (_confirmed(what, best) and _confirmed(what, between)):
        return replace(what, reasons=("what keeps every limit at some instants exceeds one between them",))
    optimum = TimingOptimum(
        before=trajectory.duration,
        uniform=found.uniform,
        after=best.duration,
        found=found.found,
        starts=found.starts,
        agreeing=found.agreeing,
        bounding=found.bounding,
    )
    return replace(what, timing=optimum, trajectory=best)


def _confirmed(what: Optimum, trajectory: Trajectory) -> bool:
    """Whether a run keeps margin and limits."""
    task = Task(Acceptance(what.robot, what.margin), trajectory)
    return task.confirms(Remedy(0.0, what.robot, trajectory))


def varied_with_timing(robot: Robot, trajectory: Trajectory, vary: str) -> list[int]:
    """The joints whose stiffness varies with the timing, by index.

    Raises:
        InputError: the timing of the motion cannot vary, or it is not what varies.
    """
    if vary not in (TIMING, BOTH):
        raise InputError.one(f"time is what {TIMING!r} varies for, or {BOTH!r}, not {vary!r}")
    if not rests(trajectory):
        raise InputError.one(
            f"{trajectory.name} begins or ends in motion, and another timing would change how fast; vary the "
            "stiffness, or let it begin and end at rest, sinusoids by a ramp"
        )
    return chosen_joints(robot) if vary == BOTH else []


def chosen_joints(robot: Robot) -> list[int]:
    """The joints whose stiffness is commanded, by index.

    Raises:
        InputError: there are none.
    """
    chosen = [index for index, joint in enumerate(robot.joints) if STIFFNESS.key in joint.actuator.commanded]
    if not chosen:
        raise InputError.one(f"no joint of {robot.name} has a stiffness to choose")
    return chosen


def checked_criterion(robot: Robot, name: str) -> Criterion:
    """What is minimised, if it can be computed for all joints whose stiffness is chosen.

    Raises:
        InputError: it cannot, or there is no such criterion.
    """
    if name not in CRITERIA:
        raise InputError.one(f"what is minimised must be one of {', '.join(CRITERIA)}, not {name!r}")
    criterion = CRITERIA[name]()
    for index in chosen_joints(robot):
        criterion.check(robot.joints[index])
    return criterion


class _Search:
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
            changes[index] = (rows - _asked(load))[:, STEPS]
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
        bar = _Countdown(self._progress)
        search = StiffnessSearch(self._acceptance, joint, period, criterion, spaces, self._seed, bar.count)
        constant, best = search.best_constant(), search.best()
        bar.finish()
        rows = _repeated(best, max(count, 1))
        optimum = JointOptimum(
            before=cost(joint, load, criterion, _asked(load)),
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


class _Countdown:
    """Tells of searches as they are done, of `SEARCHES` in all whatever their number."""

    def __init__(self, progress: Callable[[int], object]) -> None:
        self._progress, self._left = progress, SEARCHES

    def count(self) -> None:
        """One is done."""
        if self._left:
            self._left -= 1
            self._progress(1)

    def finish(self) -> None:
        """All are."""
        self._progress(self._left)


def cost(joint: Joint, load: Load, criterion: Criterion, rows: FloatArray) -> float:
    """What a stiffness with its derivatives, (3, instants), costs over the steps; NaN if out of reach."""
    steps = load.at(STEPS)
    commanded = {**steps.command.commanded, **dict(zip(STIFFNESS.names, rows[:, STEPS], strict=True))}
    driven = drive(joint, steps.command._replace(commanded=commanded))
    return criterion.of(joint, driven, steps.time)


def _asked(load: Load) -> FloatArray:
    """Stiffness, rate and second derivative as they are commanded."""
    return np.stack([load.command.commanded[name] for name in STIFFNESS.names])


def _repeated(profile: Profile, count: int) -> FloatArray:
    """A profile passed several times."""
    return np.concatenate([np.tile(profile.rows[:, :-1], count), profile.rows[:, -1:]], axis=1)
