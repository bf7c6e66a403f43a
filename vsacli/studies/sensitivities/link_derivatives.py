"""Derivatives of the torques that the links demand, by numbers of links, rows and the robot as a whole."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from vsacli.base.arrays import FloatArray, by_joint
from vsacli.compute.duals import Dual, tangent_of
from vsacli.compute.vector import Scalar
from vsacli.dynamics.elastic_torques import TORQUES, LinkTorques
from vsacli.robot.model import Robot
from vsacli.studies.sensitivities.parameters import Parameter, seeded
from vsacli.trajectory.motion import Motion

FORWARD = ("dh", "gravity", "base")
"""Parts of a robot that move the links beyond, so that all of the recursion carries derivatives; others only
add forces, which the links before it bear."""


def batches(chosen: Sequence[Parameter]) -> Iterator[list[int]]:
    """Places of the parameters that links depend on, in groups by which the recursion carries derivatives."""
    groups: dict[tuple[int | None, bool], list[int]] = {}
    for place, parameter in enumerate(chosen):
        if parameter.part != "actuator":
            groups.setdefault((parameter.joint, parameter.part in FORWARD), []).append(place)
    yield from groups.values()


def torque_derivatives(robot: Robot, motion: Motion, chosen: Sequence[Parameter]) -> list[FloatArray | None]:
    """Derivatives of tau_e, tau_e', tau_e'' (58)-(60) by some numbers of a robot.

    Args:
        robot: the robot.
        motion: samples, and the wrench if there is one.
        chosen: the numbers, all of one of the `batches`.

    Returns:
        For each joint (parameters, 3, samples), in N m (N) per s^k and per SI unit of each number; None for a
        joint that bears nothing of what they change.
    """
    kernel = LinkTorques(seeded(robot, chosen), None if motion.wrench is None else motion.wrench.frame)
    given = motion.variables()
    rows = kernel.arguments.pack({name: by_joint(given[name]) for name in kernel.arguments.shapes})
    torques = kernel.results.unpack(kernel(rows))
    shape = (len(chosen), len(motion.time))
    return [
        _tangents(of_joint, *shape) for of_joint in zip(*(torques[name] for name in TORQUES), strict=True)
    ]


def _tangents(torques: Sequence[Scalar], directions: int, samples: int) -> FloatArray | None:
    if not any(isinstance(torque, Dual) for torque in torques):
        return None
    return np.stack([tangent_of(torque, directions, (samples,)) for torque in torques], axis=1)
