"""The check every run makes of itself: do the numbers satisfy what they were computed from?"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.reach import margin
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.flags import Flag, has
from vsacli.base.json_records import Stored, named
from vsacli.base.signals import COMMANDED
from vsacli.base.variables import VARIABLES, Block
from vsacli.compute.engine import NUMPY, Engine
from vsacli.dynamics.inverse import compute_block
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vsacli.dynamics.internal_motion import InternalMotions

SPRING_BOUND = 1e-11
"""Bound on the scaled residual of (14); solutions reach 1e-15, and 1e-12 is asked of them."""

DRIFT_BOUND = 1e-6
"""The same where the deflections are followed by integration: below what spring constants are known to."""

LADDER_BOUND = 1e-8
"""Bound on derivative errors relative to their peak: a hundred times what rounding leaves, a millionth of
1 %. Where differences must be taken over short steps rounding leaves more, see `ROUNDING_GAIN`."""

ROUNDING_GAIN = 30.0
"""What rounding may leave of a difference over the step h, relative to the derivative, in eps T/h.

A time up to T is rounded by eps T/2, a value v by some eps v, so that a difference is off by
eps (T v' + v)/h, which relative to the peak of v' is eps T/h, or a few times that, since v is hardly above
T v'. For motions that are declared T/h is 4000 and the bound above is larger. Recordings have a knot a
sample, and h must stay between knots: with 1e6 samples T/h is 5e7 and the bound 3e-7. On 34 recordings of 2
to 30 s at 5 to 50 kHz, of arms of 2 to 7 joints, at most 2 eps T/h were seen, and once 21, where the rounding
of stamps since 1970 was interpolated.
"""


class Rung(NamedTuple):
    """A variable, its derivative, and the variable of which that is the derivative of an order."""

    value: str
    derivative: str
    whole: str
    order: int


RUNGS = (
    Rung("tau_e", "dtau_e", "tau_e", 1),
    Rung("dtau_e", "ddtau_e", "tau_e", 2),
    Rung("phi", "dphi", "phi", 1),
    Rung("theta", "dtheta", "theta", 1),
    Rung("dtheta", "ddtheta", "theta", 2),
    Rung("stiffness", "dstiffness", "stiffness", 1),
    Rung("dstiffness", "ddstiffness", "stiffness", 2),
)
"""What is compared; the deflections by themselves, since the motion of the joint can hide them in theta, the
stiffness where it is not commanded."""

PROBES = 200
"""About how many times are probed."""

STEP_SCALES = np.array([8.0**-power for power in range(5)])
"""Difference steps tried at each time; the best counts, since a wrong derivative is wrong at every step.

The smallest are for motions that leave the corridor within a thousandth of their duration.
"""

FIRST_SCALES = STEP_SCALES[:2]
"""Those that are tried first: for most motions the smaller ones only add rounding."""

CLEAR = 1e-10
"""Error at which smaller steps are not tried any more, a hundredth of the bound."""

WEIGHTS = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60
"""Central first difference of sixth order over the offsets -3..3."""

SMALL_JOINT = 1e-3
"""Share of the largest joint's peak against which smaller joints are measured: what is below may be nothing
but rounding of the larger torques."""


@dataclass(frozen=True)
class SelfCheck(Stored):
    """Outcome of the self-check.

    Attributes:
        spring_residual: largest scaled residual of (14); NaN, like `ladder`, if a number is missing.
        ladder: largest relative error of a derivative against differences of what it derives.
        spring_bound: bound on the residual of (14).
        ladder_bound: bound on the error of a derivative, where it is nearest to its bound.
    """

    spring_residual: float
    ladder: float
    spring_bound: float = SPRING_BOUND
    ladder_bound: float = LADDER_BOUND

    shape: ClassVar = {**named("passed", "spring_residual", "ladder"), "bound": "ladder_bound"}

    @property
    def passed(self) -> bool:
        """Whether both are within their bounds."""
        return self.spring_residual <= self.spring_bound and self.ladder <= self.ladder_bound


def spring_residual(robot: Robot, block: Block) -> float:
    """Largest scaled residual of (14) on the regular steps, from the laws evaluated at phi.

    Scaled as |sum tau_k - tau_e| / sum |tau_k| and |sum sigma_k - sigma| / sigma. An elastic joint has one
    law; a rigid one has none, and so no residual.
    """
    errors = []
    for index, joint in enumerate(robot.joints):
        if not joint.actuator.sprung:
            continue
        regular = ~has(block.flags[:, index], Flag.INFEASIBLE | Flag.SINGULAR)
        of_joint = {name: values[..., regular] for name, values in block.of_joint(index).items()}
        tau_e, stiffness = of_joint["tau_e"], of_joint["stiffness"]
        carried = joint.actuator.carried(of_joint)
        size = np.maximum(carried.size, np.finfo(float).tiny)
        missing = np.abs(carried.tau_e - tau_e)
        if joint.damper_at("transmission"):  # whose torque may be zero where nothing else is small
            size = np.maximum(size, np.maximum(size, np.abs(tau_e)).max(initial=0.0))
            missing = np.abs(carried.tau_e + of_joint["tau_damper"] - tau_e)
            missing = np.maximum(missing - _rounding_of_damper(of_joint), 0.0)
        errors += [missing / size, np.abs(carried.stiffness - stiffness) / stiffness]
    return float(np.max(np.concatenate([np.zeros(1), *errors])))


def _rounding_of_damper(of_joint: Mapping[str, FloatArray]) -> FloatArray:
    """What rounding leaves of the torque of a damper, whose velocity is the difference theta' - q'."""
    rounding: FloatArray = 4 * np.finfo(float).eps * of_joint["damping"] * np.abs(of_joint["dq"])
    return rounding


def ladder(
    robot: Robot,
    trajectory: Trajectory,
    engine: Engine = NUMPY,
    internal: InternalMotions | None = None,
) -> tuple[float, float]:
    """Largest error of a derivative of `RUNGS` against first differences, relative to its peak; its bound.

    Differences are taken at about 200 times with steps of their own, over which the trajectory is analytic.
    Motor motion is compared where it is smooth over the difference. Of the errors that is the largest which
    is nearest to, or farthest beyond, what rounding admits with its step. The engine is that
    of the run, and so is what moves inside damped transmissions.
    """
    trajectory = trajectory.from_zero()
    times, reach = trajectory.check_points(PROBES)
    steps = np.minimum(reach / 3, trajectory.duration / 500)

    def compute(time: FloatArray) -> Block:
        inside = {} if internal is None else internal.at(time)
        return compute_block(robot, trajectory.at(time), engine=engine, internal=inside)

    errors, everywhere = _ladder(robot, trajectory, compute, times, FIRST_SCALES[:, None] * steps)
    if not (everywhere and errors.max() <= CLEAR):
        errors, _ = _ladder(robot, trajectory, compute, times, STEP_SCALES[:, None] * steps)
    rounding = ROUNDING_GAIN * np.finfo(float).eps * trajectory.duration / (FIRST_SCALES[-1] * steps)
    bounds = np.maximum(LADDER_BOUND, rounding)
    worst = int(np.argmax(errors / bounds))
    return float(errors[worst]), float(bounds[worst])


def _ladder(
    robot: Robot,
    trajectory: Trajectory,
    compute: Callable[[FloatArray], Block],
    times: FloatArray,
    steps: FloatArray,
) -> tuple[FloatArray, bool]:
    """The errors at times by the best of some difference steps; whether all motors were compared at each.

    Args:
        robot: the robot.
        trajectory: what it is asked to do.
        compute: gives everything at times.
        times: (times,), s.
        steps: (scales, times), s.
    """
    grid = times + steps[:, None, :] * np.arange(-3, 4)[None, :, None]
    block = compute(grid.ravel())
    smooth = _motors_move_smoothly(block, grid.shape)

    def on_grid(name: str) -> FloatArray:
        values: FloatArray = getattr(block, name).reshape(*grid.shape, len(robot.joints), -1)
        return np.where([_compared(joint.actuator, name) for joint in robot.joints], values, 0.0)

    errors = [
        _rung_error(
            on_grid(rung.value),
            on_grid(rung.derivative),
            steps,
            np.ones_like(smooth) if rung.value.endswith("tau_e") else smooth,
            np.abs(on_grid(rung.whole)) / trajectory.duration**rung.order,
        )
        for rung in RUNGS
    ]
    return np.max(errors, axis=0), bool(smooth.any(axis=0).all())


def _compared(actuator: Actuator, name: str) -> list[bool]:
    """Which columns of a variable of joints or motors are computed, not commanded, at such an actuator."""
    commanded = {name for key in actuator.commanded for name in COMMANDED[key].names}
    return [False] if name in commanded else actuator.has(VARIABLES[name])


def _motors_move_smoothly(block: Block, shape: tuple[int, ...]) -> BoolArray:
    """Over which differences, (scales, times, joints), of a block of the shape (scales, offsets, times).

    No step is infeasible, singular or near-singular, and the margin changes by less than a tenth: the motors'
    motion has features as short as the way to the end of the corridor.
    """
    troubled = has(block.flags, Flag.INFEASIBLE | Flag.SINGULAR | Flag.NEAR_SINGULAR).reshape(*shape, -1)
    gap = margin(block.stiffness, block.stiffness_lower, block.stiffness_upper).reshape(*shape, -1)
    hasty = np.ptp(gap, axis=1) > gap[:, shape[1] // 2] / 10
    smooth: BoolArray = ~(np.any(troubled, axis=1) | hasty)
    return smooth


def _rung_error(
    values: FloatArray, derivatives: FloatArray, steps: FloatArray, compared: BoolArray, slowest: FloatArray
) -> FloatArray:
    """Error of a derivative over its peak, (times,).

    Args:
        values: of what is derived, (scales, offsets, times, joints, motors).
        derivatives: that are to be checked, likewise.
        steps: (scales, times), s.
        compared: (scales, times, joints).
        slowest: |derivative| if the change took the whole trajectory; below may be only rounding.
    """
    difference = np.einsum("o,sotjm->stjm", WEIGHTS, values) / steps[:, :, None, None]
    error = np.where(compared[..., None], np.abs(difference - derivatives[:, 3]), np.inf).min(axis=0)
    valid: BoolArray = np.any(compared, axis=0)
    peak = np.maximum(_peak(derivatives[0, 3], valid), _peak(slowest[0, 3], valid))
    scale = np.maximum(peak, SMALL_JOINT * peak.max())
    error = np.where(valid[..., None], error, 0.0)
    relative = np.divide(error, scale, out=np.zeros_like(error), where=scale != 0)
    return np.asarray(np.max(relative, axis=(1, 2)))


def _peak(values: FloatArray, valid: BoolArray) -> FloatArray:
    peak: FloatArray = np.max(np.abs(values), axis=0, where=valid[..., None], initial=0.0)
    return peak
