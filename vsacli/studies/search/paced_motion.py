"""A motion along its path at another pace: commands, costs and bounds of joints as functions of the pace.

The path parameter s is the time of the motion as commanded; the pace is p = dt/ds, so that time is its
integral. A function of s has the rates df/dt = f_s/p and so on, by the chain rule.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from vsacli.actuators.reach import OfJoint
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray, by_joint
from vsacli.base.signals import COMMANDED, POSITION, STIFFNESS, WRENCH, Signal
from vsacli.compute.duals import Dual, value_of
from vsacli.dynamics.drive import driven_by
from vsacli.dynamics.limits import limit_checks
from vsacli.robot.model import Robot
from vsacli.robot.parameters import apart
from vsacli.studies.search.criteria import (
    ENDS_OF_CORRIDOR,
    NO_COST,
    UNSCALED,
    Criterion,
    Scale,
    limit_bounds,
    limit_names,
    made_to_carry,
)
from vsacli.studies.search.loads import AT_REST
from vsacli.studies.search.path_commands import PathCommands, Row, Speeds
from vsacli.trajectory.profile import WrenchProfile
from vsacli.trajectory.recorded.hermite import HermiteSpline
from vsacli.trajectory.times import RecordedTimes
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

LOOKED_AT = 4000
"""Instants at which bounds are looked at to see where they are missed, at most."""

FEWEST_LOOKED_AT = 1000
"""The same at least, however few steps a motion has."""

NOTHING = np.empty(0)

TOWARDS_END = (1e-5, 0.05, 150)
"""Shares of the path between which further instants towards each end are, and how many: where an arm with
a hardening spring started, torques between even instants were 8e-4 larger than at them."""

PACE_ORDERS = 4
"""The pace and its derivatives by s that the fourth derivative of a motion takes."""


class PacedMotion:
    """A robot's motion at instants of its path.

    Args:
        robot: the robot.
        trajectory: whose smooth functions are the path.
        s: instants, (instants,), seconds from the start of the trajectory.
    """

    def __init__(self, robot: Robot, trajectory: Trajectory, s: FloatArray) -> None:
        self.robot, self.s = robot, s
        motion = trajectory.at(trajectory.start + s)
        self._path = PathCommands(robot, motion)
        self._known: tuple[bytes, list[Command]] | None = None

    def commands(self, pace: Sequence[Row], instants: IndexArray) -> list[Command]:
        """Return the commands of each joint, with link torques, at a pace with its derivatives.

        The last request is kept: joints are evaluated one after the other.
        """
        values = np.stack([*(value_of(row) for row in pace), instants])
        key = values.tobytes() + type(pace[0]).__name__.encode()
        if self._known is None or self._known[0] != key:
            self._known = key, self._path.at(Speeds.of(pace), instants)
        return self._known[1]

    @property
    def resting(self) -> BoolArray:
        """Instants at which all joints rest, and go on resting, (instants,)."""
        still: BoolArray = np.all(
            [
                np.abs(row) <= AT_REST * np.abs(row).max()
                for name in POSITION.names[1:]
                for row in self._path.by_s[name]
            ],
            axis=0,
        )
        inner = (self.s > 0) & (self.s < self.s[-1])
        resting: BoolArray = still & np.roll(still, 1) & np.roll(still, -1) & inner
        return resting

    def stiffness(self, joint: int) -> FloatArray:
        """Return the commanded stiffness, (instants,)."""
        stiffness: FloatArray = self._path.by_s[STIFFNESS.key][joint]
        return stiffness

    def stiffness_rates(self, pace: Sequence[Row], by_s: Sequence[Row]) -> list[Row]:
        """Return a stiffness along the path, and its two derivatives by time."""
        return Speeds.of(pace).rates(by_s)


def instants_of(trajectory: Trajectory, duration: float, further: FloatArray = NOTHING) -> FloatArray:
    """Return the instants at which bounds are checked, s: even, and ever denser towards both ends.

    A motion that begins at rest has hardly begun where its pace, which may be high there, is past its worst.

    Args:
        trajectory: the path.
        duration: of its part that is looked at, s.
        further: instants of that part that shall be among them, s.
    """
    even = np.linspace(0.0, 1.0, min(max(2 * trajectory.samples - 1, FEWEST_LOOKED_AT), LOOKED_AT))
    towards = np.geomspace(*TOWARDS_END)
    return np.union1d(duration * np.unique(np.concatenate([even, towards, 1 - towards])), further)


CLEARANCE = 1e-4
"""Share of each bound by which a motion keeps clear of it at the instants that are looked at, for what lies
between them: with 4000 of them a hardening spring's motor exceeded its limit by 2e-5 there."""

FASTEST = 0.02
"""Least pace: fifty times as fast as commanded, more than which the units are more likely to be wrong."""

NOT_OF_THE_PACE = ("q", "damping")
"""Variables with limits that no pace changes; nor that of a stiffness that does not vary."""


class Pace:
    """The `Functions` of the pace itself: time, and bounds on it.

    Args:
        held: where the motion rests on its way, (instants,): it shall not rest for a shorter time.
        duration: by which time is scaled, s.
    """

    def __init__(self, held: BoolArray, duration: float) -> None:
        self._held, self._duration = held, duration

    def __call__(
        self, rows: Sequence[Dual] | FloatArray, instants: IndexArray
    ) -> tuple[list[Any], list[Any]]:
        """Time, and the distance of the pace from its bound."""
        return [rows[0] / self._duration], [least_pace(self._held)[instants] - rows[0]]


def least_pace(held: BoolArray) -> FloatArray:
    """Return the smallest tried pace, (instants,), or the commanded one where the motion pauses."""
    return np.where(held, 1.0, FASTEST)


class PacedJoint:
    """The `Functions` of the pace, of a stiffness if it varies, both with their derivatives, and of a level.

    Args:
        motion: of all joints.
        index: of the joint.
        near_singular: the margin.
        criterion: its cost.
        share: that its cost has in that of all joints.
        reserve: share of each limit that is kept clear of besides `CLEARANCE`.
        varied: whether the stiffness varies.

    Attributes:
        criterion: its cost.
        scale: of that cost.
    """

    def __init__(
        self,
        motion: PacedMotion,
        index: int,
        near_singular: float,
        criterion: Criterion = NO_COST,
        scale: Scale = UNSCALED,
        share: float = 1.0,
        reserve: float = 0.0,
        *,
        varied: bool = False,
    ) -> None:
        self._motion, self._index, self._near_singular = motion, index, near_singular
        self.criterion, self.scale, self._share = criterion, scale, share
        self._clearance = CLEARANCE + reserve
        self._joint = motion.robot.joints[index]
        self._carrying = (
            made_to_carry(self._joint, PACE_ORDERS + STIFFNESS.orders, moving_corridor=True)
            if self._joint.actuator.sprung
            else apart(self._joint)
        )
        fixed = NOT_OF_THE_PACE if varied else (*NOT_OF_THE_PACE, STIFFNESS.key)
        self._checks = [check for check in limit_checks(self._joint) if check.variable not in fixed]
        self._chosen = STIFFNESS.key in self._joint.actuator.commanded

    @property
    def name(self) -> str:
        """Name of the joint."""
        return self._joint.name

    @property
    def bound_names(self) -> list[str]:
        """Words for the first bounds; those after are of levels."""
        return [*(ENDS_OF_CORRIDOR if self._chosen else ()), *limit_names(self._checks)]

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
        """Integrands of the cost over the path, and the bounds; see `Functions`."""
        behind = len(rows) - self.criterion.levels
        pace, stiffness, level = list(rows[:PACE_ORDERS]), list(rows[PACE_ORDERS:behind]), rows[behind:]
        with np.errstate(all="ignore"):  # a step of the search may leave the corridor
            command = self._motion.commands(pace, instants)[self._index]
            if len(stiffness):
                rates = self._motion.stiffness_rates(pace, stiffness)
                asked = dict(zip(STIFFNESS.names, rates, strict=True))
                command = command._replace(commanded={**command.commanded, **asked})
            joint = self._carrying if isinstance(pace[0], Dual) else self._joint
            driven = driven_by(joint, command, self._near_singular)
            variables = {**command.arrays(), **driven}
            bounds = [*self._corridor(driven), *limit_bounds(self._checks, variables, self._clearance)]
            costed = (self._joint, driven, level[0] if len(level) else None, self.scale)
            integrands = list(self.criterion.integrands(*costed))
            for index in self.criterion.over_time:  # dt = pace ds
                integrands[index] = integrands[index] * pace[0]
        return integrands, [*bounds, *self.criterion.bounds(*costed)]

    def _corridor(self, driven: OfJoint) -> Iterator[Any]:
        if self._chosen:
            margin = self._near_singular
            yield driven["stiffness_min"] / ((1 - margin) * driven["stiffness"]) - 1 + CLEARANCE
            unbounded = np.isinf(driven["stiffness_max"])
            upper = np.where(unbounded, 1.0, driven["stiffness_max"]) / ((1 + margin) * driven["stiffness"])
            yield np.where(unbounded, -1.0, 1 + CLEARANCE - upper)


NEWTON_STEPS = 6
"""Steps that find s at a time, from where a line between two of many instants leads, to rounding."""

FIRST_LOOK = 4000
"""Instants between which these lines are drawn."""


def retimed(
    trajectory: Trajectory,
    pace: BSpline[np.float64],
    stiffness: Mapping[int, BSpline[np.float64]],
    name: str,
    refined: int = 1,
) -> Trajectory:
    """Return the motion of a trajectory along its path at a pace dt/ds, at about its own rate.

    Args:
        trajectory: the path, whose parameter s is the time since its start.
        pace: over the path.
        stiffness: over the path, of joints by index that get another one.
        name: of the result.
        refined: times the rate.
    """
    elapsed = pace.antiderivative()
    duration = float(elapsed(trajectory.duration) - elapsed(0.0))
    rate = (trajectory.samples - 1) / trajectory.duration
    time = np.linspace(0.0, duration, refined * max(1, round(duration * rate)) + 1)
    s = path_at(time, pace, trajectory.duration)
    speeds = Speeds.of([pace(s, nu=order) for order in range(PACE_ORDERS)])
    motion = trajectory.at(trajectory.start + s)
    arrays = {each: by_joint(rows) for each, rows in motion.variables().items() if each != "time"}
    for index, spline in stiffness.items():
        for order, each in enumerate(STIFFNESS.names):
            arrays[each][index] = spline(s, nu=order)

    def recorded(signal: Signal) -> HermiteSpline:
        by_s = np.stack([arrays[each] for each in signal.names])
        return HermiteSpline(signal=signal, time=time, rows=np.stack(speeds.rates(list(by_s))))

    wrench = None if motion.wrench is None else WrenchProfile(recorded(WRENCH), motion.wrench.frame)
    commanded = {
        key: recorded(COMMANDED[key]) for key in trajectory.commanded if trajectory.chosen(key).any()
    }
    return Trajectory(RecordedTimes(time), recorded(POSITION), commanded, wrench=wrench, name=name)


def path_at(time: FloatArray, pace: BSpline[np.float64], end: float) -> FloatArray:
    """S at times since the start, (samples,), by Newton's method."""
    elapsed = pace.antiderivative()
    known = np.linspace(0.0, end, FIRST_LOOK)
    s = np.interp(time, elapsed(known) - elapsed(0.0), known)
    for _ in range(NEWTON_STEPS):
        s = np.clip(s - (elapsed(s) - elapsed(0.0) - time) / pace(s), 0.0, end)
    return s
