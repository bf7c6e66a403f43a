"""Motors and springs of all joints, with the inertia B of rotors, for the equations of motion (5)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.elasticity import Components, Elasticity, ElasticState, SpringTorques, indices_of_equals
from vsacli.actuators.friction import FrictionLaws
from vsacli.actuators.motor import Windings
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray
from vsacli.base.variables import VARIABLES
from vsacli.compute.vector import is_zero


def largest_coupling(first: float, second: float) -> float:
    """Return the bound below which a coupled inertia leaves B positive definite.

    Args:
        first: Inertia of one rotor, on the same side of its gear as the coupled inertia.
        second: Inertia of the other rotor.
    """
    return math.sqrt(first * second)


class Rotors:
    """Rotors of all motors with springs, joint by joint; arrays (..., motors).

    Where motor 1 carries motor 2, the acceleration of each acts on the other: B is a symmetric 2x2 matrix.
    """

    def __init__(self, actuators: Sequence[Actuator]) -> None:
        motors = [
            (motor.inertia, actuator.coupled_rotors, 1 - 2 * side)
            for actuator in actuators
            for side, motor in enumerate(actuator.motors)
        ]
        inertia, coupling, offset_to_other = zip(*motors, strict=True) if motors else ((), (), ())
        self._inertia = np.stack(inertia) if inertia else np.zeros(0)
        self._coupling = np.stack(coupling) if coupling else np.zeros(0)
        self._coupled_rotors = np.flatnonzero([not is_zero(actuator) for actuator in coupling])
        self._other_rotor = (
            self._coupled_rotors + np.array(offset_to_other, dtype=np.intp)[self._coupled_rotors]
        )

    def torques(self, ddtheta: FloatArray) -> FloatArray:
        """Return B theta''."""
        torques: FloatArray = self._inertia * ddtheta
        if self._coupled_rotors.size:
            torques[..., self._coupled_rotors] += (
                self._coupling[self._coupled_rotors] * ddtheta[..., self._other_rotor]
            )
        return torques

    def accelerations(self, torques: FloatArray) -> FloatArray:
        """Return theta'' = B^-1 of the torques that accelerate the rotors."""
        accelerations: FloatArray = torques / self._inertia
        if self._coupled_rotors.size:
            coupled, other = self._coupled_rotors, self._other_rotor
            coupling_ratio = self._coupling[coupled] / self._inertia[other]
            effective_inertia = self._inertia[coupled] - coupling_ratio * self._coupling[coupled]
            accelerations[..., coupled] = (
                torques[..., coupled] - coupling_ratio * torques[..., other]
            ) / effective_inertia
        return accelerations

    def accelerations_with_held(self, torques: FloatArray, held: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Return theta'' with some motors held, and the holding torques, 0 for others; (..., motors)."""
        held_or_coupled = held.copy()
        held_or_coupled[..., self._coupled_rotors] |= held[..., self._other_rotor]
        free_accelerations = np.where(held_or_coupled, torques / self._inertia, self.accelerations(torques))
        accelerations = np.where(held, 0.0, free_accelerations)
        return accelerations, np.where(held, torques - self.torques(accelerations), 0.0)


SIDES = 2
"""Largest number of motors of a joint."""


class _SpringGroup(NamedTuple):
    """Joints of one `Actuator.spring_group`: their springs, and where the joints and motors are."""

    elasticity: Elasticity
    joints: IndexArray
    springs: IndexArray


class Drivetrain:
    """Motors of all joints, separated into those with springs and those that move their link directly.

    "Sprung" motors have springs; a rigid joint has one motor without. In shapes, `springs` are sprung motors.

    Attributes:
        present: Whether there is a motor, (joints, 2).
        sprung: Whether the motor acts through a spring, (motors,).
        joint: Index of the joint of each motor, (motors,).
        inertia, damping, max_torque: Constants of the motors, joint side of the gear, (motors,).
        rotors: Rotors of the motors with springs.
        friction: Dry friction of the motors, joint side; None without friction.
        windings: Constants of the windings; None if no torque constant is given.
        rigid: Whether the joint has no spring, (joints,).
        deflected: Whether there is a motor whose phi is a deflection, (joints, 2).
        chosen: Indices of the joints whose stiffness is commanded.
        spring_joint: Index of the joint of each sprung motor, (springs,).
        domain: Lowest and highest `ranged` for which each law holds, (2, springs).
    """

    def __init__(self, actuators: Sequence[Actuator]) -> None:
        motors = [(index, motor) for index, actuator in enumerate(actuators) for motor in actuator.motors]
        counts = [len(actuator.motors) for actuator in actuators]
        self.present = np.arange(SIDES) < np.array(counts)[:, None]
        self.joint = np.array([index for index, _ in motors])
        self.deflected = np.array([actuator.has_columns(VARIABLES["phi"]) for actuator in actuators])
        self.rigid = np.array([not actuator.sprung for actuator in actuators])
        self.sprung = ~self.rigid[self.joint]
        self.inertia, self.damping, self.max_torque = (
            np.stack([getattr(motor, name) for _, motor in motors])
            for name in ("inertia", "damping", "max_torque")
        )
        self.rotors = Rotors([actuator for actuator in actuators if actuator.sprung])
        self.friction = FrictionLaws.of([motor.friction for _, motor in motors])
        self.windings = Windings.of([motor for _, motor in motors])
        self.chosen = np.flatnonzero(["stiffness" in actuator.commanded for actuator in actuators])
        self.spring_joint = self.joint[self.sprung]
        self._rigid_joints = np.flatnonzero(self.rigid)
        groups = indices_of_equals([each.spring_group if each.sprung else None for each in actuators])
        self._groups = [self._make_group(joints, actuators) for group, joints in groups if group is not None]
        self._is_single_group = len(self._groups) == 1 and not self.rigid.any()
        sprung = [actuator for actuator in actuators if actuator.sprung]
        phi_limits = [np.stack(each) for actuator in sprung for each in actuator.phi_ranges]
        self.domain: FloatArray = np.stack(phi_limits).T if phi_limits else np.zeros((2, 0))

    def _make_group(self, joints: Sequence[int], actuators: Sequence[Actuator]) -> _SpringGroup:
        springs = np.stack([np.flatnonzero(self.spring_joint == joint) for joint in joints])
        group_actuators = [actuators[joint] for joint in joints]
        return _SpringGroup(type(group_actuators[0]).elasticity(group_actuators), np.array(joints), springs)

    def limited(self, torque: FloatArray) -> FloatArray:
        """Return the torques that the motors exert, (..., motors): commanded ones, at most the largest."""
        return np.clip(torque, -self.max_torque, self.max_torque)

    def of_motors(self, values: FloatArray) -> FloatArray:
        """Return (..., motors) from (..., joints, 2), whose entries without a motor are ignored."""
        return values[..., self.present]

    def of_joints(self, values: FloatArray) -> FloatArray:
        """Return (..., joints, 2) from (..., motors), NaN where there is no motor."""
        by_joint = np.full_like(values, np.nan, shape=(*values.shape[:-1], *self.present.shape))
        by_joint[..., self.present] = values
        return by_joint

    def of_motors_by_joint(self, sprung: FloatArray, rigid: FloatArray) -> FloatArray:
        """Return (..., joints, 2) from values of sprung motors, (..., springs), and of joints, (..., joints).

        Values of joints are used for motors without a spring.
        """
        return self.of_joints(self.of_all_motors(rigid, sprung))

    def of_rigid_joints(self, values: FloatArray) -> FloatArray:
        """Return the values of motors that move joints directly, (..., joints), else 0."""
        result = np.zeros_like(values, shape=(*values.shape[:-1], len(self.rigid)))
        if self._rigid_joints.size:
            result[..., self._rigid_joints] = values[..., ~self.sprung]
        return result

    def of_all_motors(self, rigid: FloatArray, sprung: FloatArray) -> FloatArray:
        """Return (..., motors) from values of motors with springs, and of joints for the other motors."""
        values = rigid[..., self.joint]
        values[..., self.sprung] = sprung
        return values

    def ranged(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return the coordinates that `domain` bounds, (..., springs), at positions of joints and motors."""
        coordinates_of_groups = [
            elasticity.ranged(*positions) for elasticity, positions in self._group_positions(q, theta)
        ]
        return self.of_springs(coordinates_of_groups, theta)

    def torques(self, q: FloatArray, theta: FloatArray) -> SpringTorques:
        """Return the torques of the springs: on links, (..., joints), and against motors, (..., springs)."""
        parts = [elasticity.torques(coordinates) for elasticity, coordinates in self.at(q, theta)]
        return SpringTorques(
            self.by_joint([group_torques.tau_e for group_torques in parts], q),
            self.of_springs([group_torques.tau_transmission for group_torques in parts], theta),
        )

    def energy(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return the elastic energy of each joint, (..., joints)."""
        return self.by_joint(
            [elasticity.energy(coordinates) for elasticity, coordinates in self.at(q, theta)], q
        )

    def stiffness(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return the stiffness (11) of the joints, (..., joints), 0 without springs."""
        return self.by_joint([elasticity.state(at).stiffness for elasticity, at in self.at(q, theta)], q)

    def determinant(self, q: FloatArray, theta: FloatArray) -> FloatArray:
        """Return det A (67), (..., joints), NaN where no stiffness is commanded."""
        determinants = self.by_joint(
            [elasticity.state(at).determinant for elasticity, at in self.at(q, theta)], q
        )
        return np.where(self.rigid, np.nan, determinants)

    def state(self, q: FloatArray, theta: FloatArray, dq: FloatArray, dtheta: FloatArray) -> DrivetrainState:
        """Return the springs with their derivatives, at positions and velocities of joints and motors."""
        states = [elasticity.state(coordinate_rates) for elasticity, coordinate_rates in self.at(q, theta)]
        rates = [
            [coordinate_rates[..., coordinate] for coordinate in range(coordinate_rates.shape[-1])]
            for _, coordinate_rates in self.at(dq, dtheta)
        ]
        return DrivetrainState(self, q, theta, list(zip(states, rates, strict=True)))

    def of_groups(self, values: FloatArray) -> list[FloatArray]:
        """Return the part of each group of actuators, (..., joints), of (..., joints)."""
        return [values if self._is_single_group else values[..., group.joints] for group in self._groups]

    def by_joint(self, parts: Sequence[FloatArray], template: FloatArray) -> FloatArray:
        """Return (..., joints) from the parts of the groups; 0 for joints without springs."""
        if self._is_single_group:
            return parts[0]
        result = np.zeros_like(template)
        for group, values in zip(self._groups, parts, strict=True):
            result[..., group.joints] = values
        return result

    def of_springs(self, parts: Sequence[FloatArray], template: FloatArray) -> FloatArray:
        """Return (..., springs) from the parts of the groups, (..., joints, motors)."""
        if self._is_single_group:
            return parts[0].reshape(*template.shape)
        result = np.empty_like(template)
        for group, values in zip(self._groups, parts, strict=True):
            result[..., group.springs] = values
        return result

    def by_motor(self, parts: Sequence[Components], template: FloatArray) -> FloatArray:
        """Return (..., springs) from the parts of the groups, one array (..., joints) for each motor."""
        result = np.empty_like(template)
        for group, rows in zip(self._groups, parts, strict=True):
            for motor, of_motor in enumerate(rows):
                springs = slice(motor, None, len(rows)) if self._is_single_group else group.springs[:, motor]
                result[..., springs] = of_motor
        return result

    def at(self, q: FloatArray, theta: FloatArray) -> list[tuple[Elasticity, FloatArray]]:
        """Return the springs of each group with their coordinates (..., joints, coordinates), or rates."""
        return [
            (elasticity, elasticity.coordinates(*positions))
            for elasticity, positions in self._group_positions(q, theta)
        ]

    def _group_positions(
        self, q: FloatArray, theta: FloatArray
    ) -> Iterator[tuple[Elasticity, tuple[FloatArray, FloatArray]]]:
        """Yield the springs of each group with the positions of joints and motors, (..., joints, motors)."""
        for group, group_q in zip(self._groups, self.of_groups(q), strict=True):
            if self._is_single_group:
                group_theta = theta.reshape(*theta.shape[:-1], *group.springs.shape)
            else:
                group_theta = theta[..., group.springs]
            yield group.elasticity, (group_q, group_theta)


class DrivetrainState:
    """The springs of all joints at positions and velocities of joints and motors.

    Values of joints are (..., joints), 0 where there are no springs, those of motors (..., springs).
    """

    def __init__(
        self,
        drivetrain: Drivetrain,
        q: FloatArray,
        theta: FloatArray,
        states_and_rates: Sequence[tuple[ElasticState, Components]],
    ) -> None:
        self._drivetrain, self._q, self._theta, self._states_and_rates = (
            drivetrain,
            q,
            theta,
            states_and_rates,
        )

    @property
    def tau_e(self) -> FloatArray:
        """Elastic torque (6)."""
        return self._drivetrain.by_joint([state.tau_e for state, _ in self._states_and_rates], self._q)

    @property
    def dtau_e(self) -> FloatArray:
        """Rate of the elastic torque (17)."""
        return self._drivetrain.by_joint(
            [state.torque_rate(rates) for state, rates in self._states_and_rates], self._q
        )

    @property
    def stiffness(self) -> FloatArray:
        """Stiffness of the joints (11)."""
        return self._drivetrain.by_joint([state.stiffness for state, _ in self._states_and_rates], self._q)

    @property
    def dstiffness(self) -> FloatArray:
        """Rate of the stiffness (18)."""
        return self._drivetrain.by_joint(
            [state.stiffness_rate(rates) for state, rates in self._states_and_rates], self._q
        )

    @property
    def tau_transmission(self) -> FloatArray:
        """Torque against each motor (62)."""
        return self._drivetrain.by_motor(
            [state.tau_transmission for state, _ in self._states_and_rates], self._theta
        )

    def motor_accelerations(
        self, ddq: FloatArray, ddtau_e: FloatArray, ddstiffness: FloatArray
    ) -> FloatArray:
        """Return the motor accelerations for these second derivatives of torque and stiffness, (70)-(72).

        Args:
            ddq: Acceleration of the joints.
            ddtau_e: Second derivative of the elastic torque.
            ddstiffness: Second derivative of the stiffness; ignored where it is not commanded.
        """
        demands = zip(*map(self._drivetrain.of_groups, (ddq, ddtau_e, ddstiffness)), strict=True)
        accelerations = [
            state.motor_accelerations(rates, *demand)
            for (state, rates), demand in zip(self._states_and_rates, demands, strict=True)
        ]
        return self._drivetrain.by_motor(accelerations, self._theta)
