"""Command and transmission, common to all actuators: the demand, and the springs between joint and motors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FlagArray, FloatArray
from vsacli.base.signals import COMMANDED, commanded_names


class Command(NamedTuple):
    """The demand on a joint, and the torque its link requires; arrays (samples,), SI units.

    Attributes:
        q, dq, ddq: motion of the joint.
        tau_e, dtau_e, ddtau_e: elastic torque and its derivatives.
        commanded: the signals of `COMMANDED` and their derivatives by name, e.g. `dstiffness`; those that the
            actuator does not take do not count.
    """

    q: FloatArray
    dq: FloatArray
    ddq: FloatArray
    tau_e: FloatArray
    dtau_e: FloatArray
    ddtau_e: FloatArray
    commanded: Mapping[str, FloatArray]

    @classmethod
    def names(cls, signals: Iterable[str]) -> tuple[str, ...]:
        """Names of all its arrays, as of the result variables, if these signals are given, by key."""
        return (*cls._fields[:-1], *(name for key in signals for name in COMMANDED[key].names))

    @classmethod
    def of(cls, arrays: Mapping[str, FloatArray]) -> Command:
        """Return the command from arrays by name; others are ignored."""
        commanded = {name: arrays[name] for name in commanded_names() if name in arrays}
        own = {name: arrays[name] for name in cls._fields[:-1]}
        return cls(**own, commanded=commanded)

    @classmethod
    def at_rest(cls, tau_e: FloatArray, q: FloatArray) -> Command:
        """Return the command of a resting joint that carries torques, (samples,); no signal is commanded."""
        still = np.zeros_like(tau_e)
        return cls(q, still, still, tau_e, still, still, {})

    def arrays(self) -> dict[str, FloatArray]:
        """Return all arrays by their names."""
        return {**dict(zip(self._fields[:-1], self[:-1], strict=True)), **self.commanded}


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
    *,
    stiffness: FloatArray,
    dstiffness: FloatArray,
    ddstiffness: FloatArray,
    phi: FloatArray,
    dphi: FloatArray,
    ddtheta: FloatArray,
    tau_spring: FloatArray,
    elastic_energy: FloatArray,
    flags: FlagArray,
) -> Transmission:
    """Return the transmission of an actuator with one motor, whose stiffness is not commanded.

    Arrays (samples,).
    """
    none = np.full_like(phi, np.nan)
    return Transmission(
        stiffness=stiffness,
        dstiffness=dstiffness,
        ddstiffness=ddstiffness,
        phi=np.stack((phi, none)),
        dphi=np.stack((dphi, none)),
        ddtheta=np.stack((ddtheta, none)),
        tau_spring=np.stack((tau_spring, none)),
        elastic_energy=elastic_energy,
        det_A=none,
        stiffness_lower=none,
        stiffness_upper=none,
        flags=flags,
    )
