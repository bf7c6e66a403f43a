"""The dynamics of the links without drives: M(q), n(q, q'), and the terms of (35) and (60).

Each is a program traced from the recursion (36)-(60), so that a single sample takes microseconds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache, partial, reduce
from itertools import islice
from typing import Any, TypeAlias

import numpy as np

from vsacli.actuators.motor import Motor
from vsacli.actuators.rigid import Rigid
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError, Problem
from vsacli.base.wrench import WRENCH_NAMES, Wrench, WrenchFrame, wrench_components
from vsacli.compute.tracing import Symbol, Tape, TracedArray
from vsacli.compute.tracing.python_functions import StateFunction
from vsacli.compute.vector import ZERO, Scalar, Vector
from vsacli.documents.record_checks import replaced_unchecked
from vsacli.dynamics.elastic_torques import carriers, joint_state, link_constants, tool_loads
from vsacli.dynamics.recursion import recursion
from vsacli.dynamics.recursion_inputs import RecursionInputs, ToolLoad, TorqueDerivatives
from vsacli.robot.joint import Limits
from vsacli.robot.kinematics import base_gravity
from vsacli.robot.model import Robot

SMALLEST_PIVOT = 1e-12
"""Smallest pivot of M, relative to the diagonal entry; a smaller one is rounding of a missing mass."""


LinkFunction: TypeAlias = Callable[..., FloatArray]
"""Function of arrays (joints,) or (samples, joints), and of components of a wrench."""

_Inputs: TypeAlias = Callable[[int], list[Any]]
"""Function that returns the next inputs of the recursion, scalars of any kind."""

_Torques: TypeAlias = Callable[[_Inputs], list[Scalar]]


class LinkDynamics:
    """Programs of the links of a robot, each traced at first use; use `link_dynamics` to obtain one.

    Arrays are (joints,) or (samples, joints) throughout. A wrench must be given if and only if the programs
    were made for one.
    """

    def __init__(self, robot: Robot, frame: WrenchFrame | None) -> None:
        self._names = robot.joint_names
        self._lower_indices = np.tril_indices(len(robot.joints))
        self._robot, self._frame = robot, frame

    @cached_property
    def _inertia_function(self) -> LinkFunction:
        return self._trace_function(partial(_lower_triangle, self._robot))

    @cached_property
    def _bias_function(self) -> LinkFunction:
        return self._trace_function(partial(_traced_torques, self._robot, self._frame, "tau", 1))

    @cached_property
    def _torque_rate_function(self) -> LinkFunction:
        return self._trace_function(partial(_traced_torques, self._robot, self._frame, "dtau", 2))

    @cached_property
    def _torque_acceleration_function(self) -> LinkFunction:
        return self._trace_function(partial(_traced_torques, self._robot, self._frame, "ddtau", 4))

    @staticmethod
    def _trace_function(torques: _Torques) -> LinkFunction:
        """Return a function of arrays that computes torques of the recursion."""
        tape = Tape()
        return StateFunction(tape.program(torques(tape.inputs)))

    def mass_matrix(self, q: FloatArray) -> FloatArray:
        """Return M(q), ([samples,] joints, joints): column k is the recursion's torque at q'' = e_k alone."""
        row, column = self._lower_indices
        entries = self._inertia_function(q)
        matrix = np.empty_like(q, shape=(*q.shape, q.shape[-1]))
        matrix[..., row, column] = matrix[..., column, row] = entries
        return matrix

    def bias(self, q: FloatArray, dq: FloatArray, wrench: Wrench | None) -> FloatArray:
        """Return n(q, q') of (34): gravity, centrifugal and Coriolis torques, damping, wrench; N m (N)."""
        return self._bias_function(q, dq, *_wrench_derivatives(wrench, 0))

    def torque_rate(
        self, q: FloatArray, dq: FloatArray, ddq: FloatArray, wrench: Wrench | None
    ) -> FloatArray:
        """Return M' q'' + n' of (35): the recursion's tau_e' at q''' = 0."""
        return self._torque_rate_function(q, dq, ddq, *_wrench_derivatives(wrench, 1))

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
        return self._torque_acceleration_function(q, dq, ddq, d3q, d4q, *_wrench_derivatives(wrench, 2))

    def solve(self, matrix: FloatArray, torque: FloatArray) -> FloatArray:
        """Return matrix^-1 torque, for M(q) or its extension by rigid drives.

        Args:
            matrix: ([samples,] joints, joints), symmetric.
            torque: ([samples,] joints).

        Raises:
            InputError: The matrix is not positive definite; names the first joint of each subtree on the base
                whose pivot fails. A traced program gives NaN instead.
        """
        if isinstance(matrix, TracedArray):
            return _solve_positive_definite(
                matrix,
                torque,
                SMALLEST_PIVOT,
                self._elimination_order,
                lambda row, column: row in self._coupled_joints[column],
            )
        self._check_positive_definite(matrix)
        return np.asarray(np.linalg.solve(matrix, torque[..., None])[..., 0], dtype=np.float64)

    @cached_property
    def _elimination_order(self) -> tuple[int, ...]:
        """Order in which M is factored: chains on the base from it, branched subtrees from their tips.

        Then nothing fills in, and the pivot of a joint depends only on the joints that it carries.
        """
        return tuple(
            joint
            for subtree in self._robot.subtrees
            for joint in (subtree if self._is_chain(subtree) else subtree[::-1])
        )

    def _is_chain(self, subtree: Sequence[int]) -> bool:
        return len(set(subtree) & set(self._robot.tips)) == 1

    @cached_property
    def _coupled_joints(self) -> list[set[int]]:
        """Joints with which M couples each joint: those that carry it, itself, and those it carries."""
        paths = self._robot.paths
        return [
            {*paths[joint], *(descendant for descendant, path in enumerate(paths) if joint in path)}
            for joint in range(len(paths))
        ]

    def _check_positive_definite(self, matrices: FloatArray) -> None:
        order = list(self._elimination_order)
        ordered = matrices if len(self._robot.tips) == 1 else matrices[..., order, :][..., order]
        try:
            pivots = np.diagonal(np.linalg.cholesky(ordered), axis1=-2, axis2=-1) ** 2
        except np.linalg.LinAlgError:
            raise self._indefinite_error(matrices) from None
        if (pivots <= SMALLEST_PIVOT * np.diagonal(ordered, axis1=-2, axis2=-1)).any():
            raise self._indefinite_error(matrices)

    def _indefinite_error(self, matrices: FloatArray) -> InputError:
        """Return the error with the first joint of each subtree, or branch of one, whose pivot fails."""
        failures: dict[int, str] = {}
        for position, joint in enumerate(self._elimination_order):
            earlier_joints = [
                earlier
                for earlier in self._elimination_order[:position]
                if earlier in self._coupled_joints[joint]
            ]
            leading_joints = [*earlier_joints, joint]
            if failures.keys().isdisjoint(earlier_joints) and not (
                _last_pivot(matrices[..., leading_joints, :][..., leading_joints]) > SMALLEST_PIVOT
            ):
                minor = f" (leading minor {len(leading_joints)} of the mass matrix)"
                failures[joint] = minor if len(self._robot.tips) == 1 else ""
        return InputError(
            Problem(
                "",
                0,
                f"joint {self._names[joint]}: the inertia it moves is not positive{minor}, so a torque "
                "gives no acceleration; give this link, or one beyond it, mass",
            )
            for joint, minor in failures.items()
        )


def _wrench_derivatives(wrench: Wrench | None, order: int) -> list[FloatArray]:
    """Return the wrench and its derivatives up to an order."""
    return [] if wrench is None else [getattr(wrench, name) for name in WRENCH_NAMES[: order + 1]]


def _solve_positive_definite(
    matrix: Any,
    rhs: Any,
    smallest_pivot: float,
    order: Sequence[int],
    coupled: Callable[[int, int], bool],
) -> Any:
    """Return matrix^-1 right, by L D L^T without pivoting; NaN where the matrix is not positive definite.

    Args:
        matrix: (n, n), symmetric.
        rhs: (n,).
        smallest_pivot: Relative to the diagonal entry, below which a pivot of D counts as not positive.
        order: Order of elimination of the columns.
        coupled: Function that says whether L has an entry in a row and an earlier column.
    """
    lower: dict[tuple[int, int], Any] = {}
    pivots: dict[int, Any] = {}
    for position, column in enumerate(order):
        scaled = {
            earlier: lower[column, earlier] * pivots[earlier]
            for earlier in order[:position]
            if (column, earlier) in lower
        }
        products = [lower[column, earlier] * scaled[earlier] for earlier in scaled]
        pivot = _subtract_terms(matrix[column, column], products)
        regular = pivot > smallest_pivot * matrix[column, column]
        pivots[column] = np.where(regular, pivot, math.nan)
        for row in order[position + 1 :]:
            if coupled(row, column):
                products = [
                    lower[row, earlier] * scaled[earlier] for earlier in scaled if (row, earlier) in lower
                ]
                lower[row, column] = _subtract_terms(matrix[row, column], products) / pivots[column]

    forward_solution: dict[int, Any] = {}
    for row in order:
        terms = [
            lower[row, earlier] * forward_solution[earlier]
            for earlier in forward_solution
            if (row, earlier) in lower
        ]
        forward_solution[row] = _subtract_terms(rhs[row], terms)
    solution: dict[int, Any] = {}
    for position in reversed(range(len(order))):
        row = order[position]
        terms = [
            lower[later, row] * solution[later] for later in order[position + 1 :] if (later, row) in lower
        ]
        solution[row] = _subtract_terms(forward_solution[row] / pivots[row], terms)
    return np.stack([solution[row] for row in range(len(rhs))])


def _subtract_terms(value: Any, terms: list[Any]) -> Any:
    return reduce(lambda difference, term: difference - term, terms, value)


def _last_pivot(matrices: FloatArray) -> float:
    """Return the smallest last pivot, relative to the last entry, of matrices with other pivots positive."""
    factors = np.linalg.solve(matrices[..., :-1, :-1], matrices[..., :-1, -1:])
    pivots = matrices[..., -1, -1] - (matrices[..., -1:, :-1] @ factors)[..., 0, 0]
    entries = matrices[..., -1, -1]
    return float(np.min(np.divide(pivots, entries, out=np.zeros_like(pivots), where=entries > 0)))


def link_dynamics(robot: Robot, frame: WrenchFrame | None = None) -> LinkDynamics:
    """Return the programs of a robot's links and joints; robots with equal links share them.

    Args:
        robot: Robot; its actuators and dampers are ignored.
        frame: Frame of the wrench on the tools, as in `Wrench`; None without a wrench.
    """
    try:
        return _link_dynamics_of(robot, frame)
    except NotImplementedError:  # symbols among the parameters, whose values are unknown, have no hash
        return _SymbolicLinks(without_drives(robot), frame)


@lru_cache(maxsize=16)
def _link_dynamics_of(robot: Robot, frame: WrenchFrame | None) -> LinkDynamics:
    """Return the programs of a robot; without this cache, `mass_matrix` of a 7R takes 5 times as long."""
    return _shared_link_dynamics(without_drives(robot), frame)


def without_drives(robot: Robot) -> Robot:
    """Return the robot with a common placeholder for its drives, for robots with equal links to be equal.

    Limits are left out, too, as no program depends on them.
    """
    no_drive: dict[str, Any] = {"actuator": _PLACEHOLDER_DRIVE, "damper": None, "limits": Limits()}
    joints = tuple(replaced_unchecked(joint, no_drive) for joint in robot.joints)
    tools = tuple(replaced_unchecked(tool, {"min_stiffness": None}) for tool in robot.tools)
    common = {"name": "links", "description": "", "placeholder": False, "sources": ()}
    return replaced_unchecked(robot, {**common, "joints": joints, "tools": tools})


_PLACEHOLDER_DRIVE: Any = Rigid(motor=Motor(inertia=1.0))


@lru_cache(maxsize=16)
def _shared_link_dynamics(robot: Robot, frame: WrenchFrame | None) -> LinkDynamics:
    return LinkDynamics(robot, frame)


class _SymbolicLinks(LinkDynamics):
    """Links with parameters that are symbols: each call records the recursion on their tape."""

    @staticmethod
    def _trace_function(torques: _Torques) -> LinkFunction:
        def compute(*inputs: Any) -> Any:
            scalars = iter(np.concatenate(inputs))
            return np.stack(torques(lambda count: list(islice(scalars, count))))

        return compute


def _lower_triangle(robot: Robot, inputs: _Inputs) -> list[Scalar]:
    """Return the lower triangle of M, row by row; friction offsets are left out."""
    joints = tuple(replaced_unchecked(joint, {"friction": None}) for joint in robot.joints)
    robot = replaced_unchecked(robot, {"joints": joints})
    q = inputs(len(robot.joints))
    joint_indices = range(len(robot.joints))
    columns = [
        _recursion_torques(robot, q, [(0, int(joint == moving_joint), 0, 0) for joint in joint_indices], ZERO)
        for moving_joint in joint_indices
    ]
    return [columns[column][row].tau for row in joint_indices for column in range(row + 1)]


def _traced_torques(
    robot: Robot, frame: WrenchFrame | None, output: str, order_count: int, inputs: _Inputs
) -> list[Scalar]:
    """Return an output of the recursion; derivatives of q beyond `order_count` are zero."""
    joints = len(robot.joints)
    q = inputs(joints)
    rates = [inputs(joints) if derivative < order_count else [0] * joints for derivative in range(4)]
    derivative = ("tau", "dtau", "ddtau").index(output)
    loads = () if frame is None else _tool_load_inputs(inputs, robot, frame, derivative)
    torques = _recursion_torques(robot, q, list(zip(*rates, strict=True)), base_gravity(robot), loads)
    return [getattr(torque, output) for torque in torques]


def _tool_load_inputs(inputs: _Inputs, robot: Robot, frame: WrenchFrame, order: int) -> list[ToolLoad]:
    """Return the loads with the wrench and its derivatives up to an order as inputs, the others zero."""
    components = wrench_components(frame)
    wrench = [inputs(components) if derivative <= order else [0] * components for derivative in range(3)]
    return tool_loads(robot, frame, wrench)


def _recursion_torques(
    robot: Robot,
    q: Sequence[Symbol],
    rates: Sequence[tuple[Scalar, ...]],
    gravity: Vector,
    loads: Sequence[ToolLoad] = (),
) -> list[TorqueDerivatives]:
    states = [
        joint_state(joint, position, (d1, d2, d3, d4))
        for joint, position, (d1, d2, d3, d4) in zip(robot.joints, q, rates, strict=True)
    ]
    links = [link_constants(joint) for joint in robot.joints]
    return recursion(RecursionInputs(links, states, carriers(robot), gravity, loads))
