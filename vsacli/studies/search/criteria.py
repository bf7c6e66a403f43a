"""Objectives: rms or peak of the motor torques, energy, heat in the windings; also over a run."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol

import numpy as np

from vsacli.actuators.reach import LimitCheck, OfJoint
from vsacli.analysis.run import inverse_dynamics
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.units import ENERGY, TORQUE, Quantity
from vsacli.base.variables import VARIABLES
from vsacli.compute.duals import Dual
from vsacli.dynamics.drive import drive
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.robot.parameters import apart
from vsacli.studies.search.interior_point import LAST_GAP, WARM_GAP, Minimum, Problem, minimise
from vsacli.studies.search.loads import Load
from vsacli.studies.sensitivities.joint_derivatives import ImplicitSolution
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vsacli.analysis.result import Result


Values = Dual | FloatArray
"""(instants,), which may carry derivatives."""

SMOOTHINGS = (0.1, 0.01, 1e-3)
"""Shares of the mean power over which the positive part of power is smoothed, one after the other: with
the last, a cost is overestimated by at most half as much, and the place of the optimum moves by less."""


class Scale(NamedTuple):
    """Scale of a cost in its unit, its duration, s, and its smoothing."""

    cost: float = 1.0
    duration: float = 1.0
    smoothing: float = 0.0


UNSCALED = Scale()


@dataclass(frozen=True)
class Criterion:
    """A cost of a joint: an integral over time, or a level that bounds something.

    Attributes:
        name: as on the command line.
        words: for reports.
        quantity: its quantity.
        relative: whether joints, taken together, count relative to their cost as commanded.
        over_time: places of the integrands that are integrated over time; others count at instants.
        levels: rows besides those of the motion: 1 if the cost is a level that bounds something, else 0.
        smoothings: how much it is smoothed, one search after the other.
        repeating: whether the motion ends as it begins, on its way.
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
        """Refuse a joint of which it cannot be computed.

        Raises:
            InputError: something is not given.
        """

    def integrands(self, joint: Joint, driven: OfJoint, level: Values | None, scale: Scale) -> Sequence[Any]:
        """Return the integrands of the scaled cost, each (instants,).

        Args:
            joint: the joint.
            driven: motion and torques of its motors.
            level: the further row, if there is one, scaled in the same way.
            scale: of the cost.
        """
        raise NotImplementedError

    def weights(self, time: FloatArray) -> FloatArray:
        """Return the weights of each integrand at each instant, (integrands, instants)."""
        weights: FloatArray = trapezoidal(time)[None]
        return weights

    def bound_count(self, joint: Joint) -> int:  # noqa: ARG002
        """Number of `bounds`."""
        return 0

    def bounds(self, joint: Joint, driven: OfJoint, level: Values | None, scale: Scale) -> Sequence[Any]:  # noqa: ARG002
        """Return values that a level keeps from being positive, each (instants,)."""
        return ()

    def of(self, joint: Joint, driven: OfJoint, time: FloatArray) -> float:
        """The cost itself, in its unit."""
        raise NotImplementedError

    def size(self, joint: Joint, driven: OfJoint, time: FloatArray) -> float:
        """Return the scale of the cost: its value for some motion."""
        return self.of(joint, driven, time)

    def of_run(self, result: Result, index: int) -> float:
        """Return the cost of a joint, by index, over the steps of a run; NaN if any is out of reach."""
        raise NotImplementedError

    def together(self, costs: Sequence[float]) -> float:
        """Return the cost of all joints, relative to the commanded costs if these are relative."""
        return math.fsum(costs)


class NoCost(Criterion):
    """The cost where something else is minimized."""

    over_time = ()

    def integrands(
        self, _joint: Joint, _driven: OfJoint, _level: Values | None, _scale: Scale
    ) -> Sequence[Any]:
        """Return the integrands of the scaled cost, each (instants,)."""
        return ()

    def weights(self, time: FloatArray) -> FloatArray:
        """None."""
        return np.zeros((0, len(time)))


NO_COST = NoCost()


class Torque(Criterion):
    """Root mean square over time and the motors of the joint."""

    name = "torque"
    words = "rms motor torque"
    quantity = TORQUE
    relative = True

    def integrands(self, joint: Joint, driven: OfJoint, _level: Values | None, scale: Scale) -> Sequence[Any]:
        """The mean square."""
        torques = _of_motors(joint, driven["tau_motor"])
        return [sum(torque * torque for torque in torques) / (len(torques) * scale.cost**2)]

    def weights(self, time: FloatArray) -> FloatArray:
        """Return the weights of a mean."""
        weights: FloatArray = trapezoidal(time)[None] / (time[-1] - time[0])
        return weights

    def of(self, joint: Joint, driven: OfJoint, time: FloatArray) -> float:
        """N m (N)."""
        (square,) = self.integrands(joint, driven, None, UNSCALED)
        return math.sqrt(float(self.weights(time)[0] @ square))

    def of_run(self, result: Result, index: int) -> float:
        """N m (N); by trapezoids between the steps."""
        square = np.mean(_torques_of(result, index) ** 2, axis=0)
        return math.sqrt(float(self.weights(result.time)[0] @ square))

    def together(self, costs: Sequence[float]) -> float:
        """Root mean square."""
        return math.hypot(*costs) / math.sqrt(len(costs))


class Copper(Criterion):
    """Heat in the windings of the motors of the joint."""

    name = "copper"
    words = "heat in the windings"

    def check(self, joint: Joint) -> None:
        """Refuse motors without resistance."""
        if not all(joint.has(VARIABLES["copper_loss"])[: joint.actuator.motor_count]):
            raise InputError.one(
                f"the motors of {joint.name} have no resistance, without which their heat is not known; give "
                "torque_constant and resistance, or --minimize torque"
            )

    def integrands(self, joint: Joint, driven: OfJoint, _level: Values | None, scale: Scale) -> Sequence[Any]:
        """The power of all windings."""
        return [sum(_of_motors(joint, driven["copper_loss"])) / scale.cost]

    def of(self, joint: Joint, driven: OfJoint, time: FloatArray) -> float:
        """J."""
        (power,) = self.integrands(joint, driven, None, UNSCALED)
        return float(trapezoidal(time) @ power)

    def of_run(self, result: Result, index: int) -> float:
        """J, as in the report of the run."""
        heat = result.report.joints[index].energy.copper_loss
        return math.nan if heat is None else heat


class Energy(Criterion):
    """Positive work of the motors of the joint, without energy recovered.

    Unless the motion repeats itself, the energy in its springs at the start counts as well: someone loaded
        them.
    """

    name = "energy"
    words = "energy spent"
    smoothings = SMOOTHINGS

    def integrands(self, joint: Joint, driven: OfJoint, _level: Values | None, scale: Scale) -> Sequence[Any]:
        """The positive part of each power, smoothed; and the energy in the springs."""
        width = scale.smoothing * scale.cost / scale.duration
        powers = _of_motors(joint, driven["motor_power"])
        positive = [(power + np.sqrt(power * power + width * width)) / 2 for power in powers]
        return [sum(positive) / scale.cost, driven["elastic_energy"] / scale.cost]

    def weights(self, time: FloatArray) -> FloatArray:
        """Return an integral, and the value at the start."""
        loaded = np.zeros_like(time)
        loaded[0] = 0.0 if self.repeating else 1.0
        return np.stack([trapezoidal(time), loaded])

    def of(self, joint: Joint, driven: OfJoint, time: FloatArray) -> float:
        """J."""
        spent = sum(np.maximum(power, 0.0) for power in _of_motors(joint, driven["motor_power"]))
        return float(np.sum(self.weights(time) * np.stack([spent, driven["elastic_energy"]])))

    def of_run(self, result: Result, index: int) -> float:
        """J, as in the report of the run."""
        spent = result.report.joints[index].energy.spent
        return spent if self.repeating else spent + float(result.elastic_energy[0, index])

    def size(self, joint: Joint, driven: OfJoint, time: FloatArray) -> float:
        """Return the absolute work of the motors: their positive work may be nothing."""
        passed = sum(map(np.abs, _of_motors(joint, driven["motor_power"])))
        return float(trapezoidal(time) @ passed) or 1.0


class Peak(Criterion):
    """The largest motor torque of the joint."""

    name = "peak"
    words = "peak motor torque"
    quantity = TORQUE
    relative = True
    over_time = ()
    levels = 1

    def integrands(
        self, _joint: Joint, _driven: OfJoint, level: Values | None, _scale: Scale
    ) -> Sequence[Any]:
        """The level."""
        return [level]

    def weights(self, time: FloatArray) -> FloatArray:
        """Return the weights of a mean."""
        return np.full((1, len(time)), 1 / len(time))

    def bound_count(self, joint: Joint) -> int:
        """Two a motor."""
        return 2 * joint.actuator.motor_count

    def bounds(self, joint: Joint, driven: OfJoint, level: Values | None, scale: Scale) -> Sequence[Any]:
        """The torques, either way."""
        torques = _of_motors(joint, driven["tau_motor"])
        return [sign * torque / scale.cost - level for torque in torques for sign in (1.0, -1.0)]

    def of(self, joint: Joint, driven: OfJoint, _time: FloatArray) -> float:
        """N m (N)."""
        return float(max(np.abs(torque).max() for torque in _of_motors(joint, driven["tau_motor"])))

    def of_run(self, result: Result, index: int) -> float:
        """N m (N)."""
        return float(np.abs(_torques_of(result, index)).max())

    def together(self, costs: Sequence[float]) -> float:
        """Return the largest."""
        return max(costs)


CRITERIA = {criterion.name: criterion for criterion in (Torque, Energy, Copper, Peak)}
"""Criteria of the stiffness, by name."""


def trapezoidal(time: FloatArray) -> FloatArray:
    """Weights of the trapezoidal rule, (instants,), s."""
    halves = np.diff(time) / 2
    weights: FloatArray = np.append(halves, 0.0) + np.append(0.0, halves)
    return weights


ENDS_OF_CORRIDOR = "lower end of the corridor", "upper end of the corridor"


def limit_names(checks: Sequence[LimitCheck]) -> list[str]:
    """Return words for the `limit_bounds`."""
    return [check.flag.quantity_of(check.motor) for check in checks for _ in _finite_ends(check)]


def limit_bounds(
    checks: Sequence[LimitCheck], of_joint: Mapping[str, Any], clearance: float
) -> Iterator[Any]:
    """Yield how far variables are beyond limits less a clearance, relative to these."""
    for check in checks:
        for sign, bound in _finite_ends(check):
            size = abs(bound) or 1.0
            yield sign * (check.values(of_joint) - bound) / size + clearance


def _finite_ends(check: LimitCheck) -> Iterator[tuple[float, float]]:
    """Yield the ends of a range that bound anything, each with the direction that is outside."""
    yield from ((sign, end) for sign, end in zip((-1.0, 1.0), check.range, strict=True) if np.isfinite(end))


def made_to_carry(joint: Joint, directions: int, *, moving_corridor: bool) -> Joint:
    """Return the joint with an actuator that takes a stiffness that carries derivatives.

    Args:
        joint: the joint.
        directions: of derivatives; one more a motor serves phi.
        moving_corridor: whether the ends of the corridor carry derivatives, too.
    """
    carrying = apart(joint)
    implicit = ImplicitSolution(joint.actuator, carrying.actuator, directions + joint.actuator.motor_count)
    solve = implicit.solve if moving_corridor else implicit.solve_within
    object.__setattr__(carrying.actuator, "solve", solve)
    return carrying


def _of_motors(joint: Joint, variable: Any) -> list[Any]:
    """Return the rows of the motors there are."""
    return [variable[motor] for motor in range(joint.actuator.motor_count)]


def _torques_of(result: Result, index: int) -> FloatArray:
    """Return the torques of the motors of a joint at the steps of a run, (motors, steps)."""
    torques: FloatArray = result.tau_motor[:, index].T[: result.robot.joints[index].actuator.motor_count]
    return torques


def run_costs(robot: Robot, trajectory: Trajectory, criteria: Mapping[int, Criterion]) -> dict[int, float]:
    """Return the costs of joints, by index, over the steps of a run; NaN where any is out of reach."""
    result = inverse_dynamics(robot, trajectory)
    return {index: criterion.of_run(result, index) for index, criterion in criteria.items()}


def asked_size(joint: Joint, load: Load, criterion: Criterion) -> float:
    """Return the scale of the cost of a load as commanded; NaN if it is out of reach."""
    steps = load.at(load.steps)
    return criterion.size(joint, drive(joint, steps.command), steps.time)


ROUGH_GAP = 1e-5
"""Increase of the cost by bounds after a search from far; a tenth of the difference that two starts may
have."""


class Costed(Protocol):
    """Anything with a cost that can be smoothed."""

    criterion: Criterion
    scale: Scale


def smoothed_minimum(problem: Problem, start: FloatArray, gap: float, costed: Sequence[Costed]) -> Minimum:
    """Return a minimum of a cost that is smoothed less and less, far from it at least.

    From far it is found as well as comparing starts takes; a warm search goes on from the best of these.

    Args:
        problem: the sum of the costs, with bounds.
        start: unknowns that keep all bounds.
        gap: increase of the cost by bounds at the first barrier.
        costed: parts with these costs, all by one criterion.
    """
    smoothings = costed[0].criterion.smoothings
    cold = gap > WARM_GAP
    for smoothing in smoothings if cold else smoothings[-1:]:
        for each in costed:
            each.scale = each.scale._replace(smoothing=smoothing)
        last = WARM_GAP if smoothing != smoothings[-1] else ROUGH_GAP if cold else LAST_GAP
        found = minimise(problem, start, gap, last)
        start, gap = found.unknowns, WARM_GAP
    if not cold and not found.found:  # steps became short; with new multipliers they are long again
        found = minimise(problem, start, gap, last)
    return found
