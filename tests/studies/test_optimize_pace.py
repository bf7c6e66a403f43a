"""The cheapest pace in a given time, against dense grids, another optimizer, and runs of the result."""

from __future__ import annotations

import math

import numpy as np
import pytest
from samples.fixes import pendulum, rest_to_rest

from vsacli import inverse_dynamics, load_trajectory, optimize
from vsacli.studies.search.criteria import CRITERIA, Scale
from vsacli.studies.search.loads import Ends
from vsacli.studies.search.paced_motion import PacedJoint, PacedMotion, checked_instants, retimed
from vsacli.studies.search.paced_search import CheapestPaceSearch
from vsacli.studies.search.splines import PacedSpaces, SplineSpace

DURATION = 0.4
SPAN = (0.0, DURATION)
SIZE = 100.0
"""N m or J, about what it costs."""


@pytest.fixture(scope="module")
def swing():
    """A pendulum that is lifted from where it hangs."""
    return pendulum(), rest_to_rest(DURATION, (1500.0,), start=(-math.pi / 2,), end=(0.0,), rate=1000.0)


def search(robot, trajectory, criterion, space):
    """The best pace among the splines of a space."""

    class InSpace(CheapestPaceSearch):
        pieces = (50,)  # of which each has so many instants that sums are good to 1e-5

        def _spaces(self, _pieces):
            return PacedSpaces(space, {})

    motion = PacedMotion(robot, trajectory, checked_instants(trajectory, DURATION))
    joint = PacedJoint(motion, 0, 0.01, CRITERIA[criterion](), Scale(SIZE, DURATION))
    return InSpace(motion, [joint], [], Ends(), 0, lambda: None).best()


def cost(robot, trajectory, criterion, pace):
    """Of a pace, from a run of the motion at that pace."""
    run = inverse_dynamics(robot, retimed(trajectory, pace, {}, "retimed"))
    if run.report.verdict != "ok":
        return math.inf
    torques = run.tau_motor[:, 0]
    if criterion == "peak":
        return np.abs(torques).max()
    if criterion == "energy":
        spent = np.maximum(run.motor_power[:, 0], 0).sum(axis=-1)
        return np.trapezoid(spent, run.time) + run.elastic_energy[0, 0]
    return math.sqrt(np.trapezoid((torques**2).mean(axis=-1), run.time) / DURATION)


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("criterion", ["torque", "energy", "peak"])
def test_no_pace_of_a_dense_family_is_better(swing, criterion):
    """Slower at the ends than between, or the other way; the grid is refined about its best four times."""
    free, s = SplineSpace.free(SPAN, 2).of_mean(1.0), np.linspace(*SPAN, 100)
    shape = free.fitted(s, 1 + np.cos(2 * np.pi * s / DURATION))[:, None]
    line = SplineSpace(free.knots, free.shapes @ shape, offset=1.0)
    found = cost(*swing, criterion, search(*swing, criterion, line).pace())
    center, width = 0.0, 0.32
    for _ in range(5):
        amounts = center + np.linspace(-width, width, 9)
        on_grid = [cost(*swing, criterion, line.spline(np.array([amount]))) for amount in amounts]
        center, width = amounts[int(np.argmin(on_grid))], width / 4
    # The last grid is 3e-4 wide, at a minimum that is flat, or a kink of slope one.
    assert found == pytest.approx(min(on_grid), rel=1e-4)
    assert found < 0.993 * cost(*swing, criterion, line.spline(np.zeros(1)))


@pytest.mark.exhaustive
@pytest.mark.slow
def test_scipys_optimizer_comes_to_the_same_cost(swing):
    """Over all coefficients of a coarse spline, scaled to the duration."""
    from scipy.optimize import minimize

    space = SplineSpace.free(SPAN, 2)

    def other_cost(coefficients):
        mean = space.spline(coefficients).integrate(*SPAN) / DURATION
        return cost(*swing, "torque", space.spline(coefficients / mean)) / SIZE

    other = minimize(
        other_cost, np.ones(space.size), jac="3-point", method="trust-constr", options={"gtol": 1e-6}
    )
    found = cost(*swing, "torque", search(*swing, "torque", space.of_mean(1.0)).pace())
    assert found / SIZE == pytest.approx(other.fun, rel=1e-4)


@pytest.mark.slow
def test_what_is_found_lasts_as_commanded_and_costs_what_the_report_says(swing):
    robot, trajectory = swing
    found = optimize(robot, trajectory, "torque", "timing")
    assert found.trajectory.duration == pytest.approx(DURATION, rel=1e-12)
    run = inverse_dynamics(robot, found.trajectory)
    assert run.report.verdict == "ok"
    mean = np.trapezoid((run.tau_motor[:, 0] ** 2).mean(axis=-1), run.time) / DURATION
    of_joint = found.joints["swing"]
    assert of_joint.after == pytest.approx(math.sqrt(mean), rel=1e-9)
    assert (of_joint.found, of_joint.agreeing) == (True, of_joint.starts)
    assert found.together.after == pytest.approx(of_joint.after / of_joint.before)


@pytest.mark.exhaustive
@pytest.mark.slow
def test_timing_and_stiffness_together_are_better_than_either(swing):
    both, timing, stiffness = (optimize(*swing, "torque", vary) for vary in ("both", "timing", "stiffness"))
    cheaper = min(timing.joints["swing"].after, stiffness.joints["swing"].after)
    assert both.joints["swing"].after < 0.99 * cheaper


@pytest.mark.exhaustive
@pytest.mark.slow
def test_a_motion_that_repeats_itself_goes_on_doing_so(tmp_path):
    path = tmp_path / "shake.yaml"
    path.write_text(
        "format: vsacli-trajectory/1\nname: shake\nduration: 0.25\nrate: 1600\n"
        "position: {type: sinusoids, frequency: 8, offset: 0.3, sine: [0.1]}\n"
        "stiffness: {type: constant, value: 4000}\n"
    )
    robot = pendulum()
    found = optimize(robot, load_trajectory(path, robot), "peak", "timing", min_margin=0.03)
    assert found.together.after < 0.97
    run = inverse_dynamics(robot, found.trajectory)
    half = len(run.time) // 2
    for rows in (run.q, run.dq, run.ddq, run.d3q):
        np.testing.assert_allclose(rows[half:], rows[: half + 1], atol=1e-6 * np.abs(rows).max())
    assert found.trajectory.duration == pytest.approx(0.25, rel=1e-12)


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("criterion", ["torque", "time"])
def test_ends_that_move_go_on_as_commanded(tmp_path, criterion):
    """Three tenths of a swing: position and four derivatives at both ends are no one's to choose."""
    path = tmp_path / "part.yaml"
    path.write_text(
        "format: vsacli-trajectory/1\nname: part\nduration: 0.3\nrate: 800\n"
        "stiffness: {type: constant, value: 2000}\n"
        "position: {type: sinusoids, frequency: 1, offset: 0.2, sine: [0.4]}\n"
    )
    robot = pendulum().replace({"joints.0.actuator.motor.max_torque": 250.0})
    asked = load_trajectory(path, robot)
    found = optimize(robot, asked, criterion, "timing", min_margin=0.03)
    before, after = (inverse_dynamics(robot, each) for each in (asked, found.trajectory))
    assert after.report.verdict == "ok"
    for name in ("q", "dq", "ddq", "d3q", "d4q"):
        rows, expected = (getattr(run, name)[[0, -1], 0] for run in (after, before))
        # three derivatives of the pace vanish there but for the rounding of a spline over 1/24 of the path
        np.testing.assert_allclose(rows, expected, rtol=1e-6, err_msg=name)
    if criterion == "time":
        assert found.timing.after == pytest.approx(found.trajectory.duration)
        assert found.timing.after < 0.7 * asked.duration
        assert math.isnan(found.timing.uniform)
    else:
        assert found.trajectory.duration == pytest.approx(asked.duration, rel=1e-12)
        assert found.together.after < 1 + 1e-6  # next to nothing to gain here
