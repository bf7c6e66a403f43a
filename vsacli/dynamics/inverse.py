"""All variables of a block of steps: recursion, then actuation joint by joint."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.reach import LimitCheck, OfJoint
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import AnyArray, FloatArray, by_joint, over_time
from vsacli.base.errors import InputError, check_type
from vsacli.base.flags import NEAR_SINGULAR_MARGIN
from vsacli.base.json_records import Stored
from vsacli.base.signals import COMMANDED, DAMPING, POSITION
from vsacli.base.variables import VARIABLES, Block
from vsacli.compute.control_flow import Keyed, call
from vsacli.compute.engine import NUMPY, Engine, samples_per_pass
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
"""Rows of the motion inside damped transmissions, as the fields of `InternalMotion`."""


def usual_block(joints: int) -> int:
    """Steps computed at a time: one pass of NumPy's, which hides the interpreter and bounds the memory."""
    signals = (POSITION, *(signal for signal in COMMANDED.values() if signal.device is None))
    return samples_per_pass(joints * sum(signal.orders for signal in signals))


@dataclass(frozen=True)
class Stop(Stored):
    """The time, s, from which the deflections of a joint cannot be integrated, and the reason."""

    time: float
    reason: str


@dataclass(frozen=True)
class InverseDynamics(RowKernel):
    """Inverse dynamics (36)-(74) over rows of samples, for an engine.

    Inputs are those of `LinkTorques`, the commanded signals of the joints with their derivatives, then the
    deflections if they are integrated; outputs the variables of `COMPUTED` one after the other.

    Attributes:
        robot: the robot.
        frame: of the wrench; None if there is none.
        near_singular: margin below which a step is near-singular.
        integrated: whether deflections are given, else they are solved for.
        internal: the joints whose transmission is damped, by index: what moves inside them is given.
        driven: whether of that the deflections alone are given, and their rates follow from the damping.
        limits: those of each joint, since springs compare equal whatever their limits.
        block: what holds its results.
    """

    block: ClassVar[type[Block]] = Block

    robot: Robot
    frame: str | None = None
    near_singular: float = NEAR_SINGULAR_MARGIN
    integrated: bool = False
    internal: tuple[int, ...] = ()
    driven: bool = False
    limits: tuple[tuple[LimitCheck, ...], ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        limits = tuple(tuple(limit_checks(joint)) for joint in self.robot.joints)
        object.__setattr__(self, "limits", limits)

    @property
    def links(self) -> LinkTorques:
        """The recursion alone."""
        return LinkTorques(self.robot, self.frame)

    @property
    def arguments(self) -> RowLayout:
        """Rows that inverse dynamics takes."""
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
        """Rows that inverse dynamics gives."""
        return RowLayout(self.shapes())

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Return the shapes of its variables at one instant, by name."""
        joints, declared = len(self.robot.joints), [VARIABLES[name] for name in COMPUTED]
        return {
            variable.name: (joints, SIDES) if "motor" in variable.dims else (joints,)
            for variable in declared
            if self.robot.has(variable)
        }

    def __call__(self, rows: Sequence[Scalar]) -> list[Scalar]:
        """Run (36)-(74)."""
        return self.results.pack(self.rows_of(rows, self.at_joints(rows)))

    def at_joints(self, rows: Sequence[Scalar]) -> Sequence[OfJoint]:
        """Return the variables of each joint by name, without those that it does not have."""
        links, given = self.links, self.arguments.unpack(rows)
        demanded = links(rows[: links.inputs])
        torques = links.results.unpack([_as_row(torque, rows[0]) for torque in demanded])
        of_all = {**given, **torques}
        names = Command.names(signal.key for signal in self.robot.signals)
        found = []
        for index, joint in enumerate(self.robot.joints):
            command = Command.of({name: of_all[name][index] for name in names})
            phi = np.stack(given["phi"][SIDES * index : SIDES * (index + 1)]) if self.integrated else None
            internal = self._internal(index, given)
            driving = behind_link(drive, joint, self.limits[index])
            driven = call(rows[0], driving, command, self.near_singular, phi, internal)
            found.append({**command.arrays(), **driven})
            _check_limits(self.limits[index], found[-1])
        if self.robot.has(VARIABLES["dissipated_power"]):
            for joint, of_joint in zip(self.robot.joints, found, strict=True):
                of_joint["dissipated_power"] = call(rows[0], behind_link(dissipated_power, joint), of_joint)
        return found

    def rows_of(self, rows: Sequence[Scalar], of_joints: Sequence[OfJoint]) -> dict[str, Iterable[Any]]:
        """Return the rows of each result by name, from kernel arguments and variables of the joints."""
        absent = {1: np.full_like(rows[0], np.nan), 2: np.full_like(of_joints[0]["dtheta"], np.nan)}
        return {
            name: rows_of_joints(
                [of_joint.get(name, absent[len(VARIABLES[name].dims)]) for of_joint in of_joints]
            )
            for name in COMPUTED
            if self.robot.has(VARIABLES[name])
        }

    def _internal(self, index: int, given: Mapping[str, Sequence[Scalar]]) -> InternalMotion | None:
        """Return the internal motion of a joint, if its transmission is damped."""
        if index not in self.internal:
            return None
        from vsacli.actuators.damped_springs import InternalMotion

        place = self.internal.index(index)
        deflections = np.stack(given[INTERNAL[0]][SIDES * place : SIDES * (place + 1)])
        rates = [None, None] if self.driven else [given[name][place] for name in INTERNAL[1:]]
        return InternalMotion(deflections, *rates)


def _check_limits(limits: Sequence[LimitCheck], of_joint: OfJoint) -> None:
    """Refuse a limit on a variable that no joint computes, which would be skipped without a word."""
    for check in limits:
        if check.variable not in of_joint:
            raise NotImplementedError(f"{check.variable} has a limit, but is neither commanded nor computed")


def behind_link(function: Callable[..., Any], joint: Joint, *further: Hashable) -> Keyed:
    """Wrap `function(joint, ...)` so that name, DH row and link do not count when joints are compared.

    Args:
        function: takes the joint first.
        joint: the joint.
        further: keys to compare in addition.
    """
    counting = joint.type, joint.actuator, joint.damping, joint.friction, joint.damper
    return Keyed((function, *counting, *further), partial(function, joint))


def _as_row(torque: Scalar, row: Scalar) -> Scalar:
    """Return a torque as a row of samples; the recursion gives a plain zero for joints that move nothing."""
    return np.full_like(row, torque) if np.ndim(torque) == 0 else torque


def compute_block(
    robot: Robot,
    motion: Motion,
    near_singular: float = NEAR_SINGULAR_MARGIN,
    engine: Engine = NUMPY,
    internal: Mapping[int, InternalMotion] | None = None,
) -> Block:
    """Inverse dynamics (36)-(74) of a block of steps.

    Args:
        robot: the robot.
        motion: commanded motion and stiffness, (samples, joints); the actuators that take no stiffness
            have a stiffness of their own, or none.
        near_singular: margin below which a step is near-singular.
        engine: the backend.
        internal: what moves inside the transmissions that are damped, by index of the joint; if None, all of
            them are where their springs carry the joint alone, or where their damper is said to start.
    """
    frame = None if motion.wrench is None else motion.wrench.frame
    internal = internal_equilibrium(robot, motion) if internal is None else internal
    kernel = InverseDynamics(robot, frame, near_singular, internal=tuple(internal))
    return block_of(kernel, motion, engine, internal=internal)


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
        kernel: what is computed, and in which block it comes.
        motion: as of `compute_block`.
        engine: the backend.
        integrated: deflections of the joints, if the kernel takes them, (joints, 2, samples); a step where
            they are NaN is infeasible.
        internal: what moves inside the joints that the kernel names.
    """
    robot = kernel.robot
    given = {name: array for name, array in motion.variables().items() if robot.has(VARIABLES[name])}
    rows = {name: by_joint(given[name]) for name in kernel.arguments.shapes if name in given}
    if integrated is not None:
        rows["phi"] = integrated.reshape(-1, integrated.shape[-1])
    for name, values in zip(INTERNAL, zip(*internal.values(), strict=True), strict=False):
        of_joints = np.concatenate(values) if name == INTERNAL[0] else np.stack(values)
        rows[name] = np.ascontiguousarray(of_joints)
    found = kernel.results.arrays(engine.run(kernel, kernel.arguments.pack(rows)))
    computed = {name: over_time(array) for name, array in found.items()}
    arrays: dict[str, AnyArray] = {**given, **computed, "flags": computed["flags"].astype(np.uint32)}
    return kernel.block(**arrays)


def internal_equilibrium(robot: Robot, motion: Motion) -> dict[int, InternalMotion]:
    """Return the start of motions in damped transmissions, with rates, by index of the joint."""
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
        found[index] = InternalMotion(phi, *springs.driven(phi, command))
    return found


def rows_of_joints(of_joints: Iterable[FloatArray]) -> Iterator[FloatArray]:
    """Yield the rows (samples,) of arrays of the joints, each (samples,) or (2, samples)."""
    for array in of_joints:
        yield from array if array.ndim > 1 else [array]


def elastic_torques(robot: Robot, motion: Motion) -> dict[str, FloatArray]:
    """tau_e, dtau_e and ddtau_e, (58)-(60), by name, each (samples, joints); the stiffness plays no part."""
    damping: dict[str, Any] = {
        name: motion.commanded[name] for name in DAMPING.names if name in motion.commanded
    }
    return link_torques(
        robot, motion.q, motion.dq, motion.ddq, motion.d3q, motion.d4q, motion.wrench, **damping
    )._asdict()


def fitted(robot: Robot, trajectory: Trajectory) -> Trajectory:
    """Return a trajectory for a robot: the same, with what its devices do that are not commanded.

    Raises:
        InputError: it has another number of joints than the robot, or lacks a stiffness that one takes.
        TypeError: one of both is of another type.
    """
    check_robot(robot)
    remedy = "load_trajectory({}, robot) reads one; it comes after the robot"
    check_type("trajectory", trajectory, Trajectory, remedy)
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
    """Return the part of one joint in variables by name, each (samples, joints)."""
    names = (name for name in Command.names(COMMANDED) if name in commanded)
    return Command.of({name: commanded[name][:, index] for name in names})
