"""All variables of a block of steps: recursion, then actuation joint by joint."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.limit_check import LimitCheck
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import AnyArray, FloatArray, by_joint, over_time
from vsacli.base.errors import InputError, check_type
from vsacli.base.flags import NEAR_SINGULAR_MARGIN
from vsacli.base.json_records import Stored
from vsacli.base.signals import COMMANDED, DAMPING, POSITION
from vsacli.base.variables import VARIABLES, Block
from vsacli.compute.engine import NUMPY, Engine, samples_per_pass
from vsacli.compute.rows import RowKernel, RowLayout
from vsacli.compute.vector import Scalar
from vsacli.dynamics.drive import Drive, drive
from vsacli.dynamics.elastic_torques import TORQUES, LinkTorques, link_torques
from vsacli.dynamics.limits import limit_checks
from vsacli.dynamics.losses import dissipated_power
from vsacli.robot.commanded_joints import takers
from vsacli.robot.model import Robot, check_robot
from vsacli.trajectory.devices import with_uncommanded_devices
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory

COMPUTED = (*TORQUES, *Drive._fields, "dissipated_power")
"""The variables that inverse dynamics computes, where the robot has them."""


def usual_block(joints: int) -> int:
    """Steps computed at a time: one pass of NumPy's, which hides the interpreter and bounds the memory."""
    signals = (POSITION, *(signal for signal in COMMANDED.values() if signal.device is None))
    return samples_per_pass(joints * sum(signal.orders for signal in signals))


@dataclass(frozen=True)
class Stop(Stored):
    """From when on, s, the deflections of a joint cannot be integrated, and why."""

    time: float
    reason: str


@dataclass(frozen=True)
class InverseDynamics(RowKernel):
    """Inverse dynamics (36)-(74) over rows of samples, for an engine.

    Inputs are those of `LinkTorques`, the commanded signals of the joints with their derivatives, then the
    deflections if they are integrated; outputs the variables of `COMPUTED` one after the other.

    Attributes:
        robot: the robot.
        frame: of the wrench; None if there is none.
        near_singular: margin below which a step is near-singular.
        integrated: whether deflections are given, else they are solved for.
        limits: those of each joint, since springs compare equal whatever their limits.
    """

    robot: Robot
    frame: str | None = None
    near_singular: float = NEAR_SINGULAR_MARGIN
    integrated: bool = False
    limits: tuple[tuple[LimitCheck, ...], ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        limits = tuple(tuple(limit_checks(joint)) for joint in self.robot.joints)
        object.__setattr__(self, "limits", limits)

    @property
    def links(self) -> LinkTorques:
        """The recursion alone."""
        return LinkTorques(self.robot, self.frame)

    @property
    def arguments(self) -> RowLayout:
        """Rows that inverse dynamics takes."""
        joints = len(self.robot.joints)
        names = (name for signal in self.robot.signals for name in signal.names)
        commanded = dict.fromkeys(names, (joints,))
        integrated = {"phi": (joints, SIDES)} if self.integrated else {}
        return RowLayout({**self.links.arguments.shapes, **commanded, **integrated})

    @cached_property
    def results(self) -> RowLayout:
        """Rows that inverse dynamics gives."""
        joints, declared = len(self.robot.joints), [VARIABLES[name] for name in COMPUTED]
        shapes = {
            variable.name: (joints, SIDES) if "motor" in variable.dims else (joints,)
            for variable in declared
            if self.robot.has(variable)
        }
        return RowLayout(shapes)

    def __call__(self, rows: Sequence[Scalar]) -> list[Scalar]:
        """Run (36)-(74)."""
        links, given = self.links, self.arguments.unpack(rows)
        demanded = links(rows[: links.inputs])
        torques = links.results.unpack([_as_row(torque, rows[0]) for torque in demanded])
        of_joints = {**given, **torques}
        names = Command.names(signal.key for signal in self.robot.signals)
        drives = [
            drive(
                joint,
                Command.of({name: of_joints[name][index] for name in names}),
                self.near_singular,
                np.stack(given["phi"][SIDES * index : SIDES * (index + 1)]) if self.integrated else None,
            )
            for index, joint in enumerate(self.robot.joints)
        ]
        driven = {name: [getattr(each, name) for each in drives] for name in Drive._fields}
        if "dissipated_power" in self.results.shapes:
            moved = zip(given["dq"], driven["dtheta"], strict=True)
            motions = [{"dq": dq, "dtheta": dtheta} for dq, dtheta in moved]
            driven["dissipated_power"] = list(map(dissipated_power, self.robot.joints, motions))
        absent = {1: np.full_like(rows[0], np.nan), 2: np.full_like(drives[0].dtheta, np.nan)}
        computed: dict[str, Iterable[Scalar]] = {
            name: _rows([absent[len(VARIABLES[name].dims)] if array is None else array for array in of_all])
            for name, of_all in driven.items()
        }
        return self.results.pack({**torques, **computed})


def _as_row(torque: Scalar, row: Scalar) -> Scalar:
    """Of a joint that moves nothing, the recursion finds a plain zero; the actuator takes rows of samples."""
    return np.full_like(row, torque) if isinstance(torque, int | float) else torque


def compute_block(
    robot: Robot,
    motion: Motion,
    near_singular: float = NEAR_SINGULAR_MARGIN,
    integrated: FloatArray | None = None,
    engine: Engine = NUMPY,
) -> Block:
    """Inverse dynamics (36)-(74) of a block of steps.

    Args:
        robot: the robot.
        motion: commanded motion and stiffness, (samples, joints); the actuators that take no stiffness
            have a stiffness of their own, or none.
        near_singular: margin below which a step is near-singular.
        integrated: deflections of the joints to use instead of the root of (14), (joints, 2, samples);
            a step where they are NaN is infeasible.
        engine: what computes.
    """
    frame = None if motion.wrench is None else motion.wrench.frame
    kernel = InverseDynamics(robot, frame, near_singular, integrated is not None)
    given = {name: array for name, array in motion.variables().items() if robot.has(VARIABLES[name])}
    rows = {name: by_joint(given[name]) for name in kernel.arguments.shapes if name in given}
    if integrated is not None:
        rows["phi"] = integrated.reshape(-1, integrated.shape[-1])
    found = kernel.results.arrays(engine.run(kernel, kernel.arguments.pack(rows)))
    computed = {name: over_time(array) for name, array in found.items()}
    arrays: dict[str, AnyArray] = {**given, **computed, "flags": computed["flags"].astype(np.uint16)}
    return Block(**arrays)


def _rows(of_joints: Iterable[FloatArray]) -> Iterator[FloatArray]:
    """The rows (samples,) of arrays of the joints, each (samples,) or (2, samples)."""
    for array in of_joints:
        yield from array if array.ndim > 1 else [array]


def elastic_torques(robot: Robot, motion: Motion) -> dict[str, FloatArray]:
    """tau_e, dtau_e and ddtau_e, (58)-(60), by name, each (samples, joints); the stiffness plays no part."""
    damping: dict[str, Any] = {
        name: motion.commanded[name] for name in DAMPING.names if name in motion.commanded
    }
    return link_torques(
        robot, motion.q, motion.dq, motion.ddq, motion.d3q, motion.d4q, motion.wrench, **damping
    )._asdict()


def fitted(robot: Robot, trajectory: Trajectory) -> Trajectory:
    """A trajectory for a robot: the same, with what its devices do that are not commanded.

    Raises:
        InputError: it has another number of joints than the robot, or lacks a stiffness that one takes.
        TypeError: one of both is none.
    """
    check_robot(robot)
    remedy = "load_trajectory({}, robot) reads one; it comes after the robot"
    check_type("trajectory", trajectory, Trajectory, remedy)
    if trajectory.joints != len(robot.joints):
        joints = f"{trajectory.joints} joints, the robot {robot.name} {len(robot.joints)}"
        raise InputError.one(f"the trajectory {trajectory.name} has {joints}")
    trajectory = with_uncommanded_devices(trajectory, robot)
    for key, signal in COMMANDED.items():
        lacking = [
            joint.name
            for joint, chosen in zip(robot.joints, trajectory.chosen(key), strict=True)
            if key in joint.commanded and not chosen
        ]
        if lacking:
            raise InputError.one(
                f"the trajectory {trajectory.name} has no {key} for {', '.join(lacking)}; "
                f"each {takers(signal)} needs one"
            )
    return trajectory


def command_of(index: int, commanded: Mapping[str, FloatArray]) -> Command:
    """The part of one joint in variables by name, each (samples, joints)."""
    names = (name for name in Command.names(COMMANDED) if name in commanded)
    return Command.of({name: commanded[name][:, index] for name in names})
