"""The full model of an arm, from the potentials of its springs alone; shares no code with what it judges.

    M(q) q'' + n(q, q') + D q' + f(q') + d q' = -U_q + sum_k d_k (theta_k' - q')
    B theta'' + D_m theta' + f_m(theta') + U_theta + d_k (theta_k' - q') = tau_motor

U(q, theta_1[, theta_2]) is the energy of the springs of a joint, B the 2x2 matrix of its rotors, d the damper
between the links and d_k those beside the transmissions, f whatever friction there is. The links come from
Lagrange's equations, the derivatives from sympy, the motion from an integrator of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import sympy
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

Array = npt.NDArray[np.float64]
Potential = Callable[..., Any]
"""U(q, theta_1) or U(q, theta_1, theta_2), of sympy's expressions."""

OfVelocity = Callable[[float], float]
OfTime = Callable[[float], float]

RTOL, ATOL = 1e-13, 1e-14
"""Of the integration; a thousand times finer than what is to be shown, 1e-9."""

SPLINE_DEGREE = 7
"""Of the torques between their samples: the error is h^8 of what changes within a tenth of a second."""


class Springs(NamedTuple):
    """What springs do at q and theta: -tau_e, U over each theta, and the stiffness."""

    link: float
    motors: Sequence[float]
    stiffness: float


def springs_of(potential: Potential, motors: int) -> Callable[..., Springs]:
    """The springs of a potential, as a function of q and each theta; numbers, or arrays of one shape."""
    q, *theta = variables = sympy.symbols(f"q theta_1:{motors + 1}", real=True)
    energy = potential(*variables)
    wanted = [energy.diff(q), [energy.diff(each) for each in theta], energy.diff(q, 2)]
    of_numbers = sympy.lambdify(variables, wanted, "math", cse=True)
    of_arrays = sympy.lambdify(variables, wanted, "numpy", cse=True)
    return lambda *at: Springs(*(of_numbers if isinstance(at[0], float) else of_arrays)(*at))


@dataclass(frozen=True)
class Drive:
    """What drives a joint.

    Attributes:
        inertia: B, (motors, motors).
        damping: D_m of each motor.
        springs: at q and each theta, None if the motor moves the link directly; see `springs_of`.
        friction: f_m of each motor, none if empty.
        damper: d between the links, over time.
        transmission_dampers: d_k beside each transmission over time, none if empty.
    """

    inertia: npt.ArrayLike
    damping: Sequence[float]
    springs: Callable[..., Springs] | None = None
    friction: Sequence[OfVelocity] = ()
    damper: OfTime | None = None
    transmission_dampers: Sequence[OfTime] = ()

    @property
    def motors(self) -> int:
        """Coordinates that the motors add to the joint's."""
        return len(self.damping) if self.springs else 0

    @cached_property
    def mobility(self) -> Array:
        """B^-1."""
        return np.linalg.inv(np.atleast_2d(self.inertia))

    def resistance(self, dtheta: Sequence[float]) -> list[float]:
        """D_m theta' + f_m(theta')."""
        frictions = self.friction or [lambda _: 0.0] * len(self.damping)
        each = zip(self.damping, frictions, dtheta, strict=True)
        return [damping * rate + friction(rate) for damping, friction, rate in each]


@dataclass(frozen=True)
class PlanarArm:
    """Links in a vertical plane, each joint's angle measured from the link before, the first from the x axis.

    Attributes:
        lengths: from joint to joint, m.
        masses: kg.
        centers: of mass, from the link's own joint, m.
        inertias: about the centers, kg m^2.
        damping: between the links, N m s/rad.
        friction: f of each joint, none if empty.
        gravity: m/s^2, along -y.
    """

    lengths: Sequence[float]
    masses: Sequence[float]
    centers: Sequence[float]
    inertias: Sequence[float]
    damping: Sequence[float]
    friction: Sequence[OfVelocity] = ()
    gravity: float = 9.81

    @cached_property
    def dynamics(self) -> Callable[..., tuple[list[list[float]], list[float]]]:
        """M and n of all q, then all q', by Lagrange's equations."""
        joints = len(self.lengths)
        q, dq = (sympy.symbols(f"{name}1:{joints + 1}", real=True) for name in ("q", "dq"))
        angle, turn, foot, energy, weight = 0, 0, sympy.Matrix([0, 0]), 0, 0
        for i in range(joints):
            angle, turn = angle + q[i], turn + dq[i]
            along = sympy.Matrix([sympy.cos(angle), sympy.sin(angle)])
            center = foot + self.centers[i] * along
            velocity = center.jacobian(q) * sympy.Matrix(dq)
            energy += self.masses[i] * velocity.dot(velocity) / 2 + self.inertias[i] * turn**2 / 2
            weight += self.masses[i] * self.gravity * center[1]
            foot += self.lengths[i] * along
        mass = sympy.hessian(energy, dq)
        momentum = sympy.Matrix([energy]).jacobian(dq)
        bias = momentum.jacobian(q) * sympy.Matrix(dq) - sympy.Matrix([energy - weight]).jacobian(q).T
        return sympy.lambdify((*q, *dq), (mass.tolist(), list(bias)), "math", cse=True)


class Followed(NamedTuple):
    """q and stiffness (joints, samples), theta (joints, 2, samples); NaN where there is none."""

    q: Array
    theta: Array
    stiffness: Array


@dataclass(frozen=True)
class FullModel:
    """An arm with a drive at each joint."""

    arm: PlanarArm
    drives: Sequence[Drive]
    _slices: list[slice] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        ends = np.cumsum([len(self.drives), *(drive.motors for drive in self.drives)]).tolist()
        self._slices.extend(slice(*each) for each in pairwise(ends))

    def follow(
        self, time: Array, torque: Array, q: Array, theta: Array, dq: Array, dtheta: Array
    ) -> Followed:
        """The motion under motor torques.

        Args:
            time: (samples,), s.
            torque: of the motors, (samples, joints, 2), NaN where there is none.
            q, theta, dq, dtheta: where it starts, (joints,) and (joints, 2).
        """
        held = [np.arange(len(drive.damping)) for drive in self.drives]
        columns = np.concatenate([torque[:, joint, motors] for joint, motors in enumerate(held)], axis=1)
        given = make_interp_spline(time, columns, k=SPLINE_DEGREE)
        start = [self._packed(q, theta), self._packed(dq, dtheta)]
        size = len(start[0])

        def rates(at: float, y: Array) -> Array:
            return np.concatenate((y[size:], self._accelerations(at, y[:size], y[size:], given(at))))

        found = solve_ivp(rates, time[[0, -1]], np.concatenate(start), "DOP853", time, rtol=RTOL, atol=ATOL).y
        return self._followed(found[:size])

    def _packed(self, of_joints: Array, of_motors: Array) -> Array:
        parts = [of_motors[joint, : drive.motors] for joint, drive in enumerate(self.drives)]
        return np.concatenate((of_joints, *parts))

    def _followed(self, positions: Array) -> Followed:
        q = positions[: len(self.drives)]
        theta = np.full((len(q), 2, q.shape[1]), math.nan)
        stiffness = np.full_like(q, math.nan)
        for joint, (drive, motors) in enumerate(zip(self.drives, self._slices, strict=True)):
            if drive.springs:
                theta[joint, : drive.motors] = positions[motors]
                stiffness[joint] = drive.springs(q[joint], *positions[motors]).stiffness
        return Followed(q, theta, stiffness)

    def _accelerations(self, time: float, at: Array, rate: Array, torque: Array) -> Array:
        """Of the joints, then of the motors with springs."""
        joints = len(self.drives)
        q, dq = at[:joints].tolist(), rate[:joints].tolist()
        mass, bias = self.arm.dynamics(*q, *dq)
        accelerations, force, of_motor = np.empty_like(at), [-each for each in bias], torque.tolist()
        for i, drive in enumerate(self.drives):
            mine, of_motor = of_motor[: len(drive.damping)], of_motor[len(drive.damping) :]
            theta, dtheta = at[self._slices[i]].tolist(), rate[self._slices[i]].tolist()
            force[i] -= self.arm.damping[i] * dq[i]
            if self.arm.friction:
                force[i] -= self.arm.friction[i](dq[i])
            if drive.damper:
                force[i] -= drive.damper(time) * dq[i]
            if drive.springs is None:
                force[i] += mine[0] - drive.resistance(dq[i : i + 1])[0]
                mass[i][i] += float(np.squeeze(drive.inertia))
                continue
            springs = drive.springs(q[i], *theta)
            force[i] -= springs.link
            left = [a - b - c for a, b, c in zip(mine, springs.motors, drive.resistance(dtheta), strict=True)]
            for motor, damper in enumerate(drive.transmission_dampers):
                passed = damper(time) * (dtheta[motor] - dq[i])
                left[motor] -= passed
                force[i] += passed
            accelerations[self._slices[i]] = drive.mobility @ left
        accelerations[:joints] = np.linalg.solve(mass, force)
        return accelerations
