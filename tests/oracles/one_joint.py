"""Motor torques of one joint in closed form, from the position and its derivatives.

The link is a pendulum. It is driven by a linear spring, or by two motors with equal springs
tau = k phi + k_c phi^3. With phi_1 = a + p and phi_2 = a - p, the joint torque
tau_e = 2 k a + 2 k_c (a^3 + 3 a p^2) and the joint stiffness sigma = 2 k + 6 k_c (a^2 + p^2) give
tau_e = a sigma - 4 k_c a^3, which has one root where p is real.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

MASS, LEVER, INERTIA = 5.0894, 0.15, 0.0434
"""Of the link: kg; distance of its center of mass from the joint, m; inertia about that center, kg m^2."""

GRAVITY = 9.81
JOINT_DAMPING, MOTOR_DAMPING = 1e-5, 1e-4
"""N m s/rad."""

ROUNDS = 60
"""Newton's method starts below the root of a concave function, and so approaches it from one side."""


class Arm(NamedTuple):
    """A joint that turns a link.

    Attributes:
        motor_inertia: kg m^2.
        k: stiffness of the spring, or linear coefficient of each of two, N m/rad.
        k_c: cubic coefficient of each of two springs, N m/rad^3; 0 if there is one linear spring.
        horizontal: whether gravity does not act on it.
    """

    motor_inertia: float
    k: float
    k_c: float
    horizontal: bool

    @property
    def antagonistic(self) -> bool:
        """Whether it has two motors, and is commanded a stiffness."""
        return self.k_c > 0


def joint_torque(arm: Arm, q: np.ndarray) -> np.ndarray:
    """Return tau_e and its first two derivatives, (3, samples).

    Args:
        arm: the arm.
        q: position and four derivatives, (5, samples).
    """
    inertia = INERTIA + MASS * LEVER**2
    weight = 0.0 if arm.horizontal else MASS * GRAVITY * LEVER
    sine, cosine = np.sin(q[0]), np.cos(q[0])
    load = weight * np.array([cosine, -sine * q[1], -cosine * q[1] ** 2 - sine * q[2]])
    return inertia * q[2:] + JOINT_DAMPING * q[1:4] + load


def least_stiffness(arm: Arm, q: np.ndarray) -> np.ndarray:
    """Return the stiffness of two springs without co-contraction (p = 0), (samples,)."""
    torque = joint_torque(arm, q)[0]
    deflection = np.zeros_like(torque)
    for _ in range(ROUNDS):
        excess = 2 * arm.k * deflection + 2 * arm.k_c * deflection**3 - torque
        deflection -= excess / (2 * arm.k + 6 * arm.k_c * deflection**2)
    return 2 * arm.k + 6 * arm.k_c * deflection**2


def motor_torque(arm: Arm, q: np.ndarray, stiffness: np.ndarray | None = None) -> np.ndarray:
    """Return tau_motor, (motors, samples); NaN where the stiffness cannot be had.

    Args:
        arm: the arm.
        q: position and four derivatives, (5, samples).
        stiffness: joint stiffness and two derivatives, (3, samples), of an antagonistic arm.
    """
    torque = joint_torque(arm, q)
    if stiffness is None:
        deflections = torque[None] / arm.k
    else:
        shared, preload = _twins(arm, torque, stiffness)
        deflections = np.array([shared + preload, shared - preload])
    spring = arm.k * deflections[:, 0] + arm.k_c * deflections[:, 0] ** 3
    speed, acceleration = q[1] + deflections[:, 1], q[2] + deflections[:, 2]
    return arm.motor_inertia * acceleration + MOTOR_DAMPING * speed + spring


def _twins(arm: Arm, torque: np.ndarray, stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return half the sum a and half the difference p of two deflections with two derivatives each."""
    sigma, first, second = stiffness
    a = torque[0] / sigma
    for _ in range(ROUNDS):
        a -= (a * sigma - 4 * arm.k_c * a**3 - torque[0]) / (sigma - 12 * arm.k_c * a**2)
    slope = sigma - 12 * arm.k_c * a**2
    da = (torque[1] - a * first) / slope
    dda = (torque[2] - 2 * da * first - a * second + 24 * arm.k_c * a * da**2) / slope
    square = (sigma - 2 * arm.k) / (6 * arm.k_c) - a**2
    dsquare = first / (6 * arm.k_c) - 2 * a * da
    ddsquare = second / (6 * arm.k_c) - 2 * da**2 - 2 * a * dda
    with np.errstate(invalid="ignore"):
        p = np.sqrt(square)
    dp = dsquare / (2 * p)
    ddp = (ddsquare - 2 * dp**2) / (2 * p)
    return np.array([a, da, dda]), np.array([p, dp, ddp])
