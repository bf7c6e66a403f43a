"""Motors and springs of all joints in a row, whatever the actuators: what the equations of motion need.

Arrays over motors have the motors on their last axis, joint by joint, side 1 before side 2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import singledispatch

import numpy as np

from vsacli.actuators.antagonistic import Antagonistic
from vsacli.actuators.elastic import Elastic
from vsacli.actuators.kinds import Actuator
from vsacli.actuators.laws import SpringLaw
from vsacli.actuators.laws.state import SpringState
from vsacli.actuators.motor import JointMotor
from vsacli.actuators.pairs.decoupling_matrix import determinant
from vsacli.actuators.rigid import Rigid
from vsacli.base.arrays import FloatArray

SIDES = 2
"""Motors that a joint has at most."""


@singledispatch
def motors_and_springs(actuator: object) -> list[tuple[JointMotor, SpringLaw | None]]:
    """Each motor of an actuator with the spring between it and the link; None if there is none."""
    raise TypeError(f"{type(actuator).__name__} is no actuator")


@motors_and_springs.register(Antagonistic)
def _(actuator: Antagonistic) -> list[tuple[JointMotor, SpringLaw | None]]:
    return [(motor.at_joint, law) for motor, law in zip(actuator.motor, actuator.laws, strict=True)]


@motors_and_springs.register(Elastic)
def _(actuator: Elastic) -> list[tuple[JointMotor, SpringLaw | None]]:
    from vsacli.actuators.laws.polynomial import Polynomial

    return [(actuator.motor.at_joint, Polynomial(c1=actuator.stiffness))]


@motors_and_springs.register(Rigid)
def _(actuator: Rigid) -> list[tuple[JointMotor, SpringLaw | None]]:
    return [(actuator.motor.at_joint, None)]


class Drivetrain:
    """The motors of all joints, those with a spring apart from those that move their link directly.

    Attributes:
        present: (joints, 2), where there is a motor.
        sprung: (motors,), whether the motor acts through a spring; of motors without one, one a joint.
        joint: (motors,), index of the joint of each motor.
        side: (motors,), 0 or 1.
        inertia, damping, max_torque: (motors,) of the motors, joint side of the gear.
        rigid: (joints,), whether the joint has no spring.
        spring_joint: (springs,), index of the joint of each spring.
        domain: (2, springs), lowest and highest deflection of each law.
        first, second: (pairs,), the springs of each joint that has two.
        single: the springs of the other joints.
    """

    def __init__(self, actuators: Sequence[Actuator]) -> None:
        units = [
            (joint, side, motor, law)
            for joint, actuator in enumerate(actuators)
            for side, (motor, law) in enumerate(motors_and_springs(actuator))
        ]
        joints, sides, motors, laws = zip(*units, strict=True)
        self.joint, self.side = np.array(joints), np.array(sides)
        self.present = np.zeros((len(actuators), SIDES), dtype=bool)
        self.present[self.joint, self.side] = True
        self.sprung = np.array([law is not None for law in laws])
        self.inertia = np.array([motor.inertia for motor in motors])
        self.damping = np.array([motor.damping for motor in motors])
        self.max_torque = np.array([motor.max_torque for motor in motors])

        springs = [law for law in laws if law is not None]
        self.rigid = ~np.isin(np.arange(len(actuators)), self.joint[self.sprung])
        self.spring_joint, spring_side = self.joint[self.sprung], self.side[self.sprung]
        self.domain = np.array([law.domain for law in springs]).reshape(-1, 2).T
        paired = self.present[self.spring_joint].all(axis=1)
        self.first = np.flatnonzero(paired & (spring_side == 0))
        self.second = np.flatnonzero(paired & (spring_side == 1))
        self.single = np.flatnonzero(~paired)
        self._groups = list(_alike(springs))
        self._incidence = (self.joint[:, None] == np.arange(len(actuators))).astype(np.float64)

    def of_motors(self, values: FloatArray) -> FloatArray:
        """(..., motors) from (..., joints, 2), whose entries without a motor do not matter."""
        return values[..., self.present]

    def of_joints(self, values: FloatArray) -> FloatArray:
        """(..., joints, 2) from (..., motors), NaN where there is no motor."""
        result = np.full((*values.shape[:-1], *self.present.shape), np.nan)
        result[..., self.present] = values
        return result

    def merged(self, sprung: FloatArray, rigid: FloatArray) -> FloatArray:
        """(..., joints, 2) from values of the springs (..., springs), and of the joints (..., joints).

        The latter are taken at motors without a spring.
        """
        values = rigid[..., self.joint]
        values[..., self.sprung] = sprung
        return self.of_joints(values)

    def joint_sum(self, values: FloatArray) -> FloatArray:
        """Sum over the springs of each joint, (..., joints) from (..., springs); 0 where there is none."""
        result: FloatArray = values @ self._incidence[self.sprung]
        return result

    def rigid_sum(self, values: FloatArray) -> FloatArray:
        """The value of the motor that moves a joint directly, (..., joints) from (..., motors), else 0."""
        result: FloatArray = values[..., ~self.sprung] @ self._incidence[~self.sprung]
        return result

    def torque(self, phi: FloatArray) -> FloatArray:
        """Torque of each spring at its deflection, (..., springs)."""
        return self._each(phi, lambda law, part: law.torque(part))

    def springs(self, phi: FloatArray) -> SpringState:
        """The springs at their deflections, (..., springs)."""
        result = SpringState(*(np.empty_like(phi) for _ in SpringState._fields))
        for law, members in self._groups:
            for values, of_law in zip(result, law.state(phi[..., members]), strict=True):
                values[..., members] = of_law
        return result

    def energy(self, phi: FloatArray) -> FloatArray:
        """Elastic energy of each joint, (..., joints), from the deflections (..., springs)."""
        return self.joint_sum(self._each(phi, lambda law, part: law.energy(part)))

    def decoupling_determinant(self, springs: SpringState) -> FloatArray:
        """Det A (67) of the joints that have two springs, (..., pairs)."""
        return determinant(springs.take(self.first), springs.take(self.second))

    def _each(self, phi: FloatArray, value: Callable[[SpringLaw, FloatArray], FloatArray]) -> FloatArray:
        result = np.empty_like(phi)
        for law, members in self._groups:
            result[..., members] = value(law, phi[..., members])
        return result


def _alike(laws: list[SpringLaw]) -> Iterator[tuple[SpringLaw, list[int]]]:
    """Each distinct law, with the springs that obey it."""
    distinct: list[SpringLaw] = []
    for law in laws:
        if law not in distinct:
            distinct.append(law)
            yield law, [index for index, other in enumerate(laws) if other == law]
