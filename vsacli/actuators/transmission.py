"""The command of a joint, from which `Actuator.transmit` computes, and the variables of a single motor."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from vsacli.actuators.reach import OfJoint
from vsacli.base.arrays import AnyArray, FloatArray
from vsacli.base.signals import COMMANDED, commanded_names
from vsacli.base.variables import VARIABLES


class Command(NamedTuple):
    """The commanded motion and signals of a joint, and the elastic torque of its link; (samples,), SI units.

    Attributes:
        q, dq, ddq: motion of the joint.
        tau_e, dtau_e, ddtau_e: elastic torque and its derivatives.
        commanded: the signals of `COMMANDED` and their derivatives by name, e.g. `dstiffness`; those that the
            actuator does not take are ignored.
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
        """Return the names of all its arrays, given the keys of the commanded signals."""
        return (*cls._fields[:-1], *(name for key in signals for name in COMMANDED[key].names))

    @classmethod
    def of(cls, arrays: Mapping[str, FloatArray]) -> Command:
        """Return the command of arrays by name; other names are ignored."""
        commanded = {name: arrays[name] for name in commanded_names() if name in arrays}
        own = {name: arrays[name] for name in cls._fields[:-1]}
        return cls(**own, commanded=commanded)

    @classmethod
    def at_rest(cls, tau_e: FloatArray, q: FloatArray) -> Command:
        """Return the command of a joint at rest under torques, (samples,); no signal is commanded."""
        still = np.zeros_like(tau_e)
        return cls(q, still, still, tau_e, still, still, {})

    def arrays(self) -> dict[str, FloatArray]:
        """Return all arrays by name."""
        return {**dict(zip(self._fields[:-1], self[:-1], strict=True)), **self.commanded}


def single_motor(**variables: AnyArray) -> OfJoint:
    """Return `Actuator.transmit` of an actuator with one motor, whose stiffness is not commanded.

    Args:
        variables: `stiffness` with its derivatives, `phi`, `dphi`, `ddtheta`, `tau_transmission`,
            `elastic_energy` and `flags`, each (samples,).
    """
    none = np.full_like(variables["phi"], np.nan)
    transmitted = {
        name: np.stack((values, none)) if "motor" in VARIABLES[name].dims else values
        for name, values in variables.items()
    }
    return {**transmitted, "det_A": none, "stiffness_min": none, "stiffness_max": none}
