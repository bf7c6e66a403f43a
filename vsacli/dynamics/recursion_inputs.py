"""Inputs and outputs of the recursion, with scalars of any kind."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from vsacli.compute.vector import Matrix, Scalar, SymmetricTensor, Vector


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


class Seat(NamedTuple):
    """The place on a link at which the row of a joint begins, if that is not the frame of the link.

    Attributes:
        rotation: From components of the seat to those of the link.
        lever: Vector from the origin of the link's frame, in this frame.
    """

    rotation: Matrix
    lever: Vector


class Carrier(NamedTuple):
    """The carrier of a joint: the link of joint `parent`, or frame 0 if that is -1, and the seat on it."""

    parent: int
    seat: Seat | None = None


class ToolLoad(NamedTuple):
    """Force and moment of a tool on the environment, at a point of its link.

    Attributes:
        joint: Index of the joint whose link carries the tool.
        force: Force and its first and second derivatives.
        moment: Moment about the point and its first and second derivatives.
        point: Vector from the origin of the link's frame, in this frame.
        in_base: Whether the components are along the axes of frame 0, else of the link's frame.
    """

    joint: int
    force: Sequence[Vector]
    moment: Sequence[Vector]
    point: Vector
    in_base: bool


class RecursionInputs(NamedTuple):
    """A whole tree; each joint comes after the one that carries it.

    Attributes:
        links: Constants of each joint and link.
        states: Pose and motion of each joint.
        carriers: What carries each joint.
        gravity: Gravity acceleration in frame 0, m/s^2.
        loads: Loads of the tools on the environment; N and N m per s^k.
    """

    links: Sequence[LinkConstants]
    states: Sequence[JointState]
    carriers: Sequence[Carrier]
    gravity: Vector
    loads: Sequence[ToolLoad] = ()
