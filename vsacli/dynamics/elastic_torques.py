"""Link torques tau_e, tau_e', tau_e'', (36)-(60), over blocks of samples.

`LinkTorques` is the kernel: it assembles constants and states of the joints and runs the recursion.
`link_torques` is the function for users.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from vsacli.base.arrays import FloatArray, by_joint, checked_shape
from vsacli.base.errors import InputError
from vsacli.base.signals import DAMPING, POSITION
from vsacli.base.wrench import (
    WRENCH_AXES,
    WRENCH_NAMES,
    Wrench,
    WrenchFrame,
    check_wrench,
    frames_by_tool,
    wrench_components,
)
from vsacli.compute.control_flow import Keyed, call
from vsacli.compute.engine import KEPT_PROGRAMS, NUMBERS, Engine, engine_of_call
from vsacli.compute.rows import RowLayout
from vsacli.compute.vector import (
    ZERO,
    Matrix,
    Scalar,
    SymmetricTensor,
    Vector,
    add,
    exact,
    trigonometric,
)
from vsacli.dynamics.dampers import damper_torque
from vsacli.dynamics.dry_friction import joint_friction
from vsacli.dynamics.recursion import recursion
from vsacli.dynamics.recursion_inputs import (
    Carrier,
    JointState,
    LinkConstants,
    RecursionInputs,
    Seat,
    ToolLoad,
    TorqueDerivatives,
)
from vsacli.dynamics.variants import RobotKernel
from vsacli.robot.joint import Joint, Pose, Tool
from vsacli.robot.kinematics import base_gravity, rotation_matrix
from vsacli.robot.model import Robot, check_robot

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

TORQUES = ("tau_e", "dtau_e", "ddtau_e")
"""Outputs of the recursion, by name."""


def link_constants(joint: Joint) -> LinkConstants:
    """Return the constants of a joint for the recursion; zeros and ones of the geometry are exact."""
    inertia = joint.link.inertia
    return LinkConstants(
        revolute=joint.is_revolute,
        a=exact(joint.dh.a),
        cos_alpha=trigonometric("cos", joint.dh.alpha),
        sin_alpha=trigonometric("sin", joint.dh.alpha),
        mass=exact(joint.link.mass),
        com=Vector(*map(exact, joint.link.com)),
        inertia=SymmetricTensor(
            *map(exact, (inertia.xx, inertia.yy, inertia.zz, inertia.xy, inertia.xz, inertia.yz))
        ),
        viscous_damping=exact(joint.damping),
    )


def carriers(robot: Robot) -> list[Carrier]:
    """Return what carries each joint of a robot.

    Exact zeros and ones of a seat are those of all seats on the same link, so that equal fingers at different
    mounts share their compiled code.
    """
    seat_entries = {
        index: [*chain.from_iterable(rotation_matrix(joint.mount)), *_exact_position(joint.mount)]
        for index, joint in enumerate(robot.joints)
        if joint.mount is not None
    }
    seats = dict[int, Seat]()
    for index, entries in seat_entries.items():
        entries_on_link = [
            other_entries
            for other, other_entries in seat_entries.items()
            if robot.parents[other] == robot.parents[index]
        ]
        common_entries = list(map(_common_exact, entries, zip(*entries_on_link, strict=True)))
        *axes, lever = (
            Vector(*common_entries[start : start + 3]) for start in range(0, len(common_entries), 3)
        )
        seats[index] = Seat(Matrix(*axes), lever)
    return [Carrier(parent, seats.get(index)) for index, parent in enumerate(robot.parents)]


def _common_exact(number: Scalar, counterparts: Sequence[Scalar]) -> Scalar:
    """Return a number that is exact, a Python integer, only if it is the same in all places beside it."""
    equal = all(type(other) is int and other == number for other in counterparts)
    return float(number) if type(number) is int and not equal else number


def tool_loads(robot: Robot, frame: WrenchFrame, wrench: Sequence[Sequence[Scalar]]) -> list[ToolLoad]:
    """Return the loads of the tools while the environment exerts wrenches on them.

    Args:
        robot: Robot with its base and tools.
        frame: Frame of the components for each tool.
        wrench: Components of all tools, six each, their first and their second derivatives; scalars of any
            kind.
    """
    component_count, loads = len(WRENCH_AXES), []
    frames = frames_by_tool(frame)
    for index, (tool, carrier, tool_frame) in enumerate(
        zip(robot.end_effectors, robot.tool_joints, frames, strict=True)
    ):
        if tool_frame is not None:
            tool_components = [
                components[component_count * index : component_count * (index + 1)] for components in wrench
            ]
            loads.append(_tool_load(robot, tool, carrier, tool_frame, tool_components))
    return loads


def _tool_load(
    robot: Robot, tool: Tool, carrier: int, frame: str, wrench: Iterable[Sequence[Scalar]]
) -> ToolLoad:
    in_base = frame == "base"
    rotation = rotation_matrix(robot.base).transposed() if in_base else rotation_matrix(tool)
    reactions = [(ZERO - Vector(*components[:3]), ZERO - Vector(*components[3:])) for components in wrench]
    return ToolLoad(
        joint=carrier,
        force=[rotation.times(force) for force, _ in reactions],
        moment=[rotation.times(moment) for _, moment in reactions],
        point=_exact_position(tool),
        in_base=in_base,
    )


def _exact_position(pose: Pose) -> Vector:
    return Vector(*map(exact, pose.xyz))


@dataclass(frozen=True)
class LinkTorques(RobotKernel):
    """Kernel of the recursion over rows of samples, for an engine.

    Inputs are q, dq, ddq, d3q, d4q of the joints, the damping and its two derivatives if there are dampers
    between the links, then the wrench and its two derivatives if there is one. Outputs are tau_e, dtau_e,
    ddtau_e of the joints.

    Attributes:
        robot: Robot.
        frame: Frame of the wrench; None without a wrench.
    """

    robot: Robot
    frame: WrenchFrame | None = None

    def of_robot(self, robot: Robot) -> Self:
        """See `RobotKernel.of_robot`."""
        return replace(self, robot=robot)

    @cached_property
    def arguments(self) -> RowLayout:
        """Layout of the input rows."""
        joint_inputs = (*POSITION.names, *(DAMPING.names if link_damped(self.robot) else ()))
        shapes = dict.fromkeys(joint_inputs, (len(self.robot.joints),))
        if self.frame is not None:
            shapes |= dict.fromkeys(WRENCH_NAMES, (wrench_components(self.frame),))
        return RowLayout(shapes)

    @cached_property
    def results(self) -> RowLayout:
        """Layout of the output rows."""
        return RowLayout(dict.fromkeys(TORQUES, (len(self.robot.joints),)))

    def __call__(self, rows: Sequence[Scalar]) -> list[Scalar]:
        """Run (36)-(60)."""
        torques = recursion(self.recursion_inputs(rows))  # (36)-(60)
        return self.results.pack(dict(zip(TORQUES, zip(*torques, strict=True), strict=True)))

    def recursion_inputs(self, rows: Sequence[Scalar]) -> RecursionInputs:
        """Return the inputs of the recursion from rows in the layout of `arguments`."""
        inputs, joints = self.arguments.unpack(rows), self.robot.joints
        zeros = [0] * len(joints)
        damper_dampings = zip(*(inputs.get(name, zeros) for name in DAMPING.names), strict=True)
        states = [
            call(q, _keyed_joint_state(joint), q, (dq, ddq, d3q, d4q), damper_damping)
            for joint, damper_damping, q, dq, ddq, d3q, d4q in zip(
                joints, damper_dampings, *(inputs[name] for name in POSITION.names), strict=True
            )
        ]
        wrench = [inputs[name] for name in WRENCH_NAMES if name in inputs]
        loads = () if self.frame is None else tool_loads(self.robot, self.frame, wrench)
        return RecursionInputs(self._links, states, self._carriers, self._gravity, loads)

    @cached_property
    def _links(self) -> list[LinkConstants]:
        return list(map(link_constants, self.robot.joints))

    @cached_property
    def _carriers(self) -> list[Carrier]:
        return carriers(self.robot)

    @cached_property
    def _gravity(self) -> Vector:
        return base_gravity(self.robot)


class ElasticTorques(NamedTuple):
    """Torques that the motion of the links requires of the joints, each ([samples,] joints), N m (N) per s^k.

    Attributes:
        tau_e: Total elastic torque (58).
        dtau_e: First derivative of tau_e (59); None if d3q was not given.
        ddtau_e: Second derivative of tau_e (60); None if d4q was not given.
    """

    tau_e: FloatArray
    dtau_e: FloatArray | None
    ddtau_e: FloatArray | None


def link_torques(
    robot: Robot,
    q: ArrayLike,
    dq: ArrayLike | None = None,
    ddq: ArrayLike | None = None,
    d3q: ArrayLike | None = None,
    d4q: ArrayLike | None = None,
    wrench: Wrench | None = None,
    *,
    damping: ArrayLike | None = None,
    ddamping: ArrayLike | None = None,
    dddamping: ArrayLike | None = None,
    engine: str | Engine = "numpy",
) -> ElasticTorques:
    """Compute the torques that the links require of the joints, with two derivatives, (36)-(60).

    With q alone the robot holds still. Otherwise missing derivatives of q are not replaced by zeros: tau_e
    requires dq and ddq, dtau_e also d3q, ddtau_e also d4q.

    Args:
        robot: Robot.
        q: Joint positions, ([samples,] joints), rad (m).
        dq: First derivative of q.
        ddq: Second derivative of q.
        d3q: Third derivative of q.
        d4q: Fourth derivative of q.
        wrench: Wrench of the environment on the tools, see `Wrench`; zero if None.
        damping: Damping of the dampers between the links, of the shape of q; their minimum if None.
        ddamping: First derivative of the damping; zero if None.
        dddamping: Second derivative of the damping; zero if None.
        engine: Backend: one of `vsacli.compute.engine.NAMES`, or an engine chosen before.

    Returns:
        tau_e, dtau_e, ddtau_e, each of the shape of q; None for derivatives whose input is missing.

    Raises:
        InputError: The shape of an array does not fit the robot, or `q` and the wrench; a derivative of q is
            missing; the engine is unknown, or there is no C compiler for it.
        TypeError: Robot or wrench is of another type.
    """
    check_robot(robot)
    if wrench is not None:
        check_wrench(wrench, robot.tool_names)
    motion_arrays = _check_motion_arrays(robot, (q, dq, ddq, d3q, d4q))
    shape = motion_arrays[0].shape
    motion = list(map(_rows_over_samples, motion_arrays))
    while len(motion) < len(POSITION.names):
        motion.append(np.zeros_like(motion[0]))

    kernel = _recursion_kernel(robot, None if wrench is None else wrench.frame)
    damped = DAMPING.key in kernel.arguments.shapes
    dampings = _damping_rows(robot, shape, (damping, ddamping, dddamping)) if damped else ()
    inputs = (*motion, *dampings, *_wrench_rows(wrench, shape[:-1]))
    backend = engine_of_call(engine, kernel, motion[0].shape[1])
    rows: Any = np.concatenate(inputs) if backend is NUMBERS else [row for array in inputs for row in array]
    torques = backend.run(kernel, rows).reshape(len(TORQUES), *motion[0].shape)
    tau_e, dtau_e, ddtau_e = torques.transpose(0, 2, 1).reshape(len(TORQUES), *shape)
    return ElasticTorques(
        tau_e, dtau_e if len(motion_arrays) > 3 else None, ddtau_e if len(motion_arrays) > 4 else None
    )


@lru_cache(KEPT_PROGRAMS)
def _recursion_kernel(robot: Robot, frame: WrenchFrame | None) -> LinkTorques:
    """Return a kernel; without this cache, `link_torques` of a 7R takes 1.3 times as long."""
    return LinkTorques(robot, frame)


def _check_motion_arrays(robot: Robot, motion: Iterable[ArrayLike | None]) -> list[FloatArray]:
    """Return the given arrays of q, dq, ..., checked: of one shape, none missing before the last."""
    joint_count, by_name = len(robot.joints), zip(POSITION.names, motion, strict=True)
    arrays = {name: checked_shape(name, array, joint_count) for name, array in by_name if array is not None}
    missing = [name for name in POSITION.names[: max(len(arrays), 3)] if name not in arrays]
    if missing and list(arrays) != ["q"]:
        raise InputError.one(
            f"{list(arrays)[-1]} is given without {' and '.join(missing)}; give q alone if the robot holds "
            "still, else q, dq and ddq, then d3q for dtau_e, then d4q for ddtau_e"
        )
    if len({array.shape for array in arrays.values()}) > 1:
        shapes = ", ".join(str(array.shape) for array in arrays.values())
        raise InputError.one(f"{', '.join(arrays)} must have one shape, not {shapes}")
    return list(arrays.values())


def _rows_over_samples(array: FloatArray) -> FloatArray:
    """Return the rows of an array of one sample, (n,), or over time, (samples, n)."""
    return array[:, None] if array.ndim == 1 else by_joint(array)


def _damping_rows(
    robot: Robot, shape: tuple[int, ...], dampings: Sequence[ArrayLike | None]
) -> Iterator[FloatArray]:
    """Yield the damping and its derivatives of a robot with dampers between the links."""
    minima = np.array([joint.damper.range[0] if joint.damper else 0.0 for joint in robot.joints])
    for name, array, default in zip(DAMPING.names, dampings, (minima, 0 * minima, 0 * minima), strict=True):
        values = np.broadcast_to(default, shape) if array is None else np.asarray(array, dtype=np.float64)
        if values.shape != shape:
            raise InputError.one(f"{name} must have the shape {shape} of q, not {values.shape}")
        yield _rows_over_samples(values)


def _wrench_rows(wrench: Wrench | None, sample_shape: tuple[int, ...]) -> Iterator[FloatArray]:
    """Yield the components, and each of their derivatives; `sample_shape` is that before the last axis."""
    if wrench is None:
        return
    for name in WRENCH_NAMES:
        array, expected = getattr(wrench, name), (*sample_shape, wrench_components(wrench.frame))
        if (shape := np.shape(array)) != expected:
            raise InputError.one(f"{name} must have the shape {expected}, not {shape}")
        yield _rows_over_samples(np.asarray(array, dtype=np.float64))


def _keyed_joint_state(joint: Joint) -> Keyed:
    return Keyed((joint.type, joint.dh, joint.friction, joint.damper), partial(joint_state, joint))


def joint_state(
    joint: Joint,
    q: Scalar,
    rates: tuple[Scalar, Scalar, Scalar, Scalar],
    damper_damping: tuple[Scalar, Scalar, Scalar] = (0, 0, 0),
) -> JointState:
    """Return the pose and motion of a joint for the recursion.

    Args:
        joint: Joint.
        q: Position of the joint.
        rates: First to fourth derivative of q.
        damper_damping: Damping of a damper between the links, with two derivatives; ignored otherwise.
    """
    dh = joint.dh
    resistance = link_resistance(joint, rates, damper_damping)
    if joint.is_revolute:
        angle = q + dh.theta
        return JointState(np.cos(angle), np.sin(angle), exact(dh.d), rates, resistance)
    cos, sin = (trigonometric(name, dh.theta) for name in ("cos", "sin"))
    return JointState(cos, sin, q + dh.d, rates, resistance)


def link_resistance(
    joint: Joint, rates: Sequence[Scalar], damper_damping: Sequence[Scalar]
) -> TorqueDerivatives:
    """Return the torque of dry friction and of a damper between the links; arguments as for `joint_state`."""
    friction = joint_friction(joint.friction, rates)
    if not joint.damper_at("link"):
        return friction
    return TorqueDerivatives(*map(add, damper_torque(damper_damping, rates[:3]), friction))


def link_damped(robot: Robot) -> bool:
    """Return whether a joint has a damper between its links."""
    return any(joint.damper_at("link") for joint in robot.joints)
