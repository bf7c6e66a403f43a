"""Torques that the links demand of the joints, over blocks of samples."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vsacli.base.arrays import FloatArray, by_joint, over_time
from vsacli.base.errors import InputError
from vsacli.base.wrench import WRENCH_AXES, WRENCH_NAMES, Wrench
from vsacli.compute.engine import Engine, choose
from vsacli.compute.vector import (
    ZERO,
    Scalar,
    SymmetricTensor,
    Vector,
    exact,
    trigonometric,
)
from vsacli.dynamics.recursion import JointState, LinkConstants, TipLoad, recursion
from vsacli.robot.kinematics import base_gravity, rotation_matrix
from vsacli.robot.model import Joint, Robot

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

MOTION_NAMES = ("q", "dq", "ddq", "d3q", "d4q")


def link_constants(joint: Joint) -> LinkConstants:
    """Constants of a joint for the recursion, with exact zeros and ones where the geometry has them."""
    inertia = joint.link.inertia
    return LinkConstants(
        revolute=joint.is_revolute,
        a=exact(joint.dh.a),
        cos_alpha=trigonometric(math.cos, joint.dh.alpha),
        sin_alpha=trigonometric(math.sin, joint.dh.alpha),
        mass=exact(joint.link.mass),
        com=Vector(*map(exact, joint.link.com)),
        inertia=SymmetricTensor(
            *map(exact, (inertia.xx, inertia.yy, inertia.zz, inertia.xy, inertia.xz, inertia.yz))
        ),
        damping=exact(joint.damping),
    )


def tip_load(robot: Robot, frame: str, wrench: Iterable[Sequence[Scalar]]) -> TipLoad:
    """What the end effector exerts while the environment exerts a wrench on it.

    Args:
        robot: whose base and tool count.
        frame: along whose axes the components are, one of `vsacli.base.wrench.WRENCH_FRAMES`.
        wrench: the six components, their first and their second derivatives; scalars of any kind.
    """
    in_base = frame == "base"
    rotation = rotation_matrix(robot.base).transposed() if in_base else rotation_matrix(robot.tool)
    exerted = [(ZERO - Vector(*components[:3]), ZERO - Vector(*components[3:])) for components in wrench]
    return TipLoad(
        force=[rotation.times(force) for force, _ in exerted],
        moment=[rotation.times(moment) for _, moment in exerted],
        point=Vector(*map(exact, robot.tool.xyz)),
        in_base=in_base,
    )


@dataclass(frozen=True)
class LinkTorques:
    """The recursion over rows of samples, for an engine.

    Inputs are q, dq, ddq, d3q, d4q of the joints, then the wrench and its two derivatives if there is one;
    outputs are tau_e, dtau_e, ddtau_e of the joints.

    Attributes:
        robot: the chain.
        frame: of the wrench; None if there is none.
    """

    robot: Robot
    frame: str | None = None

    @property
    def inputs(self) -> int:
        """Rows it takes."""
        of_wrench = 0 if self.frame is None else len(WRENCH_NAMES) * len(WRENCH_AXES)
        return len(MOTION_NAMES) * len(self.robot.joints) + of_wrench

    @property
    def outputs(self) -> int:
        """Rows it gives."""
        return 3 * len(self.robot.joints)

    def __call__(self, rows: Sequence[Scalar]) -> list[Scalar]:
        """Run (36)-(60)."""
        joints = self.robot.joints
        motion = [rows[order * len(joints) :] for order in range(len(MOTION_NAMES))]
        states = [
            joint_state(joint, q, (dq, ddq, d3q, d4q))
            for joint, q, dq, ddq, d3q, d4q in zip(joints, *motion, strict=False)
        ]
        links = [link_constants(joint) for joint in joints]
        torques = recursion(links, states, base_gravity(self.robot), self._tip(rows))
        return [row for rows_of_order in zip(*torques, strict=True) for row in rows_of_order]

    def _tip(self, rows: Sequence[Scalar]) -> TipLoad | None:
        if self.frame is None:
            return None
        axes, start = len(WRENCH_AXES), len(MOTION_NAMES) * len(self.robot.joints)
        wrench = [rows[first : first + axes] for first in range(start, len(rows), axes)]
        return tip_load(self.robot, self.frame, wrench)


def link_torques(
    robot: Robot,
    q: ArrayLike,
    dq: ArrayLike,
    ddq: ArrayLike,
    d3q: ArrayLike,
    d4q: ArrayLike,
    wrench: Wrench | None = None,
    *,
    engine: str | Engine = "numpy",
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Torques that the links demand of the joints, and their first two derivatives, (36)-(60).

    Args:
        robot: the chain.
        q: joint positions, (samples, joints), rad (m).
        dq: their first derivative.
        ddq: their second derivative.
        d3q: their third derivative.
        d4q: their fourth derivative.
        wrench: what the environment exerts on the end effector, over the same samples; nothing if None.
        engine: what computes, one of `vsacli.compute.engine.NAMES`, or one that was chosen before.

    Returns:
        tau_e, dtau_e, ddtau_e, each (samples, joints), N m (N) per s^k.

    Raises:
        InputError: an array has another shape than (samples, joints), or not that of `q`; one of the wrench
            another than (samples, 6); there is no such engine, or no C compiler for it.
    """
    motion = [_checked(robot, name, array) for name, array in _named(q, dq, ddq, d3q, d4q)]
    shape = motion[0].shape
    if len({array.shape for array in motion}) > 1:
        shapes = ", ".join(str(array.shape[::-1]) for array in motion)
        raise InputError.one(f"q, dq, ddq, d3q, d4q must have one shape, not {shapes}")

    kernel = LinkTorques(robot, None if wrench is None else wrench.frame)
    rows = [row for array in (*motion, *_wrench_rows(wrench, shape[1])) for row in array]
    chosen = choose(engine, kernel, shape[1]).engine if isinstance(engine, str) else engine
    tau_e, dtau_e, ddtau_e = map(over_time, chosen.run(kernel, rows).reshape(3, *shape))
    return tau_e, dtau_e, ddtau_e


def _named(*motion: ArrayLike) -> Iterator[tuple[str, ArrayLike]]:
    return zip(MOTION_NAMES, motion, strict=True)


def _checked(robot: Robot, name: str, array: ArrayLike) -> FloatArray:
    shape = np.shape(array)
    if len(shape) != 2 or shape[1] != len(robot.joints):
        raise InputError.one(f"{name} must have the shape (samples, {len(robot.joints)}), not {shape}")
    return by_joint(array)


def _wrench_rows(wrench: Wrench | None, samples: int) -> Iterator[FloatArray]:
    """The components, and each of their derivatives."""
    for name in WRENCH_NAMES if wrench is not None else ():
        array = getattr(wrench, name)
        if (shape := np.shape(array)) != (samples, len(WRENCH_AXES)):
            raise InputError.one(f"{name} must have the shape ({samples}, {len(WRENCH_AXES)}), not {shape}")
        yield by_joint(array)


def joint_state(joint: Joint, q: Scalar, rates: tuple[Scalar, Scalar, Scalar, Scalar]) -> JointState:
    """Pose and motion of a joint for the recursion, from its position and four derivatives."""
    dh = joint.dh
    if joint.is_revolute:
        angle = q + dh.theta
        return JointState(np.cos(angle), np.sin(angle), exact(dh.d), rates)
    return JointState(trigonometric(math.cos, dh.theta), trigonometric(math.sin, dh.theta), q + dh.d, rates)
