"""Balances that every result must satisfy, for the self-check: springs (14), shafts (73)-(74), link energy.

`BalancedDynamics` computes the residuals of springs and shafts with every sample. The energies and powers of
shafts and links are for `analysis.self_check`, which compares an energy's derivative with the power.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import ClassVar, NamedTuple, Self, TypeAlias

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.elasticity import Components
from vsacli.actuators.friction import REST, Friction
from vsacli.actuators.motor import JointMotor
from vsacli.actuators.transmission import JointVariables
from vsacli.base import units
from vsacli.base.arrays import BoolArray, FloatArray, stack_constants
from vsacli.base.flags import Flag, has_flag
from vsacli.base.variables import VARIABLES, Block, Variable
from vsacli.base.wrench import WRENCH_AXES, WrenchFrame, frames_by_tool
from vsacli.compute.rows import RowLayout
from vsacli.compute.vector import ZERO, Rotation, Scalar, Vector, cross, is_zero
from vsacli.dynamics.dampers import joints_with_parallel_damper, parallel_damper_torques
from vsacli.dynamics.elastic_torques import carriers, link_constants
from vsacli.dynamics.inverse import InverseDynamics, call_at_joints, rows_of_joints
from vsacli.dynamics.recursion_inputs import Seat
from vsacli.dynamics.variants import RobotKernel
from vsacli.robot.joint import Joint, Tool
from vsacli.robot.kinematics import base_gravity, rotation_matrix
from vsacli.robot.model import Robot

POSITION_ROUNDING = 8 * np.finfo(float).eps
"""Error of phi = theta - q by rounding, relative to the size of q and theta: a few roundings."""

Residual = tuple[FloatArray, FloatArray]
"""Residual of a balance, and the size of its terms."""


def shaft_error(
    joint: Joint, variables: JointVariables, tau_transmission: Components, regular: BoolArray
) -> FloatArray:
    """Return the largest residual of the shafts of a joint, relative to the terms of its balance, (samples,).

    Args:
        joint: Joint.
        variables: Variables of the joint.
        tau_transmission: Torque of the springs against each motor by their laws, each (samples,).
        regular: Samples at which values must exist; the error is zero elsewhere.
    """
    errors = [
        np.where(regular, np.abs(residual) / np.maximum(magnitude, np.finfo(float).tiny), 0.0)
        for residual, magnitude in _shaft_residuals(joint, variables, tau_transmission)
    ]
    return reduce(np.maximum, errors)


def _shaft_residuals(
    joint: Joint, variables: JointVariables, tau_transmission: Components
) -> Iterator[Residual]:
    for index, motor in enumerate(joint.actuator.motors):
        torque, dtheta, power = (
            rows[index] for rows in (variables.tau_motor, variables.dtheta, variables.motor_power)
        )
        yield _torque_residual(joint, index, variables, tau_transmission[index])
        yield _balance_residual(power, torque * dtheta)
        if motor.torque_constant is not None:
            electrical = (variables.current, variables.voltage, variables.copper_loss)
            rows = (None if array is None else array[index] for array in electrical)
            yield from _winding_residuals(motor, torque, dtheta, power, *rows)
    if joint.damper is not None:
        yield _balance_residual(
            variables.tau_damper,
            *(
                variables.damping * velocity
                for velocity in _damper_velocity_by_motor(joint, variables).values()
            ),
        )
    if variables.dissipated_power is not None:
        losses = (*link_losses(joint, variables), *shaft_losses(joint, variables))
        yield _balance_residual(variables.dissipated_power, *losses)


def _balance_residual(computed: FloatArray, *terms: FloatArray) -> Residual:
    magnitude = reduce(np.add, [np.abs(term) for term in terms], np.abs(computed))
    return computed - reduce(np.add, terms, np.zeros_like(computed)), magnitude


def _torque_residual(
    joint: Joint, index: int, variables: JointVariables, tau_transmission: FloatArray
) -> Residual:
    """Return the residual of a shaft, without the effect of rounded positions on the springs."""
    motor, dtheta = joint.actuator.motors[index], variables.dtheta[index]
    terms = [*_momentum_rates(joint, index, variables.ddtheta), tau_transmission]
    terms += [motor.damping * dtheta, *_friction_torques(motor.friction, dtheta)]
    damper_velocity = _damper_velocity_by_motor(joint, variables).get(index)
    if damper_velocity is not None:
        terms.append(variables.damping * damper_velocity)
    residual, magnitude = _balance_residual(variables.tau_motor[index], *terms)
    if joint.actuator.sprung:
        position_magnitude = np.abs(variables.q) + np.abs(variables.theta[index])
        rounding = POSITION_ROUNDING * variables.stiffness * position_magnitude
        residual = np.maximum(np.abs(residual) - rounding, 0.0)
    return residual, magnitude


def _momentum_rates(joint: Joint, index: int, ddtheta: FloatArray) -> list[FloatArray]:
    """Return row `index` of B theta'', term by term."""
    rotor_term = joint.actuator.motors[index].inertia * ddtheta[index]
    coupling_inertia = joint.actuator.coupled_rotors
    return [rotor_term] if is_zero(coupling_inertia) else [rotor_term, coupling_inertia * ddtheta[1 - index]]


def _winding_residuals(
    motor: JointMotor,
    tau_motor: FloatArray,
    dtheta: FloatArray,
    motor_power: FloatArray,
    current: FloatArray,
    voltage: FloatArray | None = None,
    copper_loss: FloatArray | None = None,
) -> Iterator[Residual]:
    """Yield the balances of the windings: torque of the current, heat R i^2, u i as heat and shaft power."""
    assert motor.torque_constant is not None, "windings without a torque constant have no current"
    yield _balance_residual(tau_motor, motor.torque_constant * current)
    if motor.resistance is None or voltage is None or copper_loss is None:
        return
    heat = motor.resistance * current**2
    yield _balance_residual(copper_loss, heat)
    yield _balance_residual(voltage * current, heat, motor_power)
    yield _balance_residual(voltage, motor.resistance * current, motor.torque_constant * dtheta)


def _friction_torques(friction: Friction | None, velocity: FloatArray) -> list[FloatArray]:
    """Return dry friction as the mean of both directions, half their difference, and the offset."""
    if friction is None:
        return []
    backward, forward = friction.coulomb
    if is_zero(friction.width):
        shape = np.where(velocity > REST, 1.0, np.where(velocity < -REST, -1.0, 0.0 * velocity))
    else:
        shape = np.tanh(velocity / friction.width)
    mean, half_difference = (forward + backward) / 2, (forward - backward) / 2
    return [mean * shape, half_difference * np.abs(shape), friction.offset + 0.0 * velocity]


def _damper_velocity_by_motor(joint: Joint, variables: JointVariables) -> dict[int | None, FloatArray]:
    """Return damper velocities of a joint by the motor that they act on; None for a damper between links."""
    if joint.damper is None:
        return {}
    if joint.damper_at("link"):
        return {None: variables.dq}
    motors_with_phi = joint.actuator.has_columns(VARIABLES["phi"])
    return {motor: variables.dphi[motor] for motor, has_phi in enumerate(motors_with_phi) if has_phi}


def link_losses(joint: Joint, variables: JointVariables) -> list[FloatArray]:
    """Return the power lost between the two links of a joint, term by term."""
    dq = variables.dq
    losses = [joint.damping * dq * dq, *(torque * dq for torque in _friction_torques(joint.friction, dq))]
    if joint.damper_at("link"):
        losses.append(variables.damping * dq * dq)
    return losses


def shaft_losses(joint: Joint, variables: JointVariables) -> list[FloatArray]:
    """Return the power lost between the motors and the link of a joint, term by term."""
    losses = []
    for motor, dtheta in zip(joint.actuator.motors, variables.dtheta, strict=False):
        losses.append(motor.damping * dtheta * dtheta)
        losses.extend(torque * dtheta for torque in _friction_torques(motor.friction, dtheta))
    if joint.damper_at("transmission"):
        velocities = _damper_velocity_by_motor(joint, variables).values()
        losses.extend(variables.damping * velocity * velocity for velocity in velocities)
    return losses


def shaft_energy(joint: Joint, variables: JointVariables) -> FloatArray:
    """Return the kinetic energy of the rotors of a joint plus the energy in its springs, (samples,), J."""
    energy: FloatArray = variables.elastic_energy
    motors, dtheta = joint.actuator.motors, variables.dtheta
    for motor, velocity in zip(motors, dtheta, strict=False):
        energy = energy + motor.inertia / 2 * velocity * velocity
    coupling_inertia = joint.actuator.coupled_rotors
    return energy if is_zero(coupling_inertia) else energy + coupling_inertia * dtheta[0] * dtheta[1]


def shaft_powers(joint: Joint, variables: JointVariables) -> list[FloatArray]:
    """Return the powers that change `shaft_energy`: motors, torque on the link, losses; W."""
    motor_count = len(joint.actuator.motors)
    outflows = [variables.tau_e * variables.dq, *shaft_losses(joint, variables)]
    return [*variables.motor_power[:motor_count], *(-power for power in outflows)]


BALANCES = {
    variable.name: variable
    for variable in (
        Variable("passed_power", ("joint", "motor"), units.POWER, "power passed on", "(73)-(74)"),
        Variable("passed_rate", ("joint", "motor"), units.POWER, "its rate, W/s", "(73)-(74)"),
        Variable("spring_error", (), units.DIMENSIONLESS, "largest residual of springs, scaled", "(14)"),
        Variable("shaft_error", (), units.DIMENSIONLESS, "largest residual of shafts, scaled", "(73)-(74)"),
        Variable(
            "damped_error", ("damped",), units.TORQUE, "residual of springs parallel to a damper", "(14)"
        ),
        Variable("damped_size", ("damped",), units.TORQUE, "size of the torques that are balanced", "(14)"),
    )
}
"""Quantities of the balances; they are computed with the result variables, but not stored."""


class BalancedBlock(Block):
    """A block with the result variables and `BALANCES`."""

    declared: ClassVar[Mapping[str, Variable]] = {**VARIABLES, **BALANCES}


@dataclass(frozen=True)
class BalancedDynamics(RobotKernel):
    """Kernel of a run: inverse dynamics with `BALANCES` at each sample.

    As part of one program the balances take hardly any time.

    Attributes:
        dynamics: Inverse dynamics that are balanced.
    """

    dynamics: InverseDynamics

    def of_robot(self, robot: Robot) -> Self:
        """See `RobotKernel.of_robot`."""
        return replace(self, dynamics=self.dynamics.of_robot(robot))

    @property
    def arguments(self) -> RowLayout:
        """Layout of the input rows."""
        return self.dynamics.arguments

    @cached_property
    def results(self) -> RowLayout:
        """Layout of the output rows: those of inverse dynamics, then `BALANCES`."""
        joints = self.dynamics.robot.joints
        motor_shape, damped_shape = (len(joints), SIDES), (len(joints_with_parallel_damper(joints)),)
        shapes = dict(
            zip(BALANCES, (motor_shape, motor_shape, (), (), damped_shape, damped_shape), strict=True)
        )
        return RowLayout({**self.dynamics.results.shapes, **shapes})

    def __call__(self, rows: Sequence[Scalar]) -> list[Scalar]:
        """Run (36)-(74) and the balances."""
        joints, joint_variables = self.dynamics.robot.joints, self.dynamics.joint_variables(rows)
        powers_and_rates = call_at_joints(rows[0], passed_power, joints, zip(joint_variables, strict=True))
        powers, rates = zip(*powers_and_rates, strict=True)
        motor_rows = {"passed_power": rows_of_joints(powers), "passed_rate": rows_of_joints(rates)}
        computed = self.dynamics.result_rows(rows, joint_variables)
        return self.results.pack({**computed, **motor_rows, **balance_errors(joints, joint_variables)})


def balance_errors(
    joints: Sequence[Joint], joint_variables: Sequence[JointVariables]
) -> dict[str, list[FloatArray]]:
    """Return the residuals of (14), by the springs' laws at phi, and of the shafts, by name.

    They are zero at infeasible and singular samples. Springs are scaled as |sum tau_k - tau_e| / sum |tau_k|
    and |sum sigma_k - sigma| / sum |sigma_k|; a rigid joint has no springs and no residual. With a parallel
    damper the torque of the springs may pass zero while nothing else is small, so the torque residual is
    returned unscaled, with its size: only the whole run has a scale for it.
    """
    row = joint_variables[0].tau_e
    spring_errors, shaft_errors, damped_residuals, damped_magnitudes = [np.zeros_like(row)], [], [], []
    joint_errors = call_at_joints(row, _joint_balance_errors, joints, zip(joint_variables, strict=True))
    for stiffness_error, torque_error, magnitude, largest_shaft_error in joint_errors:
        shaft_errors.append(largest_shaft_error)
        if stiffness_error is not None:
            spring_errors.append(stiffness_error)
        if magnitude is not None:
            damped_residuals.append(torque_error)
            damped_magnitudes.append(magnitude)
        elif torque_error is not None:
            spring_errors.append(torque_error)
    largest = {
        "spring_error": [reduce(np.maximum, spring_errors)],
        "shaft_error": [reduce(np.maximum, shaft_errors)],
    }
    return {**largest, "damped_error": damped_residuals, "damped_size": damped_magnitudes}


def _joint_balance_errors(joint: Joint, variables: JointVariables) -> tuple[FloatArray | None, ...]:
    """Return the scaled errors of stiffness and torque of the springs, and the error of the shafts.

    With a parallel damper the torque error is in N m, and its size is returned, which is None otherwise.
    """
    regular = ~has_flag(variables.flags, Flag.INFEASIBLE | Flag.SINGULAR)
    tau_e, stiffness = variables.tau_e, variables.stiffness
    if not joint.actuator.sprung:
        return None, None, None, shaft_error(joint, variables, tau_e[None], regular)
    springs = joint.actuator.springs_of(variables)
    torque_magnitude, stiffness_magnitude = springs.sizes(
        joint.actuator.unknowns(variables.phi, variables.theta)
    )
    largest_shaft_error = shaft_error(joint, variables, springs.tau_transmission, regular)
    stiffness_error = np.abs(springs.stiffness - stiffness) / np.where(regular, stiffness_magnitude, 1.0)
    stiffness_error = np.where(regular, stiffness_error, 0.0)
    torque_magnitude = np.maximum(torque_magnitude, np.finfo(float).tiny)
    if not joint.damper_at("transmission"):
        torque_error = np.where(regular, np.abs(springs.tau_e - tau_e) / torque_magnitude, 0.0)
        return stiffness_error, torque_error, None, largest_shaft_error
    residual = np.abs(springs.tau_e + variables.tau_damper - tau_e)
    residual = np.maximum(residual - _rounding_of_damper(variables), 0.0)
    torque_magnitude = np.where(regular, np.maximum(torque_magnitude, np.abs(tau_e)), 0.0)
    return stiffness_error, np.where(regular, residual, 0.0), torque_magnitude, largest_shaft_error


def _rounding_of_damper(variables: JointVariables) -> FloatArray:
    """Return the rounding of the torque of a damper, whose velocity is the difference theta' - q'."""
    rounding: FloatArray = 4 * np.finfo(float).eps * variables.damping * np.abs(variables.dq)
    return rounding


def passed_power(joint: Joint, variables: JointVariables) -> tuple[FloatArray, FloatArray]:
    """Return the power of motors into springs, dampers and damping, and its rate, W, W/s.

    It is the motor power without that of inertia and dry friction, which `energy` integrates separately. Each
    (2, samples), NaN where there is no motor.
    """
    dtheta, ddtheta = variables.dtheta, variables.ddtheta
    dampings = [motor.damping for motor in joint.actuator.motors]
    motor_damping = stack_constants([*dampings, *[np.nan] * (SIDES - len(dampings))])
    torque = motor_damping * dtheta + variables.tau_transmission
    torque_rate = motor_damping * ddtheta
    no_motor = np.full_like(variables.q, np.nan)
    torque_rate = torque_rate + np.stack([*_transmission_rates(joint.actuator, variables), no_motor][:SIDES])
    if joint.damper_at("transmission"):
        damper_torque, damper_rate = parallel_damper_torques(joint, variables)
        torque, torque_rate = torque + damper_torque, torque_rate + damper_rate
    return torque * dtheta, torque_rate * dtheta + torque * ddtheta


def _transmission_rates(actuator: Actuator, variables: JointVariables) -> Sequence[FloatArray]:
    """Return the rates of the torques that act on each motor beside its own losses."""
    if not actuator.sprung:
        return [variables.dtau_e]
    coordinate_rates = *actuator.unknowns(variables.dphi, variables.dtheta), variables.dq
    return actuator.springs_of(variables).transmission_rates(coordinate_rates)


_Axes: TypeAlias = tuple[Vector, Vector, Vector]


class _FrameVelocity(NamedTuple):
    """Motion of a link frame, in components of that frame.

    Derived along the links from the rows themselves, on purpose not from the frames of `kinematics`: it is an
    independent check, which shares no fault with what it checks.

    Attributes:
        origin: Vector from the origin of frame 0.
        velocity: Velocity of the origin.
        omega: Angular velocity.
        gravity: Acceleration.
        base: Axes of frame 0.
    """

    origin: Vector
    velocity: Vector
    omega: Vector
    gravity: Vector
    base: _Axes

    def seat_motion(self, seat: Seat) -> _FrameVelocity:
        """Return the motion of a frame fixed in this one, in its components."""
        into_seat, lever = seat.rotation.transposed().times, seat.lever
        return _FrameVelocity(
            origin=into_seat(self.origin + lever),
            velocity=into_seat(self.velocity + cross(self.omega, lever)),
            omega=into_seat(self.omega),
            gravity=into_seat(self.gravity),
            base=_rotate_axes(into_seat, self.base),
        )

    def moved_link(self, joint: Joint, q: FloatArray, dq: FloatArray) -> _FrameVelocity:
        """Return the motion of the frame of the link that a joint moves, seated here."""
        link = link_constants(joint)
        angle, d = (joint.dh.theta + q, joint.dh.d) if joint.is_revolute else (joint.dh.theta, joint.dh.d + q)
        into_link = Rotation(np.cos(angle), np.sin(angle), link.cos_alpha, link.sin_alpha).undo
        axis = into_link(Vector(0, 0, 1))
        p = Vector(link.a, 0, 0) + axis * d
        omega = into_link(self.omega) + (axis * dq if joint.is_revolute else ZERO)
        sliding = ZERO if joint.is_revolute else axis * dq
        return _FrameVelocity(
            origin=into_link(self.origin) + p,
            velocity=into_link(self.velocity) + cross(omega, p) + sliding,
            omega=omega,
            gravity=into_link(self.gravity),
            base=_rotate_axes(into_link, self.base),
        )


def _rotate_axes(rotate: Callable[[Vector], Vector], axes: _Axes) -> _Axes:
    x, y, z = axes
    return rotate(x), rotate(y), rotate(z)


def link_energy(robot: Robot, block: Block) -> FloatArray:
    """Return the kinetic and potential energy of all links, (samples,), J."""
    energy = np.zeros(len(block.time))
    for joint, frame in zip(robot.joints, _frame_velocities(robot, block), strict=True):
        link = link_constants(joint)
        velocity = frame.velocity + cross(frame.omega, link.com)
        angular_term = frame.omega.dot(link.inertia.times(frame.omega))
        height = frame.gravity.dot(frame.origin + link.com)
        energy = energy + angular_term / 2 + link.mass * (velocity.dot(velocity) / 2 - height)
    return energy


def link_powers(robot: Robot, block: Block, frame: WrenchFrame | None) -> list[FloatArray]:
    """Return the powers that change `link_energy`: joints, losses between links, and the wrenches; W.

    Args:
        robot: Robot.
        block: Variables of the robot.
        frame: Frame of the components of the wrench; None without a wrench.
    """
    powers = []
    for index, joint in enumerate(robot.joints):
        variables = JointVariables.of(block.of_joint(index))
        powers.append(variables.tau_e * variables.dq)
        powers.extend(-loss for loss in link_losses(joint, variables))
    return powers if frame is None else [*powers, *_wrench_powers(robot, block, frame)]


def _frame_velocities(robot: Robot, block: Block) -> list[_FrameVelocity]:
    axes = (Vector(1, 0, 0), Vector(0, 1, 0), Vector(0, 0, 1))
    base_frame = _FrameVelocity(ZERO, ZERO, ZERO, base_gravity(robot), axes)
    link_frames = list[_FrameVelocity]()
    for joint, (parent, seat), q, dq in zip(
        robot.joints, carriers(robot), block.q.T, block.dq.T, strict=True
    ):
        frame = link_frames[parent] if parent >= 0 else base_frame
        link_frames.append((frame if seat is None else frame.seat_motion(seat)).moved_link(joint, q, dq))
    return link_frames


def _wrench_powers(robot: Robot, block: Block, frame: WrenchFrame) -> Iterator[FloatArray]:
    """Yield the power of the wrench on each tool on which one acts."""
    velocities = _frame_velocities(robot, block)
    wrenches = block.wrench.reshape(len(block.time), -1, len(WRENCH_AXES))
    for index, (tool, tool_frame) in enumerate(zip(robot.end_effectors, frames_by_tool(frame), strict=True)):
        if tool_frame is not None:
            link_frame, components = velocities[robot.tool_joints[index]], wrenches[:, index].T
            yield _wrench_power(robot, tool, link_frame, tool_frame, components)


def _wrench_power(
    robot: Robot, tool: Tool, link_frame: _FrameVelocity, frame: str, wrench: FloatArray
) -> FloatArray:
    force, moment = Vector(*wrench[:3]), Vector(*wrench[3:])
    velocity = link_frame.velocity + cross(link_frame.omega, Vector(*tool.xyz))
    if frame == "end_effector":
        into_link = rotation_matrix(tool)
        force, moment = into_link.times(force), into_link.times(moment)
    else:
        into_frame_0 = rotation_matrix(robot.base).transposed()
        force, moment = (
            _vector_along_axes(link_frame.base, into_frame_0.times(vector)) for vector in (force, moment)
        )
    power: FloatArray = force.dot(velocity) + moment.dot(link_frame.omega)
    return power


def _vector_along_axes(axes: _Axes, components: Vector) -> Vector:
    """Return the vector with components along axes, which are given in the components of the result."""
    x, y, z = axes
    vector: Vector = x * components.x + y * components.y + z * components.z
    return vector
