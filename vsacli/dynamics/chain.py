"""Inputs and outputs of the recursion, with scalars of any kind."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vsacli.compute.vector import Scalar, SymmetricTensor, Vector


class LinkConstants(NamedTuple):
    """Constants of a joint and its link for the recursion; scalars of any kind.

    Attributes:
        revolute: Kind of the joint.
        a: Length of the Denavit-Hartenberg row.
        cos_alpha: Cosine of its twist.
        sin_alpha: Sine of its twist.
        mass: Mass of the augmented link.
        com: Center of mass, in the link frame.
        inertia: Inertia tensor about the center of mass, link axes.
        viscous_damping: Viscous damping D of the joint, in (58)-(60).
    """

    revolute: bool
    a: Scalar
    cos_alpha: Scalar
    sin_alpha: Scalar
    mass: Scalar
    com: Vector
    inertia: SymmetricTensor
    viscous_damping: Scalar


class TorqueDerivatives(NamedTuple):
    """Torque (force) of a joint, and its first and second time derivative."""

    tau: Scalar
    dtau: Scalar
    ddtau: Scalar


class JointState(NamedTuple):
    """Cos and sin of a joint's angle, offset d, q' to q'''', and the torque against damper and friction."""

    cos: Scalar
    sin: Scalar
    d: Scalar
    rates: tuple[Scalar, Scalar, Scalar, Scalar]
    resistance: TorqueDerivatives = TorqueDerivatives(0, 0, 0)


class TipLoad(NamedTuple):
    """Force and moment of the end effector on the environment, at a point of the last link.

    Attributes:
        force: Force and its first and second derivatives.
        moment: Moment about the point and its first and second derivatives.
        point: Vector from the origin of frame N, in frame N.
        in_base: Whether the components are along the axes of frame 0, else of frame N.
    """

    force: Sequence[Vector]
    moment: Sequence[Vector]
    point: Vector
    in_base: bool


class RecursionInputs(NamedTuple):
    """A whole chain, base to tip.

    Attributes:
        links: Constants of each joint and link.
        states: Pose and motion of each joint.
        gravity: Gravity acceleration in frame 0, m/s^2.
        tip: Load of the end effector on the environment, if any; N and N m per s^k.
    """

    links: Sequence[LinkConstants]
    states: Sequence[JointState]
    gravity: Vector
    tip: TipLoad | None = None
