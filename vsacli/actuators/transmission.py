"""What every actuator has in common: what it is asked to do, and what lies between joint and motors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FlagArray, FloatArray


class Command(NamedTuple):
    """What a joint is asked to do and what its link demands of it; arrays (samples,), SI units.

    The stiffness and its derivatives count at antagonistic joints only.
    """

    q: FloatArray
    dq: FloatArray
    ddq: FloatArray
    stiffness: FloatArray
    dstiffness: FloatArray
    ddstiffness: FloatArray
    tau_e: FloatArray
    dtau_e: FloatArray
    ddtau_e: FloatArray


class Transmission(NamedTuple):
    """Stiffness of a joint and motion of its motors; (2, samples) for the motors, else (samples,).

    The names are those of the result variables. What the actuator does not have is NaN: a second motor, say.
    """

    stiffness: FloatArray
    dstiffness: FloatArray
    ddstiffness: FloatArray
    phi: FloatArray
    dphi: FloatArray
    ddtheta: FloatArray
    tau_spring: FloatArray
    elastic_energy: FloatArray
    det_A: FloatArray  # noqa: N815  (the published name)
    stiffness_lower: FloatArray
    stiffness_upper: FloatArray
    flags: FlagArray


def single_motor(
    command: Command,
    *,
    stiffness: float,
    stiffness_rates: float,
    phi: FloatArray,
    dphi: FloatArray,
    ddtheta: FloatArray,
) -> Transmission:
    """The transmission of an actuator with one motor, which carries tau_e and is always within reach.

    Args:
        command: what the joint is asked to do.
        stiffness: the same at every step, NaN if the joint has none.
        stiffness_rates: its derivatives, zero or NaN.
        phi: deflection of the transmission, (samples,).
        dphi: its rate, (samples,).
        ddtheta: acceleration of the motor, (samples,).
    """
    none = np.full_like(command.q, np.nan)
    return Transmission(
        stiffness=np.full_like(none, stiffness),
        dstiffness=np.full_like(none, stiffness_rates),
        ddstiffness=np.full_like(none, stiffness_rates),
        phi=np.stack((phi, none)),
        dphi=np.stack((dphi, none)),
        ddtheta=np.stack((ddtheta, none)),
        tau_spring=np.stack((command.tau_e, none)),
        elastic_energy=phi * command.tau_e / 2,
        det_A=none,
        stiffness_lower=none,
        stiffness_upper=none,
        flags=np.zeros(none.shape, dtype=np.uint16),
    )
