"""Stiff equations of motion: their Jacobian, and checks whether double precision resolves them."""

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
"""Step of forward differences, relative to an entry, at which truncation and rounding are equal."""


def difference_jacobian(function: Derivative, time: float, vector: FloatArray) -> FloatArray:
    """Return the Jacobian of a function with respect to the state, (values, entries), by forward differences.

    An entry is zero if its difference leaves the range of a spring's law: Newton's iteration becomes slower,
    not wrong.
    """
    steps = _RELATIVE_STEP * np.maximum(np.abs(vector), 1.0)
    rows = function(time, np.vstack((vector, vector + np.diag(steps))))
    columns = (rows[1:] - rows[0]) / steps[:, None]
    return np.where(np.isfinite(columns), columns, 0.0).T


def rounding_effect(jacobian: FloatArray, vector: FloatArray) -> FloatArray:
    """Return the effect of a rounded state on a function, (values,), by its Jacobian, (values, entries)."""
    return _EPSILON * (np.abs(jacobian) @ np.maximum(np.abs(vector), 1.0))


def resolved_tolerances(jacobian: FloatArray, vector: FloatArray, rtol: float) -> FloatArray:
    """Return the smallest absolute tolerances, (entries,), that rounding allows with an implicit method.

    Rounding makes the rates of the fastest mode uncertain, and this mode decays within 1/|lambda|. Newton's
    iteration in SciPy's `Radau` stops at a share of sqrt(rtol) of the tolerance, which must exceed rounding.
    """
    spectral_radius = float(np.abs(np.linalg.eigvals(jacobian)).max(initial=1.0))
    return rounding_effect(jacobian, vector) / (spectral_radius * math.sqrt(rtol))


LARGEST_SHARE = 1e-4
"""Share of the largest torque of the motion by which rounding may change torques. At 4e-6, with a spring of
1e12 N m/rad, a simulation is as accurate as others; at 4e-4, with 1e14 N m/rad, steps follow rounding."""

SMALLEST_TORQUE = 1e-3
"""Change of torques, N m (N), that is harmless even if the motion requires no torque at all."""


def check_rounding(robot: Robot, loop: ClosedLoop, start: FloatArray, time: float, peak: float) -> None:
    """Raise an error for springs so stiff, or poles so fast, that torques follow the rounding of the state.

    Args:
        robot: robot.
        loop: robot under its controller.
        start: initial state vector.
        time: initial time, s.
        peak: largest motor torque that the motion requires, N m (N).

    Raises:
        InputError: torques follow the rounding; names the worst joint, and a fix.
    """

    def spring_torques(_time: float, vectors: FloatArray) -> FloatArray:
        phase = loop.packing.unpack(vectors)
        return drivetrain.torques(phase.q, phase.theta).tau_transmission

    drivetrain, bound = loop.plant.drivetrain, max(LARGEST_SHARE * peak, SMALLEST_TORQUE)
    for torques, joints, fault, advice in (
        (
            spring_torques,
            drivetrain.spring_joint,
            "springs are too stiff",
            "soften them or make the joint rigid",
        ),
        (loop.demand, drivetrain.joint, "poles are too fast", "choose slower ones"),
    ):
        changes = rounding_effect(difference_jacobian(torques, time, start), start)
        if changes.max(initial=0.0) > bound:
            worst = int(np.argmax(changes))
            joint = robot.joints[joints[worst]]
            unit = TORQUE.unit(joint.type)
            raise InputError.one(
                f"{joint.name}: its {fault} to be simulated: rounding of positions alone changes torques by "
                f"{changes[worst]:.2g} {unit}, and the motion takes up to {peak:.3g} {unit}; {advice}"
            )
