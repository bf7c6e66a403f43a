"""Derivatives of the torques that the links demand, by numbers of links, rows and the robot as a whole."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray, by_joint
from vsacli.compute.duals import tangents_of
from vsacli.compute.vector import Scalar
from vsacli.dynamics.chain import Chain
from vsacli.dynamics.elastic_torques import LinkTorques
from vsacli.dynamics.recursion import backward, base_frame, forward
from vsacli.robot.model import Robot
from vsacli.robot.parameters import Parameter, seeded
from vsacli.trajectory.motion import Motion


class TorqueSlopes(NamedTuple):
    """Derivatives of tau_e, tau_e', tau_e'' by some numbers.

    Attributes:
        places: of the numbers, among those that were chosen.
        of_joints: of each joint, (numbers, 3, samples), in N m (N) per s^k and per SI unit of each number;
            None for a joint that bears nothing of what they change.
    """

    places: Sequence[int]
    of_joints: Sequence[FloatArray | None]


def torque_slopes(robot: Robot, motion: Motion, chosen: Sequence[Parameter]) -> Iterator[TorqueSlopes]:
    """Differentiate (58)-(60) by numbers of a robot.

    Joint by joint, since links before it move alike whatever its numbers are, and since the derivatives of
    a whole chain by all of them would not stay in the caches: at once they took a tenth longer.

    Args:
        robot: the robot.
        motion: samples, and the wrench if there is one.
        chosen: the numbers; no torque of the links depends on those of actuators.
    """
    frame, given = None if motion.wrench is None else motion.wrench.frame, motion.variables()
    arguments = LinkTorques(robot, frame).arguments
    rows = arguments.pack({name: by_joint(given[name]) for name in arguments.shapes})
    plain, carrying = (LinkTorques(each, frame).chain(rows) for each in (robot, seeded(robot, chosen)))
    bodies = forward(plain.links, plain.states, base_frame(plain.gravity))
    for joint, places in _by_joint(chosen).items():
        links, states, gravity, tip = _mixed(plain, carrying, joint)
        known = bodies[:joint] if joint else []
        previous = known[-1].frame if known else base_frame(gravity)
        moved = [*known, *forward(links[len(known) :], states[len(known) :], previous)]
        torques = backward(links, states, moved, tip)
        yield TorqueSlopes(places, [_derivatives(each, places, len(motion.time)) for each in torques])


def _by_joint(chosen: Sequence[Parameter]) -> dict[int | None, list[int]]:
    """Places of the numbers of each joint, and of the robot as a whole."""
    places: dict[int | None, list[int]] = {}
    for place, parameter in enumerate(chosen):
        places.setdefault(parameter.joint, []).append(place)
    return places


def _mixed(plain: Chain, carrying: Chain, joint: int | None) -> Chain:
    """The chain that carries derivatives by the numbers of one joint alone, or of the robot as a whole."""
    if joint is None:
        return plain._replace(gravity=carrying.gravity, tip=carrying.tip)
    links, states = list(plain.links), list(plain.states)
    links[joint], states[joint] = carrying.links[joint], carrying.states[joint]
    return plain._replace(links=links, states=states)


def _derivatives(torques: Sequence[Scalar], places: Sequence[int], samples: int) -> FloatArray | None:
    tangents = [tangents_of(torque) for torque in torques]
    if not any(tangents):
        return None
    derivatives = np.zeros((len(places), len(torques), samples))
    for order, by_place in enumerate(tangents):
        for row, place in enumerate(places):
            derivatives[row, order] = by_place.get(place, 0.0)
    return derivatives
