"""The work of the actuator of a joint, whatever its kind: motors, springs, flags."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.friction import FrictionLaws
from vsacli.actuators.motor import Windings
from vsacli.actuators.reach import OfJoint
from vsacli.actuators.transmission import Command, Transmission
from vsacli.base.arrays import AnyArray, BoolArray, FlagArray, FloatArray
from vsacli.base.flags import NEAR_SINGULAR_MARGIN, Flag, finite, has, not_finite_flags
from vsacli.base.signals import DAMPING
from vsacli.base.variables import VARIABLES
from vsacli.dynamics.limits import limit_flags
from vsacli.robot.joint import Joint

if TYPE_CHECKING:
    from vsacli.actuators.damped_springs import InternalMotion


class Drive(NamedTuple):
    """Stiffness, motor motion and motor torques of a joint; (2, samples) for the motors, else (samples,).

    The names are those of the result variables. Where a step is infeasible everything of the motors is NaN,
    where it is singular what needs the inverse of the decoupling matrix is. What the actuator does not have
    is NaN throughout; what belongs to devices that the joint does not have, or to motors without torque
    constant, is None.
    """

    stiffness: FloatArray
    dstiffness: FloatArray
    ddstiffness: FloatArray
    phi: FloatArray
    dphi: FloatArray
    theta: FloatArray
    dtheta: FloatArray
    ddtheta: FloatArray
    tau_spring: FloatArray
    tau_motor: FloatArray
    elastic_energy: FloatArray
    motor_power: FloatArray
    det_A: FloatArray  # noqa: N815  (the published name)
    stiffness_lower: FloatArray
    stiffness_upper: FloatArray
    flags: FlagArray
    tau_damper: FloatArray | None = None
    current: FloatArray | None = None
    voltage: FloatArray | None = None
    copper_loss: FloatArray | None = None

    def arrays(self) -> dict[str, AnyArray]:
        """Return the arrays that exist, by name."""
        return {name: values for name, values in self._asdict().items() if values is not None}


def drive(
    joint: Joint,
    command: Command,
    near_singular: float = NEAR_SINGULAR_MARGIN,
    integrated: FloatArray | None = None,
    internal: InternalMotion | None = None,
) -> Drive:
    """Motor motion and motor torques of a joint, (61)-(74).

    Args:
        joint: the joint with its actuator.
        command: commanded motion and stiffness, and the elastic torque with its two derivatives.
        near_singular: margin below which a step is near-singular.
        integrated: deflections of a joint to use instead of the root of (14), (2, samples); a
            step where they are NaN is infeasible.
        internal: what moves inside a transmission that is damped.
    """
    driven = driven_by(joint, command, near_singular, integrated, internal)
    of_joint = {**command.arrays(), **driven.arrays()}
    exceeded = limit_flags(joint, of_joint, np.zeros_like(driven.flags))
    unexplained = not_finite_flags(_not_finite(joint, of_joint))
    return driven._replace(flags=driven.flags | exceeded | unexplained)


def driven_by(
    joint: Joint,
    command: Command,
    near_singular: float,
    integrated: FloatArray | None = None,
    internal: InternalMotion | None = None,
) -> Drive:
    """Return `drive` with the flags of reach alone; also with scalars that carry derivatives."""
    actuator = joint.actuator
    if internal is None:
        transmission = actuator.transmit(command, near_singular, integrated)
    else:
        transmission = _damped(actuator, command, near_singular, internal)
    dtheta = actuator.motor_positions(transmission.dphi, command.dq)  # (69)
    tau_motor = motor_torques(actuator, dtheta, transmission.ddtheta, transmission.tau_spring)
    tau_damper, beside = _damper_torques(joint, command, transmission.dphi)
    if beside is not None:
        tau_motor = tau_motor + beside
    windings = Windings.of(actuator.sides)
    electrical: dict[str, Any] = (
        {} if windings is None else windings.with_axis_behind().variables(tau_motor, dtheta)
    )
    driven = Drive(
        **transmission._asdict(),
        theta=actuator.motor_positions(transmission.phi, command.q),  # (69)
        dtheta=dtheta,
        tau_motor=tau_motor,
        motor_power=tau_motor * dtheta,
        tau_damper=tau_damper,
    )._replace(**electrical)
    return driven._replace(phi=_published(actuator, driven.phi), dphi=_published(actuator, driven.dphi))


def motor_torques(
    actuator: Actuator, dtheta: FloatArray, ddtheta: FloatArray, tau_spring: FloatArray
) -> FloatArray:
    """Torques of motors that move and bear springs so, (73)-(74) with friction; all (2, samples)."""
    damping = _by_motor([motor.damping for motor in actuator.motors])
    torques = _rotor_torques(actuator, ddtheta) + damping * dtheta + tau_spring
    friction = FrictionLaws.of([side.friction if side else None for side in actuator.sides])
    if friction is not None:
        torques = torques + friction.with_axis_behind().torque(dtheta)
    return torques


def _damped(
    actuator: Actuator, command: Command, near_singular: float, internal: InternalMotion
) -> Transmission:
    from vsacli.actuators.damped_springs import DampedSprings

    return DampedSprings(actuator).transmit(command, internal, near_singular)


def _damper_torques(
    joint: Joint, command: Command, dphi: FloatArray
) -> tuple[FloatArray | None, FloatArray | None]:
    """Return the torques of a damper on the link, (samples,), and against each motor, (2, samples)."""
    if joint.damper is None:
        return None, None
    damping = command.commanded[DAMPING.key]
    if joint.damper_at("link"):
        return damping * command.dq, None
    behind = joint.actuator.has(VARIABLES["phi"])
    passed = [damping * rate if there else 0 * damping for rate, there in zip(dphi, behind, strict=True)]
    return passed[0] + passed[1], np.stack(passed)


def _rotor_torques(actuator: Actuator, ddtheta: FloatArray) -> FloatArray:
    """B theta'', (2, samples)."""
    own = _by_motor([motor.inertia for motor in actuator.motors]) * ddtheta
    coupling = actuator.coupled_rotors
    return own + coupling * ddtheta[::-1] if coupling else own


def _not_finite(joint: Joint, of_joint: OfJoint) -> BoolArray:
    """Return where a value of the motors is not finite, although neither infeasible nor singular.

    Of a demand that is no finite number itself, neither can be said. By (69) and (73)-(74) everything of a
    motor goes into its position or its power; singular steps have no power.
    """
    theta, tau_spring, power = (
        finite(of_joint[name][: joint.actuator.motor_count])
        for name in ("theta", "tau_spring", "motor_power")
    )
    infeasible, singular = (has(of_joint["flags"], flag) for flag in (Flag.INFEASIBLE, Flag.SINGULAR))
    explained = infeasible | (theta & tau_spring & (singular | power))
    demand = finite([of_joint["tau_e"], *(of_joint[key] for key in joint.commanded)])
    return ~(demand & explained)


def _published(actuator: Actuator, phi: FloatArray) -> FloatArray:
    """Phi of the motors that a spring lies behind; NaN of one that sets the springs."""
    there = actuator.has(VARIABLES["phi"])[: actuator.motor_count]
    return phi if all(there) else np.where(np.array(actuator.has(VARIABLES["phi"]))[:, None], phi, np.nan)


def _by_motor(values: list[float]) -> FloatArray:
    """(2, 1), NaN for a motor there is not."""
    return np.stack([*values, *[math.nan] * (SIDES - len(values))])[:, None]
