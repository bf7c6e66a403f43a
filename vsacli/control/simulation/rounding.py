"""Whether numbers of double precision are fine enough for a closed loop."""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.units import TORQUE
from vsacli.control.simulation.closed_loop import ClosedLoop
from vsacli.control.simulation.stiff import jacobian, rounding
from vsacli.robot.model import Robot

LARGEST_SHARE = 1e-4
"""Share of the largest torque of the motion by which rounding may change torques. With 4e-6, a spring of
1e12 N m/rad, a simulation is as exact as ever, with 4e-4, one of 1e14, its steps follow the rounding."""

SMALLEST_TORQUE = 1e-3
"""N m (N): a change below is harmless even where the motion takes no torque at all."""


def check_rounding(robot: Robot, loop: ClosedLoop, start: FloatArray, time: float, peak: float) -> None:
    """Refuse springs so stiff, or poles so fast, that torques follow the rounding of the state.

    Args:
        robot: the robot.
        loop: it, under its controller.
        start: its first state vector.
        time: of that, s.
        peak: the largest torque of a motor that the motion takes, N m (N).

    Raises:
        InputError: torques do, at the joint where it is worst; it says what would help.
    """

    def of_springs(_time: float, vectors: FloatArray) -> FloatArray:
        phase = loop.packing.unpack(vectors)
        return drivetrain.torques(phase.q, phase.theta).tau_spring

    drivetrain, bound = loop.plant.drivetrain, max(LARGEST_SHARE * peak, SMALLEST_TORQUE)
    for torques, joints, fault, remedy in (
        (
            of_springs,
            drivetrain.spring_joint,
            "springs are too stiff",
            "soften them or make the joint rigid",
        ),
        (loop.demand, drivetrain.joint, "poles are too fast", "choose slower ones"),
    ):
        changes = rounding(jacobian(torques, time, start), start)
        if changes.max(initial=0.0) > bound:
            worst = int(np.argmax(changes))
            joint = robot.joints[joints[worst]]
            unit = TORQUE.unit(joint.type)
            raise InputError.one(
                f"{joint.name}: its {fault} to be simulated: rounding of positions alone changes torques by "
                f"{changes[worst]:.2g} {unit}, and the motion takes up to {peak:.3g} {unit}; {remedy}"
            )
