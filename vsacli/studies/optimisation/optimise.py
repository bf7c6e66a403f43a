"""The trajectory with which a cost is least, among those that the robot can execute."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from vsacli.base.flags import NEAR_SINGULAR_MARGIN, check_near_singular
from vsacli.dynamics.internal_motion import refuse_damped_transmissions
from vsacli.dynamics.inverse import fitted
from vsacli.robot.model import Robot
from vsacli.studies.optimisation.checks import (
    BOTH,
    TIME,
    TIMING,
    check_timing_varies,
    checked_criterion,
    chosen_joints,
    varied_joints,
)
from vsacli.studies.optimisation.countdown import SEARCHES
from vsacli.studies.optimisation.joint_by_joint import cheapest_stiffness
from vsacli.studies.optimisation.joints_together import cheapest_pace, fastest
from vsacli.studies.optimisation.optimum import Optimum
from vsacli.trajectory.trajectory import Trajectory


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
    """The stiffness or the timing with which a motion costs least, or takes least time, within all limits.

    A stiffness profile is four times continuously differentiable. Its first two derivatives vanish at both
    ends, unless the motion repeats itself: then so does the profile. A timing passes the same path at another
    pace, in the same time unless that is minimised. What is found is a local optimum.

    Args:
        robot: the robot.
        trajectory: for this robot.
        minimize: "torque" (rms of the motor torques), "energy" (that the motors spend), "copper" (heat in
            their windings) or "peak" (of the motor torques), of each joint by itself, or of all
            together where the timing varies; or "time".
        vary: "stiffness", "timing" or "both"; for "time" one of the latter.
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
    varied = varied_joints(robot, vary)
    what = Optimum(robot, trajectory.name, minimize, "duration", vary, margin)
    if minimize == TIME:
        check_timing_varies(vary)
        return fastest(what, trajectory, varied, seed, progress)
    shared = vary in (TIMING, BOTH)
    criterion = checked_criterion(robot, minimize, range(len(robot.joints)) if shared else varied)
    what = replace(what, words=criterion.words)
    if shared:
        return cheapest_pace(what, trajectory, criterion, varied, seed, progress)
    return cheapest_stiffness(what, trajectory, criterion, seed, progress)


def searches(robot: Robot, minimize: str, vary: str) -> int:
    """How many searches an optimisation may take."""
    of_pace = SEARCHES * (vary in (TIMING, BOTH))
    return of_pace + (0 if minimize == TIME or vary == TIMING else SEARCHES * len(chosen_joints(robot)))
