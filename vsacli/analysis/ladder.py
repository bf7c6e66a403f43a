"""The part of the self-check that holds derivatives against differences of what they derive."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.reach import margin
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.flags import Flag, has
from vsacli.base.signals import COMMANDED
from vsacli.base.variables import VARIABLES, Block
from vsacli.compute.engine import NUMPY, Engine
from vsacli.dynamics.balances import BalancedDynamics
from vsacli.dynamics.inverse import block_of, usual_block
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vsacli.dynamics.internal_motion import InternalMotions

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
"""About how many times are probed, and steps at which the laws of springs are evaluated apart."""

STEP_SCALES = np.array([8.0**-power for power in range(5)])
"""Difference steps tried at each time; the best counts, since a wrong derivative is wrong at every step.

The smallest are for motions that leave the corridor within a thousandth of their duration.
"""

FIRST_SCALES = STEP_SCALES[:2]
"""Those that are tried first: for most motions the smaller ones only add rounding."""

CLEAR = 1e-10
"""Error at which smaller steps are not tried any more, a hundredth of the bound."""

OFFSETS = np.arange(-3, 4)
"""Steps from the time that is probed to those at which its differences are taken."""

MIDDLE = len(OFFSETS) // 2
"""The place of that time among them."""

WEIGHTS = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60
"""Central first difference of sixth order over these offsets."""

SMALL_JOINT = 1e-3
"""Share of the largest joint's peak against which smaller joints are measured: what is below may be nothing
but rounding of the larger torques."""


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

    frame = None if trajectory.wrench is None else trajectory.wrench.frame
    damped = () if internal is None else internal.joints
    kernel = BalancedDynamics(robot, frame, internal=damped)  # as that of the run, which is compiled

    def compute(time: FloatArray) -> Block:
        inside = {} if internal is None else internal.at(time)
        return block_of(kernel, trajectory.at(time), engine, internal=inside)

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

    So many times are computed together as fill a block, since a run has the memory for one.

    Args:
        robot: the robot.
        trajectory: what it is asked to do.
        compute: gives everything at times.
        times: (times,), s.
        steps: (scales, times), s.
    """
    errors, everywhere = [_RungErrors() for _ in RUNGS], True
    together = max(1, usual_block(len(robot.joints)) // (len(steps) * len(OFFSETS)))
    for start in range(0, len(times), together):
        part = slice(start, start + together)
        grid = times[part] + steps[:, None, part] * OFFSETS[:, None]
        block = compute(grid.ravel())
        smooth = _motors_move_smoothly(block, grid.shape)
        everywhere = everywhere and bool(smooth.any(axis=0).all())
        for rung, found in zip(RUNGS, errors, strict=True):
            value, derivative, whole = (
                _on_grid(robot, block, name, grid.shape) for name in (rung.value, rung.derivative, rung.whole)
            )
            compared = np.ones_like(smooth) if rung.value.endswith("tau_e") else smooth
            slowest = np.abs(whole[0, MIDDLE]) / trajectory.duration**rung.order
            found.add(value, derivative, steps[:, part], compared, slowest)
    return np.max([found.relative() for found in errors], axis=0), everywhere


def _on_grid(robot: Robot, block: Block, name: str, shape: tuple[int, ...]) -> FloatArray:
    """A variable of a block of the shape (scales, offsets, times), (*shape, joints, motors or 1)."""
    values: FloatArray = getattr(block, name).reshape(*shape, len(robot.joints), -1)
    return np.where([_compared(joint.actuator, name) for joint in robot.joints], values, 0.0)


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
    hasty = np.ptp(gap, axis=1) > gap[:, MIDDLE] / 10
    smooth: BoolArray = ~(np.any(troubled, axis=1) | hasty)
    return smooth


class _RungErrors:
    """Errors of a derivative over its peak; `add` times in order, then ask for the errors at all of them."""

    def __init__(self) -> None:
        self._errors: list[FloatArray] = []
        self._peak: FloatArray | float = 0.0

    def add(
        self,
        values: FloatArray,
        derivatives: FloatArray,
        steps: FloatArray,
        compared: BoolArray,
        slowest: FloatArray,
    ) -> None:
        """Merge some times.

        Args:
            values: of what is derived, (scales, offsets, times, joints, motors).
            derivatives: that are to be checked, likewise.
            steps: (scales, times), s.
            compared: (scales, times, joints).
            slowest: |derivative| if the change took the whole trajectory, (times, joints, motors); below may
                be only rounding.
        """
        difference = np.einsum("o,sotjm->stjm", WEIGHTS, values) / steps[:, :, None, None]
        derivative = derivatives[:, MIDDLE]
        error = np.where(compared[..., None], np.abs(difference - derivative), np.inf).min(axis=0)
        valid: BoolArray = np.any(compared, axis=0)[..., None]
        self._errors.append(np.where(valid, error, 0.0))
        for size in (np.abs(derivative[0]), slowest):
            self._peak = np.maximum(self._peak, np.max(size, axis=0, where=valid, initial=0.0))

    def relative(self) -> FloatArray:
        """The largest error of any joint at each time, (times,)."""
        error = np.concatenate(self._errors)
        scale = np.maximum(self._peak, SMALL_JOINT * np.max(self._peak))
        relative = np.divide(error, scale, out=np.zeros_like(error), where=scale != 0)
        return np.asarray(np.max(relative, axis=(1, 2)))
