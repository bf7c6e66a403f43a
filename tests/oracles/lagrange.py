"""Lagrange's equations of a tree, from 4x4 Denavit-Hartenberg matrices; no angular velocity, no recursion.

With the transform T_k of link k in the base and its pseudo-inertia J_k = integral(r r^T dm) of the points
r = (x, y, z, 1):

    kinetic energy    1/2 sum_k tr(T_k' J_k T_k'^T)
    potential energy     -sum_k g^T T_k J_k e_4
    tau_i = sum_k tr(dT_k/dq_i J_k T_k''^T) - g^T dT_k/dq_i J_k e_4 + D_i q_i'    (Uicker, 1965)

Every matrix is the list of its time derivatives, so the derivatives of tau_i follow from the product rule.
Matrices have the shape (..., 4, 4): of floats, for many samples at once, or of exact fractions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from oracles.jets import Scalar, circle, leibniz, matrix_product
from oracles.kinematics import transform
from vsacli.robot.joint import FRAME_0, Pose
from vsacli.robot.model import Robot

Array = npt.NDArray[Any]
Derivatives = list[Array]


@dataclass(frozen=True)
class Link:
    """A joint and its link; `inertia` is the 3x3 tensor about the center of mass `com`."""

    revolute: bool
    a: Scalar
    cos_alpha: Scalar
    sin_alpha: Scalar
    mass: Scalar
    com: Array
    inertia: Array
    damping: Scalar

    @property
    def pseudo_inertia(self) -> Array:
        """integral(r r^T dm) over the link, r homogeneous."""
        central = np.trace(self.inertia) / 2 * np.eye(3, dtype=int) - self.inertia
        moment = self.mass * self.com
        corner = np.array([[self.mass]])
        return np.block([[central + np.outer(moment, self.com), moment[:, None]], [moment[None, :], corner]])

    @property
    def generator(self) -> Array:
        """Q with dA/dq = Q A for the joint's transform A."""
        q = np.zeros((4, 4), dtype=int)
        if self.revolute:
            q[0, 1], q[1, 0] = -1, 1
        else:
            q[2, 3] = 1
        return q


@dataclass(frozen=True)
class State:
    """Cosine and sine of the joint's angle, its offset, and the rates q', q'', q''', q''''."""

    cos: Scalar
    sin: Scalar
    d: Scalar
    rates: Sequence[Scalar]


class Place(NamedTuple):
    """Where a joint stands: on the link of joint `parent`, -1 the base, at `seat`, 4x4, None at its frame."""

    parent: int
    seat: Array | None = None


class Chain:
    """Links at given states; `gravity` is the acceleration in the base frame.

    `places` says where each joint stands, after the one whose link carries it: by default on the link before.
    """

    def __init__(
        self,
        links: Sequence[Link],
        states: Sequence[State],
        gravity: Array,
        places: Sequence[Place] | None = None,
    ) -> None:
        self.links = links
        self.states = states
        self.gravity = np.array([*gravity, 0])
        self.places = places or [Place(index - 1) for index in range(len(links))]
        self.steps = [_transform(link, state) for link, state in zip(links, states, strict=True)]
        self.poses = self._poses()

    def torques(self, order: int) -> list[Scalar]:
        """Derivative of the given order, 0 to 2, of the torque of each joint."""
        return [self._torque(i, order) for i in range(len(self.links))]

    def kinetic_energy(self, order: int) -> Scalar:
        """Derivative of the given order, 0 to 3."""
        return sum(
            leibniz(order, pose[1:], pose[1:], lambda a, b, j=link.pseudo_inertia: _trace(a @ j, b)) / 2
            for link, pose in zip(self.links, self.poses, strict=True)
        )

    def potential_energy(self, order: int) -> Scalar:
        """Derivative of the given order, 0 to 4."""
        return -sum(
            self._weight(pose[order], link) for link, pose in zip(self.links, self.poses, strict=True)
        )

    def _poses(self) -> list[Derivatives]:
        poses = list[Derivatives]()
        for place, step in zip(self.places, self.steps, strict=True):
            poses.append(_behind(poses[place.parent] if place.parent >= 0 else None, place.seat, step))
        return poses

    def _torque(self, i: int, order: int) -> Scalar:
        total = self.links[i].damping * self.states[i].rates[order]
        for k, sensitivity in self.sensitivities(i).items():
            link, pose = self.links[k], self.poses[k]
            j = link.pseudo_inertia
            total = total + leibniz(order, sensitivity, pose[2:], lambda a, b, j=j: _trace(a @ j, b))
            total = total - self._weight(sensitivity[order], link)
        return total

    def sensitivities(self, i: int) -> dict[int, Derivatives]:
        """Derivatives of dT_k/dq_i, by k, of each link k that joint i moves."""
        return self._sensitivities[i]

    @cached_property
    def _sensitivities(self) -> list[dict[int, Derivatives]]:
        return [self._sensitivities_by(i) for i in range(len(self.links))]

    def _sensitivities_by(self, i: int) -> dict[int, Derivatives]:
        parent, seat = self.places[i]
        generated = [self.links[i].generator @ step for step in self.steps[i]]
        moved = {i: _behind(self.poses[parent] if parent >= 0 else None, seat, generated)}
        for k in range(i + 1, len(self.links)):
            parent, seat = self.places[k]
            if parent in moved:
                moved[k] = _behind(moved[parent], seat, self.steps[k])
        return moved

    def _weight(self, pose: Array, link: Link) -> Scalar:
        return (pose @ link.pseudo_inertia[:, 3]) @ self.gravity


def chain_of(robot: Robot, motion: Sequence[Array], *, modified: bool = False) -> Chain:
    """The links of a robot at q, dq, ddq, d3q, d4q, each (samples, joints).

    `modified` says that its rows and link frames are meant in the modified Denavit-Hartenberg convention.
    """
    q, *rates = (np.moveaxis(np.asarray(array), -1, 0) for array in motion)
    links, states = [], []
    for index, joint in enumerate(robot.joints):
        turn, slide = (q[index], 0) if joint.type == "revolute" else (0, q[index])
        angle = joint.dh.theta + turn + np.zeros_like(q[index])
        offset = joint.dh.d + slide + np.zeros_like(q[index])
        states.append(State(np.cos(angle), np.sin(angle), offset, [rate[index] for rate in rates]))
        links.append(
            Link(
                revolute=joint.type == "revolute",
                a=0 if modified else joint.dh.a,
                cos_alpha=1 if modified else math.cos(joint.dh.alpha),
                sin_alpha=0 if modified else math.sin(joint.dh.alpha),
                mass=joint.link.mass,
                com=np.array(joint.link.com),
                inertia=joint.link.inertia.tensor,
                damping=joint.damping,
            )
        )
    return Chain(links, states, np.array(robot.gravity), _places(robot, modified))


def _places(robot: Robot, modified: bool) -> list[Place]:
    """Where the joints stand: on the base behind its pose, or on a link, behind the mount."""
    names, places = [joint.name for joint in robot.joints], list[Place]()
    for index, joint in enumerate(robot.joints):
        on_base = index == 0 if joint.parent is None else joint.parent == FRAME_0
        before = [robot.base] if on_base else []
        poses = [transform(pose).real for pose in (*before, *([joint.mount] if joint.mount else []))]
        if modified:
            poses.append(transform(Pose(xyz=(joint.dh.a, 0, 0), rpy=(joint.dh.alpha, 0, 0))).real)
        parent = index - 1 if joint.parent in (None, FRAME_0) else names.index(joint.parent)
        places.append(Place(-1 if on_base else parent, reduce(np.matmul, poses) if poses else None))
    return places


def _behind(carrying: Derivatives | None, seat: Array | None, step: Derivatives) -> Derivatives:
    """Transform of a link: of the carrying one, unless that is the base, its seat, and its own step."""
    seated = step if seat is None else [seat @ matrix for matrix in step]
    return seated if carrying is None else matrix_product(carrying, seated)


def _transform(link: Link, state: State) -> Derivatives:
    """A = Rz(theta) Tz(d) Tx(a) Rx(alpha) and its four derivatives."""
    still = [0 * rate for rate in state.rates]
    cosines, sines = circle(state.cos, state.sin, state.rates if link.revolute else still)
    offsets = [state.d, *(still if link.revolute else state.rates)]
    fixed = np.array(
        [
            [1, 0, 0, link.a],
            [0, link.cos_alpha, -link.sin_alpha, 0],
            [0, link.sin_alpha, link.cos_alpha, 0],
            [0, 0, 0, 1],
        ]
    )
    return [
        _screw(c, s, d, int(order == 0)) @ fixed
        for order, (c, s, d) in enumerate(zip(cosines, sines, offsets, strict=True))
    ]


def _screw(cos: Scalar, sin: Scalar, d: Scalar, one: int) -> Array:
    """Rz Tz, or a derivative of it, where the constant entry `one` has become 0."""
    zero = 0 * cos
    rows = [
        [cos, -sin, zero, zero],
        [sin, cos, zero, zero],
        [zero, zero, zero + one, d],
        [zero, zero, zero, zero + one],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def _trace(a: Array, b: Array) -> Scalar:
    """tr(a b^T) of each matrix."""
    return (a * b).sum(axis=(-2, -1))
