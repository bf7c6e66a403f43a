"""The interface of an actuator, common to all kinds.

`Actuator.transmit` is its part of the inverse dynamics, (61)-(72). The other methods describe motors, springs
and limits to the forward dynamics, the self-check, exports and reports.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self

from vsacli.actuators.elasticity import Components, Elasticity, ElasticState
from vsacli.actuators.laws.law import PairSolution
from vsacli.actuators.motor import SHAFT, JointMotor, Motor
from vsacli.actuators.reach import LimitCheck
from vsacli.actuators.spring_elements import SpringAssembly, SpringElement
from vsacli.actuators.transmission import Command, JointVariables
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.base.flags import Flag
from vsacli.base.variables import MOTORS, SPRINGS, Variable


class PlaceholderConstants(NamedTuple):
    """Default constants of an unknown actuator, in SI units; at a prismatic joint kg, N/m, N/m^3.

    Attributes:
        motor_inertia: Inertia of each motor, joint side of the gear.
        stiffness: Stiffness of an elastic transmission.
        spring: Coefficients k and k_c of cubic springs, equal on both sides.
        max_torque: Largest torque of a motor that drives the joint alone, joint side of the gear.
        gear_ratio: Gear ratio of such a motor; None if unknown.
    """

    motor_inertia: float
    stiffness: float
    spring: tuple[float, float]
    max_torque: float = math.inf
    gear_ratio: float | None = None

    @property
    def only_motor(self) -> Motor:
        """Motor that drives the joint alone, on its shaft if its gear ratio is known.

        The inertia is rounded to hide the digits of the division.
        """
        ratio = abs(self.gear_ratio or 1.0)
        return Motor(
            inertia=float(f"{self.motor_inertia / (ratio * ratio):.12g}"),
            max_torque=self.max_torque / ratio,
            gear_ratio=self.gear_ratio,
            side=None if self.gear_ratio is None else SHAFT,
        )


class Actuator(SpringAssembly, ABC):
    """The drive of a joint: motors, and springs between them and the link.

    A kind is a frozen dataclass of declared fields that derives from this class, and a line in `ACTUATORS`.
    The state of the springs is that of the unknowns of (14), one per motor: their deflections phi, or others
    that the kind chooses.

    Attributes:
        motor: Motor of the joint, or motors 1 and 2; a declared field of each kind.
        motor_count: Number of motors of the joint, 1 or 2.
        commanded: Keys of the signals that a trajectory commands in addition to the motion of the joint.
        uncommanded: Reasons why a trajectory does not command other signals, by key; clauses.
        sprung: Whether springs lie between motors and link; otherwise the motor moves with the joint.
    """

    motor: Motor | tuple[Motor, ...]
    motor_count: ClassVar[int] = 1
    commanded: ClassVar[tuple[str, ...]] = ()
    uncommanded: ClassVar[Mapping[str, str]] = {}
    sprung: ClassVar[bool] = True

    @classmethod
    def has_columns(cls, variable: Variable) -> list[bool]:
        """Return whether joints of this kind have each column of a result variable: one, or one per motor."""
        of_kind = {None: True, SPRINGS: cls.sprung}
        exists = of_kind.get(variable.requires, variable.requires in cls.commanded)
        if "motor" not in variable.dims:
            return [exists]
        return [exists and motor <= cls.motor_count for motor in MOTORS]

    @classmethod
    @abstractmethod
    def example(cls, joint_type: str, mechanism: str | None = None) -> dict[str, Any]:
        """Return plausible values of the fields, for a new robot file.

        Args:
            joint_type: Type of the joint.
            mechanism: Mechanism or spring law, one of `mechanisms_of` this kind; by default the usual one.
        """

    @classmethod
    @abstractmethod
    def placeholder(cls, constants: PlaceholderConstants) -> Self:
        """Return an actuator with default constants.

        Raises:
            InvalidRecordError: A constant is not positive.
        """

    def unfit_for(self, joint_type: str) -> FieldProblem | None:  # noqa: ARG002
        """Return the field that excludes joints of this type, with the reason; None if it can drive them."""
        return None

    @cached_property
    def motors(self) -> tuple[JointMotor, ...]:
        """Motors, on the joint side of their gears."""
        declared = self.motor if isinstance(self.motor, tuple) else (self.motor,)
        return tuple(motor.at_joint for motor in declared)

    @property
    def coupled_rotors(self) -> float:
        """Inertia B_12 that couples the accelerations of the two motors, joint side of the gears."""
        return 0.0

    @property
    def co_contracts(self) -> bool:
        """Whether the motors bear shares of tau_e and nothing else, so that they can oppose each other."""
        return False

    @cached_property
    def sides(self) -> tuple[JointMotor | None, ...]:
        """Motors 1 and 2; None for a missing one."""
        return (*self.motors, None)[: len(MOTORS)]

    @property
    def max_deflections(self) -> tuple[float, ...]:
        """Largest admissible |phi| at each motor; a violation is flagged."""
        return (math.inf,) * self.motor_count

    @property
    def phi_ranges(self) -> tuple[tuple[float, float], ...]:
        """Range of phi, or of the coordinates `Elasticity.ranged`, in which the springs' laws hold."""
        return ((-math.inf, math.inf),) * self.motor_count

    @property
    def spring_elements(self) -> tuple[SpringElement, ...] | None:
        """Springs whose deflections are weighted sums of positions; None if there are others."""
        return None if self.sprung else ()

    @cached_property
    def limits(self) -> tuple[LimitCheck, ...]:
        """All limits of motors and springs, finite or not."""
        return tuple(
            LimitCheck(flag, variable, motor_number, (-largest, largest))
            for motor_number, (motor, deflection) in enumerate(
                zip(self.motors, self.max_deflections, strict=True), 1
            )
            for flag, variable, largest in (
                (Flag.DEFLECTION_LIMIT, "phi", deflection),
                (Flag.MOTOR_VELOCITY_LIMIT, "dtheta", motor.max_velocity),
                (Flag.MOTOR_TORQUE_LIMIT, "tau_motor", motor.max_torque),
                (Flag.CURRENT_LIMIT, "current", _bound_or_infinity(motor.max_current)),
                (Flag.VOLTAGE_LIMIT, "voltage", _bound_or_infinity(motor.max_voltage)),
            )
        )

    @abstractmethod
    def transmit(self, command: Command, min_margin: float, prescribed: FloatArray | None) -> JointVariables:
        """Compute the springs and the motion of the motors for a command.

        Args:
            command: Motion and elastic torque of the joint; arrays (samples,).
            min_margin: Margin below which a sample is near-singular.
            prescribed: Unknowns to use instead of those that `solve` finds, (2, samples), NaN where there are
                none; only for kinds with a commanded stiffness.

        Returns:
            The command with the stiffness and its derivatives, deflections, motor motion, spring torques and
            energy, det A, the attainable range and `flags`; NaN where the actuator lacks them, such as a
            second motor.
        """

    def motor_positions(self, unknowns: Components, q: FloatArray) -> FloatArray:
        """Return theta, (motors, samples), from the unknowns, or velocities from their rates (69)."""
        return unknowns + q

    def unknowns(self, phi: FloatArray, theta: FloatArray) -> tuple[FloatArray, ...]:  # noqa: ARG002
        """Return the unknowns from deflections and motor positions, (2, samples), or their rates."""
        return tuple(phi[: self.motor_count])

    def springs(self, unknowns: Components, q: FloatArray) -> ElasticState:
        """Return the springs with their derivatives at unknowns and joint positions, one array for each."""
        raise NotImplementedError(f"{type(self).__name__} has no springs")

    def springs_of(self, variables: JointVariables) -> ElasticState:
        """Return the springs with their derivatives from the motion of joint and motors."""
        return self.springs(self.unknowns(variables.phi, variables.theta), variables.q)

    @property
    def spring_group(self) -> Hashable:
        """Key of actuators whose springs are computed together: by default, all of one kind."""
        return type(self)

    @classmethod
    def elasticity(cls, actuators: Sequence[Self]) -> Elasticity:
        """Return the springs of actuators of one `spring_group`, as one object."""
        raise NotImplementedError(f"{cls.__name__} has no springs")

    # Methods of kinds with a commanded stiffness

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> PairSolution:
        """Solve (14): return the unknowns for a torque and a stiffness, on the actuator's branch.

        Args:
            tau_e: Elastic torque, (samples,).
            stiffness: Demanded joint stiffness, (samples,).
            q: Position of the joint, (samples,); the springs of most kinds do not depend on it.
        """
        raise NotImplementedError(f"{type(self).__name__} takes no stiffness")

    branch_field: ClassVar[str] = "branch"
    """Path to the branch field."""


def _bound_or_infinity(limit: float | None) -> float:
    """Return a largest value, infinite if there is none."""
    return math.inf if limit is None else limit
