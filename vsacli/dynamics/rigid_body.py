"""The dynamics of the chain of links without drives: M(q), n(q, q'), and the terms of (35) and (60).

Each is a program traced from the recursion (36)-(60), so that a single sample takes microseconds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, lru_cache, reduce
from typing import Any

import numpy as np

from vsacli.actuators.motor import Motor
from vsacli.actuators.rigid import Rigid
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.wrench import WRENCH_AXES, WRENCH_NAMES, Wrench
from vsacli.compute.tracing import Symbol, Tape, TracedArray
from vsacli.compute.tracing.python_functions import StateFunction
from vsacli.compute.vector import ZERO, Scalar, Vector
from vsacli.dynamics.chain import TipLoad, TorqueDerivatives
from vsacli.dynamics.elastic_torques import joint_state, link_constants, tip_load
from vsacli.dynamics.recursion import recursion
from vsacli.robot.joint import Limits
from vsacli.robot.kinematics import base_gravity
from vsacli.robot.model import Robot

SMALLEST_PIVOT = 1e-12
"""Smallest pivot of M, relative to the diagonal entry; a smaller one is rounding of a missing mass."""


class LinkDynamics:
    """Programs of a chain of joints, each traced at first use; use `link_dynamics` to obtain one.

    Arrays are (joints,) or (samples, joints) throughout. A wrench must be given if and only if the chain was
    made for one.
    """

    def __init__(self, robot: Robot, frame: str | None) -> None:
        self._names = robot.joint_names
        self._lower = np.tril_indices(len(robot.joints))
        self._robot, self._frame = robot, frame

    @cached_property
    def _inertia(self) -> StateFunction:
        return _inertia_program(self._robot)

    @cached_property
    def _bias(self) -> StateFunction:
        return _torque_program(self._robot, self._frame, "tau", orders=1)

    @cached_property
    def _rate(self) -> StateFunction:
        return _torque_program(self._robot, self._frame, "dtau", orders=2)

    @cached_property
    def _acceleration(self) -> StateFunction:
        return _torque_program(self._robot, self._frame, "ddtau", orders=4)

    def mass_matrix(self, q: FloatArray) -> FloatArray:
        """Return M(q), ([samples,] joints, joints): column k is the recursion's torque at q'' = e_k alone."""
        row, column = self._lower
        entries = self._inertia(q)
        matrix = np.empty_like(q, shape=(*q.shape, q.shape[-1]))
        matrix[..., row, column] = matrix[..., column, row] = entries
        return matrix

    def bias(self, q: FloatArray, dq: FloatArray, wrench: Wrench | None) -> FloatArray:
        """Return n(q, q') of (34): gravity, centrifugal and Coriolis torques, damping, wrench; N m (N)."""
        return self._bias(q, dq, *_wrench_derivatives(wrench, 0))

    def torque_rate(
        self, q: FloatArray, dq: FloatArray, ddq: FloatArray, wrench: Wrench | None
    ) -> FloatArray:
        """Return M' q'' + n' of (35): the recursion's tau_e' at q''' = 0."""
        return self._rate(q, dq, ddq, *_wrench_derivatives(wrench, 1))

    def torque_acceleration(
        self,
        q: FloatArray,
        dq: FloatArray,
        ddq: FloatArray,
        d3q: FloatArray,
        d4q: FloatArray,
        wrench: Wrench | None,
    ) -> FloatArray:
        """Return tau_e'' (60)."""
        return self._acceleration(q, dq, ddq, d3q, d4q, *_wrench_derivatives(wrench, 2))

    def solve(self, matrix: FloatArray, torque: FloatArray) -> FloatArray:
        """Return matrix^-1 torque, for M(q) or its extension by rigid drives.

        Args:
            matrix: ([samples,] joints, joints), symmetric.
            torque: ([samples,] joints).

        Raises:
            InputError: The matrix is not positive definite; names the first joint whose leading minor fails.
                A traced program gives NaN instead.
        """
        if isinstance(matrix, TracedArray):
            return _solve_positive_definite(matrix, torque, SMALLEST_PIVOT)
        self._check_positive_definite(matrix)
        return np.asarray(np.linalg.solve(matrix, torque[..., None])[..., 0], dtype=np.float64)

    def _check_positive_definite(self, matrices: FloatArray) -> None:
        try:
            pivots = np.diagonal(np.linalg.cholesky(matrices), axis1=-2, axis2=-1) ** 2
        except np.linalg.LinAlgError:
            raise self._indefinite(matrices) from None
        if (pivots <= SMALLEST_PIVOT * np.diagonal(matrices, axis1=-2, axis2=-1)).any():
            raise self._indefinite(matrices)

    def _indefinite(self, matrices: FloatArray) -> InputError:
        joint = next(
            index
            for index in range(len(self._names))
            if not _last_pivot(matrices[..., : index + 1, : index + 1]) > SMALLEST_PIVOT
        )
        return InputError.one(
            f"joint {self._names[joint]}: the inertia it moves is not positive (leading minor {joint + 1} of "
            "the mass matrix), so a torque gives no acceleration; give this link, or one beyond it, mass"
        )


def _wrench_derivatives(wrench: Wrench | None, order: int) -> list[FloatArray]:
    """Return the wrench and its derivatives up to an order."""
    return [] if wrench is None else [getattr(wrench, name) for name in WRENCH_NAMES[: order + 1]]


def _solve_positive_definite(matrix: Any, right: Any, smallest_pivot: float) -> Any:
    """Return matrix^-1 right, by L D L^T without pivoting; NaN where the matrix is not positive definite.

    Args:
        matrix: (n, n), symmetric.
        right: (n,).
        smallest_pivot: Relative to the diagonal entry, below which a pivot of D counts as not positive.
    """
    size = len(right)
    lower: dict[tuple[int, int], Any] = {}
    pivots: list[Any] = []
    for column in range(size):
        scaled = {inner: lower[column, inner] * pivots[inner] for inner in range(column)}
        pivot = _subtracted(
            matrix[column, column], [lower[column, inner] * scaled[inner] for inner in range(column)]
        )
        regular = pivot > smallest_pivot * matrix[column, column]
        pivots.append(np.where(regular, pivot, math.nan))
        for row in range(column + 1, size):
            products = [lower[row, inner] * scaled[inner] for inner in range(column)]
            lower[row, column] = _subtracted(matrix[row, column], products) / pivots[column]

    forward: list[Any] = []
    for row in range(size):
        forward.append(_subtracted(right[row], [lower[row, inner] * forward[inner] for inner in range(row)]))
    solution: dict[int, Any] = {}
    for row in reversed(range(size)):
        terms = [lower[below, row] * solution[below] for below in range(row + 1, size)]
        solution[row] = _subtracted(forward[row] / pivots[row], terms)
    return np.stack([solution[row] for row in range(size)])


def _subtracted(value: Any, terms: list[Any]) -> Any:
    return reduce(lambda rest, term: rest - term, terms, value)


def _last_pivot(matrices: FloatArray) -> float:
    """Return the smallest last pivot, relative to the last entry, of matrices with other pivots positive."""
    factors = np.linalg.solve(matrices[..., :-1, :-1], matrices[..., :-1, -1:])
    pivots = matrices[..., -1, -1] - (matrices[..., -1:, :-1] @ factors)[..., 0, 0]
    entries = matrices[..., -1, -1]
    return float(np.min(np.divide(pivots, entries, out=np.zeros_like(pivots), where=entries > 0)))


@lru_cache(maxsize=16)
def link_dynamics(robot: Robot, frame: str | None = None) -> LinkDynamics:
    """Return the programs of a robot's links and joints; equal chains share them.

    Args:
        robot: Robot; its actuators and dampers are ignored.
        frame: Frame of the wrench at the end effector, as in `Wrench`; None without a wrench.
    """
    return _shared_link_dynamics(without_drives(robot), frame)


def without_drives(robot: Robot) -> Robot:
    """Return the robot with a common placeholder for its drives, so that equal chains compare equal."""
    nothing: dict[str, Any] = {"actuator": _ANY_DRIVE, "damper": None, "limits": Limits()}
    joints = tuple(replace(joint, **nothing) for joint in robot.joints)
    return Robot(name="chain", gravity=robot.gravity, base=robot.base, tool=robot.tool, joints=joints)


_ANY_DRIVE: Any = Rigid(motor=Motor(inertia=1.0))


@lru_cache(maxsize=16)
def _shared_link_dynamics(robot: Robot, frame: str | None) -> LinkDynamics:
    return LinkDynamics(robot, frame)


def _inertia_program(robot: Robot) -> StateFunction:
    """Return the program of the lower triangle of M, row by row; friction offsets are left out."""
    robot = replace(robot, joints=tuple(replace(joint, friction=None) for joint in robot.joints))
    tape = Tape()
    q = tape.inputs(len(robot.joints))
    numbers = range(len(robot.joints))
    columns = [
        _recursion_torques(robot, q, [(0, int(joint == moving), 0, 0) for joint in numbers], ZERO, None)
        for moving in numbers
    ]
    lower = [columns[column][row].tau for row in numbers for column in range(row + 1)]
    return StateFunction(tape.program(lower))


def _torque_program(robot: Robot, frame: str | None, output: str, orders: int) -> StateFunction:
    """Return an output of the recursion; derivatives of q beyond `orders` are zero."""
    tape = Tape()
    joints = len(robot.joints)
    q = tape.inputs(joints)
    rates = [tape.inputs(joints) if order < orders else [0] * joints for order in range(4)]
    tip = (
        None
        if frame is None
        else _tip_load_inputs(tape, robot, frame, ("tau", "dtau", "ddtau").index(output))
    )
    torques = _recursion_torques(robot, q, list(zip(*rates, strict=True)), base_gravity(robot), tip)
    return StateFunction(tape.program([getattr(torque, output) for torque in torques]))


def _tip_load_inputs(tape: Tape, robot: Robot, frame: str, order: int) -> TipLoad:
    """Return the wrench and its derivatives up to an order as inputs, the others zero."""
    axes = len(WRENCH_AXES)
    wrench = [tape.inputs(axes) if derivative <= order else [0] * axes for derivative in range(3)]
    return tip_load(robot, frame, wrench)


def _recursion_torques(
    robot: Robot,
    q: Sequence[Symbol],
    rates: Sequence[tuple[Scalar, ...]],
    gravity: Vector,
    tip: TipLoad | None,
) -> list[TorqueDerivatives]:
    states = [
        joint_state(joint, position, (d1, d2, d3, d4))
        for joint, position, (d1, d2, d3, d4) in zip(robot.joints, q, rates, strict=True)
    ]
    return recursion([link_constants(joint) for joint in robot.joints], states, gravity, tip)
