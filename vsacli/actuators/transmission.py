"""Input and output of `Actuator.transmit`: command, internal motion and variables of a joint."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

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
        zero = np.zeros_like(tau_e)
        return cls(q, zero, zero, tau_e, zero, zero, {})

    def variables(self) -> JointVariables:
        """Return the record of the joint that has only these variables."""
        fields = {name: array for name, array in self.commanded.items() if name in JointVariables._fields}
        other_signals = {name: array for name, array in self.commanded.items() if name not in fields}
        return JointVariables(*self[:-1], **fields, further=other_signals)

    def arrays(self) -> dict[str, FloatArray]:
        """Return all arrays by name."""
        return {**dict(zip(self._fields[:-1], self[:-1], strict=True)), **self.commanded}


class InternalMotion(NamedTuple):
    """Internal motion of a transmission with a damper.

    Attributes:
        phi: State of the springs, (2, samples): its spread is used, the rest is a guess from which (14) is
            solved for the stiffness.
        velocity: w, the rate of the spread, (samples,); None if it follows from the damping.
        acceleration: Derivative of w, (samples,); None with `velocity`.
    """

    phi: FloatArray
    velocity: FloatArray | None
    acceleration: FloatArray | None


ABSENT: Any = None
"""Variable that a joint does not have, or that is not computed yet."""


class JointVariables(NamedTuple):
    """Variables of one joint, arrays (samples,), those of its motors (2, samples).

    `Actuator.transmit` computes the springs and the motion of the motors, `drive` the torques. Names and
    units are those of `vsacli.base.variables`; a motor that the actuator lacks is NaN.
    """

    q: AnyArray = ABSENT
    dq: AnyArray = ABSENT
    ddq: AnyArray = ABSENT
    tau_e: AnyArray = ABSENT
    dtau_e: AnyArray = ABSENT
    ddtau_e: AnyArray = ABSENT
    stiffness: AnyArray = ABSENT
    dstiffness: AnyArray = ABSENT
    ddstiffness: AnyArray = ABSENT
    damping: AnyArray = ABSENT
    ddamping: AnyArray = ABSENT
    dddamping: AnyArray = ABSENT
    phi: AnyArray = ABSENT
    dphi: AnyArray = ABSENT
    theta: AnyArray = ABSENT
    dtheta: AnyArray = ABSENT
    ddtheta: AnyArray = ABSENT
    tau_transmission: AnyArray = ABSENT
    tau_motor: AnyArray = ABSENT
    elastic_energy: AnyArray = ABSENT
    motor_power: AnyArray = ABSENT
    det_A: AnyArray = ABSENT  # noqa: N815
    stiffness_min: AnyArray = ABSENT
    stiffness_max: AnyArray = ABSENT
    flags: AnyArray = ABSENT
    tau_damper: AnyArray = ABSENT
    current: AnyArray = ABSENT
    voltage: AnyArray = ABSENT
    copper_loss: AnyArray = ABSENT
    dissipated_power: AnyArray = ABSENT
    further: Any = MappingProxyType({})
    """Arrays of commanded signals without a field here, by name."""

    @classmethod
    def of(cls, arrays: Mapping[str, AnyArray]) -> JointVariables:
        """Return the record of arrays by name; other names are ignored."""
        return cls(**{name: arrays[name] for name in cls._fields if name in arrays})

    def by_name(self) -> dict[str, AnyArray]:
        """Return the variables present, by name."""
        fields = zip(self._fields[:-1], self[:-1], strict=True)
        return {**{name: array for name, array in fields if array is not None}, **self.further}


def single_motor(command: Command, **variables: AnyArray) -> JointVariables:
    """Return the result of `Actuator.transmit` for one motor without a commanded stiffness.

    Args:
        command: Command of the joint.
        variables: Variables `stiffness` with its derivatives, `phi`, `dphi`, `theta`, `dtheta`, `ddtheta`,
            `tau_transmission`, `elastic_energy` and `flags`, each (samples,).
    """
    absent = np.full_like(variables["phi"], np.nan)
    motor_variables: dict[str, AnyArray] = {
        name: np.stack((values, absent)) if "motor" in VARIABLES[name].dims else values
        for name, values in variables.items()
    }
    return command.variables()._replace(
        **motor_variables, det_A=absent, stiffness_min=absent, stiffness_max=absent
    )
