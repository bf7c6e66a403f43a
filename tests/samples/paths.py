"""Paths that are analytic in complex time, and the recursion along them: derivatives by complex steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from vsacli import Joint, Robot
from vsacli.dynamics.elastic_torques import carriers, link_constants, tool_loads
from vsacli.dynamics.recursion import recursion
from vsacli.dynamics.recursion_inputs import JointState, RecursionInputs
from vsacli.robot.kinematics import base_gravity

ComplexArray = npt.NDArray[np.complex128]

STEP = 1e-30
"""s; a complex step has no cancellation, and the square of this one vanishes against 1."""


class Path:
    """q(t) = a + b t + c sin(w t + f) for each component, analytic in complex t."""

    def __init__(self, components: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.a, self.b, self.c, self.f = rng.uniform(-2, 2, (4, components, 1))
        self.w = rng.uniform(1, 4, (components, 1))

    def motion(self, time: ComplexArray) -> list[ComplexArray]:
        """q, dq, ddq, d3q, d4q, each (components, samples)."""
        phase = self.w * time + self.f
        sine, cosine = self.c * np.sin(phase), self.c * np.cos(phase)
        return [
            self.a + self.b * time + sine,
            self.b + self.w * cosine,
            -(self.w**2) * sine,
            -(self.w**3) * cosine,
            self.w**4 * sine,
        ]


def complex_torques(
    robot: Robot,
    motion: Sequence[ComplexArray],
    wrench: Sequence[ComplexArray] | None = None,
    frame: str = "end_effector",
) -> ComplexArray:
    """The recursion on complex rows, (orders, samples, joints)."""
    q, *rates = motion
    states = [_state(joint, q[k], [rate[k] for rate in rates]) for k, joint in enumerate(robot.joints)]
    links = [link_constants(joint) for joint in robot.joints]
    loads = [] if wrench is None else tool_loads(robot, frame, wrench)
    torques = recursion(RecursionInputs(links, states, carriers(robot), base_gravity(robot), loads))
    return np.moveaxis(np.array([tuple(joint) for joint in torques]), 0, -1)


def _state(joint: Joint, q: ComplexArray, rates: list[ComplexArray]) -> JointState:
    turn, slide = (q, 0) if joint.is_revolute else (0, q)
    angle, offset = joint.dh.theta + turn, joint.dh.d + slide
    dq, ddq, d3q, d4q = rates
    return JointState(np.cos(angle), np.sin(angle), offset, (dq, ddq, d3q, d4q))
