"""Objectives: rms or peak of the motor torques, energy, copper loss.

Each `Criterion` is a sum of integrands for the interior-point method, and a number computed from a run.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol

import numpy as np

from vsacli.actuators.reach import LimitCheck
from vsacli.actuators.transmission import JointVariables
from vsacli.analysis.run import Run
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.units import ENERGY, TORQUE, Quantity
from vsacli.base.variables import VARIABLES
from vsacli.compute.duals import Dual
from vsacli.dynamics.drive import drive
from vsacli.dynamics.losses import trapezoidal_weights
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.robot.parameters import with_copied_actuator
from vsacli.studies.search.interior_point import (
    FIRST_GAP,
    WARM_GAP,
    Minimum,
    Problem,
    minimize,
    minimize_all,
)
from vsacli.studies.search.loads import Load
from vsacli.studies.sensitivities.joint_derivatives import ImplicitSolution
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vsacli.dynamics.energy import JointEnergy


Values = Dual | FloatArray
"""Arrays (instants,), which may carry derivatives."""

SMOOTHINGS = (0.1, 0.01, 1e-3)
"""Widths over which the positive part of power is smoothed in successive searches, relative to the mean
power. The last one overestimates a cost by at most half as much, and moves the optimum by less."""


class Scale(NamedTuple):
    """Size of a cost in its unit, duration in s, and smoothing relative to the mean power."""

    cost: float = 1.0
    duration: float = 1.0
    smoothing: float = 0.0


UNSCALED = Scale()


class MotorsOfRun(NamedTuple):
    """The variables of a run on which costs depend; there is no self-check, which would take longer.

    Attributes:
        robot: robot.
        time: times of the samples, (samples,) in s.
        tau_motor: motor torques, (samples, joints, 2), N m (N).
        elastic_energy: energy in the springs, (samples, joints), J.
        energies: energy of each joint over the run.
    """

    robot: Robot
    time: FloatArray
    tau_motor: FloatArray
    elastic_energy: FloatArray
    energies: Sequence[JointEnergy]

    @classmethod
    def of(cls, robot: Robot, trajectory: Trajectory) -> MotorsOfRun:
        """Return the variables of a run along a trajectory."""
        run = Run(robot, trajectory)
        block_columns = [(block.time, block.tau_motor, block.elastic_energy) for block in run]
        time, tau_motor, elastic_energy = map(np.concatenate, zip(*block_columns, strict=True))
        return cls(robot, time, tau_motor, elastic_energy, run.energies())

    def torques(self, index: int) -> FloatArray:
        """Return the torques of the motors that a joint has, (motors, samples)."""
        return self.tau_motor[:, index].T[: self.robot.joints[index].actuator.motor_count]


@dataclass(frozen=True)
class Criterion:
    """A cost of a joint: an integral over time, or a level that bounds values from above.

    Attributes:
        name: name on the command line.
        words: name in reports.
        quantity: physical quantity of the cost.
        relative: whether the costs of several joints are compared relative to their commanded costs.
        over_time: indices of the integrands that are integrated over time; others are summed over instants.
        levels: number of unknowns besides the motion: 1 if the cost is a level, otherwise 0.
        smoothings: smoothing of the cost in successive searches.
        repeating: whether the motion is periodic.
    """

    name: ClassVar[str]
    words: ClassVar[str]
    quantity: ClassVar[Quantity] = ENERGY
    relative: ClassVar[bool] = False
    over_time: ClassVar[tuple[int, ...]] = (0,)
    levels: ClassVar[int] = 0
    smoothings: ClassVar[tuple[float, ...]] = (0.0,)
    repeating: bool = False

    def check(self, joint: Joint) -> None:
        """Check that the cost can be computed for a joint.

        Raises:
            InputError: the joint lacks a parameter.
        """

    def integrands(
        self, joint: Joint, driven: JointVariables, level: Values | None, scale: Scale
    ) -> Sequence[Any]:
        """Return the integrands of the scaled cost, each (instants,).

        Args:
            joint: joint whose cost it is.
            driven: motion and torques of the joint's motors.
            level: level, in the scale of the cost, if the cost is one.
            scale: scale of the cost.
        """
        raise NotImplementedError

    def weights(self, time: FloatArray) -> FloatArray:
        """Return the weights of each integrand at each instant, (integrands, instants)."""
        return trapezoidal_weights(time)[None]

    def bound_count(self, joint: Joint) -> int:  # noqa: ARG002
        """Return the number of `bounds`."""
        return 0

    def bounds(
        self, _joint: Joint, _driven: JointVariables, _level: Values | None, _scale: Scale
    ) -> Sequence[Any]:
        """Return bounds, each (instants,), which a sufficiently large level makes negative."""
        return ()

    def of(self, joint: Joint, driven: JointVariables, time: FloatArray) -> float:
        """Return the cost, in its unit."""
        raise NotImplementedError

    def size(self, joint: Joint, driven: JointVariables, time: FloatArray) -> float:
        """Return a scale for the cost from its value for some motion."""
        return self.of(joint, driven, time)

    def of_run(self, run: MotorsOfRun, index: int) -> float:
        """Return the cost of a joint, by index, over a run; NaN if any sample is infeasible."""
        raise NotImplementedError

    def together(self, costs: Sequence[float]) -> float:
        """Combine the costs of all joints, or their ratios to the commanded costs."""
        return math.fsum(costs)


class NoCost(Criterion):
    """A cost of zero, for searches that minimize the time."""

    over_time = ()

    def integrands(
        self, _joint: Joint, _driven: JointVariables, _level: Values | None, _scale: Scale
    ) -> Sequence[Any]:
        """Return no integrand."""
        return ()

    def weights(self, time: FloatArray) -> FloatArray:
        """Return no weights, (0, instants)."""
        return np.zeros((0, len(time)))


NO_COST = NoCost()


class Torque(Criterion):
    """Root mean square of the motor torques over time and the motors of the joint."""

    name = "torque"
    words = "rms motor torque"
    quantity = TORQUE
    relative = True

    def integrands(
        self, joint: Joint, driven: JointVariables, _level: Values | None, scale: Scale
    ) -> Sequence[Any]:
        """Return the mean square of the motor torques."""
        torques = _motor_rows(joint, driven.tau_motor)
        return [sum(torque * torque for torque in torques) / (len(torques) * scale.cost**2)]

    def weights(self, time: FloatArray) -> FloatArray:
        """Return the weights of a mean over time."""
        return np.asarray(trapezoidal_weights(time)[None] / (time[-1] - time[0]))

    def of(self, joint: Joint, driven: JointVariables, time: FloatArray) -> float:
        """Return the rms torque, N m (N)."""
        (square,) = self.integrands(joint, driven, None, UNSCALED)
        return math.sqrt(float(self.weights(time)[0] @ square))

    def of_run(self, run: MotorsOfRun, index: int) -> float:
        """Return the rms torque, N m (N), by the trapezoidal rule."""
        square = np.mean(run.torques(index) ** 2, axis=0)
        return math.sqrt(float(self.weights(run.time)[0] @ square))

    def together(self, costs: Sequence[float]) -> float:
        """Return the root mean square of the costs."""
        return math.hypot(*costs) / math.sqrt(len(costs))


class CopperLoss(Criterion):
    """Copper loss of the motors of the joint."""

    name = "copper_loss"
    words = "copper loss"

    def check(self, joint: Joint) -> None:
        """Check that the motors have a resistance."""
        if not all(joint.has_columns(VARIABLES["copper_loss"])[: joint.actuator.motor_count]):
            raise InputError.one(
                f"the motors of {joint.name} have no resistance, which copper loss requires; add "
                "torque_constant and resistance to the robot file, or use --minimize torque"
            )

    def integrands(
        self, joint: Joint, driven: JointVariables, _level: Values | None, scale: Scale
    ) -> Sequence[Any]:
        """Return the copper loss of all motors."""
        return [sum(_motor_rows(joint, driven.copper_loss)) / scale.cost]

    def of(self, joint: Joint, driven: JointVariables, time: FloatArray) -> float:
        """Return the heat, J."""
        (power,) = self.integrands(joint, driven, None, UNSCALED)
        return float(trapezoidal_weights(time) @ power)

    def of_run(self, run: MotorsOfRun, index: int) -> float:
        """Return the heat in the report of the run, J."""
        heat = run.energies[index].copper_loss
        return math.nan if heat is None else heat


class Energy(Criterion):
    """Positive work of the motors of the joint, without energy recovery.

    Unless the motion is periodic, the energy in the springs at the start counts as well, since loading them
    required it.
    """

    name = "energy"
    words = "positive motor work"
    smoothings = SMOOTHINGS

    def integrands(
        self, joint: Joint, driven: JointVariables, _level: Values | None, scale: Scale
    ) -> Sequence[Any]:
        """Return the smoothed positive part of the motor power, and the energy in the springs."""
        width = scale.smoothing * scale.cost / scale.duration
        powers = _motor_rows(joint, driven.motor_power)
        positive = [(power + np.sqrt(power * power + width * width)) / 2 for power in powers]
        return [sum(positive) / scale.cost, driven.elastic_energy / scale.cost]

    def weights(self, time: FloatArray) -> FloatArray:
        """Return the weights of an integral over time, and of the value at the start."""
        initial_weight = np.zeros_like(time)
        initial_weight[0] = 0.0 if self.repeating else 1.0
        return np.stack([trapezoidal_weights(time), initial_weight])

    def of(self, joint: Joint, driven: JointVariables, time: FloatArray) -> float:
        """Return the energy, J."""
        positive_power = sum(np.maximum(power, 0.0) for power in _motor_rows(joint, driven.motor_power))
        return float(np.sum(self.weights(time) * np.stack([positive_power, driven.elastic_energy])))

    def of_run(self, run: MotorsOfRun, index: int) -> float:
        """Return the positive work in the report of the run and the initial spring energy, J."""
        spent = run.energies[index].spent
        return spent if self.repeating else spent + float(run.elastic_energy[0, index])

    def size(self, joint: Joint, driven: JointVariables, time: FloatArray) -> float:
        """Return the absolute work of the motors, since their positive work may be zero."""
        absolute_power = sum(map(np.abs, _motor_rows(joint, driven.motor_power)))
        return float(trapezoidal_weights(time) @ absolute_power) or 1.0


class Peak(Criterion):
    """The largest motor torque of the joint."""

    name = "peak"
    words = "peak motor torque"
    quantity = TORQUE
    relative = True
    over_time = ()
    levels = 1

    def integrands(
        self, _joint: Joint, _driven: JointVariables, level: Values | None, _scale: Scale
    ) -> Sequence[Any]:
        """Return the level."""
        return [level]

    def weights(self, time: FloatArray) -> FloatArray:
        """Return equal weights of sum one, so that the cost is the level."""
        return np.full((1, len(time)), 1 / len(time))

    def bound_count(self, joint: Joint) -> int:
        """Return two bounds for each motor."""
        return 2 * joint.actuator.motor_count

    def bounds(
        self, joint: Joint, driven: JointVariables, level: Values | None, scale: Scale
    ) -> Sequence[Any]:
        """Return the excess of each torque, in both directions, over the level."""
        torques = _motor_rows(joint, driven.tau_motor)
        return [sign * torque / scale.cost - level for torque in torques for sign in (1.0, -1.0)]

    def of(self, joint: Joint, driven: JointVariables, _time: FloatArray) -> float:
        """Return the peak torque, N m (N)."""
        return float(max(np.abs(torque).max() for torque in _motor_rows(joint, driven.tau_motor)))

    def of_run(self, run: MotorsOfRun, index: int) -> float:
        """Return the peak torque, N m (N)."""
        return float(np.abs(run.torques(index)).max())

    def together(self, costs: Sequence[float]) -> float:
        """Return the largest cost."""
        return max(costs)


CRITERIA = {criterion.name: criterion for criterion in (Torque, Energy, CopperLoss, Peak)}
"""Criteria by name."""


ENDS_OF_CORRIDOR = "minimum attainable stiffness", "maximum attainable stiffness"


def limit_names(checks: Sequence[LimitCheck]) -> list[str]:
    """Return the names of the `limit_bounds`."""
    return [check.flag.quantity_of(check.motor) for check in checks for _ in _finite_ends(check)]


def limit_bounds(
    checks: Sequence[LimitCheck], joint_variables: Mapping[str, Any], clearance: float
) -> Iterator[Any]:
    """Yield the excess of variables over their limits relative to the limits, plus the clearance."""
    for check in checks:
        for sign, bound in _finite_ends(check):
            scale = abs(bound) or 1.0
            yield sign * (check.values(joint_variables) - bound) / scale + clearance


def _finite_ends(check: LimitCheck) -> Iterator[tuple[float, float]]:
    """Yield the finite ends of a range, each after the sign of the direction that leads outside."""
    yield from ((sign, end) for sign, end in zip((-1.0, 1.0), check.range, strict=True) if np.isfinite(end))


def with_seeded_stiffness(joint: Joint, directions: int, *, moving_corridor: bool) -> Joint:
    """Return a copy of a joint whose actuator accepts a stiffness that carries derivatives.

    Args:
        joint: joint to copy.
        directions: number of derivatives that the stiffness carries; each motor adds one for phi.
        moving_corridor: whether the ends of the attainable range carry derivatives as well.
    """
    seeded_joint = with_copied_actuator(joint)
    implicit = ImplicitSolution(
        joint.actuator, seeded_joint.actuator, directions + joint.actuator.motor_count
    )
    solve = implicit.solve if moving_corridor else implicit.solve_within
    object.__setattr__(seeded_joint.actuator, "solve", solve)
    return seeded_joint


def _motor_rows(joint: Joint, variable: Any) -> list[Any]:
    """Return the rows of the motors that the joint has."""
    return [variable[motor] for motor in range(joint.actuator.motor_count)]


def run_costs(robot: Robot, trajectory: Trajectory, criteria: Mapping[int, Criterion]) -> dict[int, float]:
    """Return the costs of a run, by joint index; NaN for a joint with an infeasible sample."""
    run = MotorsOfRun.of(robot, trajectory)
    return {index: criterion.of_run(run, index) for index, criterion in criteria.items()}


def commanded_cost_scale(joint: Joint, load: Load, criterion: Criterion) -> float:
    """Return the scale of the cost of a load as commanded; NaN if it is infeasible."""
    samples = load.at(load.steps)
    return criterion.size(joint, drive(joint, samples.command), samples.time)


ROUGH_GAP = 1e-5
"""Last barrier of a search from a distant start, as an increase of the cost by the bounds: a tenth of the
difference within which two starts count as equal."""


class Costed(Protocol):
    """A part of a problem with a cost that can be smoothed, in successive searches by `smoothings`."""

    scale: Scale

    @property
    def smoothings(self) -> Sequence[float]: ...  # noqa: D102


def smoothed_minimum(problem: Problem, start: FloatArray, gap: float, costed: Sequence[Costed]) -> Minimum:
    """Return a minimum of a cost; a cold search smooths it less and less.

    A cold search is as accurate as the comparison of starts requires; a warm one continues from the best.

    Args:
        problem: sum of the costs, with bounds.
        start: unknowns that keep all bounds.
        gap: increase of the cost by the bounds at the first barrier; above `WARM_GAP` the search is cold.
        costed: parts of the problem with these costs, all with the same criterion.
    """
    if gap > WARM_GAP:
        return rough_minima(problem, [start], costed, gap)[0]
    _set_smoothing(costed, costed[0].smoothings[-1])
    minimum = minimize(problem, start, gap)
    if not minimum.found:  # steps became short; with new multipliers they are long again
        minimum = minimize(problem, minimum.unknowns, WARM_GAP)
    return minimum


def rough_minima(
    problem: Problem, starts: Sequence[FloatArray], costed: Sequence[Costed], gap: float = FIRST_GAP
) -> list[Minimum]:
    """Return a minimum near each of several starts, as accurate as their comparison requires.

    See `smoothed_minimum`; only a cold search smooths the cost more than in the end.
    """
    smoothings = costed[0].smoothings
    minima: list[Minimum] = []
    for smoothing in smoothings if gap > WARM_GAP else smoothings[-1:]:
        _set_smoothing(costed, smoothing)
        last_gap = ROUGH_GAP if smoothing == smoothings[-1] else WARM_GAP
        minima = minimize_all(problem, starts, gap, last_gap)
        starts, gap = [each.unknowns for each in minima], WARM_GAP
    return minima


def _set_smoothing(costed: Sequence[Costed], smoothing: float) -> None:
    for each in costed:
        each.scale = each.scale._replace(smoothing=smoothing)
