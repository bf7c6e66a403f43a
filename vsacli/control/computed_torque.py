"""Computed torque for robots without springs, (3)."""

from __future__ import annotations

from vsacli.base.arrays import FloatArray
from vsacli.control.gains import Gains
from vsacli.control.linear_control import Integral, linear_control
from vsacli.dynamics.forward import Plant
from vsacli.trajectory.motion import Motion


class ComputedTorque:
    """The law for a robot all of whose motors move their links directly."""

    def __init__(self, plant: Plant, gains: Gains) -> None:
        self._plant = plant
        self._gains = gains

    def torque(
        self,
        q: FloatArray,
        dq: FloatArray,
        _theta: FloatArray,
        _dtheta: FloatArray,
        reference: Motion,
        integral: Integral,
    ) -> FloatArray:
        """Motor torques, (..., motors): tau = (M + B) v + n + Dm q'."""
        v_q = linear_control(
            (reference.q, reference.dq, reference.ddq),
            (q, dq),
            self._gains.position, self._gains.position_integral, integral.q,
        )  # fmt: skip
        chain, drivetrain = self._plant.chain, self._plant.drivetrain
        of_links = (chain.mass_matrix(q) @ v_q[..., None])[..., 0] + chain.bias(q, dq, reference.wrench)
        of_links += drivetrain.inertia * v_q + drivetrain.damping * dq
        return of_links
