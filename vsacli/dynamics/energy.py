"""Energy of a run: work of the motors, elastic energy, co-contraction and losses, integrated over time.

`IntervalEnergy` computes the energy that flows between two samples, `EnergyMeter` sums it up, `RunEnergy`
runs both over the blocks of a run.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.base.arrays import FloatArray, contiguous_rows, over_time
from vsacli.base.json_records import Stored, named
from vsacli.base.variables import VARIABLES, Block
from vsacli.compute.control_flow import call
from vsacli.compute.engine import Engine
from vsacli.compute.rows import RowLayout
from vsacli.compute.vector import is_zero
from vsacli.dynamics.losses import LossMeter, LostEnergy, integral, positive_work, work_on_each_other
from vsacli.dynamics.variants import RobotKernel, Variants
from vsacli.robot.model import Robot


@dataclass(frozen=True)
class JointEnergy(Stored):
    """Energy of a joint over a run; except for the peak, NaN if the torques at a sample do not exist.

    For two springs, tau_1^2 + tau_2^2 = tau_e^2/2 + (tau_1 - tau_2)^2/2. The first term is the minimum, with
    which two motors carry half of the load each. The second, co-contraction, moves nothing and is required by
    the stiffness. With other springs, or a spring between the motors, torques do not split like this.

    Attributes:
        elastic_peak: Largest energy in the springs, J, over the samples at which it exists.
        spent: Integral of the positive part of each motor's power, summed over the motors, J.
        recovered: Integral of the negative part, J; spent - recovered is the work of the motors.
        co_contraction: Root mean square over time of (tau_1 - tau_2)/2, N m (N); NaN where
            torques do not split.
        load: Root mean square of tau_e/2, as above.
        dissipated: Energy lost to friction and damping of joint and motors, J; None without dry friction.
        copper_loss: Heat in the windings of the motors, J; None if no resistance is given.
    """

    elastic_peak: float
    spent: float
    recovered: float
    co_contraction: float
    load: float
    dissipated: float | None = None
    copper_loss: float | None = None

    shape: ClassVar = {
        **named("elastic_peak", "spent", "recovered", "co_contraction", "load", "co_contraction_share"),
        "dissipated?": "dissipated",
        "copper_loss?": "copper_loss",
    }

    @property
    def co_contraction_share(self) -> float:
        """Share of the co-contraction in the time integral of tau_1^2 + tau_2^2; NaN if that is zero."""
        squared = self.co_contraction**2 + self.load**2
        return self.co_contraction**2 / squared if squared else math.nan


class Flow(NamedTuple):
    """Energy that flows in consecutive intervals; for motors (joints, 2, intervals), NaN for missing ones.

    Attributes:
        intervals: Lengths of the intervals, (intervals,), s.
        work: Work of each motor, J.
        spent: Positive part of the work, J.
        load: Integral of (tau_1 + tau_2)^2/4, (joints, intervals).
        co_contraction: Integral of (tau_1 - tau_2)^2/4, (joints, intervals).
        dissipated: Energy lost to friction and damping, (joints, intervals), J; None without dry friction.
        copper: Heat in the windings of each motor, J; None if unknown.
    """

    intervals: FloatArray
    work: FloatArray
    spent: FloatArray
    load: FloatArray
    co_contraction: FloatArray
    dissipated: FloatArray | None = None
    copper: FloatArray | None = None


class Efforts(NamedTuple):
    """(tau_1 + tau_2)^2/4 and (tau_1 - tau_2)^2/4, each integrated over an interval."""

    load: FloatArray
    co_contraction: FloatArray


def efforts(interval: FloatArray, before: Iterable[FloatArray], after: Iterable[FloatArray]) -> Efforts:
    """Return the common and the opposing effort of two springs over intervals, by the trapezoidal rule.

    Args:
        interval: Length, s.
        before: Torques of both springs at the beginning of the interval.
        after: Torques of both springs at its end.
    """
    (tau_1, tau_2), (next_1, next_2) = before, after
    return Efforts(
        *(
            interval / 8 * (end * end + begin * begin)
            for begin, end in ((tau_1 + tau_2, next_1 + next_2), (tau_1 - tau_2, next_1 - next_2))
        )
    )


class EnergyMeter:
    """Sum of energy over a run: `add` flows, `add_stored` elastic energy, then `report`.

    Terms are added interval by interval, so that rounding does not depend on the division into blocks. All
    arrays of a batch of runs have an axis of variants before that of the intervals.
    """

    def __init__(self) -> None:
        self._work: FloatArray | float = 0.0
        self._totals: FloatArray | float = 0.0
        self._layout = RowLayout({})
        self._peak: FloatArray | float = math.nan

    def add(self, flow: Flow) -> FloatArray:
        """Add a flow; return the work up to the end of each interval, which overwrites `flow.work`."""
        totals = {
            name: terms for name, terms in flow._asdict().items() if name != "work" and terms is not None
        }
        self._layout = RowLayout({name: terms.shape[:-1] for name, terms in totals.items()})
        rows = np.concatenate([terms.reshape(-1, terms.shape[-1]) for terms in totals.values()])
        columns = np.ascontiguousarray(rows.T)  # so that NumPy adds one interval after the other
        columns[0] += self._totals
        self._totals = np.add.reduce(columns, axis=0)
        work = flow.work
        work[..., 0] += self._work
        np.add.accumulate(work, axis=-1, out=work)
        self._work = work[..., -1].copy()
        return work

    def add_stored(self, elastic_energy: FloatArray) -> None:
        """Add the elastic energy at samples, (joints[, variants], samples), J, to the peak."""
        self._peak = np.fmax(self._peak, np.fmax.reduce(elastic_energy, axis=-1))

    def report(self, robot: Robot, variant: int | None = None) -> list[JointEnergy]:
        """Return the energy of each joint of a robot; at least one flow must have been added.

        Args:
            robot: Robot.
            variant: Its index in a batch; None without an axis of variants.
        """
        selection = ... if variant is None else (..., variant)
        has_motor = [[side < joint.actuator.motor_count for side in range(SIDES)] for joint in robot.joints]
        totals = {
            name: total[selection] for name, total in self._layout.arrays(np.asarray(self._totals)).items()
        }
        works = np.asarray(self._work)[selection], totals["spent"]
        work, spent = (np.sum(total, axis=1, where=has_motor) for total in works)
        duration = float(totals["intervals"])
        co_contracts = [joint.actuator.co_contracts for joint in robot.joints]
        efforts = [
            np.where(co_contracts, _root_mean(totals[name], duration), np.nan)
            for name in ("co_contraction", "load")
        ]
        energies = np.array((np.asarray(self._peak)[selection], spent, spent - work, *efforts))
        losses = zip(_dissipated_energies(robot, totals), _copper_losses(robot, totals), strict=True)
        return [
            replace(JointEnergy(*values), dissipated=dissipated, copper_loss=copper_loss)
            for values, (dissipated, copper_loss) in zip(energies.T.tolist(), losses, strict=True)
        ]


def _dissipated_energies(robot: Robot, totals: Mapping[str, FloatArray]) -> list[float | None]:
    if not robot.has_variable(VARIABLES["dissipated_power"]):
        return [None] * len(robot.joints)
    return list(map(float, totals["dissipated"]))


def _copper_losses(robot: Robot, totals: Mapping[str, FloatArray]) -> Iterator[float | None]:
    for index, joint in enumerate(robot.joints):
        heated = joint.has_columns(VARIABLES["copper_loss"])
        yield float(np.sum(totals["copper"][index, heated])) if any(heated) else None


def _root_mean(squares: FloatArray, duration: float) -> FloatArray:
    """Return the root of the mean over time; NaN if no time has passed."""
    return np.sqrt(squares / duration) if duration else np.full_like(squares, np.nan)


END_VARIABLES = ("dtheta", "motor_power", "tau_transmission", "passed_power", "passed_rate")
"""Variables from which the work of motors in an interval follows, at both its ends."""


@dataclass(frozen=True)
class IntervalEnergy(RobotKernel):
    """Kernel of the energy that flows between samples; a sample of its rows is an interval.

    The work of a motor is the sum of the integral of `passed_power`, the change of B theta'^2/2, the work of
    dry friction, and the work by the acceleration of the other motor through B_12.

    Attributes:
        robot: Robot.
        with_friction: Whether the work of dry friction is an input.
    """

    robot: Robot
    with_friction: bool

    def of_robot(self, robot: Robot) -> Self:
        """See `RobotKernel.of_robot`."""
        return replace(self, robot=robot)

    @cached_property
    def end_variables(self) -> tuple[str, ...]:
        """Names of the input variables at both ends of an interval."""
        coupled = not all(is_zero(joint.actuator.coupled_rotors) for joint in self.robot.joints)
        return (*END_VARIABLES, "ddtheta") if coupled else END_VARIABLES

    @cached_property
    def arguments(self) -> RowLayout:
        """Layout of the input rows: length, variables before and after, and the work of dry friction."""
        motors = (len(self.robot.joints), SIDES)
        friction = {"friction": motors} if self.with_friction else {}
        return RowLayout({"interval": (), **dict.fromkeys(self.end_variables, (2, *motors)), **friction})

    @cached_property
    def results(self) -> RowLayout:
        """Layout of the output rows, as in `Flow`."""
        joints = (len(self.robot.joints),)
        motors = dict.fromkeys(("work", "spent"), (*joints, SIDES))
        return RowLayout({**motors, **dict.fromkeys(("load", "co_contraction"), joints)})

    def __call__(self, rows: Sequence[Any]) -> list[Any]:
        """Compute the energy joint by joint."""
        inputs = self.arguments.unpack(rows)
        (interval,) = inputs["interval"]
        joints = self.robot.joints
        friction = _motor_pairs(inputs["friction"]) if self.with_friction else [None] * len(joints)
        both_ends = [
            {name: _rows_at_end(inputs[name], end) for name in self.end_variables} for end in range(2)
        ]
        flows = []
        for index, joint in enumerate(joints):
            inertia = tuple(motor.inertia for motor in joint.actuator.motors)
            ends = [
                {name: pairs_of_joints[index] for name, pairs_of_joints in end.items()} for end in both_ends
            ]
            constants = inertia, joint.actuator.coupled_rotors
            flows.append(call(interval, _joint_flow, *constants, interval, ends, friction[index]))
        works, spent, joint_efforts = zip(*flows, strict=True)
        row_groups = works, spent, zip(*joint_efforts, strict=True)
        return [row for group in row_groups for rows_of_joint in group for row in rows_of_joint]


def _joint_flow(
    inertia: Sequence[float],
    coupling: float,
    interval: FloatArray,
    ends: Sequence[Mapping[str, Sequence[FloatArray]]],
    friction: Sequence[FloatArray] | None,
) -> tuple[list[FloatArray], list[FloatArray], Efforts]:
    """Return work, positive work and efforts of both motors of a joint; NaN for a missing motor."""
    works = [np.full_like(interval, np.nan)] * SIDES
    for side, rotor_inertia in enumerate(inertia):
        power_and_rate = ((end["passed_power"][side], end["passed_rate"][side]) for end in ends)
        before, after = (rotor_inertia / 2 * end["dtheta"][side] ** 2 for end in ends)
        works[side] = integral(interval, *power_and_rate) + (after - before)
    if not is_zero(coupling):
        motions = ((np.stack(end["dtheta"]), np.stack(end["ddtheta"])) for end in ends)
        coupling_work = coupling * work_on_each_other(interval, *motions)
        works = [work + coupling_work[side] for side, work in enumerate(works)]
    if friction is not None:
        works = [work + friction_work for work, friction_work in zip(works, friction, strict=True)]
    powers = (end["motor_power"] for end in ends)
    spent = [
        positive_work(interval, *powers_and_work) for powers_and_work in zip(*powers, works, strict=True)
    ]
    return works, spent, efforts(interval, *(end["tau_transmission"] for end in ends))


def _motor_pairs(rows: Sequence[Any]) -> list[Sequence[Any]]:
    return [rows[first : first + SIDES] for first in range(0, len(rows), SIDES)]


def _rows_at_end(rows: Sequence[Any], end: int) -> list[Sequence[Any]]:
    half = len(rows) // 2
    return _motor_pairs(rows[end * half : (end + 1) * half])


class RunEnergy:
    """Energy of the runs of a batch; `add` its blocks in order, then call `report`.

    Args:
        variants: Robots.
        engine: Backend.
    """

    def __init__(self, variants: Variants, engine: Engine) -> None:
        self._variants, self._engine = variants, engine
        robot = variants.base
        lossy = any(robot.has_variable(VARIABLES[name]) for name in ("dissipated_power", "copper_loss"))
        self._losses = [LossMeter(robot_variant) for robot_variant in variants.robots] if lossy else []
        kernel = IntervalEnergy(robot, with_friction=lossy)
        self._end_variables, self._kernel = kernel.end_variables, variants.kernel(kernel)
        self._meter = EnergyMeter()
        self._last_samples: dict[str, FloatArray] = {}

    def add(self, block: Block) -> FloatArray:
        """Add a block of `BalancedDynamics`; return `motor_energy` at its samples, (samples, joints, 2).

        The block has the samples of one variant after the other.
        """
        variant_shape = -1, len(self._variants), len(block.time) // len(self._variants)
        samples = {
            name: np.moveaxis(getattr(block, name), 0, -1).reshape(variant_shape)
            for name in ("time", *self._end_variables)
        }
        lost = self._add_losses(block)
        first = _select_samples(samples, slice(1))
        before = self._last_samples or first
        # Copies, since views would keep the whole block in memory.
        self._last_samples = {
            name: values.copy() for name, values in _select_samples(samples, slice(-1, None)).items()
        }
        self._meter.add_stored(_by_variant(np.moveaxis(block.elastic_energy, 0, -1), len(self._variants)))
        works = [self._add_flow(before, first, lost and lost.select_intervals(slice(1)))]
        if variant_shape[-1] > 1:
            earlier, later = _select_samples(samples, slice(-1)), _select_samples(samples, slice(1, None))
            works.append(self._add_flow(earlier, later, lost and lost.select_intervals(slice(1, None))))
        work = np.concatenate(works, axis=-1)
        return over_time(work.reshape(*work.shape[:-2], -1))

    def _add_losses(self, block: Block) -> LostEnergy | None:
        """Return the losses in the intervals of all variants, (..., variants, intervals)."""
        if not self._losses:
            return None
        meters_and_blocks = zip(self._losses, block.divided(len(self._losses)), strict=True)
        lost = [meter.add(block_of_variant) for meter, block_of_variant in meters_and_blocks]
        friction, dissipated, copper = (
            [block_part for block_part in parts_of_kind if block_part is not None]
            for parts_of_kind in zip(*lost, strict=True)
        )
        heat = np.stack(copper, axis=-2) if copper else None
        return LostEnergy(np.stack(friction, axis=-2), np.stack(dissipated, axis=-2), heat)

    def _add_flow(self, before: _SampleRows, after: _SampleRows, lost: LostEnergy | None) -> FloatArray:
        """Add the flow from samples to the next ones; return the work of motors until these."""
        interval = after["time"][0] - before["time"][0]
        rows: dict[str, Iterable[FloatArray]] = {
            name: [*_flat_rows(before[name]), *_flat_rows(after[name])] for name in self._end_variables
        }
        if lost is not None:
            rows["friction"] = _flat_rows(lost.motor_friction.reshape(-1, *interval.shape))
        variant = np.repeat(np.arange(len(interval)), interval.shape[1])
        rows |= {"interval": _flat_rows(interval[None]), **self._variants.inputs(variant)}
        results = self._kernel.results.arrays(
            self._engine.run(self._kernel, self._kernel.arguments.pack(rows))
        )
        flow = Flow(interval, **{name: _by_variant(rows, len(interval)) for name, rows in results.items()})
        if lost is not None:
            flow = flow._replace(dissipated=lost.dissipated, copper=lost.copper)
        return self._meter.add(flow)

    def report(self, variant: int = 0) -> list[JointEnergy]:
        """Return the energy of each joint of a variant; at least one block must have been added."""
        return self._meter.report(self._variants.robots[variant], variant)


_SampleRows = Mapping[str, FloatArray]
"""Rows of variables at consecutive samples, (rows, variants, samples), by name."""


def _select_samples(rows: _SampleRows, selection: slice) -> dict[str, FloatArray]:
    return {name: values[..., selection] for name, values in rows.items()}


def _flat_rows(values: FloatArray) -> FloatArray:
    """Return values (rows, variants, intervals) as contiguous rows of one variant after the other."""
    return contiguous_rows(values.reshape(len(values), -1))


def _by_variant(values: FloatArray, variants: int) -> FloatArray:
    """Return values (..., samples) of one variant after the other as (..., variants, samples)."""
    return values.reshape(*values.shape[:-1], variants, -1)
