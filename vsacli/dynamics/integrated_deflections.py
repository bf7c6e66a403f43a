"""Deflections by integration of (19)-(20) from the root of (14) at the first sample.

Buondonno & De Luca (2016), III-B, warn of the drift. SciPy's DOP853 integrates the pieces between breakpoints
of the trajectory, all joints together; where a joint cannot be integrated further, the others are restarted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt
import scipy

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.drivetrain import SIDES
from vsacli.actuators.laws.law import PairSolution
from vsacli.actuators.reach import reach_flags
from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FloatArray
from vsacli.base.flags import Flag, has_flag
from vsacli.base.signals import STIFFNESS
from vsacli.dynamics.inverse import DeflectionStop, command_of, link_torques_along
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from scipy.integrate import DOP853, DenseOutput, OdeSolution


REASONS = (
    "",
    "its decoupling matrix becomes singular",
    "its stiffness leaves the range that its springs can reach",
    "the integration cannot go on",
)
FOLLOWED, SINGULAR, UNATTAINABLE, STALLED = range(len(REASONS))


def integrable(joint: Joint) -> bool:
    """Return whether (19) applies to a joint; with a parallel damper, deflections are integrated anyway."""
    return STIFFNESS.key in joint.actuator.commanded and joint.damper_at("transmission") is None


class DeflectionEquation:
    """A robot and its commanded motion; deflections are (joints, 2, samples).

    Attributes:
        trajectory: Commanded motion.
        joints: Joints whose deflections can be integrated, by index.
    """

    def __init__(self, robot: Robot, trajectory: Trajectory) -> None:
        self.trajectory = trajectory
        self._robot = robot
        self._actuators = {
            index: joint.actuator for index, joint in enumerate(robot.joints) if integrable(joint)
        }
        self.joints = tuple(self._actuators)

    def roots(self, joints: tuple[int, ...], time: FloatArray) -> FloatArray:
        """Return the roots of (14) of some joints."""
        return np.stack(
            [
                _deflection_root(actuator, command).deflections
                for actuator, command in self._commands(joints, time)
            ]
        )

    def rates(self, joints: tuple[int, ...], time: FloatArray, phi: FloatArray) -> FloatArray:
        """Return the rates of the deflections of some joints, (19)."""
        return np.stack(
            [
                _rates_of_unknowns(actuator, command, joint_phi)
                for (actuator, command), joint_phi in zip(self._commands(joints, time), phi, strict=True)
            ]
        )

    def stop_reasons(
        self, joints: tuple[int, ...], time: FloatArray, phi: FloatArray
    ) -> npt.NDArray[np.intp]:
        """Return why deflections of some joints cannot be integrated at times: indices into `REASONS`."""
        return np.stack(
            [
                _stop_reasons(actuator, command, joint_phi)
                for (actuator, command), joint_phi in zip(self._commands(joints, time), phi, strict=True)
            ]
        )

    def _commands(self, joints: tuple[int, ...], time: FloatArray) -> Iterator[tuple[Actuator, Command]]:
        """Yield the commands of some joints, from one pass of the recursion."""
        motion = self.trajectory.at(time)
        commanded = {**motion.variables(), **link_torques_along(self._robot, motion)}
        for joint in joints:
            yield self._actuators[joint], command_of(joint, commanded)


def _deflection_root(actuator: Actuator, command: Command) -> PairSolution:
    return actuator.solve(command.tau_e, command.commanded["stiffness"], command.q)


def _rates_of_unknowns(actuator: Actuator, command: Command, phi: FloatArray) -> FloatArray:
    dstiffness = command.commanded[STIFFNESS.names[1]]
    return np.stack(actuator.springs(phi, command.q).rates(command.dtau_e, dstiffness, command.dq)[:SIDES])


def _stop_reasons(actuator: Actuator, command: Command, phi: FloatArray) -> npt.NDArray[np.intp]:
    """Return indices into `REASONS`; also singular where det A has another sign than on the branch."""
    solution = _deflection_root(actuator, command)
    flags = reach_flags(command.commanded["stiffness"], solution)
    sign, branch_sign = (
        np.sign(actuator.springs(deflections, command.q).determinant)
        for deflections in (phi, solution.deflections)
    )
    singular = has_flag(flags, Flag.SINGULAR) | (sign != branch_sign)
    return np.where(has_flag(flags, Flag.INFEASIBLE), UNATTAINABLE, np.where(singular, SINGULAR, FOLLOWED))


MOST_PIECES = 500
"""Largest number of pieces into which a trajectory is divided; recordings have more breakpoints."""

ROUGH_TOLERANCE = 1e-6
"""Smallest tolerance of pieces with breakpoints inside. A tighter one is out of reach because of rounding in
the spline's third derivative, 1e-16 over the cube of the sample distance. Pieces are so short that the drift
of smooth recordings is far smaller."""

CHECKS_PER_STEP = 64
"""Number of times in an integrator step at which a joint is checked; the search for the end divides by it."""


class Pieces(NamedTuple):
    """Pieces of a trajectory that are integrated one after the other.

    Attributes:
        ends: Ends of the pieces, ascending, s.
        tolerance: Relative tolerance of the integrator.
    """

    ends: FloatArray
    tolerance: float

    @classmethod
    def of(cls, trajectory: Trajectory, tolerance: float) -> Pieces:
        """Return the pieces between all breakpoints, or between some of them if they are too many."""
        ends = trajectory.breakpoints[1:]
        if len(ends) <= MOST_PIECES:
            return cls(ends, tolerance)
        indices = np.linspace(0, len(ends) - 1, MOST_PIECES + 1).round().astype(np.intp)[1:]
        return cls(ends[indices], max(tolerance, ROUGH_TOLERANCE))


class Integration:
    """Integration of the deflections of some joints from a start time, until one of them stops.

    Args:
        equation: Robot and motion.
        joints: Indices of the joints.
        pieces: Pieces of the whole trajectory.
        start: Time of the deflections, s.
        phi: Deflections, (joints, 2).

    Attributes:
        joints: Indices of the joints.
        times: Ends of the integrator's steps, s.
        stopped: Reasons of the joints that ended the integration at the last of `times`, by index.
    """

    def __init__(
        self,
        equation: DeflectionEquation,
        joints: tuple[int, ...],
        pieces: Pieces,
        start: float,
        phi: FloatArray,
    ) -> None:
        self.joints = joints
        self.times = [start]
        self.stopped: dict[int, str] = {}
        self._equation = equation
        self._steps: list[DenseOutput] = []
        self._tolerance = pieces.tolerance
        self._smallest_phi = float(np.abs(phi).max(axis=1).min())
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):  # in rejected steps
            self._integrate_pieces(pieces.ends[pieces.ends > start].tolist(), phi.ravel())

    def solution(self) -> OdeSolution:
        """Return the deflections as a function of time, (2 joints, samples)."""
        return scipy.integrate.OdeSolution(self.times, self._steps)

    def _rates(self, time: float, phi_rows: Any) -> Any:
        return self._equation.rates(
            self.joints, np.array([time]), deflections_by_joint(phi_rows[:, None])
        ).ravel()

    def _integrate_pieces(self, ends: list[float], state: FloatArray) -> None:
        for end in ends:
            start = self.times[-1]
            integrator = scipy.integrate.DOP853(
                self._rates,
                start,
                state,
                end,
                first_step=end - start
                if len(ends) > 1
                else None,  # pieces are short, a whole trajectory is not
                rtol=self._tolerance,
                atol=self._tolerance * self._smallest_phi,
            )
            self._integrate_piece(integrator)
            if self.stopped:
                return
            state = integrator.y

    def _integrate_piece(self, integrator: DOP853[np.float64]) -> None:
        while integrator.status == "running" and not self.stopped:
            if integrator.step() is not None:
                self.stopped = {self._fastest(integrator): REASONS[STALLED]}
            else:
                step = integrator.dense_output()
                self._steps.append(step)
                self.times.append(self._end_of_step(step, self.times[-1], float(integrator.t)))

    def _end_of_step(self, step: DenseOutput, left: float, right: float) -> float:
        """Return the end of a step, or the first time in it at which a joint cannot be integrated."""
        while right - left > 4 * np.spacing(abs(right)):
            times = np.linspace(left, right, CHECKS_PER_STEP + 1)
            reason_indices = self._equation.stop_reasons(
                self.joints, times[1:], deflections_by_joint(step(times[1:]))
            )
            stopped = np.flatnonzero(reason_indices.any(axis=0))
            if not stopped.size:
                break
            left, right = float(times[stopped[0]]), float(times[stopped[0] + 1])
            reasons = zip(self.joints, reason_indices[:, stopped[0]].tolist(), strict=True)
            self.stopped = {joint: REASONS[reason] for joint, reason in reasons if reason}
        return right

    def _fastest(self, integrator: DOP853[np.float64]) -> int:
        """Return the joint with the fastest relative change of deflections: it makes the steps short."""
        phi = integrator.y
        speed = np.abs(self._rates(float(integrator.t), phi)) / np.abs(phi)
        return self.joints[int(np.nan_to_num(speed, nan=np.inf).argmax()) // 2]


def deflections_by_joint(state: FloatArray) -> FloatArray:
    """Return the integrator's state (2 joints, samples) as (joints, 2, samples)."""
    return state.reshape(-1, 2, state.shape[1])


TOLERANCE = 1e-12
"""Relative tolerance of the integrator; the drift is about as large."""


class _IntegratedPart(NamedTuple):
    """Deflections of some joints over a part of the trajectory."""

    joints: list[int]
    solution: OdeSolution


@dataclass(frozen=True)
class IntegratedDeflections:
    """Deflections along a trajectory, from `integrate_deflections`.

    Attributes:
        stops: For each joint, the time at which its integration ends before the trajectory, or None.
    """

    stops: tuple[DeflectionStop | None, ...]
    _parts: tuple[_IntegratedPart, ...] = field(repr=False)
    _start: float

    def at(self, time: FloatArray) -> FloatArray:
        """Return the deflections of all joints at times within the trajectory, (joints, 2, samples).

        NaN from a stop on, and for joints whose stiffness is not commanded.
        """
        phi = np.full((len(self.stops), 2, len(time)), np.nan)
        elapsed = time - self._start
        for part in self._parts:
            in_part = (part.solution.t_min <= elapsed) & (elapsed <= part.solution.t_max)
            if in_part.any():
                for joint, deflections in zip(
                    part.joints, deflections_by_joint(part.solution(elapsed[in_part])), strict=True
                ):
                    phi[joint][:, in_part] = deflections
        for joint, stop in enumerate(self.stops):
            if stop is not None:
                phi[joint, :, time >= stop.time] = np.nan
        return phi


def integrate_deflections(
    robot: Robot, trajectory: Trajectory, tolerance: float = TOLERANCE
) -> IntegratedDeflections:
    """Integrate phi' = A(phi)^-1 (tau_e', sigma') (19) from the root of (14) at the first sample.

    The integration uses the smooth functions of the trajectory and ignores derivatives given with samples.
    For a joint it ends where A becomes singular or the stiffness is unattainable; the other joints continue.
    Only joints with a commanded stiffness have deflections to integrate.

    Args:
        robot: Robot.
        trajectory: Commanded motion.
        tolerance: Relative tolerance of the integrator, at least 1e-13.
    """
    start, trajectory = trajectory.start, trajectory.from_zero()
    equation = DeflectionEquation(robot, trajectory)
    if not equation.joints:
        return IntegratedDeflections((None,) * trajectory.joints, (), start)
    time, end = trajectory.times.span
    pieces = Pieces.of(trajectory, tolerance)
    phi = np.full((trajectory.joints, SIDES, 1), np.nan)
    phi[list(equation.joints)] = equation.roots(equation.joints, np.array([time]))
    reason_indices = equation.stop_reasons(equation.joints, np.array([time]), phi[list(equation.joints)])[
        :, 0
    ]
    reasons = zip(equation.joints, reason_indices.tolist(), strict=True)
    stops = {joint: DeflectionStop(start + time, REASONS[reason]) for joint, reason in reasons if reason}
    parts = []
    while time < end and len(stops) < len(equation.joints):
        remaining = [joint for joint in equation.joints if joint not in stops]
        integration = Integration(equation, tuple(remaining), pieces, time, phi[remaining, :, 0])
        if integration.times[-1] > time:
            time = integration.times[-1]
            parts.append(_IntegratedPart(remaining, integration.solution()))
            phi[remaining] = deflections_by_joint(parts[-1].solution(np.array([time])))
        stops |= {
            joint: DeflectionStop(start + time, reason) for joint, reason in integration.stopped.items()
        }
    return IntegratedDeflections(tuple(map(stops.get, range(trajectory.joints))), tuple(parts), start)
