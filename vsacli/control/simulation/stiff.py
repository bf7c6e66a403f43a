"""Stiff equations of motion: their Jacobian, and whether double precision resolves them."""

from __future__ import annotations

import math

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.units import TORQUE
from vsacli.control.simulation.closed_loop import ClosedLoop
from vsacli.control.simulation.ending import Derivative
from vsacli.robot.model import Robot

_EPSILON = float(np.finfo(np.float64).eps)
_RELATIVE_STEP = math.sqrt(_EPSILON)
"""Step of forward differences, where truncation and rounding are equal."""


def jacobian(function: Derivative, time: float, vector: FloatArray) -> FloatArray:
    """Derivative of a function of time and state by the state, (values, entries), by forward differences.

    Where a difference steps over the end of a spring's law the entry is zero: Newton's iteration becomes
    slower by that, and not wrong.
    """
    steps = _RELATIVE_STEP * np.maximum(np.abs(vector), 1.0)
    rows = function(time, np.vstack((vector, vector + np.diag(steps))))
    columns = (rows[1:] - rows[0]) / steps[:, None]
    return np.where(np.isfinite(columns), columns, 0.0).T


def rounding(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """Return the effect of a rounded state on a function, (values,), from its Jacobian (values, entries)."""
    changes: FloatArray = _EPSILON * (np.abs(matrix) @ np.maximum(np.abs(vector), 1.0))
    return changes


def resolved(matrix: FloatArray, vector: FloatArray, rtol: float) -> FloatArray:
    """Smallest absolute tolerances (entries,) that rounding allows an implicit method with such a Jacobian.

    Rounding makes rates of the fastest mode uncertain, and the mode forgets within 1/|lambda|. Newton's
    iteration stops at a share of sqrt(rtol) of the tolerance (`Radau` of SciPy), which must not lie below.
    """
    fastest = float(np.abs(np.linalg.eigvals(matrix)).max(initial=1.0))
    return rounding(matrix, vector) / (fastest * math.sqrt(rtol))


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
        return drivetrain.torques(phase.q, phase.theta).tau_transmission

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
