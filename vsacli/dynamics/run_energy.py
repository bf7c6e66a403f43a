"""The energy of a run of the inverse dynamics: what flows from step to step, as a program of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.base.arrays import FloatArray, contiguous_rows, over_time
from vsacli.base.variables import VARIABLES, Block
from vsacli.compute.control_flow import call
from vsacli.compute.engine import Engine
from vsacli.compute.rows import RowKernel, RowLayout
from vsacli.dynamics.energy import Efforts, EnergyMeter, Flow, JointEnergy, efforts
from vsacli.dynamics.losses import LossMeter, Lost
from vsacli.dynamics.quadrature import integral, positive_work, work_on_each_other
from vsacli.robot.model import Robot

AT_STEPS = ("dtheta", "motor_power", "tau_spring", "passed_power", "passed_rate")
"""What the work of motors in an interval follows from, at the step before it and at the step after it."""


@dataclass(frozen=True)
class IntervalEnergy(RowKernel):
    """Energy that flows in intervals between steps, a row each, for an engine.

    The work of a motor is the integral of the power that it passes on, the change of B theta'^2/2, what dry
    friction takes, and the work of another motor's acceleration on it.

    Attributes:
        inertia: of the motors of each joint.
        coupling: the inertia B_12 of each joint.
        rubbing: whether the work of dry friction is given.
    """

    inertia: tuple[tuple[float, ...], ...]
    coupling: tuple[float, ...]
    rubbing: bool

    @property
    def at_steps(self) -> tuple[str, ...]:
        """Names of what it takes at both ends of an interval."""
        return (*AT_STEPS, "ddtheta") if any(self.coupling) else AT_STEPS

    @cached_property
    def arguments(self) -> RowLayout:
        """The length of the interval, what there is before and after it, and the work of dry friction."""
        motors = (len(self.inertia), SIDES)
        friction = {"friction": motors} if self.rubbing else {}
        return RowLayout({"interval": (), **dict.fromkeys(self.at_steps, (2, *motors)), **friction})

    @cached_property
    def results(self) -> RowLayout:
        """As of `Flow`."""
        joints = (len(self.inertia),)
        motors = dict.fromkeys(("work", "spent"), (*joints, SIDES))
        return RowLayout({**motors, **dict.fromkeys(("load", "co_contraction"), joints)})

    def __call__(self, rows: Sequence[Any]) -> list[Any]:
        """Energy joint by joint."""
        given = self.arguments.unpack(rows)
        (interval,) = given["interval"]
        friction = _by_joint(given["friction"]) if self.rubbing else [None] * len(self.inertia)
        every = [{name: _at_end(given[name], end) for name in self.at_steps} for end in range(2)]
        found = []
        for joint, constants in enumerate(zip(self.inertia, self.coupling, strict=True)):
            ends = [{name: of_joints[joint] for name, of_joints in end.items()} for end in every]
            found.append(call(interval, _joint_flow, *constants, interval, ends, friction[joint]))
        works, spent, of_springs = zip(*found, strict=True)
        kinds = works, spent, zip(*of_springs, strict=True)
        return [row for kind in kinds for part in kind for row in part]


def _joint_flow(
    inertia: Sequence[float],
    coupling: float,
    interval: FloatArray,
    ends: Sequence[Mapping[str, Sequence[FloatArray]]],
    friction: Sequence[FloatArray] | None,
) -> tuple[list[FloatArray], list[FloatArray], Efforts]:
    """Work of both motors of a joint, NaN of one that is not there, its positive part, and efforts."""
    works = [np.full_like(interval, np.nan)] * SIDES
    for side, of_motor in enumerate(inertia):
        at_ends = ((each["passed_power"][side], each["passed_rate"][side]) for each in ends)
        before, after = (of_motor / 2 * each["dtheta"][side] ** 2 for each in ends)
        works[side] = integral(interval, *at_ends) + (after - before)
    if coupling:
        motions = ((np.stack(each["dtheta"]), np.stack(each["ddtheta"])) for each in ends)
        of_other = coupling * work_on_each_other(interval, *motions)
        works = [work + of_other[side] for side, work in enumerate(works)]
    if friction is not None:
        works = [work + rubbed for work, rubbed in zip(works, friction, strict=True)]
    powers = (end["motor_power"] for end in ends)
    spent = [positive_work(interval, *of_motor) for of_motor in zip(*powers, works, strict=True)]
    return works, spent, efforts(interval, *(end["tau_spring"] for end in ends))


def _by_joint(rows: Sequence[Any]) -> list[Sequence[Any]]:
    """The rows of the motors of each joint."""
    return [rows[first : first + SIDES] for first in range(0, len(rows), SIDES)]


def _at_end(rows: Sequence[Any], end: int) -> list[Sequence[Any]]:
    """Those at one end of the intervals."""
    half = len(rows) // 2
    return _by_joint(rows[end * half : (end + 1) * half])


class RunEnergy:
    """The energy of a run of the inverse dynamics; `add` its blocks in order, then ask for the `report`.

    Args:
        robot: the robot.
        engine: what computes.
    """

    def __init__(self, robot: Robot, engine: Engine) -> None:
        self._robot, self._engine = robot, engine
        actuators = [joint.actuator for joint in robot.joints]
        lossy = any(robot.has(VARIABLES[name]) for name in ("dissipated_power", "copper_loss"))
        self._losses = LossMeter(robot) if lossy else None
        self._kernel = IntervalEnergy(
            tuple(tuple(motor.inertia for motor in actuator.motors) for actuator in actuators),
            tuple(actuator.coupled_rotors for actuator in actuators),
            rubbing=lossy,
        )
        self._meter = EnergyMeter()
        self._last: dict[str, list[FloatArray]] = {}

    def add(self, block: Block) -> FloatArray:
        """Merge a block of `BalancedDynamics`; returns `motor_energy` at its steps, (samples, joints, 2)."""
        steps = {name: contiguous_rows(getattr(block, name)) for name in ("time", *self._kernel.at_steps)}
        lost = None if self._losses is None else self._losses.add(block)
        first = _every(steps, slice(1))
        before = self._last or first
        self._last = {name: [row[-1:].copy() for row in rows] for name, rows in steps.items()}  # no views
        self._meter.add_stored(np.moveaxis(block.elastic_energy, 0, -1))
        works = [self._flown(before, first, lost and lost.taken(slice(1)))]
        if len(block.time) > 1:
            earlier, later = _every(steps, slice(-1)), _every(steps, slice(1, None))
            works.append(self._flown(earlier, later, lost and lost.taken(slice(1, None))))
        return over_time(np.concatenate(works, axis=-1))

    def _flown(self, before: _Steps, after: _Steps, lost: Lost | None) -> FloatArray:
        """Merge what flows from steps to the next ones; the work of motors until these."""
        interval = after["time"][0] - before["time"][0]
        rows = {name: [*before[name], *after[name]] for name in self._kernel.at_steps}
        if lost is not None:
            rows["friction"] = contiguous_rows(over_time(lost.motor_friction))
        given = self._kernel.arguments.pack({"interval": [interval], **rows})
        flow = Flow(interval, **self._kernel.results.arrays(self._engine.run(self._kernel, given)))
        if lost is not None:
            flow = flow._replace(dissipated=lost.dissipated, copper=lost.copper)
        return self._meter.add(flow)

    def report(self) -> list[JointEnergy]:
        """What was found of each joint; at least one block must have been added."""
        return self._meter.report(self._robot)


_Steps = Mapping[str, Sequence[FloatArray]]
"""Rows (samples,) of variables at consecutive steps, by name."""


def _every(steps: _Steps, part: slice) -> dict[str, list[FloatArray]]:
    return {name: [row[part] for row in rows] for name, rows in steps.items()}
