"""Torques along noisy records of one joint: how right they are, and what is said of them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from oracles.one_joint import Arm, motor_torque
from scipy.interpolate import make_interp_spline

from samples.noisy_records import MOTIONS, Record, record
from samples.random_recordings import Recording
from vsacli import (
    Antagonistic,
    DenavitHartenberg,
    Elastic,
    Inertia,
    Joint,
    Link,
    Motion,
    Motor,
    Robot,
    Trajectory,
    inverse_dynamics,
    laws,
    motor_torques,
)
from vsacli.base.signals import STIFFNESS
from vsacli.trajectory.curves import ConstantProfile

STIFFNESS_ASKED = 1200.0
"""Of the antagonistic arm, N m/rad."""


class Error(NamedTuple):
    """How wrong a variable is, and what is said of it, away from the unreliable ends of the record.

    Attributes:
        size: of the error, root mean square, relative to the variable; of the motor with the larger one.
        stated: deviation, likewise; NaN if none is stated.
        covered: share of the steps whose error is within two deviations; NaN if none is stated.
    """

    size: float
    stated: float
    covered: float


class Outcome(NamedTuple):
    """What a run along a record says, and what is true.

    Attributes:
        arm: its name.
        verdict: of the run.
        bound: what `tau_motor` is at most wrong by, as the report says.
        torque: error of `tau_motor`.
        fourth: error of d4q.
        warned: whether a warning speaks of d4q.
    """

    arm: str
    verdict: str
    bound: float
    torque: Error
    fourth: Error
    warned: bool


def lifting(actuator, *, horizontal: bool = False) -> Robot:
    """One joint that lifts a link, or turns it in a horizontal plane, of the size of an elbow."""
    link = Link(mass=5.0894, com=(-0.15, 0, 0), inertia=Inertia(xx=0.0104, yy=0.0434, zz=0.0434))
    joint = Joint(
        name="elbow",
        type="revolute",
        dh=DenavitHartenberg(a=0.3, alpha=0),
        link=link,
        damping=1e-5,
        actuator=actuator,
    )
    gravity = (0, 0, -9.81) if horizontal else (0, -9.81, 0)
    return Robot(name="arm", gravity=gravity, joints=(joint,))


MOTOR, SPRING = Motor(inertia=1.98, damping=1e-4), laws.Cubic(k=400, k_c=2000)
ARMS = {
    "antagonistic": lifting(Antagonistic(motor=(MOTOR, MOTOR), spring=(SPRING, SPRING))),
    "elastic": lifting(Elastic(motor=MOTOR, stiffness=1000.0)),
    "soft": lifting(Elastic(motor=Motor(inertia=0.3, damping=1e-4), stiffness=60.0)),
    "softest": lifting(Elastic(motor=MOTOR, stiffness=2.0), horizontal=True),
}
"""From one whose preload outweighs the motion to one whose torque is little else than d4q."""


class Verdict(NamedTuple):
    """What a run along a random recording says, and how right it is.

    Attributes:
        verdict: of the run.
        torque: error of `tau_motor`.
    """

    verdict: str
    torque: Error


def robot_of(arm: Arm) -> Robot:
    """Return the robot of a random recording."""
    motor = Motor(inertia=arm.motor_inertia, damping=1e-4)
    if not arm.antagonistic:
        return lifting(Elastic(motor=motor, stiffness=arm.k), horizontal=arm.horizontal)
    spring = laws.Cubic(k=arm.k, k_c=arm.k_c)
    return lifting(Antagonistic(motor=(motor, motor), spring=(spring, spring)), horizontal=arm.horizontal)


def judge(recording: Recording) -> Verdict:
    """Compute motor torques along a random recording, and compare them with the truth in closed form."""
    q, stiffness = recording.position.recorded[:, None], recording.stiffness
    firm = {} if stiffness is None else {"stiffness": stiffness.recorded[:, None]}
    trajectory = Trajectory.from_samples(recording.time, q, **firm)
    result = inverse_dynamics(robot_of(recording.arm), trajectory)
    true = motor_torque(recording.arm, *recording.truth).T
    starts, ends = zip(*(each.fit.unreliable for each in trajectory.estimates.values()), strict=True)
    time = recording.time
    inside = (time >= min(max(starts), time[-1] / 4)) & (time <= time[-1] - min(max(ends), time[-1] / 4))
    torque, deviation = (
        getattr(result, name)[inside, 0, : true.shape[1]] for name in ("tau_motor", "tau_motor_std")
    )
    return Verdict(result.report.verdict, _error(torque, deviation, true[inside]))


def outcomes(motion: str, color: str, seed: int, rate: int) -> Iterator[Outcome]:
    """Of each arm along a record."""
    of = record(MOTIONS[motion], color, seed, rate)
    recorded = Trajectory.from_samples(of.time, of.values[:, None])
    firm = ConstantProfile(signal=STIFFNESS, span=(0.0, recorded.duration), value=(STIFFNESS_ASKED,))
    exact = _exact_motion(of, motion, seed)
    (estimate,) = recorded.estimates.values()
    start, end = estimate.fit.parts[0].inside
    inside = (of.time >= start) & (of.time <= end)
    for name, robot in ARMS.items():
        chosen = {"stiffness": firm} if name == "antagonistic" else {}
        trajectory = Trajectory(recorded.times, recorded.position, chosen, name=motion)
        result = inverse_dynamics(robot, trajectory)
        true = motor_torques(robot, exact)
        motors = slice(robot.joints[0].actuator.motor_count)
        torque, deviation, fourth, of_fourth = (
            getattr(result, variable)[inside, 0]
            for variable in ("tau_motor", "tau_motor_std", "d4q", "d4q_std")
        )
        report = result.report
        yield Outcome(
            arm=name,
            verdict=report.verdict,
            bound=report.joints[0].uncertainty.variables["tau_motor"].bound,
            torque=_error(torque[:, motors], deviation[:, motors], true.tau_motor[inside, 0, motors]),
            fourth=_error(fourth[:, None], of_fourth[:, None], of.truth[1][inside, None]),
            warned=any(each.startswith(("d4q of", "q of")) for each in report.warnings),
        )


def _error(found: np.ndarray, deviation: np.ndarray, true: np.ndarray) -> Error:
    size = np.sqrt(np.mean(true**2, axis=0))
    error, stated = (np.sqrt(np.mean(each**2, axis=0)) / size for each in (found - true, deviation))
    covered = np.mean(np.abs(found - true) <= 2 * deviation)
    return Error(error.max(), stated.max(), np.nan if np.isnan(stated).any() else covered)


def _exact_motion(of: Record, motion: str, seed: int) -> Motion:
    """What was recorded, with all derivatives: those of a spline through exact values at 2 kHz.

    It gives the impulses of minimum jerk the length of such a step. Else d4q is exact: the spline's rounding
    error is some 5 % of a slow one.
    """
    fine = np.linspace(0, of.time[-1], 20_001)
    spline = make_interp_spline(fine, MOTIONS[motion](fine, seed)[0], k=9)
    names = ("q", "dq", "ddq", "d3q", "d4q")
    arrays = {name: spline(of.time, nu=order)[:, None] for order, name in enumerate(names)}
    if motion != "minimum jerk":
        arrays["d4q"] = of.truth[1][:, None]
    still = np.zeros((len(of.time), 1))
    arrays |= {"stiffness": still + STIFFNESS_ASKED, "dstiffness": still, "ddstiffness": still}
    return Motion.of(of.time, arrays)
