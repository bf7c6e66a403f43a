"""An elastic potential U(q, theta_1, theta_2) that a file states as an expression, and its springs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from vsacli.actuators.elasticity import Components, MotorMatrix
from vsacli.actuators.mechanisms.mechanism import MechanismState
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.compute.jets import FUNCTIONS, Order, Truncation
from vsacli.documents.expression import Expression, Grammar, parse

if TYPE_CHECKING:
    from vsacli.compute.tracing.row_functions import RowFunction


VARIABLES = ("q", "theta_1", "theta_2", "phi")
"""Names of positions in an expression; phi is theta_1 - q."""

MAX_LENGTH = 2000
"""Largest number of characters of an expression; a MACCEPA needs 80."""

RESERVED = frozenset({*VARIABLES, "pi", *FUNCTIONS})
"""Names that no constant may have."""


def read_energy(text: str, constants: Mapping[str, float]) -> Expression:
    """Return the expression of a potential.

    Raises:
        ExpressionError: The text is none.
    """
    names = (*VARIABLES, "pi", *constants)
    return parse(
        text.replace("\n", " "), Grammar(names, tuple(FUNCTIONS), powers=True, max_length=MAX_LENGTH)
    )


def _truncation(q_order: int, motor_order: int, total_order: int) -> Truncation:
    """Return derivatives over (q, theta_1, theta_2) up to an order over q, over both motors, and in all."""
    return Truncation(
        (a, b, c)
        for a in range(q_order + 1)
        for b in range(motor_order + 1)
        for c in range(motor_order + 1 - b)
        if a + b + c <= total_order
    )


TORQUE_DERIVATIVES, STIFFNESS_DERIVATIVES, ACCELERATION_DERIVATIVES = (
    _truncation(1, 1, 1),
    _truncation(2, 1, 3),
    _truncation(4, 2, 4),
)
"""Derivatives of the potential for the torques; for the stiffness and the matrix A; for the accelerations."""


class PotentialEnergy:
    """A potential with the values of its constants."""

    def __init__(self, expression: Expression, constants: Mapping[str, float]) -> None:
        self._expression = expression
        self._constants = {name: np.float64(number) for name, number in constants.items()}
        self._row_functions: dict[Truncation, RowFunction] = {}

    def derivatives(self, coordinates: Components, truncation: Truncation) -> PotentialDerivatives:
        """Return the derivatives by q, theta_1 and theta_2 at coordinates phi, theta_2 and q.

        For numbers, a program traced from the series is run: the series itself would take ten times as long,
        for bookkeeping of the orders.
        """
        if not all(isinstance(row, np.ndarray) for row in coordinates):
            return PotentialDerivatives(
                dict(zip(truncation.orders, self._series_derivatives(coordinates, truncation), strict=True))
            )
        if truncation not in self._row_functions:
            self._row_functions[truncation] = self._trace_series(truncation)
        function, shape = self._row_functions[truncation], coordinates[0].shape
        flat_coordinates = [np.ravel(row) for row in coordinates]
        values = np.empty((len(truncation.orders), flat_coordinates[0].size))
        function(flat_coordinates, values, function.workspace(flat_coordinates[0].size))
        return PotentialDerivatives(
            dict(zip(truncation.orders, values.reshape(len(values), *shape), strict=True))
        )

    def _trace_series(self, truncation: Truncation) -> RowFunction:
        from vsacli.compute.tracing import Kind, trace
        from vsacli.compute.tracing.row_functions import RowFunction

        return RowFunction(trace(lambda rows: self._series_derivatives(rows, truncation), [Kind.REAL] * 3))

    def _series_derivatives(self, coordinates: Components, truncation: Truncation) -> list[FloatArray]:
        """Return the derivatives in the truncation's order, from rows of phi, theta_2 and q."""
        phi, s, q = coordinates
        names = {
            "q": truncation.linear(q, (1, 0, 0)),
            "theta_1": truncation.linear(phi + q, (0, 1, 0)),
            "theta_2": truncation.linear(s, (0, 0, 1)),
            "phi": truncation.linear(phi, (-1, 1, 0)),
            "pi": np.float64(np.pi),
            **self._constants,
        }
        zero = np.zeros_like(phi)
        energy = self._expression.value(names, FUNCTIONS, np.float64) + truncation.linear(zero, (0, 0, 0))
        return [energy.derivative(order) + zero for order in truncation.orders]


class PotentialDerivatives:
    """Derivatives of a potential over q, theta_1 and theta_2, by how often it is differentiated over each."""

    def __init__(self, by_order: Mapping[Order, FloatArray]) -> None:
        self._by_order = by_order

    def __call__(self, *variables: int) -> FloatArray:
        """Return the derivative over variables, each by its number 0, 1 or 2."""
        return self._by_order[variables.count(0), variables.count(1), variables.count(2)]

    @property
    def finite(self) -> BoolArray:
        """Return where all of them are finite."""
        return np.asarray(np.isfinite(list(self._by_order.values())).all(axis=0))

    @property
    def matrix(self) -> MotorMatrix:
        """The matrix A of tau_e = -U_q and the stiffness U_qq over theta_1 and theta_2."""
        return MotorMatrix(-self(0, 1), -self(0, 2), self(0, 0, 1), self(0, 0, 2))


class PotentialState(MechanismState):
    """The springs of a potential that depends on q, theta_1 and theta_2 in any way.

    With x = (q, theta_1, theta_2) and y = (tau_e, sigma) = (-U_q, U_qq),

        A theta'  = y'  - y_q q'
        A theta'' = y'' - y_q q'' - (x'^T H x' of either), H the second derivatives of y over x.
    """

    def __init__(self, potential: PotentialEnergy, coordinates: Components) -> None:
        self._potential, self._coordinates = potential, coordinates

    @cached_property
    def _torque_derivatives(self) -> PotentialDerivatives:
        return self._potential.derivatives(self._coordinates, TORQUE_DERIVATIVES)

    @cached_property
    def _acceleration_derivatives(self) -> PotentialDerivatives:
        return self._potential.derivatives(self._coordinates, ACCELERATION_DERIVATIVES)

    @property
    def energy(self) -> FloatArray:
        """U."""
        return self._torque_derivatives()

    @property
    def tau_e(self) -> FloatArray:
        """-U_q."""
        return -self._torque_derivatives(0)

    @property
    def stiffness(self) -> FloatArray:
        """U_qq."""
        return self._acceleration_derivatives(0, 0)

    @property
    def tau_transmission(self) -> tuple[FloatArray, ...]:
        """Derivatives of U over theta_1 and theta_2."""
        return self._torque_derivatives(1), self._torque_derivatives(2)

    @property
    def matrix(self) -> MotorMatrix:
        """Derivatives of tau_e and the stiffness over theta_1 and theta_2."""
        return self._acceleration_derivatives.matrix

    def torque_rate(self, rates: Components) -> FloatArray:
        """Return the rate of -U_q."""
        return -self._derivative_rate((0,), rates)

    def stiffness_rate(self, rates: Components) -> FloatArray:
        """Return the rate of U_qq."""
        return self._derivative_rate((0, 0), rates)

    def stiffness_curvature(self, rates: Components) -> FloatArray:
        """Return the terms of U_qq'' that are quadratic in the rates of x."""
        return self._quadratic_terms((0, 0), rates)

    def transmission_rates(self, rates: Components) -> tuple[FloatArray, ...]:
        """Return the rates of the derivatives by theta_1 and theta_2."""
        return self._derivative_rate((1,), rates), self._derivative_rate((2,), rates)

    def rates(self, dtau_e: FloatArray, dstiffness: FloatArray, dq: FloatArray) -> tuple[FloatArray, ...]:
        """Return A^-1 (y' - y_q q'), with phi' = theta_1' - q'."""
        u = self._acceleration_derivatives
        dtheta_1, dtheta_2 = self.matrix.solve(dtau_e + u(0, 0) * dq, dstiffness - u(0, 0, 0) * dq)
        return dtheta_1 - dq, dtheta_2, dq

    def motor_accelerations(
        self, rates: Components, ddq: FloatArray, ddtau_e: FloatArray, ddstiffness: FloatArray
    ) -> tuple[FloatArray, ...]:
        """Return A^-1 of y'' - y_q q'' minus the terms quadratic in the rates."""
        u = self._acceleration_derivatives
        torque_row = ddtau_e + u(0, 0) * ddq + self._quadratic_terms((0,), rates)
        stiffness_row = ddstiffness - u(0, 0, 0) * ddq - self.stiffness_curvature(rates)
        return self.matrix.solve(torque_row, stiffness_row)

    def _derivative_rate(self, variables: tuple[int, ...], rates: Components) -> FloatArray:
        """Return the rate of a derivative of the potential."""
        return sum(
            (
                self._acceleration_derivatives(*variables, index) * rate
                for index, rate in _position_rates(rates)
            ),
            np.zeros_like(rates[0]),
        )

    def _quadratic_terms(self, variables: tuple[int, ...], rates: Components) -> FloatArray:
        """Return the terms quadratic in the rates of the second time derivative of a partial derivative."""
        return sum(
            (
                self._derivative_rate((*variables, index), rates) * rate
                for index, rate in _position_rates(rates)
            ),
            np.zeros_like(rates[0]),
        )


def _position_rates(rates: Components) -> Iterator[tuple[int, FloatArray]]:
    """Return the rates of q, theta_1 and theta_2 by index, from rates of the coordinates."""
    dphi, ds, dq = rates
    return enumerate((dq, dphi + dq, ds))
