"""The generated controller: feedback linearization (32)-(35), (60), (69)-(74) from the measured state."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, cast

import numpy as np

from vsacli.actuators.drivetrain import Drivetrain, DrivetrainState
from vsacli.base.flags import Flag, finite, flags_where, not_finite_flags
from vsacli.base.wrench import WrenchFrame
from vsacli.control.codegen.interface import Array, Function, Rows, Structure, arrays_by_argument
from vsacli.control.codegen.robot_functions import (
    command_structure,
    state_structure,
    variable_array,
    wrench_argument,
    wrench_on_tools,
)
from vsacli.control.gains import STIFFNESS_ORDER, Gains, Integral
from vsacli.control.linearization import Decoupling, LinkMotion, control_law, position_order
from vsacli.dynamics.forward import Plant
from vsacli.dynamics.limits import limit_flags
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Motion

Arrays = Mapping[str, Any]
"""Arrays of numbers or symbols, by name."""


class _GainInputs(NamedTuple):
    """Gains that are known only when the controller runs; fields as of `vsacli.control.gains.Gains`."""

    position: Any
    stiffness: Any
    position_integral: Any
    stiffness_integral: Any


def feedback_linearization_function(robot: Robot, frame: WrenchFrame | None = None) -> Function:
    """Return the function of feedback linearization, (32)-(35), (60), (69)-(74).

    Args:
        robot: robot.
        frame: frame along whose axes a wrench is given, see `WrenchFrame`; None without a wrench.

    Raises:
        InputError: the robot mixes rigid joints with others, or has a damped transmission; no law exists.
    """
    law = _Law(robot, frame)
    return Function(
        name="feedback_linearization",
        meaning=(
            "Motor torques that make the errors of position and stiffness decay as the gains say; returns "
            "the flags of all joints, 0 if all is well. Without integral action, let its gains be 0."
        ),
        arguments=law.arguments,
        result=Structure(
            "control",
            "What the controller wants; NaN where a flag says it cannot be.",
            (variable_array(robot, "tau_motor"), variable_array(robot, "flags")),
        ),
        compute=law,
    )


def law_in_parts(robot: Robot, frame: WrenchFrame | None = None) -> Function:
    """Return the second part of feedback linearization, which takes what `link_motion_function` computes.

    The two have fewer values at once than the law in one text; for arguments see there.
    """
    law = _Law(robot, frame, in_parts=True)
    whole_law = feedback_linearization_function(robot, frame)
    return dataclasses.replace(whole_law, name="feedback_of_links", arguments=law.arguments, compute=law)


def link_motion_function(robot: Robot, frame: WrenchFrame | None = None) -> Function:
    """Return the first part of feedback linearization of a robot with springs: (34) and (35)."""
    plant = Plant(robot, frame)
    arguments = (
        ("state", state_structure(robot)),
        ("reference", command_structure(robot)),
        *wrench_argument(robot, frame),
    )

    def compute(rows: Rows) -> Rows:
        arrays = arrays_by_argument(arguments, rows)
        wrench = None if frame is None else wrench_on_tools(robot, frame, arrays["wrench"])
        state = arrays["state"]
        theta, dtheta = _sprung_motor_state(plant.drivetrain, state)
        law = Decoupling(plant, cast("Gains", None))
        link = law.link_motion(state["q"], state["dq"], theta, dtheta, wrench, arrays["reference"])
        return [*link.ddq, *link.d3q]

    return Function(
        name="move_links",
        meaning="Acceleration and jerk of the joints at a state.",
        arguments=arguments,
        result=_link_motion_structure(robot),
        compute=compute,
    )


def _link_motion_structure(robot: Robot) -> Structure:
    joints = (len(robot.joints),)
    arrays = (
        Array("ddq", joints, "joint acceleration, rad/s^2 (m/s^2)"),
        Array("d3q", joints, "joint jerk, rad/s^3 (m/s^3)"),
    )
    return Structure("link_motion", "Motion of the links that follows from the state.", arrays)


def _sprung_motor_state(drivetrain: Drivetrain, state: Arrays) -> Iterator[Any]:
    """Yield position and velocity of the motors with springs at a state, (springs,)."""
    return (drivetrain.of_motors(state[name])[..., drivetrain.sprung] for name in ("theta", "dtheta"))


class _OnLinkMotion(Decoupling):
    """The control law where the motion of the links is known."""

    def __init__(self, plant: Plant, gains: Gains, ddq: Any, d3q: Any) -> None:
        super().__init__(plant, gains)
        self._motion = ddq, d3q

    def _link_motion(self, _q: Any, _dq: Any, springs: DrivetrainState, *_: Any) -> LinkMotion:
        return LinkMotion(springs.tau_e, springs.dtau_e, *self._motion, springs.stiffness, springs.dstiffness)


class _Law:
    """The control law as a function of rows of all its arguments.

    Attributes:
        arguments: arguments of the generated function.
    """

    def __init__(self, robot: Robot, frame: WrenchFrame | None, *, in_parts: bool = False) -> None:
        self._robot = robot
        self._frame = frame
        self._plant = Plant(robot, frame)
        joints, order = (len(robot.joints),), position_order(robot, self._plant)
        self.arguments = (
            ("state", state_structure(robot)),
            ("reference", command_structure(robot)),
            (
                "gains",
                Structure(
                    "gains",
                    "Gains of (32): the poles are the roots of s^r + K_{r-1} s^(r-1) + ... + K0.",
                    (
                        Array("position", (*joints, order), "K0, K1, ..., 1/s^(r-k)"),
                        Array(
                            "stiffness", (*joints, STIFFNESS_ORDER), "the same for the stiffness, 1/s^(2-k)"
                        ),
                        Array("position_integral", joints, "gain of the integral of the position error"),
                        Array("stiffness_integral", joints, "gain of the integral of the stiffness error"),
                    ),
                ),
            ),
            (
                "integral",
                Structure(
                    "integral",
                    "Time integrals of the errors, command minus measurement.",
                    (Array("q", joints, "of the position"), Array("stiffness", joints, "of the stiffness")),
                ),
            ),
            *wrench_argument(robot, frame),
            *([("link_motion", _link_motion_structure(robot))] if in_parts else []),
        )

    def __call__(self, rows: Rows) -> list[Any]:
        """Return the rows of the motor torques, then those of the flags."""
        state, reference, gain_arrays, integral, *further_arguments = arrays_by_argument(
            self.arguments, rows
        ).values()
        drivetrain = self._plant.drivetrain
        gains = cast("Gains", _GainInputs(**gain_arrays))
        wrench = None
        if self._frame is not None:
            wrench = wrench_on_tools(self._robot, self._frame, further_arguments.pop(0))
        law: Any = (
            _OnLinkMotion(self._plant, gains, **further_arguments[0])
            if further_arguments
            else control_law(self._plant, gains)
        )
        theta, dtheta = _sprung_motor_state(drivetrain, state)
        command = Motion.of(np.zeros(1), reference, wrench)
        torque = law.torque(state["q"], state["dq"], theta, dtheta, command, Integral(**integral))
        tau_motor = drivetrain.of_joints(torque)
        values = {**state, "phi": state["theta"] - state["q"][:, None], "tau_motor": tau_motor}
        if drivetrain.windings is not None:
            velocity = drivetrain.of_all_motors(state["dq"], dtheta)
            electrical = drivetrain.windings.variables(torque, velocity)
            values |= {name: drivetrain.of_joints(array) for name, array in electrical.items()}
        singular = drivetrain.determinant(state["q"], theta) == 0
        flags = [
            self._joint_flags(joint, values, singular[joint]) for joint in range(len(self._robot.joints))
        ]
        return [*tau_motor.ravel(), *flags]

    def _joint_flags(self, index: int, values: Arrays, singular: Any) -> Any:
        """Return the flags of a joint: torque undefined, or a limit exceeded by state or torque."""
        joint, variables = self._robot.joints[index], {name: array[index] for name, array in values.items()}
        exists = finite(variables["tau_motor"][: joint.actuator.motor_count])
        flags = flags_where(Flag.SINGULAR, singular) | not_finite_flags(~(exists | singular))
        return limit_flags(joint, variables, flags)
