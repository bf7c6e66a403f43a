"""Actuation of a joint, (61)-(74): stiffness, motor motion and motor torques, for every kind of actuator.

`Actuator.transmit` computes (61)-(72), `drive_without_limits` adds (73)-(74), `drive` the flags of limits.
"""

from __future__ import annotations

import math

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.friction import FrictionLaws
from vsacli.actuators.motor import ELECTRICAL, Windings
from vsacli.actuators.reach import VariablesOfJoint
from vsacli.actuators.transmission import Command, InternalMotion, JointVariables
from vsacli.base.arrays import BoolArray, FloatArray, stack_constants
from vsacli.base.flags import MIN_MARGIN, Flag, finite, has_flag, not_finite_flags
from vsacli.base.signals import DAMPING
from vsacli.base.variables import VARIABLES
from vsacli.compute.vector import is_zero
from vsacli.dynamics.limits import limit_flags
from vsacli.robot.joint import Joint

ACTUATED = (
    *("stiffness", "dstiffness", "ddstiffness", "phi", "dphi", "theta", "dtheta", "ddtheta"),
    *(
        "tau_transmission",
        "tau_motor",
        "elastic_energy",
        "motor_power",
        "det_A",
        "stiffness_min",
        "stiffness_max",
        "flags",
    ),
)
"""Result variables of the actuation of every joint, in the order of their rows."""

OF_DEVICES = ("tau_damper", *ELECTRICAL)
"""Further result variables, of joints with a damper or with a motor that has a torque constant."""


def drive(
    joint: Joint,
    command: Command,
    min_margin: float = MIN_MARGIN,
    prescribed: FloatArray | InternalMotion | None = None,
) -> JointVariables:
    """Compute motor motion and motor torques of a joint, (61)-(74).

    Args:
        joint: Joint with its actuator.
        command: Commanded motion and stiffness, and the elastic torque with its two derivatives.
        min_margin: Margin below which a sample is near-singular.
        prescribed: Deflections to use instead of the root of (14), (2, samples); a sample where they are
            NaN is infeasible. Of a damped transmission, its internal motion.

    Returns:
        The command, the variables `ACTUATED`, and those of `OF_DEVICES` that the joint has. At infeasible
        samples all motor variables are NaN; at singular samples those that need the inverse of the decoupling
        matrix. A motor that the actuator does not have is NaN throughout.
    """
    variables = drive_without_limits(joint, command, min_margin, prescribed)  # (61)-(74)
    arrays = variables.by_name()
    limit_bits = limit_flags(joint, arrays, np.zeros_like(variables.flags))
    not_finite_bits = not_finite_flags(_motors_not_finite(joint, arrays))
    return variables._replace(flags=variables.flags | limit_bits | not_finite_bits)


def drive_without_limits(
    joint: Joint,
    command: Command,
    min_margin: float,
    prescribed: FloatArray | InternalMotion | None = None,
) -> JointVariables:
    """Compute as `drive`, but only the flags of feasibility; scalars may also be dual numbers."""
    actuator = joint.actuator
    if isinstance(prescribed, InternalMotion):
        from vsacli.actuators.damped_springs import DampedSprings

        transmission = DampedSprings(actuator).transmit(command, prescribed, min_margin)
    else:
        transmission = actuator.transmit(command, min_margin, prescribed)  # (61)-(72)
    tau_motor = shaft_torques(
        actuator, transmission.dtheta, transmission.ddtheta, transmission.tau_transmission
    )
    tau_damper, motor_reactions = _damper_torques(joint, command, transmission.dphi)
    if motor_reactions is not None:
        tau_motor = tau_motor + motor_reactions
    windings = Windings.over_samples(actuator.sides)
    electrical = {} if windings is None else windings.variables(tau_motor, transmission.dtheta)
    variables = transmission._replace(
        tau_motor=tau_motor, motor_power=tau_motor * transmission.dtheta, **electrical
    )
    return variables if tau_damper is None else variables._replace(tau_damper=tau_damper)


def shaft_torques(
    actuator: Actuator, dtheta: FloatArray, ddtheta: FloatArray, tau_transmission: FloatArray
) -> FloatArray:
    """Compute motor torques from motion and spring torques, (73)-(74) with friction; all (2, samples).

    The paper's B_k is `motor.inertia`, D_mk `motor.damping`, tau_ek `tau_transmission`, tau_k the result.
    """
    motor_damping = _motor_constants([motor.damping for motor in actuator.motors])
    torques = _rotor_torques(actuator, ddtheta) + motor_damping * dtheta + tau_transmission  # (73)-(74)
    friction = FrictionLaws.over_samples([side.friction if side else None for side in actuator.sides])
    if friction is not None:
        torques = torques + friction.torque(dtheta)
    return torques


def _damper_torques(
    joint: Joint, command: Command, dphi: FloatArray
) -> tuple[FloatArray | None, FloatArray | None]:
    """Return the damper torque on the link, (samples,), and on each motor, (2, samples); None if absent."""
    if joint.damper is None:
        return None, None
    damping = command.commanded[DAMPING.key]
    if joint.damper_at("link"):
        return damping * command.dq, None
    has_spring = joint.actuator.has_columns(VARIABLES["phi"])
    motor_reactions = [
        damping * rate if sprung else 0 * damping for rate, sprung in zip(dphi, has_spring, strict=True)
    ]
    return motor_reactions[0] + motor_reactions[1], np.stack(motor_reactions)


def _rotor_torques(actuator: Actuator, ddtheta: FloatArray) -> FloatArray:
    """Return B theta'', (2, samples), with the coupling B_12 of the rotors."""
    own_torques = _motor_constants([motor.inertia for motor in actuator.motors]) * ddtheta
    coupling_inertia = actuator.coupled_rotors
    return own_torques if is_zero(coupling_inertia) else own_torques + coupling_inertia * ddtheta[::-1]


def _motors_not_finite(joint: Joint, arrays: VariablesOfJoint) -> BoolArray:
    """Return where a motor variable is not finite although the sample is neither infeasible nor singular.

    Samples with a demand that is not finite count, too.
    """
    # Three variables suffice: by (69) and (73)-(74) every variable of a motor enters its position or its
    # power. Singular samples have no power.
    theta_finite, spring_torque_finite, power_finite = (
        finite(arrays[name][: joint.actuator.motor_count])
        for name in ("theta", "tau_transmission", "motor_power")
    )
    infeasible, singular = (has_flag(arrays["flags"], flag) for flag in (Flag.INFEASIBLE, Flag.SINGULAR))
    explained = infeasible | (theta_finite & spring_torque_finite & (singular | power_finite))
    demand_finite = finite([arrays["tau_e"], *(arrays[key] for key in joint.commanded)])
    return ~(demand_finite & explained)


def _motor_constants(values: list[float]) -> FloatArray:
    return stack_constants([*values, *[math.nan] * (SIDES - len(values))])
