"""Arms of `samples.full_model` as robots of vsacli; whether the full model follows the computed torques."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from samples.full_model import Drive, FullModel, PlanarArm
from samples.moves import move
from vsacli import (
    Damper,
    DenavitHartenberg,
    Inertia,
    Joint,
    Link,
    Result,
    Robot,
    Trajectory,
    inverse_dynamics,
)
from vsacli.actuators.actuator import Actuator

LINK = PlanarArm(lengths=[0.4], masses=[1.5], centers=[0.25], inertias=[0.03], damping=[0.2])
"""A pendulum."""

ARM = PlanarArm(
    lengths=[0.4, 0.3, 0.2],
    masses=[1.5, 1.0, 0.6],
    centers=[0.25, 0.12, 0.1],
    inertias=[0.03, 0.02, 0.004],
    damping=[0.2, 0.1, 0.05],
)
"""Three links."""

START, MOVE = np.array([-1.2, 0.5, 0.3]), np.array([0.8, -0.9, 1.1])
"""Where the joints begin, and how far they go, rad."""

DURATION, RATE = 0.5, 2000
"""s and 1/s; so short that a plant that falls away from the motion does not fall far."""


def robot_of(arm: PlanarArm, actuators: list[Actuator], dampers: Sequence[Damper | None] = ()) -> Robot:
    """The arm as a robot."""
    devices = zip(actuators, dampers or [None] * len(actuators), strict=True)
    links = zip(arm.lengths, arm.masses, arm.centers, arm.inertias, arm.damping, devices, strict=True)
    joints = tuple(
        Joint(
            name=f"joint_{number}",
            type="revolute",
            dh=DenavitHartenberg(a=length, alpha=0),
            link=Link(
                mass=mass,
                com=(center - length, 0, 0),
                inertia=Inertia(**dict.fromkeys(("xx", "yy", "zz"), inertia)),
            ),
            damping=damping,
            actuator=actuator,
            damper=damper,
        )
        for number, (length, mass, center, inertia, damping, (actuator, damper)) in enumerate(links, 1)
    )
    return Robot(name="arm", gravity=(0, -arm.gravity, 0), joints=joints)


def motion_of(
    stiffness: list[tuple[float, float]], damping: Sequence[tuple[float, float]] = ()
) -> Trajectory:
    """Rest to rest; stiffness and damping of each joint from one to another, NaN where none is commanded."""
    joints, signals = len(stiffness), {"stiffness": stiffness, "damping": damping}
    commanded = {key: tuple(zip(*values, strict=True)) for key, values in signals.items() if values}
    ends = START[:joints], (START + MOVE)[:joints]
    return move(DURATION, RATE, ends, degrees=(11, 7), **commanded)


def assert_follows(
    arm: PlanarArm,
    actuators: list[Actuator],
    drives: list[Drive],
    stiffness: list[tuple[float, float]],
    dampers: Sequence[Damper | None] = (),
    damping: Sequence[tuple[float, float]] = (),
) -> Result:
    """The computed torques move the full model along the command: 1e-9 rad, and 1e-9 of each stiffness.

    The integration is good to some 1e-12; the spline through the torques to some 1e-11.
    """
    result = inverse_dynamics(robot_of(arm, actuators, dampers), motion_of(stiffness, damping))
    assert not result.flags.any(), result
    start = result.q[0], result.theta[0], result.dq[0], result.dtheta[0]
    followed = FullModel(arm, drives).follow(result.time, result.tau_motor, *start)
    np.testing.assert_allclose(followed.q, result.q.T, rtol=0, atol=1e-9)
    sprung = [drive.springs is not None for drive in drives]
    np.testing.assert_allclose(followed.stiffness[sprung], result.stiffness.T[sprung], rtol=1e-9)
    return result
