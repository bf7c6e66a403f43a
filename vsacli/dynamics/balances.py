"""Balances at each step of a run: of springs (14), of the motors' shafts, and power that motors pass on."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from typing import Any, ClassVar

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.limit_check import OfJoint
from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.flags import Flag, has
from vsacli.base.variables import VARIABLES, Block, Variable
from vsacli.compute.control_flow import call
from vsacli.compute.vector import Scalar
from vsacli.dynamics.dampers import motor_torques
from vsacli.dynamics.inverse import InverseDynamics, behind_link, rows_of_joints
from vsacli.dynamics.shaft_balances import SHAFT_VARIABLES, shaft_error
from vsacli.robot.joint import Joint

BALANCES = {
    variable.name: variable
    for variable in (
        Variable("passed_power", ("joint", "motor"), units.POWER, "power passed on", "(73)-(74)"),
        Variable("passed_rate", ("joint", "motor"), units.POWER, "its rate, W/s", "(73)-(74)"),
        Variable("spring_error", (), units.DIMENSIONLESS, "largest residual of springs, scaled", "(14)"),
        Variable("shaft_error", (), units.DIMENSIONLESS, "largest residual of shafts, scaled", "(73)-(74)"),
        Variable("damped_error", ("damped",), units.TORQUE, "residual of springs beside a damper", "(14)"),
        Variable("damped_size", ("damped",), units.TORQUE, "size of the torques that are balanced", "(14)"),
    )
}
"""What is computed beside the variables of a result, and is not stored."""


BALANCED = {*SHAFT_VARIABLES, "phi", "flags"}
"""The variables from which springs and shafts are balanced."""


class BalancedBlock(Block):
    """A block with `BALANCES`, too."""

    declared: ClassVar[Mapping[str, Variable]] = {**VARIABLES, **BALANCES}


class BalancedDynamics(InverseDynamics):
    """Inverse dynamics with `BALANCES` at each step: as part of its program they take next to no time."""

    block = BalancedBlock

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Of the variables it gives, at one instant, by name."""
        motors, damped = (len(self.robot.joints), SIDES), (len(damped_joints(self.robot.joints)),)
        return {
            **super().shapes(),
            **dict(zip(BALANCES, (motors, motors, (), (), damped, damped), strict=True)),
        }

    def rows_of(self, rows: Sequence[Scalar], of_joints: Sequence[OfJoint]) -> dict[str, Iterable[Any]]:
        """The rows of each result by name, from the kernel's arguments and the variables of the joints."""
        joints = self.robot.joints
        passed = [
            call(rows[0], behind_link(passed_power, joint), of_joint)
            for joint, of_joint in zip(joints, of_joints, strict=True)
        ]
        powers, rates = zip(*passed, strict=True)
        by_motor = {"passed_power": rows_of_joints(powers), "passed_rate": rows_of_joints(rates)}
        return {**super().rows_of(rows, of_joints), **by_motor, **balances(joints, of_joints)}


def damped_joints(joints: Sequence[Joint]) -> list[int]:
    """Those with a damper beside their springs, by index."""
    return [index for index, joint in enumerate(joints) if joint.damper_at("transmission")]


def balances(joints: Sequence[Joint], of_joints: Sequence[OfJoint]) -> dict[str, list[FloatArray]]:
    """The balances of (14) by the springs' laws at phi, and of the shafts, by name.

    Zero at steps that are not regular. Springs are scaled as |sum tau_k - tau_e| / sum |tau_k| and
    |sum sigma_k - sigma| / sum |sigma_k|. An elastic joint has one
    law; a rigid one has none, and so no residual. Beside a damper the torque of the springs may be zero where
    nothing else is small, so that only a whole run says what residuals are to be measured against.
    """
    springs, shafts, missing, sizes = [np.zeros_like(of_joints[0]["tau_e"])], [], [], []
    for joint, of_joint in zip(joints, of_joints, strict=True):
        found = call(of_joint["tau_e"], behind_link(_balance, joint), of_joint)
        of_stiffness, of_torque, size, of_shafts = found
        shafts.append(of_shafts)
        if of_stiffness is not None:
            springs.append(of_stiffness)
        if size is not None:
            missing.append(of_torque)
            sizes.append(size)
        elif of_torque is not None:
            springs.append(of_torque)
    largest = {"spring_error": [reduce(np.maximum, springs)], "shaft_error": [reduce(np.maximum, shafts)]}
    return {**largest, "damped_error": missing, "damped_size": sizes}


def _balance(joint: Joint, of_joint: OfJoint) -> tuple[FloatArray | None, ...]:
    """Errors of stiffness and torque of the springs, both scaled, and of the shafts.

    Beside a damper that of the torque is in N m, with its size, which is None elsewhere.
    """
    regular = ~has(of_joint["flags"], Flag.INFEASIBLE | Flag.SINGULAR)
    tau_e, stiffness = of_joint["tau_e"], of_joint["stiffness"]
    if not joint.actuator.sprung:
        return None, None, None, shaft_error(joint, of_joint, tau_e[None], regular)
    carried = joint.actuator.carried(of_joint)
    of_shafts = shaft_error(joint, of_joint, carried.tau_spring, regular)
    of_stiffness = np.abs(carried.stiffness - stiffness) / np.where(regular, carried.stiffness_size, 1.0)
    of_stiffness = np.where(regular, of_stiffness, 0.0)
    size = np.maximum(carried.size, np.finfo(float).tiny)
    if not joint.damper_at("transmission"):
        of_torque = np.where(regular, np.abs(carried.tau_e - tau_e) / size, 0.0)
        return of_stiffness, of_torque, None, of_shafts
    residual = np.abs(carried.tau_e + of_joint["tau_damper"] - tau_e)
    residual = np.maximum(residual - _rounding_of_damper(of_joint), 0.0)
    size = np.where(regular, np.maximum(size, np.abs(tau_e)), 0.0)
    return of_stiffness, np.where(regular, residual, 0.0), size, of_shafts


def _rounding_of_damper(of_joint: OfJoint) -> FloatArray:
    """What rounding leaves of the torque of a damper, whose velocity is the difference theta' - q'."""
    rounding: FloatArray = 4 * np.finfo(float).eps * of_joint["damping"] * np.abs(of_joint["dq"])
    return rounding


def passed_power(joint: Joint, of_joint: OfJoint) -> tuple[FloatArray, FloatArray]:
    """What the motors of a joint pass on to springs and dampers, or lose to damping, and its rate, W, W/s.

    It is the motors' power but for that of their inertia and of dry friction. Each (2, samples), NaN where
    there is no motor.
    """
    dtheta, ddtheta = of_joint["dtheta"], of_joint["ddtheta"]
    motors = [motor.damping for motor in joint.actuator.motors]
    damping = np.array([*motors, *[np.nan] * (SIDES - len(motors))])[:, None]
    torque = damping * dtheta + of_joint["tau_spring"]
    rate = damping * ddtheta
    own = joint.actuator.spring_rates(of_joint)
    rate = rate + (own if len(own) == SIDES else np.concatenate((own, np.full_like(own, np.nan))))
    if joint.damper_at("transmission"):
        against, its_rate = motor_torques(joint, of_joint)
        torque, rate = torque + against, rate + its_rate
    return torque * dtheta, rate * dtheta + torque * ddtheta
