"""A motion along its path with another timing: commands, costs and bounds of joints as functions of the pace.

The path coordinate s is the time of the motion as commanded; the pace is p = dt/ds, whose integral is time.
Derivatives by time follow from those by s by the chain rule, df/dt = f_s/p and so on.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vsacli.actuators.transmission import Command, JointVariables
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray, by_joint
from vsacli.base.signals import COMMANDED, POSITION, STIFFNESS, Signal
from vsacli.compute.duals import Dual, value_of
from vsacli.dynamics.drive import drive_without_limits
from vsacli.dynamics.limits import limit_checks
from vsacli.robot.model import Robot
from vsacli.robot.parameters import with_copied_actuator
from vsacli.studies.search.criteria import (
    ENDS_OF_CORRIDOR,
    NO_COST,
    UNSCALED,
    Criterion,
    Scale,
    limit_bounds,
    limit_names,
    with_seeded_stiffness,
)
from vsacli.studies.search.loads import REST_SPEED_SHARE
from vsacli.studies.search.path_commands import PathCommands, Row, Speeds
from vsacli.trajectory.recorded.hermite import HermiteSpline
from vsacli.trajectory.times import RecordedTimes
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

MIN_CHECK_INSTANTS = 4000
"""Largest number of evenly spaced instants at which bounds are checked."""

FEWEST_LOOKED_AT = 1000
"""Smallest number of such instants, even if a motion has fewer samples."""

NOTHING = np.empty(0)

TOWARDS_END = (1e-5, 0.05, 150)
"""Range of further instants near each end, as shares of the path, and their number: when an arm with a
hardening spring started, torques between evenly spaced instants were 8e-4 larger than at them."""

PACE_ORDERS = 4
"""Rows of the pace: the fourth derivative of a motion depends on the third derivative of the pace."""


class PacedMotion:
    """A robot's motion at instants of its path.

    Args:
        robot: robot that executes the motion.
        trajectory: trajectory whose functions of time define the path.
        s: path coordinates of the instants, (instants,), seconds from the start of the trajectory.
    """

    def __init__(self, robot: Robot, trajectory: Trajectory, s: FloatArray) -> None:
        self.robot, self.s = robot, s
        motion = trajectory.at(trajectory.start + s)
        self._path = PathCommands(robot, motion)
        self._latest_commands: tuple[bytes, list[Command]] | None = None

    def commands(self, pace: Sequence[Row], instants: IndexArray) -> list[Command]:
        """Return the command of each joint, with link torques, for a pace with its derivatives.

        The last result is cached, since joints are evaluated one after the other. Without it, the timing of
        least energy of a 3R takes 1.3 times as long.
        """
        values = np.stack([*(value_of(row) for row in pace), instants])
        key = values.tobytes() + type(pace[0]).__name__.encode()
        if self._latest_commands is None or self._latest_commands[0] != key:
            self._latest_commands = key, self._path.at(Speeds.of(pace), instants)
        return self._latest_commands[1]

    @property
    def resting(self) -> BoolArray:
        """Mask of the inner instants at which all joints rest, also at both neighbors, (instants,)."""
        is_at_rest: BoolArray = np.all(
            [
                np.abs(row) <= REST_SPEED_SHARE * np.abs(row).max()
                for name in POSITION.names[1:]
                for row in self._path.by_s[name]
            ],
            axis=0,
        )
        is_inner = (self.s > 0) & (self.s < self.s[-1])
        return np.asarray(is_at_rest & np.roll(is_at_rest, 1) & np.roll(is_at_rest, -1) & is_inner)

    def stiffness(self, joint: int) -> FloatArray:
        """Return the commanded stiffness of a joint, (instants,)."""
        return np.asarray(self._path.by_s[STIFFNESS.key][joint])


def checked_instants(
    trajectory: Trajectory, duration: float, further_instants: FloatArray = NOTHING
) -> FloatArray:
    """Return the path coordinates s at which bounds are checked: even, and ever denser towards both ends.

    Near a start from rest, a high pace can violate a bound before the motion has moved noticeably.

    Args:
        trajectory: trajectory that defines the path.
        duration: length of the checked part of the path, s.
        further_instants: coordinates to include, s.
    """
    even_shares = np.linspace(
        0.0, 1.0, min(max(2 * trajectory.samples - 1, FEWEST_LOOKED_AT), MIN_CHECK_INSTANTS)
    )
    end_shares = np.geomspace(*TOWARDS_END)
    return np.union1d(
        duration * np.unique(np.concatenate([even_shares, end_shares, 1 - end_shares])), further_instants
    )


CLEARANCE = 1e-4
"""Relative distance from each bound at the checked instants, as an allowance for the time between them: with
4000 instants, the motor of a hardening spring exceeded its limit by 2e-5 between them."""

MIN_PACE = 0.02
"""Smallest pace, fifty times as fast as commanded; beyond that, wrong units are more likely."""

INDEPENDENT_VARIABLES = ("q", "damping")
"""Limited variables that do not depend on the pace."""


class Pace:
    """The `Functions` of the pace alone: the time, and a lower bound on the pace.

    Args:
        held: mask of the instants at which the motion pauses, (instants,); pauses must not be shortened.
        duration: scale of the time, s.
    """

    def __init__(self, held: BoolArray, duration: float) -> None:
        self._is_paused, self._duration = held, duration

    def __call__(
        self, rows: Sequence[Dual] | FloatArray, instants: IndexArray
    ) -> tuple[list[Any], list[Any]]:
        """Return the integrand of the time, and the bound on the pace; see `Functions`."""
        return [rows[0] / self._duration], [min_pace(self._is_paused)[instants] - rows[0]]


def min_pace(held: BoolArray) -> FloatArray:
    """Return the lower bound of the pace, (instants,): the commanded pace where the motion pauses."""
    return np.where(held, 1.0, MIN_PACE)


class PacedJoint:
    """The `Functions` of pace and, if it varies, stiffness, with their derivatives, and of a level.

    Args:
        motion: motion of all joints.
        index: index of the joint.
        min_margin: required margin.
        criterion: cost of the joint.
        scale: scale of that cost.
        share: weight of the cost in that of all joints.
        reserve: required clearance to limits in addition to `CLEARANCE`, as a share of each.
        varied: whether the stiffness varies.

    Attributes:
        criterion: cost of the joint.
        scale: scale of that cost.
        smoothings: smoothings of the cost in successive searches.
        name: name of the joint.
    """

    def __init__(
        self,
        motion: PacedMotion,
        index: int,
        min_margin: float,
        criterion: Criterion = NO_COST,
        scale: Scale = UNSCALED,
        share: float = 1.0,
        reserve: float = 0.0,
        *,
        varied: bool = False,
    ) -> None:
        self._motion, self._index, self._min_margin = motion, index, min_margin
        self.criterion, self.scale, self._share = criterion, scale, share
        self.smoothings = criterion.smoothings
        self._clearance = CLEARANCE + reserve
        self._joint = motion.robot.joints[index]
        self.name = self._joint.name
        self._seeded_joint = (
            with_seeded_stiffness(self._joint, PACE_ORDERS + STIFFNESS.orders * varied, moving_corridor=True)
            if self._joint.actuator.sprung
            else with_copied_actuator(self._joint)
        )
        fixed_variables = INDEPENDENT_VARIABLES if varied else (*INDEPENDENT_VARIABLES, STIFFNESS.key)
        self._checks = [check for check in limit_checks(self._joint) if check.variable not in fixed_variables]
        self._has_stiffness = STIFFNESS.key in self._joint.actuator.commanded

    @property
    def bound_names(self) -> list[str]:
        """Names of the first bounds; the bounds after these belong to levels."""
        return [*(ENDS_OF_CORRIDOR if self._has_stiffness else ()), *limit_names(self._checks)]

    @property
    def bound_count(self) -> int:
        """Number of bounds."""
        return len(self.bound_names) + self.criterion.bound_count(self._joint)

    def weights(self, s: FloatArray) -> FloatArray:
        """Return the weights of each integrand at each instant, (integrands, instants)."""
        return self._share * self.criterion.weights(s)

    def __call__(
        self, rows: Sequence[Dual] | FloatArray, instants: IndexArray
    ) -> tuple[list[Any], list[Any]]:
        """Return the integrands of the cost over the path, and the bounds; see `Functions`."""
        level_start = len(rows) - self.criterion.levels
        pace, stiffness, level = (
            list(rows[:PACE_ORDERS]),
            list(rows[PACE_ORDERS:level_start]),
            rows[level_start:],
        )
        with np.errstate(all="ignore"):  # a step of the search may leave the attainable range
            command = self._motion.commands(pace, instants)[self._index]
            if len(stiffness):
                rates = Speeds.of(pace).rates(stiffness)
                stiffness_commands = dict(zip(STIFFNESS.names, rates, strict=True))
                command = command._replace(commanded={**command.commanded, **stiffness_commands})
            joint = self._seeded_joint if isinstance(pace[0], Dual) else self._joint
            drive_variables = drive_without_limits(joint, command, self._min_margin)
            excess = limit_bounds(self._checks, drive_variables.by_name(), self._clearance)
            bounds = [*self._attainable_range_bounds(drive_variables), *excess]
            cost_arguments = (self._joint, drive_variables, level[0] if len(level) else None, self.scale)
            integrands = list(self.criterion.integrands(*cost_arguments))
            for index in self.criterion.over_time:  # dt = pace ds
                integrands[index] = integrands[index] * pace[0]
        return integrands, [*bounds, *self.criterion.bounds(*cost_arguments)]

    def _attainable_range_bounds(self, drive_variables: JointVariables) -> Iterator[Any]:
        if self._has_stiffness:
            min_margin = self._min_margin
            yield (
                drive_variables.stiffness_min / ((1 - min_margin) * drive_variables.stiffness) - 1 + CLEARANCE
            )
            is_unbounded = np.isinf(drive_variables.stiffness_max)
            required = (1 + min_margin) * drive_variables.stiffness
            relative_max = np.where(is_unbounded, 1.0, drive_variables.stiffness_max) / required
            yield np.where(is_unbounded, -1.0, 1 + CLEARANCE - relative_max)


NEWTON_STEPS = 6
"""Newton steps that find s at a time down to rounding, from a linear interpolation."""

GRID_POINTS = 4000
"""Points of that interpolation."""


def retimed(
    trajectory: Trajectory,
    pace: BSpline[np.float64],
    stiffness: Mapping[int, BSpline[np.float64]],
    name: str,
    refinement: int = 1,
) -> Trajectory:
    """Return the motion along the path of a trajectory at a pace dt/ds, at about the same sample rate.

    Args:
        trajectory: trajectory that defines the path; the coordinate s is the time since its start.
        pace: pace as a function of s.
        stiffness: new stiffness as a function of s, by joint index.
        name: name of the result.
        refinement: factor by which the sample rate is increased.
    """
    elapsed = pace.antiderivative()
    duration = float(elapsed(trajectory.duration) - elapsed(0.0))
    rate = (trajectory.samples - 1) / trajectory.duration
    time = np.linspace(0.0, duration, refinement * max(1, round(duration * rate)) + 1)
    s = path_at(time, pace, trajectory.duration)
    speeds = Speeds.of([pace(s, nu=order) for order in range(PACE_ORDERS)])
    motion = trajectory.at(trajectory.start + s)
    arrays = {each: by_joint(rows) for each, rows in motion.variables().items() if each != "time"}
    for index, spline in stiffness.items():
        for order, each in enumerate(STIFFNESS.names):
            arrays[each][index] = spline(s, nu=order)

    def recorded(signal: Signal) -> HermiteSpline:
        by_s = np.stack([arrays[each][signal.columns] for each in signal.variables])
        return HermiteSpline(signal=signal, time=time, rows=np.stack(speeds.rates(list(by_s))))

    wrench = trajectory.wrench and trajectory.wrench.changed(lambda signal, _: recorded(signal))
    commanded = {
        key: recorded(COMMANDED[key]) for key in trajectory.commanded if trajectory.chosen(key).any()
    }
    return Trajectory(RecordedTimes(time), recorded(POSITION), commanded, wrench=wrench, name=name)


def path_at(time: FloatArray, pace: BSpline[np.float64], end: float) -> FloatArray:
    """Return s at times since the start, (samples,), by Newton's method."""
    elapsed = pace.antiderivative()
    grid = np.linspace(0.0, end, GRID_POINTS)
    s = np.interp(time, elapsed(grid) - elapsed(0.0), grid)
    for _ in range(NEWTON_STEPS):
        s = np.clip(s - (elapsed(s) - elapsed(0.0) - time) / pace(s), 0.0, end)
    return s
