"""The interface of an actuator, common to all kinds."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from vsacli.actuators.elasticity import Elasticity
from vsacli.actuators.laws.law import PairSolution
from vsacli.actuators.motor import JointMotor, Motor
from vsacli.actuators.reach import LimitCheck, OfJoint, within
from vsacli.actuators.spring_elements import LeverSpring, SpringElement
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.base.flags import Flag
from vsacli.base.variables import MOTORS, SPRINGS, Variable
from vsacli.documents.source import Source


class PlaceholderConstants(NamedTuple):
    """Constants of an actuator of which nothing is known, in SI units; at a prismatic joint kg, N/m, N/m^3.

    Attributes:
        motor_inertia: of each motor, joint side of the gear.
        stiffness: of an elastic transmission.
        spring: k and k_c of cubic springs, alike on both sides.
        max_torque: of a motor that drives the joint alone, joint side of the gear.
        gear_ratio: of such a motor, None if it is not known.
    """

    motor_inertia: float
    stiffness: float
    spring: tuple[float, float]
    max_torque: float = math.inf
    gear_ratio: float | None = None

    @property
    def only_motor(self) -> Motor:
        """A motor that drives the joint alone; its inertia has fewer digits than a division leaves."""
        ratio = abs(self.gear_ratio or 1.0)
        return Motor(
            inertia=float(f"{self.motor_inertia / (ratio * ratio):.12g}"),
            max_torque=self.max_torque / ratio,
            gear_ratio=self.gear_ratio,
        )


class Carried(NamedTuple):
    """Torque and stiffness of springs at given deflections, by their laws; arrays (samples,).

    Attributes:
        tau_e: torque on the link.
        size: sum of the absolute torques of which tau_e is the sum.
        stiffness: of the joint.
        stiffness_size: the same for the terms of the stiffness, which rounding of the deflections changes by
            eps times this.
        tau_transmission: torque against each motor, (motors, samples).
    """

    tau_e: FloatArray
    size: FloatArray
    stiffness: FloatArray
    stiffness_size: FloatArray
    tau_transmission: FloatArray


class SpringLoad(NamedTuple):
    """The load of one of an actuator's springs, or of all springs of a mechanism; arrays (samples,).

    Attributes:
        name: of the spring.
        deflection: of the spring; of a mechanism, between motor 1 and link.
        torque: of the spring at that deflection.
        energy: in it, J.
        max_deflection: largest admissible |deflection|.
    """

    name: str
    deflection: FloatArray
    torque: FloatArray
    energy: FloatArray
    max_deflection: float


class Actuator(ABC):
    """The drive of a joint: motors, and springs between them and the link.

    A kind is a frozen dataclass of declared fields that derives from this class, and a line in `ACTUATORS`.
    Below, phi (2, samples) is what describes the springs: the deflection of each of them, or whatever the
    kind solves for, one number for each motor.

    Attributes:
        motor_count: motors of the joint, 1 or 2.
        commanded: keys of the signals that a trajectory commands besides the motion of the joint.
        uncommanded: why a trajectory does not command others, by key of the signal, clauses.
        sprung: whether springs lie between its motors and the link; else its motor moves with the joint.
    """

    motor_count: ClassVar[int] = 1
    commanded: ClassVar[tuple[str, ...]] = ()
    uncommanded: ClassVar[Mapping[str, str]] = {}
    sprung: ClassVar[bool] = True

    @classmethod
    def has(cls, variable: Variable) -> list[bool]:
        """Return which columns of a result variable its joints have: of motors 1 and 2, or of the joint."""
        of_kind = {None: True, SPRINGS: cls.sprung}
        there = of_kind.get(variable.requires, variable.requires in cls.commanded)
        if "motor" not in variable.dims:
            return [there]
        return [there and motor <= cls.motor_count for motor in MOTORS]

    @classmethod
    @abstractmethod
    def example(cls, joint_type: str) -> dict[str, Any]:
        """Plausible values of its fields, as a new robot file shows them."""

    @classmethod
    @abstractmethod
    def placeholder(cls, constants: PlaceholderConstants) -> Self:
        """Return an actuator of which nothing else is known.

        Raises:
            InvalidRecordError: a constant is not positive.
        """

    def unfit_for(self, joint_type: str) -> FieldProblem | None:  # noqa: ARG002
        """Why it cannot drive joints of a type, which of its fields says so; None if it can."""
        return None

    @property
    @abstractmethod
    def motors(self) -> tuple[JointMotor, ...]:
        """Motors, on the joint side."""

    @property
    def coupled_rotors(self) -> float:
        """B_12, by which either motor feels the acceleration of the other, joint side of the gears."""
        return 0.0

    @property
    def co_contracts(self) -> bool:
        """Whether both motors exert nothing but shares of the load, and so can work against each other."""
        return False

    @property
    def sides(self) -> tuple[JointMotor | None, ...]:
        """Motors 1 and 2, None where there is none."""
        return (*self.motors, None)[: len(MOTORS)]

    @property
    def max_deflections(self) -> tuple[float, ...]:
        """Largest admissible |phi| at each motor; a limit that is flagged."""
        return (math.inf,) * self.motor_count

    @property
    def phi_ranges(self) -> tuple[tuple[float, float], ...]:
        """Lowest and highest phi, or values of `Elasticity.ranged`, for which the springs' laws hold."""
        return ((-math.inf, math.inf),) * self.motor_count

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences for the user on its springs."""
        return ()

    @property
    def sources(self) -> tuple[Source, ...]:
        """Files that its springs were read from."""
        return ()

    @property
    def spring_elements(self) -> tuple[SpringElement, ...] | None:
        """Springs that are each stretched by a weighted sum of positions; None for other springs."""
        return None if self.sprung else ()

    @property
    def lever_spring(self) -> LeverSpring | None:
        """The only spring, if it lies between a lever and a point of the link; else None."""
        return None

    def limits(self) -> Iterator[LimitCheck]:
        """Yield the limits, finite or not."""
        for number, (motor, deflection) in enumerate(zip(self.motors, self.max_deflections, strict=True), 1):
            yield LimitCheck(Flag.DEFLECTION_LIMIT, "phi", number, within(deflection))
            yield LimitCheck(Flag.MOTOR_VELOCITY_LIMIT, "dtheta", number, within(motor.max_velocity))
            yield LimitCheck(Flag.MOTOR_TORQUE_LIMIT, "tau_motor", number, within(motor.max_torque))
            yield LimitCheck(Flag.CURRENT_LIMIT, "current", number, within(motor.max_current or math.inf))
            yield LimitCheck(Flag.VOLTAGE_LIMIT, "voltage", number, within(motor.max_voltage or math.inf))

    @abstractmethod
    def transmit(self, command: Command, near_singular: float, integrated: FloatArray | None) -> OfJoint:
        """Compute the springs and the motion of the motors for a command.

        Args:
            command: motion and elastic torque of the joint; arrays (samples,).
            near_singular: margin below which a step is near-singular.
            integrated: deflections phi to use instead of those that `solve` finds, NaN where there are none;
                given only if the kind has `deflection_rates`.

        Returns:
            The result variables `stiffness`, `dstiffness`, `ddstiffness`, `phi`, `dphi`, `ddtheta`,
            `tau_transmission`, `elastic_energy`, `det_A`, `stiffness_min`, `stiffness_max` and `flags`; NaN
            where the actuator has none, such as a second motor.
        """

    def motor_positions(self, phi: FloatArray, q: FloatArray) -> FloatArray:
        """theta, (2, samples), from phi and the position of the joint; velocities from their rates (69)."""
        return phi + q

    @abstractmethod
    def spring_rates(self, of_joint: OfJoint) -> FloatArray:
        """Return the rates of tau_transmission, (motors, samples), from the other variables of the joint."""

    def spring_loads(self, of_joint: OfJoint) -> tuple[SpringLoad, ...]:
        """Return the loads of its springs from the other variables; those behind motor 1 as one."""
        if not self.sprung:
            return ()
        loaded = of_joint["phi"][0], of_joint["tau_transmission"][0], of_joint["elastic_energy"]
        return (SpringLoad("springs", *loaded, self.max_deflections[0]),)

    def carried(self, of_joint: OfJoint) -> Carried:
        """Return torque and stiffness of the springs by their laws, from the motion of joint and motors."""
        raise NotImplementedError(f"{type(self).__name__} has no springs")

    @property
    def spring_group(self) -> Hashable:
        """Actuators of which this is equal have their springs computed together: those of one kind."""
        return type(self)

    @classmethod
    def elasticity(cls, actuators: Sequence[Self]) -> Elasticity:
        """Return the springs of actuators of one `spring_group`, at any state of their joints and motors."""
        raise NotImplementedError(f"{cls.__name__} has no springs")

    # Of kinds that take a stiffness

    def solve(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> PairSolution:
        """Phi at which the springs carry the torque with the stiffness (14), on the actuator's branch.

        Args:
            tau_e: elastic torque, (samples,).
            stiffness: demanded joint stiffness, (samples,).
            q: position of the joint, (samples,), of which the springs of most kinds know nothing.
        """
        raise NotImplementedError(f"{type(self).__name__} takes no stiffness")

    @property
    def opposite_preload(self) -> str | None:
        """The other word that its field for the preload may hold; None if there is none."""
        return None

    preload_field: ClassVar[str] = "preload"
    """Path to that field."""

    def other_preload(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> BoolArray:  # noqa: ARG002
        """Return where another branch would attain the stiffness, (samples,)."""
        return np.zeros(tau_e.shape, dtype=bool)

    integrable: ClassVar[bool] = False
    """Whether phi can be integrated along a trajectory, by the two methods below."""

    def deflection_rates(self, phi: FloatArray, command: Command) -> FloatArray:
        """Rates of phi, (2, samples), that give tau_e and the stiffness those of the command, (19)-(20)."""
        raise NotImplementedError(f"{type(self).__name__} solves for its deflections at each step")

    def determinant(self, phi: FloatArray, q: FloatArray) -> FloatArray:
        """Determinant of the decoupling matrix A at phi and positions of the joint, (67)."""
        raise NotImplementedError(f"{type(self).__name__} solves for its deflections at each step")
