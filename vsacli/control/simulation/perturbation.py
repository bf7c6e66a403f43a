"""Runs whose controller has a model that differs from the robot, as an identified model does."""

from __future__ import annotations

import multiprocessing
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from vsacli.actuators.friction import Friction
from vsacli.actuators.motor import Motor
from vsacli.base.errors import InputError, InvalidRecordError
from vsacli.base.interrupts import leave_interrupts_to_others, starting_worker
from vsacli.control.simulation.simulate import SimulationRun
from vsacli.control.simulation.simulation_report import SimulationReport
from vsacli.documents.fields import (
    NamedNumbers,
    NumberWithUnit,
    OneOf,
    PairOf,
    RecordOf,
    ValueKind,
    declared_fields,
)
from vsacli.robot.joint import Inertia, Joint, Link
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory


def perturbed(robot: Robot, relative: float, seed: int) -> Robot:
    """Return the robot with a random relative error of every dynamic parameter.

    Masses, centers of mass, inertia tensors, dampings, dry friction, motor inertias and the constants of
    springs and mechanisms are each multiplied by 1 + relative u with u uniform in [-1, 1]. A tensor is scaled
    as a whole, so that it remains possible. Geometry, gravity, limits and measured tables are unchanged.

    Args:
        robot: true robot.
        relative: largest relative error, from 0 to below 1; 0 returns the robot itself.
        seed: seed of the random numbers, so that a run can be repeated.

    Raises:
        InputError: the error is not in that range, or an actuator cannot have a constant that results.
    """
    if not 0 <= relative < 1:
        bounds = "at least 0 and below 1, e.g. 0.05 for 5 %"
        raise InputError.one(f"the model error must be {bounds}, not {relative:g}")
    if seed < 0:
        raise InputError.one(f"the seed must be zero or positive, not {seed}")
    if relative == 0:
        return robot
    generator = _PerturbedRobots(relative, np.random.default_rng(seed))
    return replace(robot, joints=tuple(generator.joint(joint) for joint in robot.joints))


class _PerturbedRobots:
    """A generator of robots with random errors, drawn in the order of the joints."""

    def __init__(self, relative: float, random: np.random.Generator) -> None:
        self._relative = relative
        self._rng = random

    def joint(self, joint: Joint) -> Joint:
        try:
            actuator = self._perturb_record(joint.actuator)
        except InvalidRecordError as error:
            reason = f"an error of up to {self._relative:g} makes an actuator that cannot be"
            raise InputError.one(f"joint {joint.name}: {reason}: {error}; choose a smaller one") from error
        return replace(
            joint,
            link=self._perturb_link(joint.link),
            damping=self._perturb_number(joint.damping),
            friction=self._perturb_friction(joint.friction),
            actuator=actuator,
        )

    def _perturb_number(self, value: float) -> float:
        return value * (1 + self._relative * float(self._rng.uniform(-1, 1)))

    def _perturb_link(self, link: Link) -> Link:
        x, y, z = map(self._perturb_number, link.com)
        return replace(
            link,
            mass=self._perturb_number(link.mass),
            com=(x, y, z),
            inertia=self._perturb_inertia(link.inertia),
        )

    def _perturb_inertia(self, inertia: Inertia) -> Inertia:
        factor = self._perturb_number(1.0)
        return replace(
            inertia, **{name: factor * getattr(inertia, name) for name in declared_fields(Inertia)}
        )

    def _perturb_record(self, record: Any) -> Any:
        """Return a record with errors in its motors, springs, mechanisms and numbers, except limits.

        Errors are drawn in the order in which fields are declared.
        """
        perturbed_fields = {
            name: self._perturb_value(field.kind, getattr(record, name))
            for name, (field, _) in declared_fields(type(record)).items()
            if name != "max_deflection"
        }
        return replace(record, **perturbed_fields)

    def _perturb_value(self, kind: ValueKind, value: Any) -> Any:
        if value is None:
            return None
        match kind:
            case PairOf(item):
                return tuple(self._perturb_value(item, side) for side in value)
            case RecordOf(cls) if cls is Motor:
                return self._perturb_motor(value)
            case OneOf():
                return self._perturb_record(value)
            case NumberWithUnit():
                return self._perturb_number(value)
            case NamedNumbers():
                return tuple((name, self._perturb_number(number)) for name, number in value)
        return value

    def _perturb_motor(self, motor: Motor) -> Motor:
        return replace(
            motor,
            inertia=self._perturb_number(motor.inertia),
            damping=self._perturb_number(motor.damping),
            friction=self._perturb_friction(motor.friction),
        )

    def _perturb_friction(self, friction: Friction | None) -> Friction | None:
        """Return friction with one factor for both directions, which must stay equal between links."""
        if friction is None:
            return None
        factor = self._perturb_number(1.0)
        backward, forward = friction.coulomb
        offset = self._perturb_number(friction.offset)
        return replace(friction, coulomb=(factor * backward, factor * forward), offset=offset)


def simulate_perturbed(
    robot: Robot,
    trajectory: Trajectory,
    relative: float,
    seeds: Sequence[int],
    *,
    processes: int = 1,
    **conditions: Any,
) -> Iterator[SimulationReport]:
    """Simulate a robot whose controller has a wrong model, once for each seed; yield the reports.

    The models differ only in parameters, so that code compiled for the first run serves all.

    Args:
        robot: true robot.
        trajectory: commanded motion.
        relative: largest relative error of a parameter of the model; see `perturbed`.
        seeds: seeds of the errors, one per run.
        processes: number of worker processes. Each takes a second to start, which about ten runs repay. A
            script with more than one must call this below `if __name__ == "__main__":`.
        conditions: further arguments of `simulate`, except `model`.

    Raises:
        InputError: see `simulate` and `perturbed`; or `processes` is below 1.
    """
    if processes < 1:
        raise InputError.one(f"there must be at least 1 process, not {processes}")
    report = partial(_report_of_seed, robot, trajectory, relative, {"runs": len(seeds), **conditions})
    yield from map(report, seeds[:1])  # alone, since it may have to compile the code that the others use
    if processes == 1:
        yield from map(report, seeds[1:])
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(processes, context, leave_interrupts_to_others)
    try:
        with starting_worker():
            reports = pool.map(report, seeds[1:])
        yield from reports
    finally:
        pool.shutdown(cancel_futures=True)


def _report_of_seed(
    robot: Robot, trajectory: Trajectory, relative: float, conditions: dict[str, Any], seed: int
) -> SimulationReport:
    run = SimulationRun(robot, trajectory, model=perturbed(robot, relative, seed), **conditions)
    deque(run, maxlen=0)
    return run.report()
