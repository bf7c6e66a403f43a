"""All variables of a block of steps: recursion, then actuation joint by joint."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsacli.actuators.antagonistic import Antagonistic
from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.limit_check import LimitCheck
from vsacli.actuators.reach import NEAR_SINGULAR
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FloatArray, by_joint, over_time
from vsacli.base.errors import InputError, check_type
from vsacli.base.json_records import Stored
from vsacli.base.variables import VARIABLES, Block
from vsacli.base.wrench import WRENCH_NAMES
from vsacli.compute.engine import NUMPY, Engine, samples_per_pass
from vsacli.compute.vector import Scalar
from vsacli.dynamics.drive import Drive, drive
from vsacli.dynamics.limits import limit_checks
from vsacli.dynamics.link_torques import MOTION_NAMES, LinkTorques, link_torques
from vsacli.robot.model import Robot, check_robot
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory

TORQUES = ("tau_e", "dtau_e", "ddtau_e")
COMPUTED = (*TORQUES, *Drive._fields)
"""The variables that inverse dynamics computes."""

STIFFNESS_NAMES = ("stiffness", "dstiffness", "ddstiffness")


def usual_block(joints: int) -> int:
    """Steps computed at a time: one pass of NumPy's, which hides the interpreter and bounds the memory."""
    return samples_per_pass(joints * (len(MOTION_NAMES) + len(STIFFNESS_NAMES)))


@dataclass(frozen=True)
class Stop(Stored):
    """From when on, s, the deflections of a joint cannot be followed, and why."""

    time: float
    reason: str


@dataclass(frozen=True)
class InverseDynamics:
    """Inverse dynamics (36)-(74) over rows of samples, for an engine.

    Inputs are those of `LinkTorques`, stiffness, dstiffness, ddstiffness of the joints, then the deflections
    if they are followed, joint by joint; outputs the variables of `COMPUTED` one after the other.

    Attributes:
        robot: the robot.
        frame: of the wrench; None if there is none.
        near_singular: margin below which a step is near-singular.
        followed: whether deflections of antagonistic joints are given, else they are solved for.
        limits: those of each joint, since springs compare equal whatever their limits.
    """

    robot: Robot
    frame: str | None = None
    near_singular: float = NEAR_SINGULAR
    followed: bool = False
    limits: tuple[tuple[LimitCheck, ...], ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        limits = tuple(tuple(limit_checks(joint)) for joint in self.robot.joints)
        object.__setattr__(self, "limits", limits)

    @property
    def links(self) -> LinkTorques:
        """The recursion alone."""
        return LinkTorques(self.robot, self.frame)

    @property
    def inputs(self) -> int:
        """Rows it takes."""
        of_joint = len(STIFFNESS_NAMES) + (SIDES if self.followed else 0)
        return self.links.inputs + of_joint * len(self.robot.joints)

    @property
    def outputs(self) -> int:
        """Rows it gives."""
        return sum(math.prod(shape) for shape in self.shapes.values())

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of each output at one instant, by name."""
        joints = len(self.robot.joints)
        return {name: (joints, SIDES) if "motor" in VARIABLES[name].dims else (joints,) for name in COMPUTED}

    def __call__(self, rows: Sequence[Scalar]) -> list[Scalar]:
        """Run (36)-(74)."""
        joints, links = len(self.robot.joints), self.links
        torques = links(rows[: links.inputs])
        given = [
            *rows[: 3 * joints],
            *rows[links.inputs : links.inputs + len(STIFFNESS_NAMES) * joints],
            *torques,
        ]
        followed = rows[links.inputs + len(STIFFNESS_NAMES) * joints :]
        drives = [
            drive(
                joint,
                Command(*given[index::joints]),
                self.near_singular,
                np.stack(followed[SIDES * index : SIDES * (index + 1)]) if self.followed else None,
            )
            for index, joint in enumerate(self.robot.joints)
        ]
        driven = (getattr(of_joint, name) for name in Drive._fields for of_joint in drives)
        return [*torques, *(row for values in driven for row in (values if values.ndim > 1 else [values]))]


def compute_block(
    robot: Robot,
    motion: Motion,
    near_singular: float = NEAR_SINGULAR,
    followed: FloatArray | None = None,
    engine: Engine = NUMPY,
) -> Block:
    """Inverse dynamics (36)-(74) of a block of steps.

    Args:
        robot: the robot.
        motion: commanded motion and stiffness, (samples, joints); the actuators that are not antagonistic
            have a stiffness of their own, or none.
        near_singular: margin below which a step is near-singular.
        followed: deflections of antagonistic joints to use instead of the root of (14), (joints, 2, samples);
            a step where they are NaN is infeasible.
        engine: what computes.
    """
    frame = None if motion.wrench is None else motion.wrench.frame
    kernel = InverseDynamics(robot, frame, near_singular, followed is not None)
    given = motion.variables()
    names = (*MOTION_NAMES, *(WRENCH_NAMES if frame is not None else ()), *STIFFNESS_NAMES)
    rows = [row for name in names for row in by_joint(given[name])]
    if followed is not None:
        rows += [row for sides in followed for row in np.ascontiguousarray(sides)]
    computed = _named(kernel.shapes, engine.run(kernel, rows))
    return Block(**{**given, **computed, "flags": computed["flags"].astype(np.uint16)})


def _named(shapes: Mapping[str, tuple[int, ...]], rows: FloatArray) -> dict[str, Any]:
    """Arrays over time by name, from all their rows."""
    counts = [math.prod(shape) for shape in shapes.values()]
    parts = np.split(rows, np.cumsum(counts)[:-1])
    return {
        name: over_time(part.reshape(*shape, -1))
        for (name, shape), part in zip(shapes.items(), parts, strict=True)
    }


def elastic_torques(robot: Robot, motion: Motion) -> dict[str, FloatArray]:
    """tau_e, dtau_e and ddtau_e, (58)-(60), by name, each (samples, joints); the stiffness plays no part."""
    return link_torques(
        robot, motion.q, motion.dq, motion.ddq, motion.d3q, motion.d4q, motion.wrench
    )._asdict()


def check_fit(robot: Robot, trajectory: Trajectory) -> None:
    """Refuse a trajectory that is not for this robot.

    Raises:
        InputError: it has another number of joints, or no stiffness for an antagonistic one.
        TypeError: one of both is none.
    """
    check_robot(robot)
    remedy = "load_trajectory({}, robot) reads one; it comes after the robot"
    check_type("trajectory", trajectory, Trajectory, remedy)
    if trajectory.joints != len(robot.joints):
        joints = f"{trajectory.joints} joints, the robot {robot.name} {len(robot.joints)}"
        raise InputError.one(f"the trajectory {trajectory.name} has {joints}")
    lacking = [
        joint.name
        for joint, chosen in zip(robot.joints, trajectory.stiffened, strict=True)
        if isinstance(joint.actuator, Antagonistic) and not chosen
    ]
    if lacking:
        raise InputError.one(
            f"the trajectory {trajectory.name} has no stiffness for {', '.join(lacking)}; "
            "each antagonistic joint needs one"
        )


def command_of(index: int, commanded: Mapping[str, FloatArray]) -> Command:
    """The part of one joint in variables by name, each (samples, joints)."""
    return Command(*(commanded[name][:, index] for name in Command._fields))
