"""Compliance of tools while the motors are held, C = J (K + dg/dq)^-1 J^T, in closed form over samples.

K is the diagonal of the joint stiffness, g(q) the torque that holds the links at rest against gravity and the
wrenches on the tools. dg/dq is the geometric stiffness: constant forces and moments in the base frame, whose
levers and axes move with the links.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray, checked_shape
from vsacli.base.errors import InputError
from vsacli.base.wrench import WRENCH_AXES, Wrench, check_wrench, frames_by_tool, wrench_components
from vsacli.robot.kinematics import RobotFrames, frames_in_base, jacobian_in_base
from vsacli.robot.model import Robot, check_robot

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

SMALLEST_EIGENVALUE = 1e-12
"""Smallest eigenvalue of the symmetric part of K + dg/dq, scaled to a diagonal of ones, of a stable pose;
smaller ones are rounding of zero."""


def tip_compliance(
    robot: Robot,
    q: ArrayLike,
    stiffness: ArrayLike,
    tool: str | None = None,
    wrenches: Wrench | None = None,
) -> FloatArray:
    """Return the displacement of a tool per wrench on it, with the motors held: C = J (K + dg/dq)^-1 J^T.

    K is the joint stiffness, J the Jacobian of the joints with springs, g(q) the gravity torque less J^T w of
    all wrenches, whose components are kept in base axes while the tool yields. Without gravity and wrenches
    C is J K^-1 J^T. With moments it is not symmetric: a moment with fixed axes has no potential (Chen & Kao
    2000, Conservative congruence transformation for joint and Cartesian stiffness matrices).

    Args:
        robot: Robot.
        q: Joint positions at rest, ([samples,] joints), rad (m).
        stiffness: Joint stiffness, of the shape of q, N m/rad (N/m); ignored at joints without springs.
        tool: Name of the tool, if the robot has several.
        wrenches: Wrench of the environment on the tools that loads the pose, see `Wrench`; none if None.

    Returns:
        C, ([samples,] 6, 6), in base axes: translation of the tool frame's origin and rotation, m and rad,
        per fx fy fz mx my mz, N and N m. NaN where a value is, and where the pose is statically unstable:
        the symmetric part of K + dg/dq is not positive definite, and the links buckle.

    Raises:
        InputError: The shape of an array does not fit the robot, or q; or there is no such tool.
        TypeError: Robot or wrench is of another type.
    """
    check_robot(robot)
    tool_index = robot.end_effector(tool)
    positions = checked_shape("q", q, len(robot.joints))
    joint_stiffness = checked_shape("stiffness", stiffness, len(robot.joints))
    _check_same_shape("stiffness", joint_stiffness, positions.shape)
    if wrenches is not None:
        check_wrench(wrenches, robot.tool_names)
        components = wrench_components(wrenches.frame)
        _check_same_shape("the wrench", wrenches.wrench, (*positions.shape[:-1], components))
    pose = HeldPose(robot, np.atleast_2d(positions), np.atleast_2d(joint_stiffness), wrenches)
    compliance, _ = pose.compliance(tool_index)
    return compliance.reshape(*positions.shape[:-1], len(WRENCH_AXES), len(WRENCH_AXES))


def _check_same_shape(name: str, array: FloatArray, shape: tuple[int, ...]) -> None:
    if np.shape(array) != shape:
        raise InputError.one(f"{name} must have the shape {shape}, not {np.shape(array)}")


def softest_direction(compliance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the smallest translational stiffness of a tool, and its direction.

    It is 1 over the largest eigenvalue of the symmetric translational block: a force F along the direction
    moves the tool by F over this stiffness along the direction, and less along any other.

    Args:
        compliance: C of `tip_compliance`, (..., 6, 6).

    Returns:
        Stiffness, (...), N/m, and unit vectors in base axes, (..., 3), with the largest component positive;
        both NaN where C is. Where the tool does not yield, the stiffness is infinite, the direction NaN.
    """
    translational = compliance[..., :3, :3]
    is_finite: BoolArray = np.isfinite(np.sum(translational, axis=(-2, -1)))
    symmetric: FloatArray = (
        np.where(is_finite[..., None, None], translational + np.swapaxes(translational, -1, -2), 0.0) / 2
    )
    values, vectors = np.linalg.eigh(symmetric)
    largest, direction = values[..., -1], vectors[..., -1]
    is_yielding = is_finite & (largest > 0)
    stiffness = np.divide(1.0, largest, out=np.where(is_finite, np.inf, np.nan), where=is_yielding)
    largest_component = np.take_along_axis(direction, np.abs(direction).argmax(axis=-1)[..., None], axis=-1)
    return stiffness, np.where(is_yielding[..., None], direction * np.sign(largest_component), np.nan)


class HeldPose:
    """Poses of a robot at rest with its motors held; each tool is computed when asked for.

    Args:
        robot: Robot.
        q: Joint positions, (samples, joints).
        stiffness: Joint stiffness, (samples, joints); ignored at joints without springs.
        wrench: Wrench of the environment on the tools; None without one.
    """

    def __init__(self, robot: Robot, q: FloatArray, stiffness: FloatArray, wrench: Wrench | None) -> None:
        self._robot = robot
        with np.errstate(invalid="ignore", over="ignore"):  # of positions that are not finite
            self._frames = frames_in_base(robot, q)
            self._matrix = holding_torque_slope(robot, self._frames, wrench)
        joints = np.arange(len(robot.joints))
        self._matrix[:, joints, joints] += stiffness

    def compliance(self, tool: int) -> tuple[FloatArray, BoolArray]:
        """Return C of a tool by index, (samples, 6, 6), and where it is statically unstable, (samples,).

        C is NaN there, and where a value is.
        """
        coupled = coupled_joints(self._robot, tool)
        matrix = self._matrix[:, coupled][:, :, coupled]
        columns = jacobian_in_base(self._robot, self._frames, tool)[..., coupled]
        smallest = smallest_eigenvalues(matrix)
        is_stable = smallest > SMALLEST_EIGENVALUE
        matrix[~is_stable] = np.eye(len(coupled))
        compliance: FloatArray = columns @ np.linalg.solve(matrix, np.swapaxes(columns, -1, -2))
        compliance[~is_stable | ~np.isfinite(columns).all(axis=(-2, -1))] = np.nan
        return compliance, smallest <= SMALLEST_EIGENVALUE


def coupled_joints(robot: Robot, tool: int) -> list[int]:
    """Return the joints with springs whose deflections depend on those of a tool by index.

    They are all joints on the link of the first such joint before the tool: loads on the links beyond
    a joint change with it. Other branches do not count, so that a branch has what it has alone.
    """
    sprung = [joint.actuator.sprung for joint in robot.joints]
    first_sprung = [joint for joint in robot.paths[robot.tool_joints[tool]] if sprung[joint]][:1]
    return [joint for joint, path in enumerate(robot.paths) if sprung[joint] and {*first_sprung} & {*path}]


def smallest_eigenvalues(matrices: FloatArray) -> FloatArray:
    """Return the smallest eigenvalue of the symmetric part of each matrix, scaled to a diagonal of ones.

    Args:
        matrices: (samples, n, n). Scaled, entries of prismatic and revolute joints have one unit.

    Returns:
        Eigenvalues, (samples,): inf without joints, NaN where an entry is; the smallest entry of the diagonal
        itself if that is not positive.
    """
    if not matrices.shape[-1]:
        return np.full(len(matrices), np.inf)
    diagonal = np.diagonal(matrices, axis1=-2, axis2=-1)
    is_regular = np.isfinite(matrices).all(axis=(-2, -1)) & (diagonal > 0).all(axis=-1)
    smallest: FloatArray = np.where(np.isfinite(matrices).all(axis=(-2, -1)), diagonal.min(axis=-1), np.nan)
    scale = 1 / np.sqrt(diagonal[is_regular])
    scaled = scale[:, :, None] * matrices[is_regular] * scale[:, None]
    smallest[is_regular] = np.linalg.eigvalsh((scaled + np.swapaxes(scaled, -1, -2)) / 2)[:, 0]
    return smallest


class _ConstantLoad(NamedTuple):
    """Constant forces and moments on a link and all that it carries, in base axes.

    Attributes:
        force: Sum of the forces, (samples, 3).
        virial: Sum of lever times force, (samples, 3, 3); levers from the origin of the joint's seat.
        moment: Sum of the moments, without those of the forces, (samples, 3).
    """

    force: FloatArray
    virial: FloatArray
    moment: FloatArray


def holding_torque_slope(robot: Robot, frames: RobotFrames, wrench: Wrench | None) -> FloatArray:
    """Return dg/dq, (samples, joints, joints), of the torque that holds the links at rest.

    With the axis z of a joint, levers r from it, and forces f and moments m on all that it carries, dg/dq of
    a joint j and of i, which carries it, is z_i^T (tr(V) - V) z_j with V = sum r f^T if both are revolute,
    -sum f . (z_i x z_j) if only j is prismatic, and 0 if i is. dg_j/dq_i has -m . (z_i x z_j) in addition.

    Args:
        robot: Robot.
        frames: Its frames in the base frame.
        wrench: Wrench of the environment on the tools; None without one.
    """
    loads, joints = _constant_loads(robot, frames, wrench), robot.joints
    slope = np.zeros((*loads[0].force.shape[:1], len(joints), len(joints)))
    axes = [seat.axes[..., 2] for seat in frames.seats]
    for inner, path in enumerate(robot.paths):
        (force, virial, moment), axis = loads[inner], axes[inner]
        for outer in (joint for joint in path if joints[joint].is_revolute):
            normal = np.cross(axes[outer], axis)
            if joints[inner].is_revolute:
                trace = np.trace(virial, axis1=-2, axis2=-1)
                common_slope = np.einsum(
                    "si,sij,sj->s", axes[outer], trace[:, None, None] * np.eye(3) - virial, axis
                )
                moment_slope = np.einsum("si,si->s", moment, normal)
            else:
                common_slope, moment_slope = -np.einsum("si,si->s", force, normal), 0.0
            slope[:, outer, inner] = common_slope
            slope[:, inner, outer] = common_slope - moment_slope
    return slope


def _constant_loads(robot: Robot, frames: RobotFrames, wrench: Wrench | None) -> Sequence[_ConstantLoad]:
    """Return the loads that each joint carries: gravity and the wrenches on the tools."""
    gravity = np.array(robot.gravity)
    loads: list[_ConstantLoad] = []
    for joint, link, seat in zip(robot.joints, frames.links, frames.seats, strict=True):
        weight = np.broadcast_to(joint.link.mass * gravity, link.origin.shape)
        lever = link.point(joint.link.com) - seat.origin
        loads.append(_ConstantLoad(weight, _dyad(lever, weight), np.zeros_like(weight)))
    for carrier, tool, force, moment in _tool_wrenches(robot, frames, wrench):
        lever = frames.tools[tool].origin - frames.seats[carrier].origin
        loads[carrier] = _sum_of_loads(loads[carrier], _ConstantLoad(force, _dyad(lever, force), moment))
    for joint_index in reversed(range(len(loads))):
        parent, load = robot.parents[joint_index], loads[joint_index]
        if parent >= 0:
            lever = frames.seats[joint_index].origin - frames.seats[parent].origin
            shifted_load = load._replace(virial=load.virial + _dyad(lever, load.force))
            loads[parent] = _sum_of_loads(loads[parent], shifted_load)
    return loads


def _tool_wrenches(
    robot: Robot, frames: RobotFrames, wrench: Wrench | None
) -> Sequence[tuple[int, int, FloatArray, FloatArray]]:
    """Return joint, tool, force and moment in base axes for each tool on which a wrench acts."""
    if wrench is None:
        return []
    components = np.asarray(wrench.wrench, dtype=np.float64).reshape(-1, len(robot.tool_names), 2, 3)
    wrenches = []
    for tool, (carrier, frame) in enumerate(
        zip(robot.tool_joints, frames_by_tool(wrench.frame), strict=True)
    ):
        if frame is not None:
            axes = np.eye(3) if frame == "base" else frames.tools[tool].axes
            in_base = (axes[..., None, :, :] @ components[:, tool, :, :, None])[..., 0]
            force, moment = np.broadcast_to(in_base, (len(frames.base.origin), 2, 3)).swapaxes(0, 1)
            wrenches.append((carrier, tool, force, moment))
    return wrenches


def _dyad(lever: FloatArray, force: FloatArray) -> FloatArray:
    return lever[:, :, None] * force[:, None]


def _sum_of_loads(first: _ConstantLoad, second: _ConstantLoad) -> _ConstantLoad:
    return _ConstantLoad(
        *(first_part + second_part for first_part, second_part in zip(first, second, strict=True))
    )
