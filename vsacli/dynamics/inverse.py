"""Inverse dynamics of a block of samples, (36)-(74): the recursion, then the actuation joint by joint.

`InverseDynamics` is the kernel that an engine runs on rows of samples; `block_of` packs a motion into its
rows, and the results into a `Block`. Before that, `adapt_trajectory` checks a trajectory for a robot.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from itertools import repeat
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.transmission import Command, InternalMotion, JointVariables
from vsacli.base.arrays import FLAG_TYPE, AnyArray, FloatArray, by_joint, checked_shape, over_time
from vsacli.base.errors import InputError, check_type
from vsacli.base.flags import MIN_MARGIN
from vsacli.base.json_records import Stored
from vsacli.base.signals import COMMANDED, DAMPING, POSITION
from vsacli.base.variables import VARIABLES, Block
from vsacli.base.wrench import WrenchFrame, check_wrench_frame
from vsacli.compute.control_flow import Keyed, call
from vsacli.compute.engine import KEPT_PROGRAMS, NUMPY, Engine, engine_of_call, samples_per_pass
from vsacli.compute.rows import RowKernel, RowLayout
from vsacli.compute.vector import Scalar
from vsacli.dynamics.deflection_rows import IntegratedRows, InternalRows, internal_rows
from vsacli.dynamics.drive import ACTUATED, OF_DEVICES, drive
from vsacli.dynamics.elastic_torques import TORQUES, LinkTorques, link_torques
from vsacli.dynamics.limits import limit_checks
from vsacli.dynamics.losses import dissipated_power
from vsacli.dynamics.variants import RobotKernel
from vsacli.robot.commanded_joints import describe_commanded_joints
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot, check_robot
from vsacli.trajectory.devices import set_uncommanded_dampers
from vsacli.trajectory.trajectory import Motion, Trajectory

COMPUTED = (*TORQUES, *ACTUATED, *OF_DEVICES, "dissipated_power")
"""The variables that inverse dynamics computes, where the robot has them."""


def usual_block(joints: int) -> int:
    """Return the usual number of samples in a block: one pass of the NumPy engine.

    Long enough to hide the time of the interpreter, short enough to bound the memory.
    """
    signals = (POSITION, *(signal for signal in COMMANDED.values() if signal.device is None))
    return samples_per_pass(joints * sum(signal.orders for signal in signals))


@dataclass(frozen=True)
class DeflectionStop(Stored):
    """Time, s, from which the deflections of a joint cannot be integrated, and the reason."""

    time: float
    reason: str


@dataclass(frozen=True)
class InverseDynamics(RobotKernel):
    """Inverse dynamics (36)-(74) over rows of samples, for an engine.

    Inputs are those of `LinkTorques`, the commanded signals of the joints with their derivatives, and
    deflections that replace the root of (14). Outputs are the variables of `COMPUTED`, in that order.

    Attributes:
        robot: Robot whose motion is computed.
        frame: Frame of the wrench; None without a wrench.
        min_margin: Margin below which a sample is near-singular.
        prescribed: Deflections that are inputs instead of roots of (14), none in a usual run; where a joint
            has several, the last counts.
    """

    robot: Robot
    frame: WrenchFrame | None = None
    min_margin: float = MIN_MARGIN
    prescribed: tuple[IntegratedRows | InternalRows, ...] = ()

    def of_robot(self, robot: Robot) -> Self:
        """See `RobotKernel.of_robot`."""
        return replace(self, robot=robot)

    @cached_property
    def links(self) -> LinkTorques:
        """Kernel of the recursion alone."""
        return LinkTorques(self.robot, self.frame)

    @cached_property
    def arguments(self) -> RowLayout:
        """Layout of the input rows."""
        joints = len(self.robot.joints)
        shapes = dict(self.links.arguments.shapes)
        shapes |= {name: (joints,) for signal in self.robot.signals for name in signal.names}
        for rows in self.prescribed:
            shapes |= rows.shapes(joints)
        return RowLayout(shapes)

    @cached_property
    def results(self) -> RowLayout:
        """Layout of the output rows."""
        joints = len(self.robot.joints)
        return RowLayout(
            {
                name: (joints, SIDES) if "motor" in VARIABLES[name].dims else (joints,)
                for name in COMPUTED
                if self.robot.has_variable(VARIABLES[name])
            }
        )

    def __call__(self, rows: Sequence[Scalar]) -> list[Scalar]:
        """Run (36)-(74)."""
        return self.results.pack(self.result_rows(rows, self.joint_variables(rows)))

    def joint_variables(self, rows: Sequence[Scalar]) -> Sequence[JointVariables]:
        """Return the variables of each joint."""
        inputs = self.arguments.unpack(rows)
        torques = self.links(self.links.arguments.pack(inputs))  # (36)-(60)
        # The recursion gives the integer 0 for joints that move no mass.
        torque_rows = [np.full_like(rows[0], row) if np.ndim(row) == 0 else row for row in torques]
        all_rows = {**inputs, **self.links.results.unpack(torque_rows)}
        names, joints = Command.names(signal.key for signal in self.robot.signals), self.robot.joints
        commands = (
            Command.of({name: all_rows[name][index] for name in names}) for index in range(len(joints))
        )
        deflections = (self._prescribed_deflections(index, inputs) for index in range(len(joints)))
        drive_arguments = zip(commands, repeat(self.min_margin), deflections, strict=False)
        limits = [joint.limits for joint in joints]
        of_joints: list[JointVariables] = call_at_joints(  # (61)-(74)
            rows[0], drive, joints, drive_arguments, keys=limits
        )
        for joint, variables in zip(joints, of_joints, strict=True):
            _check_limits(joint, variables)
        if "dissipated_power" in self.results.shapes:
            powers = call_at_joints(rows[0], dissipated_power, joints, zip(of_joints, strict=True))
            of_joints = [
                variables._replace(dissipated_power=power)
                for variables, power in zip(of_joints, powers, strict=True)
            ]
        return of_joints

    def _prescribed_deflections(
        self, index: int, inputs: Mapping[str, Sequence[Scalar]]
    ) -> FloatArray | InternalMotion | None:
        candidates = (rows.of_joint(index, inputs) for rows in reversed(self.prescribed))
        return next((candidate for candidate in candidates if candidate is not None), None)

    def result_rows(
        self, rows: Sequence[Scalar], joint_variables: Sequence[JointVariables]
    ) -> dict[str, Iterable[Any]]:
        """Return the rows of each result by name, from the input rows and the variables of the joints."""
        absent_rows = {1: np.full_like(rows[0], np.nan), 2: np.full_like(joint_variables[0].dtheta, np.nan)}
        joint_arrays = [variables.by_name() for variables in joint_variables]
        return {
            name: rows_of_joints(
                [arrays.get(name, absent_rows[len(VARIABLES[name].dims)]) for arrays in joint_arrays]
            )
            for name in self.results.shapes
        }


def _check_limits(joint: Joint, variables: JointVariables) -> None:
    """Raise NotImplementedError for a limit on a variable that the joint lacks; it would go unchecked."""
    arrays = variables.by_name()
    for check in limit_checks(joint):
        if check.variable not in arrays:
            raise NotImplementedError(f"{check.variable} has a limit, but is neither commanded nor computed")


def call_at_joints(
    row: Scalar,
    function: Callable[..., Any],
    joints: Sequence[Joint],
    arguments: Iterable[Sequence[Any]],
    keys: Iterable[Hashable] = repeat(None),
) -> list[Any]:
    """Return `function(joint, ...)` of each joint; a program has one body for joints with equal actuators.

    Name, DH row and link of the joints are ignored in the comparison.

    Args:
        row: Any row of samples, for `call`.
        function: Function whose first argument is the joint.
        joints: Joints.
        arguments: Further arguments for each joint.
        keys: Keys of the joints to compare in addition.
    """
    functions = []
    for joint, key in zip(joints, keys, strict=False):
        compared = joint.type, joint.actuator, joint.damping, joint.friction, joint.damper
        functions.append(Keyed((function, *compared, key), partial(function, joint)))
    return [
        call(row, keyed_function, *joint_arguments)
        for keyed_function, joint_arguments in zip(functions, arguments, strict=True)
    ]


def compute_block(
    robot: Robot,
    motion: Motion,
    min_margin: float = MIN_MARGIN,
    engine: Engine = NUMPY,
    internal: Mapping[int, InternalMotion] | None = None,
) -> Block:
    """Compute the inverse dynamics (36)-(74) of a block of samples.

    Args:
        robot: Robot whose motion is computed.
        motion: Commanded motion and stiffness, (samples, joints); actuators without a commanded stiffness
            have their own, or none.
        min_margin: Margin below which a sample is near-singular.
        engine: Backend.
        internal: Internal motion of the damped transmissions, by index of the joint; if None, each is at the
            declared start of its damper, or else where its springs carry the joint alone.
    """
    frame = None if motion.wrench is None else motion.wrench.frame
    internal = internal_equilibrium(robot, motion) if internal is None else internal
    kernel = _inverse_dynamics_kernel(robot, frame, min_margin, tuple(internal))
    return block_of(kernel, motion, engine, internal_rows(internal))


@lru_cache(KEPT_PROGRAMS)
def _inverse_dynamics_kernel(
    robot: Robot, frame: WrenchFrame | None, min_margin: float, damped: tuple[int, ...]
) -> InverseDynamics:
    """Return a kernel; without this cache, `motor_torques` of a 7R takes 1.7 times as long."""
    prescribed = (InternalRows(damped),) if damped else ()
    return InverseDynamics(robot, frame, min_margin, prescribed)


def motor_torques(
    robot: Robot, motion: Motion, min_margin: float = MIN_MARGIN, *, engine: str | Engine = "numpy"
) -> Block:
    """Compute the motor torques for a motion, and every other variable of inverse dynamics, (36)-(74).

    This is the function for control loops: it makes no report, and a sample of a robot with seven joints
    takes 0.2 ms from the sixteenth call on. A damped transmission is taken at the equilibrium of its springs.

    Args:
        robot: Robot whose motion is computed.
        motion: Commanded motion and stiffness, ([samples,] joints), such as `trajectory.at(time)`.
        min_margin: Margin below which a sample is near-singular.
        engine: Backend: one of `vsacli.compute.engine.NAMES`, or an engine chosen before.

    Returns:
        Variables as attributes, ([samples,] joints[, 2]); `flags` gives the reason where a value is NaN.

    Raises:
        InputError: A command is missing, or a shape does not fit the robot; the engine is unknown.
        TypeError: Robot or motion is of another type.
    """
    check_robot(robot)
    check_type("motion", motion, Motion, "trajectory.at(time) gives one")
    is_single = np.ndim(motion.q) == 1
    _check_motion(robot, motion)
    if is_single:
        motion = motion.mapped(np.atleast_1d(motion.time), lambda array, _: np.asarray(array)[None])
    frame = None if motion.wrench is None else motion.wrench.frame
    kernel = _inverse_dynamics_kernel(robot, frame, min_margin, ())
    block = compute_block(robot, motion, min_margin, engine_of_call(engine, kernel, len(motion.q)))
    return block.taken(0) if is_single else block


def _check_motion(robot: Robot, motion: Motion) -> None:
    """Refuse a motion that lacks commands, or whose arrays do not fit the robot or each other.

    Raises:
        InputError: with the names of the arrays.
    """
    arrays, shape = motion.variables(), np.shape(motion.q)
    required = (name for signal in (POSITION, *robot.signals) for name in signal.names)
    if missing := [name for name in required if name not in arrays]:
        raise InputError.one(f"the motion lacks {', '.join(missing)}, which {robot.name} requires")
    checked_shape("q", motion.q, len(robot.joints))
    for name, array in motion.of_joints.items():
        if np.shape(array) != shape:
            raise InputError.one(f"{name} must have the shape {shape} of q, not {np.shape(array)}")


def block_of(
    kernel: RowKernel,
    motion: Motion,
    engine: Engine = NUMPY,
    further: Mapping[str, Iterable[FloatArray]] = MappingProxyType({}),
    block: type[Block] = Block,
) -> Block:
    """Return the variables that a kernel computes for a block of samples.

    Args:
        kernel: Kernel to run; its inputs are commands of a robot, its results variables of a block.
        motion: Commanded motion, as for `compute_block`.
        engine: Backend.
        further: Rows of further inputs of the kernel, each (samples,), by name.
        block: Class of the block.
    """
    input_shapes = kernel.arguments.shapes
    commanded = {name: array for name, array in motion.variables().items() if name in input_shapes}
    rows = {name: by_joint(array) for name, array in commanded.items()}
    results = kernel.results.arrays(engine.run(kernel, kernel.arguments.pack({**rows, **further})))
    computed: dict[str, AnyArray] = {name: over_time(array) for name, array in results.items()}
    computed["flags"] = computed["flags"].astype(FLAG_TYPE)
    return block(time=motion.time, **{**commanded, **computed})


def internal_equilibrium(robot: Robot, motion: Motion) -> dict[int, InternalMotion]:
    """Return the initial internal motion of damped transmissions, with rates, by index of the joint."""
    damped = {
        index: joint
        for index, joint in enumerate(robot.joints)
        if joint.damper_at("transmission") and np.any(motion.commanded[DAMPING.key][:, index])
    }
    if not damped:
        return {}
    from vsacli.actuators.damped_springs import DampedSprings

    commanded = {**motion.variables(), **link_torques_along(robot, motion)}
    motions = {}
    for index, joint in damped.items():
        springs, command = DampedSprings(joint.actuator), command_of(index, commanded)
        phi = springs.equilibrium(command, joint.damper_start)
        motions[index] = InternalMotion(phi, *springs.damper_motion(phi, command))
    return motions


def rows_of_joints(arrays: Iterable[FloatArray]) -> Iterator[FloatArray]:
    """Yield the rows (samples,) of arrays of the joints, each (samples,) or (2, samples)."""
    for array in arrays:
        yield from array if array.ndim > 1 else [array]


def link_torques_along(robot: Robot, motion: Motion) -> dict[str, FloatArray]:
    """Return tau_e, dtau_e and ddtau_e, (58)-(60), by name, each (samples, joints)."""
    damping: dict[str, Any] = {
        name: motion.commanded[name] for name in DAMPING.names if name in motion.commanded
    }
    return link_torques(
        robot, motion.q, motion.dq, motion.ddq, motion.d3q, motion.d4q, motion.wrench, **damping
    )._asdict()


def adapt_trajectory(robot: Robot, trajectory: Trajectory) -> Trajectory:
    """Return the trajectory with uncommanded dampers of the robot at their minimum, after checks.

    Raises:
        InputError: The numbers of joints differ, or a stiffness that a joint needs is missing.
        TypeError: Robot or trajectory is of another type.
    """
    check_robot(robot)
    advice = "load_trajectory({}, robot) reads one; it comes after the robot"
    check_type("trajectory", trajectory, Trajectory, advice)
    if trajectory.joints != len(robot.joints):
        joints = f"{trajectory.joints} joints, the robot {robot.name} {len(robot.joints)}"
        raise InputError.one(f"the trajectory {trajectory.name} has {joints}")
    if trajectory.wrench is not None:
        check_wrench_frame(trajectory.wrench.frame, robot.tool_names)
    trajectory = set_uncommanded_dampers(trajectory, robot)
    for key, signal in COMMANDED.items():
        missing = [
            joint.name
            for joint, commanded in zip(robot.joints, trajectory.chosen(key), strict=True)
            if key in joint.commanded and not commanded
        ]
        if missing:
            raise InputError.one(
                f"the trajectory {trajectory.name} has no {key} for {', '.join(missing)}; "
                f"each {describe_commanded_joints(signal)} needs one"
            )
    return trajectory


def command_of(index: int, commanded: Mapping[str, FloatArray]) -> Command:
    """Return the command of one joint from variables by name, each (samples, joints)."""
    names = (name for name in Command.names(COMMANDED) if name in commanded)
    return Command.of({name: commanded[name][:, index] for name in names})
