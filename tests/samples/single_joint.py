"""A joint without gravity, damping or coupling: its equations of motion are linear, and solved by hand."""

from __future__ import annotations

from samples.moves import move
from vsacli import DenavitHartenberg, Elastic, Inertia, Joint, Link, Motor, Rigid, Robot, Trajectory

LINK_INERTIA = 0.5
"""kg m^2 (kg)."""


def single_joint(actuator: Elastic | Rigid, joint_type: str = "revolute") -> Robot:
    """A link of `LINK_INERTIA` on its joint."""
    link = Link(
        mass=0.0 if joint_type == "revolute" else LINK_INERTIA,
        com=(0, 0, 0),
        inertia=Inertia(xx=LINK_INERTIA, yy=LINK_INERTIA, zz=LINK_INERTIA),
    )
    joint = Joint(
        name="axis", type=joint_type, dh=DenavitHartenberg(a=0, alpha=0), link=link, actuator=actuator
    )
    return Robot(name="single", gravity=(0, 0, 0), joints=(joint,))


def rigid_joint(motor_inertia: float, joint_type: str = "revolute") -> Robot:
    """A joint whose motor moves with it."""
    return single_joint(Rigid(motor=Motor(inertia=motor_inertia)), joint_type)


def step_of(size: float, duration: float = 1.0, rate: float = 50) -> Trajectory:
    """Rest to rest from 0.2 by a size."""
    return move(duration, rate, ((0.2,), (0.2 + size,)), degrees=(9, 3), name="step")
