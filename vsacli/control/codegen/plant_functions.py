"""Generated functions of the plant: the equations of motion (5) that a simulation integrates, and a step."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial, reduce
from operator import and_
from typing import Any

import numpy as np

from vsacli.actuators.drivetrain import SIDES, Drivetrain
from vsacli.base.arrays import FLAG_TYPE
from vsacli.base.errors import InputError
from vsacli.base.flags import Flag, finite, flags_where, not_finite_flags
from vsacli.base.signals import DAMPING
from vsacli.base.wrench import WrenchFrame
from vsacli.compute.tracing import cells_of
from vsacli.control.codegen.interface import (
    Array,
    Evaluate,
    Function,
    Rows,
    Step,
    Structure,
    arrays_by_argument,
    rows_by_argument,
)
from vsacli.control.codegen.robot_functions import (
    state_structure,
    variable_array,
    wrench_argument,
    wrench_on_tools,
)
from vsacli.dynamics.forward import Plant
from vsacli.robot.model import Robot

DURATION = Structure("dt", "Duration of a step.", (Array("dt", (), "s"),), by_value=True)
"""The argument for the duration of a step."""


def state_derivative_function(robot: Robot, frame: WrenchFrame | None = None) -> Function:
    """Return the function of the time derivative of the full state: (5) solved for q'' and theta''.

    A damper parallel to springs adds no state: its torque follows from the velocities.

    Args:
        robot: robot.
        frame: frame along whose axes a wrench is given, see `WrenchFrame`; None without a wrench.

    Raises:
        InputError: motors have sharp friction, which sticks and slides.
    """
    plant = Plant(robot, frame)
    drivetrain = plant.drivetrain
    _refuse_sticking_motors(robot, drivetrain)
    arguments = (
        ("state", state_structure(robot)),
        ("input", _input_structure(robot)),
        *wrench_argument(robot, frame),
    )

    def compute(rows: Rows) -> Rows:
        arrays = arrays_by_argument(arguments, rows)
        q, dq, theta, dtheta = _sprung_motor_arrays(drivetrain, arrays["state"])
        torque = drivetrain.limited(drivetrain.of_motors(arrays["input"]["tau_motor"]))
        commanded = {**dict.fromkeys(DAMPING.names, np.zeros_like(q)), **arrays["input"]}
        wrench = None if frame is None else wrench_on_tools(robot, frame, arrays["wrench"])
        ddq, ddtheta, _ = plant.accelerations(q, dq, theta, dtheta, torque, wrench, commanded)
        rates = _all_motor_arrays(drivetrain, dq, ddq, dtheta, ddtheta)
        flags = _acceleration_flags(drivetrain, ddq, ddtheta) | _range_flags(drivetrain, q, theta)
        return [entry for array in (*rates, flags) for entry in array.ravel()]

    return Function(
        name="state_derivative",
        meaning=(
            "Time derivative of the state under motor torques, as vsacli simulate integrates it; a motor "
            "exerts at most its max_torque. Returns the flags of all joints, 0 if all is well; a joint is "
            "infeasible where a spring is beyond the range of its law."
        ),
        arguments=arguments,
        result=_rates_structure(robot),
        compute=compute,
    )


def _refuse_sticking_motors(robot: Robot, drivetrain: Drivetrain) -> None:
    """Raise an error if motors have sharp friction; names their joints."""
    laws = drivetrain.friction
    if laws is not None and laws.sticks:
        joints = dict.fromkeys(drivetrain.joint[laws.sharp])
        names = ", ".join(robot.joint_names[joint] for joint in joints)
        raise InputError.one(
            f"the motors of {names} have friction without a width, so they stick and slide, which a step of "
            "constant duration cannot follow; give the friction a width"
        )


def _input_structure(robot: Robot) -> Structure:
    """Return the structure of what acts on the plant, apart from a wrench; damping if there are dampers."""
    names = ["tau_motor", *([DAMPING.key] if DAMPING in robot.signals else [])]
    arrays = tuple(variable_array(robot, name) for name in names)
    return Structure("input", "What the motors and dampers are commanded.", arrays)


def _rates_structure(robot: Robot) -> Structure:
    motors = (len(robot.joints), SIDES)
    return Structure(
        "rates",
        "Time derivatives of the state; the motor of a rigid drive moves with its joint.",
        (
            Array("dq", motors[:1], "joint velocity, rad/s (m/s)"),
            Array("ddq", motors[:1], "joint acceleration, rad/s^2 (m/s^2)"),
            Array("dtheta", motors, "motor velocity, joint side of the gear, rad/s (m/s)"),
            Array("ddtheta", motors, "motor acceleration, joint side of the gear, rad/s^2 (m/s^2)"),
            variable_array(robot, "flags"),
        ),
    )


def _sprung_motor_arrays(drivetrain: Drivetrain, state: Mapping[str, Any]) -> list[Any]:
    """Return q, dq, (joints,), and theta, dtheta of the motors with springs, (springs,).

    Other motors do not exist, or follow their joint.
    """
    q, dq, *motor_arrays = state.values()
    return [q, dq, *(drivetrain.of_motors(array)[drivetrain.sprung] for array in motor_arrays)]


def _all_motor_arrays(drivetrain: Drivetrain, q: Any, dq: Any, theta: Any, dtheta: Any) -> list[Any]:
    """Return the four parts of a state, or their rates, with all motors, (joints, 2)."""
    return [q, dq, drivetrain.of_motors_by_joint(theta, q), drivetrain.of_motors_by_joint(dtheta, dq)]


def _acceleration_flags(drivetrain: Drivetrain, ddq: Any, ddtheta: Any) -> Any:
    """Return the flags of accelerations that are not finite, (joints,)."""
    return np.stack(
        [
            not_finite_flags(~finite([acceleration, *ddtheta[drivetrain.spring_joint == joint]]))
            for joint, acceleration in enumerate(ddq)
        ]
    )


def _range_flags(drivetrain: Drivetrain, q: Any, theta: Any) -> Any:
    """Return the flags of springs beyond the range of their law, where a simulation ends, (joints,)."""
    ends = cells_of(drivetrain.domain)
    is_finite = np.array([not math.isinf(end) if isinstance(end, float) else True for end in ends.flat])
    if not is_finite.any():
        return np.zeros(len(q), dtype=FLAG_TYPE)
    (has_lowest, has_highest), (lowest, highest) = is_finite.reshape(ends.shape), drivetrain.domain
    position = drivetrain.ranged(q, theta)
    above = np.where(has_lowest, lowest <= position, True)
    inside = above & np.where(has_highest, position <= highest, True)
    outside_by_joint: list[Any] = [
        ~reduce(and_, inside[drivetrain.spring_joint == joint], np.True_) for joint in range(len(q))
    ]
    return np.stack([flags_where(Flag.INFEASIBLE, is_outside) for is_outside in outside_by_joint])


def step_function(robot: Robot, derivative: Function) -> Step:
    """Return the function of a Runge-Kutta step of order 4, which holds all arguments but the state.

    Args:
        robot: robot.
        derivative: its `state_derivative_function`, with or without parameters as an argument.
    """
    state, input_argument, *further = derivative.arguments
    arguments = (state, input_argument, ("dt", DURATION), *further)
    sources = _source_indices(Drivetrain(robot.actuators), state[1])
    moving = sorted({*sources} - {NO_MOTOR})

    def advance(evaluate: Evaluate, rows: Rows) -> Rows:
        initial, held_inputs, (dt,), *further_inputs = rows_by_argument(arguments, rows).values()

        def complete(values: Mapping[int, Any]) -> Rows:
            return [values.get(index, np.full(1, np.nan)) for index in sources]

        def rates_at(state: Rows) -> dict[int, Any]:
            rates = evaluate([*state, *held_inputs, *(row for inputs in further_inputs for row in inputs)])
            return {index: rates[index] for index in moving}

        def state_after(duration: Any, rates: Mapping[int, Any]) -> Rows:
            return complete({index: initial[index] + duration * rate for index, rate in rates.items()})

        first = rates_at(complete({index: initial[index] for index in moving}))
        second = rates_at(state_after(dt / 2, first))
        third = rates_at(state_after(dt / 2, second))
        fourth = rates_at(state_after(dt, third))
        total = {index: first[index] + 2 * (second[index] + third[index]) + fourth[index] for index in moving}
        return state_after(dt / 6, total)

    return Step(
        name="step",
        meaning=(
            "State dt later: a step of the classical Runge-Kutta method of order 4 along state_derivative, "
            "under constant torques. Returns the flags of its four stages, 0 if all is well; next may be "
            "state itself. It is accurate where dt times the frequency of the fastest vibration, rad/s, is "
            "far below 1, and unstable beyond 2.8."
        ),
        arguments=arguments,
        result=state[1],
        result_name="next",
        compute=partial(advance, derivative.compute),
        advance=advance,
        derivative=derivative,
    )


NO_MOTOR = -1
"""Source of the entries of a state that belong to no motor."""


def _source_indices(drivetrain: Drivetrain, state: Structure) -> list[int]:
    """Return for each entry of a state the entry that it equals: itself, or that of the joint it follows."""
    entries = state.layout.arrays(np.arange(float(state.layout.size)))
    followed_entries = _all_motor_arrays(drivetrain, *_sprung_motor_arrays(drivetrain, entries))
    indices = np.concatenate([array.ravel() for array in followed_entries])
    return [int(index) for index in np.nan_to_num(indices, nan=NO_MOTOR)]
