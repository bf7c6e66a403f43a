"""One rule for limits at samples and between them, with limits at the float neighbors of peaks.

A value is beyond its limit if it is outside by more than 1e-9 of the larger bound. A run with a limit that is
tighter by one float may not be judged better, and what its report states as beyond a limit counts.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from samples.command_line import REPOSITORY, Outcome
from samples.marks import exhaustive, needs_compiler
from samples.shipped import shipped_robot
from scipy.optimize import minimize_scalar

from vsacli import Flag, Limits, Report, Robot, Trajectory, motor_torques
from vsacli.actuators.reach import LimitCheck
from vsacli.analysis.run import Run
from vsacli.base.flags import LIMITS, has_flag
from vsacli.base.signals import POSITION, STIFFNESS
from vsacli.dynamics.limits import worst_excess
from vsacli.trajectory.curves.sinusoids import Sinusoids
from vsacli.trajectory.times import UniformTimes

ROBOTS = ("vsa_3r", "mixed_3r", "rp_2", "measured_1r", "hardening_1r", "coupled_1r", "tendon_1r", "cam_1r")

BOUNDED = {
    "q": Flag.POSITION_LIMIT,
    "dq": Flag.VELOCITY_LIMIT,
    "stiffness": Flag.STIFFNESS_LIMIT,
    "phi": Flag.DEFLECTION_LIMIT,
    "dtheta": Flag.MOTOR_VELOCITY_LIMIT,
    "tau_motor": Flag.MOTOR_TORQUE_LIMIT,
}
OF_JOINT = {"q": "position", "dq": "velocity", "stiffness": "stiffness"}
OF_MOTOR = {"dtheta": "max_velocity", "tau_motor": "max_torque"}

TOLERANCE = 1e-9
"""The rule: share of the larger bound."""

UNDECIDED = 1e-12
"""Distance from bound plus tolerance, as a share of it, within which rounding may decide."""


class Task(NamedTuple):
    """A robot without limits on a motion, and the quantity of a joint that will have one."""

    robot: Robot
    trajectory: Trajectory
    joint: int
    name: str

    def size(self, times: np.ndarray) -> np.ndarray:
        """The size of the quantity, of motors the larger one, (times,)."""
        values: np.ndarray = getattr(motor_torques(self.robot, self.trajectory.at(times)), self.name)
        values = np.abs(values[:, self.joint])
        return values if values.ndim == 1 else np.fmax.reduce(values, axis=1)

    def limited(self, bound: float) -> Robot:
        """The robot with a bound of the quantity's size."""
        joint = self.robot.joints[self.joint]
        actuator = joint.actuator
        if self.name in OF_JOINT:
            lowest = 0.0 if self.name == "stiffness" else -bound
            joint = dataclasses.replace(joint, limits=Limits(**{OF_JOINT[self.name]: (lowest, bound)}))
        elif self.name in OF_MOTOR:
            motors = _each(actuator.motor, **{OF_MOTOR[self.name]: bound})
            joint = dataclasses.replace(joint, actuator=dataclasses.replace(actuator, motor=motors))
        else:
            springs = _each(actuator.spring, max_deflection=bound)
            joint = dataclasses.replace(joint, actuator=dataclasses.replace(actuator, spring=springs))
        joints = list(self.robot.joints)
        joints[self.joint] = joint
        return dataclasses.replace(self.robot, joints=tuple(joints))

    def report(self, bound: float, engine: str = "numpy") -> Report:
        """The report with a bound, which states nothing beyond a limit that does not count."""
        run = Run(self.limited(bound), self.trajectory, engine=engine)
        flagged = sum(int(np.count_nonzero(has_flag(block.flags[:, self.joint], LIMITS))) for block in run)
        report = run.report()
        joint = report.joints[self.joint]
        label = BOUNDED[self.name].label
        assert joint.samples["over_limit"] == flagged
        assert (label in joint.worst) == bool(flagged), "what is stated counts"
        assert report.verdict == ("over_limit" if flagged else "ok")
        if flagged:
            assert abs(joint.worst[label].value) - bound > TOLERANCE * bound
        else:
            assert "its limit of" not in str(report)
        return report

    def beyond(self, bound: float, engine: str = "numpy") -> bool:
        return self.report(bound, engine).verdict == "over_limit"


def _each(parts: object, **changes: float) -> object:
    """One record, or each of several, with changes."""
    if isinstance(parts, tuple):
        return tuple(dataclasses.replace(part, **changes) for part in parts)
    return dataclasses.replace(parts, **changes)  # type: ignore[type-var]


def random_task(seed: int) -> Task | None:
    """A random motion at a coarse rate, peaks of which lie between samples; None if it is infeasible."""
    rng = np.random.default_rng(seed)
    robot = shipped_robot(ROBOTS[seed % len(ROBOTS)])
    robot = dataclasses.replace(
        robot, joints=tuple(dataclasses.replace(joint, limits=Limits()) for joint in robot.joints)
    )
    count, duration = len(robot.joints), float(rng.uniform(2, 6))
    span = (0.0, duration)
    sine, cosine = rng.uniform(-0.3, 0.3, (2, 3, count)) / np.arange(1, 4)[:, None]
    position = Sinusoids(
        signal=POSITION, span=span, cycles=float(rng.uniform(0.7, 2.5)), offset=(0.0,) * count,
        sine=tuple(map(tuple, sine.tolist())), cosine=tuple(map(tuple, cosine.tolist())),
    )  # fmt: skip
    times = UniformTimes(duration, int(rng.integers(4, 30)) / duration)
    chosen = np.array(["stiffness" in joint.actuator.commanded for joint in robot.joints])
    index = int(rng.integers(count))
    names = [name for name in BOUNDED if name != "stiffness" or chosen[index]]
    name = str(rng.choice(names))
    free = Trajectory(times, position, _stiffness(np.where(chosen, 1e4, np.nan), 0.0, span), name="random")
    dense = motor_torques(robot, free.at(np.linspace(*span, 401)))
    level = np.where(chosen, rng.uniform(1.2, 2.0, count) * np.fmax.reduce(dense.stiffness_min), np.nan)
    if not np.isfinite(level[chosen]).all() or (level[chosen] <= 0).any():
        return None
    stiffness = _stiffness(level, 0.05, span)
    trajectory = Trajectory(times, position, stiffness, name="random")
    task = Task(robot, trajectory, index, name)
    flags = motor_torques(robot, trajectory.at(np.linspace(*span, 401))).flags
    sprung = getattr(robot.joints[index].actuator, "spring", None) is not None
    if flags.any() or (name == "phi" and not sprung) or not np.isfinite(task.size(np.array([0.1]))).all():
        return None
    return task


def _stiffness(level: np.ndarray, swing: float, span: tuple[float, float]) -> dict[str, Sinusoids]:
    swings = (tuple((swing * level).tolist()),)
    return {
        "stiffness": Sinusoids(
            signal=STIFFNESS, span=span, cycles=1.3, offset=tuple(level.tolist()), sine=swings, cosine=swings
        )
    }


def tasks(seeds: Sequence[int]) -> Iterator[Task]:
    return (task for task in map(random_task, seeds) if task is not None)


def peak(task: Task) -> float:
    """The largest size over all time, by Brent's method about the largest of many."""
    times = np.linspace(0, task.trajectory.duration, 801)
    dense = task.size(times)
    near = int(np.clip(dense.argmax(), 1, len(times) - 2))
    found = minimize_scalar(
        lambda time: -float(task.size(np.array([time]))[0]),
        bounds=(times[near - 1], times[near + 1]),
        method="bounded",
        options={"xatol": 1e-10},
    )
    return max(-float(found.fun), float(dense.max()))


def neighbors(value: float) -> list[float]:
    """A value, the floats next to it, and values just beyond what rounding may decide."""
    floats = [math.nextafter(value, -math.inf), value, math.nextafter(value, math.inf)]
    return floats + [value * (1 + share) for share in (-2 * UNDECIDED, 2 * UNDECIDED)]


def check(task: Task) -> None:
    """Verdicts at and about the peak, with and without the tolerance, at samples and between them."""
    most = peak(task)
    at_samples = float(task.size(task.trajectory.times.block(0, task.trajectory.samples)).max())
    label = BOUNDED[task.name].label
    stated = abs(task.report(most * (1 - 1.5 * TOLERANCE)).joints[task.joint].worst[label].value)
    assert stated == pytest.approx(most, rel=1e-11, abs=0)
    centers = {value / (1 + share) for value in (most, stated, at_samples) for share in (0, TOLERANCE)}
    bounds = sorted({bound for center in centers for bound in neighbors(center)})
    verdicts = [task.beyond(bound) for bound in bounds]
    assert verdicts == sorted(verdicts, reverse=True), "a tighter limit improved the verdict"
    for bound, verdict in zip(bounds, verdicts, strict=True):
        if abs(most / (bound * (1 + TOLERANCE)) - 1) > UNDECIDED:
            assert verdict == (most > bound * (1 + TOLERANCE))


@pytest.mark.slow
def test_no_verdict_improves_by_tightening_a_limit() -> None:
    check(next(tasks(range(8))))


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("first", [3, 1, 2, *range(4, 36)])
def test_no_verdict_of_many_improves_by_tightening_a_limit(first: int) -> None:
    """Seeds so far apart that those of a case have every robot; the first has all but limits of positions."""
    for task in tasks(range(first, 320, 35)):
        check(task)


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 8, 16, 32, 40, *map(exhaustive, (24, 48, 56, 64, 72, 80, 88))])
def test_engines_differ_only_where_rounding_decides(seed: int) -> None:
    """Each limit is compiled anew, so that there are few: one of each quantity."""
    task = next(tasks(range(seed, seed + 8)))
    center = peak(task) / (1 + TOLERANCE)
    for share in (-UNDECIDED, UNDECIDED):
        bound = center * (1 + share)
        assert task.beyond(bound, "c") == task.beyond(bound, "numpy") == (share < 0)


SWINGING = """\
format: vsacli-trajectory/1
name: swinging
duration: 8
rate: 1
position:
  type: sinusoids
  frequency: 0.25
  offset: 0
  sine: [[0.01, 0.01, 0.3]]
  cosine: [[0.01, 0.01, 0.3]]
stiffness: {type: constant, value: 1200}
"""
"""All samples of the elbow are at -0.3 or 0.3 rad, the peaks between them at 0.42."""


@pytest.mark.parametrize("bound", [0.29, 0.2999999999, 0.3, 0.42, 0.43])
def test_a_sample_over_its_limit_by_rounding_does_not_hide_a_peak(
    vsacli: Callable[..., Outcome], own_folder: Path, bound: float
) -> None:
    (own_folder / "swinging.yaml").write_text(SWINGING)
    limits = f"joints.elbow.limits={{position: [-3, {bound}]}}"
    outcome = vsacli("check-feasibility", REPOSITORY / "robots/vsa_3r.yaml", "swinging.yaml", "--set", limits)
    stated = (
        "elbow: position is 0.4243 rad at t = 4.500 s, between two samples, above its limit of" in outcome.out
    )
    assert (outcome.code, stated) == ((3, True) if bound < 0.43 else (0, False))


def test_a_peak_between_samples_that_keep_the_limit_has_a_cause_and_a_fix(
    vsacli: Callable[..., Outcome], own_folder: Path
) -> None:
    (own_folder / "swinging.yaml").write_text(SWINGING)
    limits = "joints.elbow.limits={velocity: 0.65}"
    inputs = REPOSITORY / "robots/vsa_3r.yaml", "swinging.yaml", "--set", limits
    out = vsacli("check-feasibility", *inputs, "--fixes").out
    # the four peaks are equal but for rounding
    causes = re.findall(
        r"^elbow: velocity is (-?0\.6664) rad/s at t = [1357]\.500 s, \w+ its limit of", out, re.M
    )
    assert len(causes) == 1
    assert "1. slow down by a factor " in out


@pytest.mark.parametrize("bound", ["107.5174037996141", "107.5174037996142", "107.5174038"])
def test_limits_about_a_last_sample_that_is_not_the_peak(vsacli: Callable[..., Outcome], bound: str) -> None:
    """The peak is 6e-7 N m above the last sample."""
    inputs = REPOSITORY / "robots/vsa_3r.yaml", REPOSITORY / "trajectories/rest_to_rest.yaml"
    changes = "--set", f"joints.shoulder.actuator.motor.max_torque={bound}", "--set", "rate=40"
    assert vsacli("check-feasibility", *inputs, *changes).code == 3


def test_a_flag_of_one_motor_states_nothing_of_the_other() -> None:
    """Motor 2 has the larger limit, and is over it by less than the tolerance, but by more than motor 1."""
    joint = shipped_robot("vsa_3r").joints[0]
    torques = {"tau_motor": np.array([[1 + 2e-9], [1e3 + 9e-7]])}
    checks = [
        LimitCheck(Flag.MOTOR_TORQUE_LIMIT, "tau_motor", motor, (-bound, bound))
        for motor, bound in ((1, 1.0), (2, 1e3))
    ]
    beyond = np.array([True])
    first, second = (worst_excess(joint, check, torques, np.zeros(1), beyond) for check in checks)
    assert first is not None
    assert first.motor == 1
    assert second is None
