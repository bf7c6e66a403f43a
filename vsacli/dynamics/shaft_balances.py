"""Balances of the motors' shafts, by formulas of their own: no term is computed as `drive` computes it.

A motor needs the rate of the momentum of the rotors, what its springs and damper exert against it, and what
bearings take. The balance is one of power for a shaft that turns at unit speed, so that a motor which stands
still is judged as well. Of the windings, the electrical power is heat and power of the shaft.

`shaft_error` judges each step. `shaft_energy` and `shaft_power` are for differences over time: the energy in
rotors and springs of a joint, and the power that should change it.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce

import numpy as np

from vsacli.actuators.friction import REST, Friction
from vsacli.actuators.limit_check import OfJoint
from vsacli.actuators.motor import JointMotor
from vsacli.actuators.windings import ELECTRICAL
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.variables import VARIABLES
from vsacli.robot.joint import Joint

SHAFT_VARIABLES = (
    *("q", "dq", "tau_e", "stiffness", "damping", "theta", "dtheta", "ddtheta", "dphi", "tau_damper"),
    *("tau_motor", "motor_power", "current", "voltage", "copper_loss", "dissipated_power"),
)
"""The variables of a joint that are balanced, where it has them."""

POSITION_ROUNDING = 8 * np.finfo(float).eps
"""Share of q and theta by which their difference phi may be off: a few roundings."""

Residual = tuple[FloatArray, FloatArray]
"""What a balance misses, and the size of its terms, which bounds what rounding can miss."""


def shaft_error(joint: Joint, of_joint: OfJoint, tau_spring: FloatArray, regular: BoolArray) -> FloatArray:
    """The largest residual of the shafts of a joint, relative to the terms of its balance, (samples,).

    Args:
        joint: the joint.
        of_joint: its variables by name, `SHAFT_VARIABLES` among them.
        tau_spring: torque of the springs against each motor by their laws, (motors, samples).
        regular: where there must be numbers; the error is zero elsewhere.
    """
    errors = [
        np.where(regular, np.abs(missing) / np.maximum(size, np.finfo(float).tiny), 0.0)
        for missing, size in _residuals(joint, of_joint, tau_spring)
    ]
    return reduce(np.maximum, errors)


def _residuals(joint: Joint, of_joint: OfJoint, tau_spring: FloatArray) -> Iterator[Residual]:
    for index, motor in enumerate(joint.actuator.motors):
        own = {name: of_joint[name][index] for name in ("tau_motor", "dtheta", "motor_power")}
        yield _torque_residual(joint, index, of_joint, tau_spring[index])
        yield _residual(own["motor_power"], own["tau_motor"] * own["dtheta"])
        if motor.torque_constant is not None:
            electrical = {name: of_joint[name][index] for name in ELECTRICAL if name in of_joint}
            yield from _winding_residuals(motor, **own, **electrical)
    if joint.damper is not None:
        yield _residual(
            of_joint["tau_damper"],
            *(of_joint["damping"] * velocity for velocity in _damper_velocities(joint, of_joint).values()),
        )
    if of_joint.get("dissipated_power") is not None:
        lost = (*link_losses(joint, of_joint), *shaft_losses(joint, of_joint))
        yield _residual(of_joint["dissipated_power"], *lost)


def _residual(given: FloatArray, *terms: FloatArray) -> Residual:
    size = reduce(np.add, [np.abs(term) for term in terms], np.abs(given))
    return given - reduce(np.add, terms, np.zeros_like(given)), size


def _torque_residual(joint: Joint, index: int, of_joint: OfJoint, tau_spring: FloatArray) -> Residual:
    """The balance of a shaft. What rounding of positions changes in the springs' torque is no residual."""
    motor, dtheta = joint.actuator.motors[index], of_joint["dtheta"][index]
    terms = [*_momentum_rates(joint, index, of_joint["ddtheta"]), tau_spring]
    terms += [motor.damping * dtheta, *_friction_torques(motor.friction, dtheta)]
    damped = _damper_velocities(joint, of_joint).get(index)
    if damped is not None:
        terms.append(of_joint["damping"] * damped)
    missing, size = _residual(of_joint["tau_motor"][index], *terms)
    if joint.actuator.sprung:
        positions = np.abs(of_joint["q"]) + np.abs(of_joint["theta"][index])
        rounding = POSITION_ROUNDING * of_joint["stiffness"] * positions
        missing = np.maximum(np.abs(missing) - rounding, 0.0)
    return missing, size


def _momentum_rates(joint: Joint, index: int, ddtheta: FloatArray) -> list[FloatArray]:
    """Row `index` of B theta'', term by term: the rate of what the kinetic energy has as momentum."""
    own = joint.actuator.motors[index].inertia * ddtheta[index]
    coupling = joint.actuator.coupled_rotors
    return [own, coupling * ddtheta[1 - index]] if coupling else [own]


def _winding_residuals(
    motor: JointMotor,
    tau_motor: FloatArray,
    dtheta: FloatArray,
    motor_power: FloatArray,
    current: FloatArray,
    voltage: FloatArray | None = None,
    copper_loss: FloatArray | None = None,
) -> Iterator[Residual]:
    """The current makes the torque, heat is R i^2, and u i is that heat and the power of the shaft."""
    assert motor.torque_constant is not None, "windings without a torque constant have no current"
    yield _residual(tau_motor, motor.torque_constant * current)
    if motor.resistance is None or voltage is None or copper_loss is None:
        return
    heat = motor.resistance * current**2
    yield _residual(copper_loss, heat)
    yield _residual(voltage * current, heat, motor_power)
    yield _residual(voltage, motor.resistance * current, motor.torque_constant * dtheta)


def _friction_torques(friction: Friction | None, velocity: FloatArray) -> list[FloatArray]:
    """Dry friction as the mean of both directions, half their difference, and the offset."""
    if friction is None:
        return []
    backward, forward = friction.coulomb
    if friction.width > 0:
        shape = np.tanh(velocity / friction.width)
    else:
        shape = np.where(velocity > REST, 1.0, np.where(velocity < -REST, -1.0, 0.0 * velocity))
    mean, half = (forward + backward) / 2, (forward - backward) / 2
    return [mean * shape, half * np.abs(shape), friction.offset + 0.0 * velocity]


def _damper_velocities(joint: Joint, of_joint: OfJoint) -> dict[int | None, FloatArray]:
    """Velocity of each damper of a joint, by the motor that feels it; None is one between the links."""
    if joint.damper is None:
        return {}
    if joint.damper_at("link"):
        return {None: of_joint["dq"]}
    behind = joint.actuator.has(VARIABLES["phi"])
    return {motor: of_joint["dphi"][motor] for motor, there in enumerate(behind) if there}


def link_losses(joint: Joint, of_joint: OfJoint) -> list[FloatArray]:
    """Power that is lost between the two links of a joint, term by term."""
    dq = of_joint["dq"]
    lost = [joint.damping * dq * dq, *(torque * dq for torque in _friction_torques(joint.friction, dq))]
    if joint.damper_at("link"):
        lost.append(of_joint["damping"] * dq * dq)
    return lost


def shaft_losses(joint: Joint, of_joint: OfJoint) -> list[FloatArray]:
    """Power that is lost between the motors and the link of a joint, term by term."""
    lost = []
    for motor, dtheta in zip(joint.actuator.motors, of_joint["dtheta"], strict=False):
        lost.append(motor.damping * dtheta * dtheta)
        lost.extend(torque * dtheta for torque in _friction_torques(motor.friction, dtheta))
    if joint.damper_at("transmission"):
        velocities = _damper_velocities(joint, of_joint).values()
        lost.extend(of_joint["damping"] * velocity * velocity for velocity in velocities)
    return lost


def shaft_energy(joint: Joint, of_joint: OfJoint) -> FloatArray:
    """Kinetic energy of the rotors of a joint, and the energy in its springs, (samples,), J."""
    energy: FloatArray = of_joint["elastic_energy"]
    motors, dtheta = joint.actuator.motors, of_joint["dtheta"]
    for motor, velocity in zip(motors, dtheta, strict=False):
        energy = energy + motor.inertia / 2 * velocity * velocity
    coupling = joint.actuator.coupled_rotors
    return energy + coupling * dtheta[0] * dtheta[1] if coupling else energy


def shaft_powers(joint: Joint, of_joint: OfJoint) -> list[FloatArray]:
    """What changes `shaft_energy`, term by term: the motors, what the link takes, and losses; W."""
    motors = len(joint.actuator.motors)
    taken = [of_joint["tau_e"] * of_joint["dq"], *shaft_losses(joint, of_joint)]
    return [*of_joint["motor_power"][:motors], *(-power for power in taken)]
