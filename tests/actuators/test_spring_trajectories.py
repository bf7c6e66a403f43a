"""Motions along the edge of what two springs can do: a branch that splits; the singular set, passed, met."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from samples.drives import springs
from samples.marks import slow_but

from vsacli import (
    DenavitHartenberg,
    Flag,
    Inertia,
    Joint,
    Link,
    Result,
    Robot,
    Trajectory,
    inverse_dynamics,
    laws,
    load_robot,
    load_trajectory,
)
from vsacli.base.flags import has_flag
from vsacli.base.signals import POSITION
from vsacli.trajectory.curves import RestToRest

ARM = """\
format: vsacli-robot/1
name: arm
gravity: [0, -9.81, 0]
joints:
  - name: arm
    type: revolute
    dh: {a: 1, alpha: 0}
    link: {mass: 40, com: [0, 0, 0], inertia: {xx: 0.1, yy: 0.1, zz: 0.1}}
    actuator:
      type: antagonistic
      motor: {inertia: 3}
      spring: [{type: cubic, k: 400, k_c: 2000}, {type: cubic, k: 440, k_c: 2000}]
"""

SINKING = """\
format: vsacli-trajectory/1
name: sinking
duration: 60
rate: 20
position: {type: polynomial, degree: 7, start: 0.5, end: 0.3}
stiffness: {type: constant, value: 1950}
"""
"""So slowly that the load is the weight, 392.4 cos(q) N m: it grows from 344 to 375."""

SPLIT = 371.19
"""Load in N m at which the outermost branch splits; its lower end jumps from 1936 to 1965 N m/rad."""


@pytest.fixture
def sinking(tmp_path: Path) -> tuple[Path, Path]:
    robot, trajectory = tmp_path / "arm.yaml", tmp_path / "sinking.yaml"
    robot.write_text(ARM)
    trajectory.write_text(SINKING)
    return robot, trajectory


def test_step_at_which_the_branch_splits_is_named(vsacli, sinking):
    done = vsacli("check-feasibility", *sinking, "--json")
    assert done.code == 3
    (joint,) = json.loads(done.out)["joints"]
    robot = load_robot(sinking[0])
    result = inverse_dynamics(robot, load_trajectory(sinking[1], robot))
    over = result.tau_e[:, 0] > SPLIT
    first = int(over.argmax())
    # Loads grow by some 0.05 N m a step of 0.05 s; the digits of the split leave one step open.
    assert joint["first_time"]["infeasible"] == pytest.approx(result.time[first], abs=0.06)
    assert joint["samples"]["infeasible"] == pytest.approx(over.sum(), abs=2)
    assert "arm: stiffness 1950 N m/rad at t =" in vsacli("check-feasibility", *sinking).out


def test_lower_end_jumps_past_the_stiffness_between_two_samples(sinking):
    robot = load_robot(sinking[0])
    result = inverse_dynamics(robot, load_trajectory(sinking[1], robot))
    lower, infeasible = result.stiffness_min[:, 0], has_flag(result.flags[:, 0], Flag.INFEASIBLE)
    first = int(infeasible.argmax())
    assert np.all(infeasible[first:])
    assert lower[first - 1] < 1937 < 1950 < 1965 < lower[first]
    assert np.all(np.isnan(result.tau_motor[first:, 0]))
    assert np.all(np.isfinite(result.tau_motor[:first, 0]))


# The singular set

PAIRS: dict[str, tuple[laws.SpringLaw, laws.SpringLaw]] = {
    "cubic, alike": (laws.Cubic(k=400, k_c=2000), laws.Cubic(k=400, k_c=2000)),
    "cubic, unlike": (laws.Cubic(k=400, k_c=2000), laws.Cubic(k=440, k_c=2000)),
    "sinh, alike": (laws.Sinh(k=10, a=9), laws.Sinh(k=10, a=9)),
    "sinh, unlike": (laws.Sinh(k=10, a=9), laws.Sinh(k=4, a=9)),
    "sinh of two kinds": (laws.Sinh(k=10, a=9), laws.Sinh(k=14, a=6)),
    "four-bar": (laws.FourBar(k=200, ratio=2.2), laws.FourBar(k=150, ratio=2)),
    "polynomial and cubic": (laws.Polynomial(c1=300, c5=9e4), laws.Cubic(k=400, k_c=2000)),
    "linear and cubic": (laws.Polynomial(c1=300), laws.Cubic(k=400, k_c=2000)),
    "tendon and cubic": (laws.Quadratic(k=2), laws.Cubic(k=400, k_c=2000)),
}
every_pair = pytest.mark.parametrize("two_laws", PAIRS.values(), ids=PAIRS)


def arm(two_laws: tuple[laws.SpringLaw, laws.SpringLaw]) -> Robot:
    """A light arm that hangs with a constant load: its joint turns about the vertical, a moment holds it."""
    link = Link(mass=1, com=(-0.3, 0, 0), inertia=Inertia(xx=0.01, yy=0.01, zz=0.01))
    joint = Joint(
        name="arm",
        type="revolute",
        dh=DenavitHartenberg(a=0.5, alpha=0),
        link=link,
        damping=0.1,
        actuator=springs(*two_laws),
    )
    return Robot(name="arm", joints=(joint,))


LOAD = 20.0
"""N m."""


def dip(two_laws: tuple[laws.SpringLaw, laws.SpringLaw], closest: float) -> tuple[Result, np.ndarray]:
    """A still arm whose stiffness comes down to within a relative distance of the fold at half time.

    Returns the result and the stiffness of the fold.
    """
    robot = arm(two_laws)
    time = np.linspace(0, 2, 201)
    moment = np.zeros((201, 6))
    moment[:, 5] = -LOAD
    still = np.zeros((201, 1))
    probe = Trajectory.from_samples(time, still, still + 1000, wrench=moment)
    lower = inverse_dynamics(robot, probe).stiffness_min
    stiffness = lower * (1 + closest + (time[:, None] - 1) ** 2)
    slopes = {"dstiffness": 2 * lower * (time[:, None] - 1), "ddstiffness": 2 * lower}
    trajectory = Trajectory.from_samples(time, still, stiffness, wrench=moment, **slopes)
    return inverse_dynamics(robot, trajectory), lower


@pytest.mark.slow
@pytest.mark.parametrize(
    "pair", slow_but({"cubic, unlike", "sinh, alike", "four-bar", "tendon and cubic"}, PAIRS)
)
def test_passing_the_singular_set_is_near_singular_and_stays_on_the_branch(pair: str):
    result, lower = dip(PAIRS[pair], closest=1e-6)
    flags = result.flags[:, 0]
    gap = 1 - lower / result.stiffness
    np.testing.assert_array_equal(has_flag(flags, Flag.NEAR_SINGULAR), gap[:, 0] < 0.01)
    assert not np.any(has_flag(flags, Flag.INFEASIBLE | Flag.SINGULAR | Flag.SLACK))
    assert np.all(np.isfinite(result.tau_motor))
    # On one branch the determinant keeps its sign, and the deflections move on without a jump.
    assert np.all(result.det_A < 0)
    # A square-root approach in samples of 0.01 s: steps of 0.01 of what lies a second away.
    assert np.all(np.abs(np.diff(result.phi, axis=0)) < 0.03 * np.ptp(result.phi, axis=0))
    assert result.report.verdict == "ok"


@pytest.mark.cases(2)
@pytest.mark.parametrize("pair", slow_but({"cubic, unlike", "four-bar"}, PAIRS))
def test_touching_the_singular_set_loses_the_motor_torque_there_only(pair: str):
    two_laws = PAIRS[pair]
    result, _ = dip(two_laws, closest=0.0)
    passing, _ = dip(two_laws, closest=1e-6)
    singular = has_flag(result.flags[:, 0], Flag.SINGULAR)
    np.testing.assert_array_equal(np.flatnonzero(singular), [100])
    for name in ("dphi", "dtheta", "ddtheta", "tau_motor"):
        values = getattr(result, name)[:, 0]
        assert np.all(np.isnan(values[singular])), name
        assert np.all(np.isfinite(values[~singular])), name
    for name in ("phi", "theta", "tau_transmission"):
        values, near = getattr(result, name)[:, 0], getattr(passing, name)[:, 0]
        assert np.all(np.isfinite(values)), name
        # A millionth of stiffness away is a thousandth of deflection.
        np.testing.assert_allclose(values, near, rtol=0, atol=5e-3 * np.abs(near).max())
    assert np.all(np.isfinite(result.det_A))
    assert np.abs(result.det_A[100, 0]) < 1e-3 * np.abs(result.det_A).max()
    assert result.report.verdict == "singular"
    assert result.report.joints[0].first_time["singular"] == pytest.approx(1.0)


# A slide


SLIDES: dict[str, tuple[laws.SpringLaw, laws.SpringLaw]] = {
    "tendons": (laws.Exponential(c=20, a=40), laws.Exponential(c=30, a=35)),
    "tendon and sinh": (laws.Quadratic(k=2e5), laws.Sinh(k=25, a=40)),
    "four-bar and cubic": (laws.FourBar(k=900, ratio=2.2), laws.Cubic(k=2000, k_c=4e5)),
}


@pytest.mark.parametrize("two_laws", SLIDES.values(), ids=SLIDES)
def test_springs_of_a_slide(two_laws: tuple[laws.SpringLaw, laws.SpringLaw]):
    joint = dataclasses.replace(arm(two_laws).joints[0], type="prismatic")
    robot = Robot(name="lift", joints=(joint,))
    time = np.linspace(0, 1, 101)
    path = RestToRest(signal=POSITION, span=(0.0, 1.0), degree=9, start=(0.0,), end=(0.2,)).at(time)
    q, dq, ddq, d3q, d4q = (order.T for order in path)
    stiffness = np.full_like(q, 9000.0)
    result = inverse_dynamics(
        robot, Trajectory.from_samples(time, q, stiffness, dq=dq, ddq=ddq, d3q=d3q, d4q=d4q)
    )
    assert result.report.verdict == "ok"
    # The weight and the inertia of 1 kg, in N, and no more than the damping beside.
    np.testing.assert_allclose(result.tau_e, 9.81 + ddq + 0.1 * dq, rtol=1e-12)
    np.testing.assert_allclose(result.tau_transmission.sum(axis=2), result.tau_e, rtol=0, atol=1e-10)
