"""Inverse dynamics of a block of samples, (36)-(74): the recursion, then the actuation joint by joint.

`InverseDynamics` is the kernel that an engine runs on rows of samples; `block_of` packs a motion into its
rows, and the results into a `Block`. Before that, `fitted` checks a trajectory for a robot.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.reach import OfJoint
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FLAG_TYPE, AnyArray, FloatArray, by_joint, checked_shape, over_time
from vsacli.base.errors import InputError, check_type
from vsacli.base.flags import MIN_MARGIN
from vsacli.base.json_records import Stored
from vsacli.base.signals import COMMANDED, DAMPING, POSITION
from vsacli.base.variables import VARIABLES, Block
from vsacli.compute.control_flow import Keyed, call
from vsacli.compute.engine import KEPT_PROGRAMS, NUMPY, Engine, engine_of_call, samples_per_pass
from vsacli.compute.rows import RowKernel, RowLayout
from vsacli.compute.vector import Scalar
from vsacli.dynamics.drive import ACTUATED, OF_DEVICES, drive
from vsacli.dynamics.elastic_torques import TORQUES, LinkTorques, link_torques
from vsacli.dynamics.limits import limit_checks
from vsacli.dynamics.losses import dissipated_power
from vsacli.robot.commanded_joints import takers
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot, check_robot
from vsacli.trajectory.devices import with_devices
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vsacli.actuators.damped_springs import InternalMotion

COMPUTED = (*TORQUES, *ACTUATED, *OF_DEVICES, "dissipated_power")
"""The variables that inverse dynamics computes, where the robot has them."""


INTERNAL = ("internal_phi", "internal_velocity", "internal_acceleration")
"""Names of the rows of internal motion in damped transmissions, in the order of `InternalMotion`."""


def usual_block(joints: int) -> int:
    """Return the usual number of samples in a block: one pass of the NumPy engine.

    Long enough to hide the time of the interpreter, short enough to bound the memory.
    """
    signals = (POSITION, *(signal for signal in COMMANDED.values() if signal.device is None))
    return samples_per_pass(joints * sum(signal.orders for signal in signals))


@dataclass(frozen=True)
class Stop(Stored):
    """Time, s, from which the deflections of a joint cannot be integrated, and the reason."""

    time: float
    reason: str


@dataclass(frozen=True)
class InverseDynamics(RowKernel):
    """Inverse dynamics (36)-(74) over rows of samples, for an engine.

    Inputs are those of `LinkTorques`, the commanded signals of the joints with their derivatives, deflections
    if they are integrated, and internal motion. Outputs are the variables of `COMPUTED`, in that order.

    Attributes:
        robot: Robot whose motion is computed.
        frame: Frame of the wrench; None without a wrench.
        min_margin: Margin below which a sample is near-singular.
        integrated: Whether deflections are inputs; otherwise (14) is solved for them.
        internal: Joints with damped transmissions, by index; their internal motion is an input.
        driven: Whether only the internal deflections are inputs; their rates then follow from the damping.
        block: Class of the blocks that hold the results.
    """

    block: ClassVar[type[Block]] = Block

    robot: Robot
    frame: str | None = None
    min_margin: float = MIN_MARGIN
    integrated: bool = False
    internal: tuple[int, ...] = ()
    driven: bool = False

    @property
    def links(self) -> LinkTorques:
        """Kernel of the recursion alone."""
        return LinkTorques(self.robot, self.frame)

    @cached_property
    def variables(self) -> frozenset[str]:
        """Names of the variables that results of the robot have."""
        return frozenset(name for name, variable in VARIABLES.items() if self.robot.has_variable(variable))

    @cached_property
    def arguments(self) -> RowLayout:
        """Layout of the input rows."""
        joints = len(self.robot.joints)
        names = (name for signal in self.robot.signals for name in signal.names)
        commanded = dict.fromkeys(names, (joints,))
        integrated = {"phi": (joints, SIDES)} if self.integrated else {}
        inside = (len(self.internal),)
        shapes = ((*inside, SIDES),) if self.driven else ((*inside, SIDES), inside, inside)
        internal = dict(zip(INTERNAL, shapes, strict=False)) if self.internal else {}
        return RowLayout({**self.links.arguments.shapes, **commanded, **integrated, **internal})

    @cached_property
    def results(self) -> RowLayout:
        """Layout of the output rows."""
        return RowLayout(self.shapes())

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Return the shapes of the computed variables at one instant, by name."""
        joints, declared = len(self.robot.joints), [VARIABLES[name] for name in COMPUTED]
        return {
            variable.name: (joints, SIDES) if "motor" in variable.dims else (joints,)
            for variable in declared
            if self.robot.has_variable(variable)
        }

    def __call__(self, rows: Sequence[Scalar]) -> list[Scalar]:
        """Run (36)-(74)."""
        # `BalancedDynamics`, the kernel of a run, overrides `rows_of` to append the rows of the self-check.
        return self.results.pack(self.rows_of(rows, self.at_joints(rows)))

    def at_joints(self, rows: Sequence[Scalar]) -> Sequence[OfJoint]:
        """Return the variables of each joint by name, without those that it does not have."""
        links, given = self.links, self.arguments.unpack(rows)
        demanded = links(links.arguments.pack(given))  # (36)-(60)
        torques = links.results.unpack([_as_row(torque, rows[0]) for torque in demanded])
        of_all = {**given, **torques}
        names = Command.names(signal.key for signal in self.robot.signals)
        found = []
        for index, joint in enumerate(self.robot.joints):
            command = Command.of({name: of_all[name][index] for name in names})
            phi = np.stack(given["phi"][SIDES * index : SIDES * (index + 1)]) if self.integrated else None
            internal = self._internal(index, given)
            # Computes drive(joint, ...), (61)-(74). `call` lets equal joints share one recorded body.
            driving = behind_link(drive, joint, joint.limits)
            driven = call(rows[0], driving, command, self.min_margin, phi, internal)
            found.append({**command.arrays(), **driven})
            _check_limits(joint, found[-1])
        if self.robot.has_variable(VARIABLES["dissipated_power"]):
            for joint, of_joint in zip(self.robot.joints, found, strict=True):
                of_joint["dissipated_power"] = call(rows[0], behind_link(dissipated_power, joint), of_joint)
        return found

    def rows_of(self, rows: Sequence[Scalar], of_joints: Sequence[OfJoint]) -> dict[str, Iterable[Any]]:
        """Return the rows of each result by name, from the input rows and the variables of the joints."""
        absent = {1: np.full_like(rows[0], np.nan), 2: np.full_like(of_joints[0]["dtheta"], np.nan)}
        return {
            name: rows_of_joints(
                [of_joint.get(name, absent[len(VARIABLES[name].dims)]) for of_joint in of_joints]
            )
            for name in COMPUTED
            if self.robot.has_variable(VARIABLES[name])
        }

    def _internal(self, index: int, given: Mapping[str, Sequence[Scalar]]) -> InternalMotion | None:
        """Return the internal motion of a joint; None unless its transmission is damped."""
        if index not in self.internal:
            return None
        from vsacli.actuators.damped_springs import InternalMotion

        place = self.internal.index(index)
        deflections = np.stack(given[INTERNAL[0]][SIDES * place : SIDES * (place + 1)])
        rates = [None, None] if self.driven else [given[name][place] for name in INTERNAL[1:]]
        return InternalMotion(deflections, *rates)


def _check_limits(joint: Joint, of_joint: OfJoint) -> None:
    """Raise NotImplementedError for a limit on a variable that the joint lacks; it would go unchecked."""
    for check in limit_checks(joint):
        if check.variable not in of_joint:
            raise NotImplementedError(f"{check.variable} has a limit, but is neither commanded nor computed")


def behind_link(function: Callable[..., Any], joint: Joint, *further: Hashable) -> Keyed:
    """Wrap `function(joint, ...)` so that `call` records one body for joints with equal actuators.

    Name, DH row and link of the joint are ignored in the comparison.

    Args:
        function: Function whose first argument is the joint.
        joint: Joint to bind to it.
        further: Keys to compare in addition.
    """
    counting = joint.type, joint.actuator, joint.damping, joint.friction, joint.damper
    return Keyed((function, *counting, *further), partial(function, joint))


def _as_row(torque: Scalar, row: Scalar) -> Scalar:
    """Return a torque as a row of samples; the recursion gives the integer 0 for joints that move no mass."""
    return np.full_like(row, torque) if np.ndim(torque) == 0 else torque


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
    kernel = _kernel(robot, frame, min_margin, tuple(internal))
    return block_of(kernel, motion, engine, internal=internal)


@lru_cache(KEPT_PROGRAMS)
def _kernel(robot: Robot, frame: str | None, min_margin: float, internal: tuple[int, ...]) -> InverseDynamics:
    return InverseDynamics(robot, frame, min_margin, internal=internal)


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
    single = np.ndim(motion.q) == 1
    _check_motion(robot, motion)
    if single:
        motion = motion.mapped(np.atleast_1d(motion.time), lambda array, _: np.asarray(array)[None])
    frame = None if motion.wrench is None else motion.wrench.frame
    kernel = _kernel(robot, frame, min_margin, ())
    block = compute_block(robot, motion, min_margin, engine_of_call(engine, kernel, len(motion.q)))
    return block.taken(0) if single else block


def _check_motion(robot: Robot, motion: Motion) -> None:
    """Refuse a motion that lacks commands, or whose arrays do not fit the robot or each other.

    Raises:
        InputError: with the names of the arrays.
    """
    given, shape = motion.variables(), np.shape(motion.q)
    required = (name for signal in (POSITION, *robot.signals) for name in signal.names)
    if lacking := [name for name in required if name not in given]:
        raise InputError.one(f"the motion lacks {', '.join(lacking)}, which {robot.name} requires")
    checked_shape("q", motion.q, len(robot.joints))
    for name, array in motion.of_joints.items():
        if np.shape(array) != shape:
            raise InputError.one(f"{name} must have the shape {shape} of q, not {np.shape(array)}")


def block_of(
    kernel: InverseDynamics,
    motion: Motion,
    engine: Engine = NUMPY,
    *,
    integrated: FloatArray | None = None,
    internal: Mapping[int, InternalMotion] = MappingProxyType({}),
) -> Block:
    """Return the variables that a kernel of inverse dynamics computes for a block of samples.

    Args:
        kernel: Kernel to run; it names the class of the block.
        motion: Commanded motion, as for `compute_block`.
        engine: Backend.
        integrated: Deflections, (joints, 2, samples), if they are inputs of the kernel; a sample where they
            are NaN is infeasible.
        internal: Internal motion of the joints in `kernel.internal`, by index and in that order.
    """
    given = {name: array for name, array in motion.variables().items() if name in kernel.variables}
    rows = {name: by_joint(given[name]) for name in kernel.arguments.shapes if name in given}
    if integrated is not None:
        rows["phi"] = integrated.reshape(-1, integrated.shape[-1])
    # All joints' deflections, then all velocities, then all accelerations, as in `arguments`.
    for name, values in zip(INTERNAL, zip(*internal.values(), strict=True), strict=False):
        of_joints = np.concatenate(values) if name == INTERNAL[0] else np.stack(values)
        rows[name] = np.ascontiguousarray(of_joints)
    found = kernel.results.arrays(engine.run(kernel, kernel.arguments.pack(rows)))
    computed = {name: over_time(array) for name, array in found.items()}
    arrays: dict[str, AnyArray] = {**given, **computed, "flags": computed["flags"].astype(FLAG_TYPE)}
    return kernel.block(**arrays)


def internal_equilibrium(robot: Robot, motion: Motion) -> dict[int, InternalMotion]:
    """Return the initial internal motion of damped transmissions, with rates, by index of the joint."""
    damped = {
        index: joint
        for index, joint in enumerate(robot.joints)
        if joint.damper_at("transmission") and np.any(motion.commanded[DAMPING.key][:, index])
    }
    if not damped:
        return {}
    from vsacli.actuators.damped_springs import DampedSprings, InternalMotion

    commanded = {**motion.variables(), **elastic_torques(robot, motion)}
    found = {}
    for index, joint in damped.items():
        springs, command = DampedSprings(joint.actuator), command_of(index, commanded)
        phi = springs.equilibrium(command, joint.damper_start)
        found[index] = InternalMotion(phi, *springs.damper_motion(phi, command))
    return found


def rows_of_joints(of_joints: Iterable[FloatArray]) -> Iterator[FloatArray]:
    """Yield the rows (samples,) of arrays of the joints, each (samples,) or (2, samples)."""
    for array in of_joints:
        yield from array if array.ndim > 1 else [array]


def elastic_torques(robot: Robot, motion: Motion) -> dict[str, FloatArray]:
    """Return tau_e, dtau_e and ddtau_e, (58)-(60), by name, each (samples, joints)."""
    damping: dict[str, Any] = {
        name: motion.commanded[name] for name in DAMPING.names if name in motion.commanded
    }
    return link_torques(
        robot, motion.q, motion.dq, motion.ddq, motion.d3q, motion.d4q, motion.wrench, **damping
    )._asdict()


def fitted(robot: Robot, trajectory: Trajectory) -> Trajectory:
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
    trajectory = with_devices(trajectory, robot)
    for key, signal in COMMANDED.items():
        lacking = [
            joint.name
            for joint, chosen in zip(robot.joints, trajectory.chosen(key), strict=True)
            if key in joint.commanded and not chosen
        ]
        if lacking:
            raise InputError.one(
                f"the trajectory {trajectory.name} has no {key} for {', '.join(lacking)}; "
                f"each {takers(signal)} needs one"
            )
    return trajectory


def command_of(index: int, commanded: Mapping[str, FloatArray]) -> Command:
    """Return the command of one joint from variables by name, each (samples, joints)."""
    names = (name for name in Command.names(COMMANDED) if name in commanded)
    return Command.of({name: commanded[name][:, index] for name in names})
