"""Input and output of `Actuator.transmit`: the command of a joint, and the result variables of one motor."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from vsacli.actuators.reach import OfJoint
from vsacli.base.arrays import AnyArray, FloatArray
from vsacli.base.signals import COMMANDED, commanded_names
from vsacli.base.variables import VARIABLES


class Command(NamedTuple):
    """The demand on a joint: motion, commanded signals, and elastic torque; arrays (samples,), SI units.

    Attributes:
        q, dq, ddq: Motion of the joint.
        tau_e, dtau_e, ddtau_e: Elastic torque and its derivatives.
        commanded: Signals of `COMMANDED` and their derivatives by name, e.g. `dstiffness`; the actuator
            ignores those that it does not need.
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
        """Return the names of all arrays of a command with commanded signals of these keys."""
        return (*cls._fields[:-1], *(name for key in signals for name in COMMANDED[key].names))

    @classmethod
    def of(cls, arrays: Mapping[str, FloatArray]) -> Command:
        """Return the command from arrays by name; other names are ignored."""
        commanded = {name: arrays[name] for name in commanded_names() if name in arrays}
        motion = {name: arrays[name] for name in cls._fields[:-1]}
        return cls(**motion, commanded=commanded)

    @classmethod
    def at_rest(cls, tau_e: FloatArray, q: FloatArray) -> Command:
        """Return the command of a joint at rest under torques, (samples,), without commanded signals."""
        still = np.zeros_like(tau_e)
        return cls(q, still, still, tau_e, still, still, {})

    def arrays(self) -> dict[str, FloatArray]:
        """Return all arrays by name."""
        return {**dict(zip(self._fields[:-1], self[:-1], strict=True)), **self.commanded}


def single_motor(**variables: AnyArray) -> OfJoint:
    """Return the result of `Actuator.transmit` for one motor without a commanded stiffness.

    Args:
        variables: Variables `stiffness` with its derivatives, `phi`, `dphi`, `theta`, `dtheta`, `ddtheta`,
            `tau_transmission`, `elastic_energy` and `flags`, each (samples,).
    """
    none = np.full_like(variables["phi"], np.nan)
    transmitted = {
        name: np.stack((values, none)) if "motor" in VARIABLES[name].dims else values
        for name, values in variables.items()
    }
    return {**transmitted, "det_A": none, "stiffness_min": none, "stiffness_max": none}
