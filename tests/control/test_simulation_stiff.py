"""Stiff simulations: which method integrates, its budget, and what double precision cannot resolve."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from samples.drives import motion
from samples.marks import slow, slow_but
from samples.robots import vsa_3r
from samples.simulated import short_motion
from samples.single_joint import LINK_INERTIA, rigid_joint, single_joint, step_of

from vsacli import Antagonistic, Elastic, Gains, InitialError, InputError, Motor, Trajectory, laws, simulate
from vsacli.base.units import time_text
from vsacli.control.simulation.ending import Budget
from vsacli.control.simulation.stiff import difference_jacobian
from vsacli.trajectory.times import RecordedTimes

MOTOR_INERTIA = 2.0
GAINS = Gains.from_poles([-20] * 4, [-20] * 2)


def elastic_joint(stiffness, motor_inertia=MOTOR_INERTIA):
    return single_joint(Elastic(motor=Motor(inertia=motor_inertia), stiffness=stiffness))


def methods(simulation):
    return [method.name for method in simulation.report.methods]


def go_on_implicitly(monkeypatch, after):
    """Every run, after a time, s."""
    monkeypatch.setattr(Budget, "too_slow", lambda _self, time: time > after)


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [slow(1e9), 1e12])
def test_a_joint_like_steel_under_drifted_feedforward_moves_as_in_closed_form(stiffness):
    """The center s = (M q + B theta)/(M + B) obeys (M + B) s'' = tau, and the spring stands still.

    Its deflection M tau/(K (M + B)) is 1e-9 rad; what it oscillates about that is smaller by 1/K again.
    """
    assumed = 1.1 * MOTOR_INERTIA
    trajectory = step_of(1.0)
    simulation = simulate(elastic_joint(stiffness), trajectory, model=elastic_joint(stiffness, assumed))
    assert methods(simulation) == ["DOP853", "Radau"]
    assert simulation.report.methods[1].start < 0.1  # of 1 s
    whole = LINK_INERTIA + MOTOR_INERTIA
    command = trajectory.at(simulation.history.time)
    q, ddq, d4q = (getattr(command, name)[:, 0] for name in ("q", "ddq", "d4q"))
    bent = LINK_INERTIA * assumed / stiffness
    center = 0.2 + ((LINK_INERTIA + assumed) * (q - 0.2) + bent * ddq) / whole
    torque = (LINK_INERTIA + assumed) * ddq + bent * d4q
    deflection = LINK_INERTIA * torque / (stiffness * whole)
    exact = center - MOTOR_INERTIA * deflection / whole
    # two hundred steps with local errors of 1e-9
    assert simulation.history.q[:, 0] == pytest.approx(exact, abs=1e-8)
    assert simulation.report.verdict == "off_target"


@pytest.mark.slow
def test_poles_of_a_million_hold_a_rigid_joint_on_its_command():
    """An error at the start is gone before the first sample, as (1 + p t) exp(-p t) is."""
    gains = Gains.from_poles([-1e6] * 2)
    simulation = simulate(rigid_joint(2.0), step_of(1.0), gains=gains, initial_error=InitialError(1e-3))
    assert methods(simulation) == ["DOP853", "Radau"]
    assert simulation.report.verdict == "ok"
    assert simulation.report.evaluations < 30_000  # explicit: some ten million
    assert np.abs(simulation.history.q_error[1:]).max() < 1e-7  # the method's order falls where it is stiff


@pytest.mark.slow
@pytest.mark.parametrize(("gains", "frame"), [(None, None), slow(GAINS, "base")])
def test_both_methods_find_the_same_motion(monkeypatch, gains, frame):
    conditions = {"gains": gains, "initial_error": InitialError(0.01)}
    trajectory = short_motion(3, wrench=frame)
    explicit = simulate(vsa_3r(), trajectory, **conditions)
    assert methods(explicit) == ["DOP853"]
    go_on_implicitly(monkeypatch, 0.1)
    implicit = simulate(vsa_3r(), trajectory, **conditions)
    assert methods(implicit) == ["DOP853", "Radau"]
    assert 0.1 < implicit.report.methods[1].start < 0.2
    for name in ("time", "q", "dq", "theta", "tau_motor_cmd"):
        found, expected = (getattr(simulation.history, name) for simulation in (implicit, explicit))
        # tolerances of 1e-9, which the open loop magnifies ten times; torques of 100 N m
        assert found == pytest.approx(expected, rel=1e-6, abs=1e-7, nan_ok=True)


@pytest.mark.slow
def test_controllers_with_encoders_can_be_stiff(monkeypatch):
    conditions = {"gains": GAINS, "feedback": "positions"}
    trajectory = short_motion(3, rate=100, duration=0.2)
    explicit = simulate(vsa_3r(), trajectory, **conditions)
    go_on_implicitly(monkeypatch, 0.1)
    switched = simulate(vsa_3r(), trajectory, **conditions)
    assert methods(switched) == ["DOP853", "Radau"]
    assert np.array_equal(switched.history.time, explicit.history.time)
    assert switched.history.q == pytest.approx(explicit.history.q, abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("what", ["slack", slow("singular")])
def test_runs_end_at_the_same_boundary_with_both_methods(monkeypatch, what):
    conditions = {"gains": GAINS}
    robot, trajectory = vsa_3r(), motion((850.0,) * 3, (805.0,) * 3, duration=1.0)
    if what == "slack":
        motor = Motor(inertia=3.0, damping=1e-4)
        actuator = Antagonistic(motor=(motor, motor), spring=(laws.Quadratic(k=2000), laws.Quadratic(k=2000)))
        joints = tuple(dataclasses.replace(joint, actuator=actuator) for joint in robot.joints)
        robot, trajectory = dataclasses.replace(robot, joints=joints), motion((530.0,) * 3)
        conditions = {"initial_error": InitialError(0.02, 50)}
    explicit = simulate(robot, trajectory, **conditions)
    go_on_implicitly(monkeypatch, 0.02)
    implicit = simulate(robot, trajectory, **conditions)
    assert methods(implicit) == ["DOP853", "Radau"]
    assert implicit.report.verdict == explicit.report.verdict == {"slack": "infeasible"}.get(what, what)
    assert implicit.history.time[-1] == pytest.approx(explicit.history.time[-1], rel=1e-6)
    assert np.array_equal(implicit.history.flags[-1], explicit.history.flags[-1])


@pytest.mark.slow
def test_what_was_integrated_when_the_budget_is_used_up_is_kept():
    whole = simulate(vsa_3r(), short_motion(3))
    cut = simulate(vsa_3r(), short_motion(3), budget=300)
    report = cut.report
    assert methods(cut) == ["DOP853", "Radau"]
    assert report.verdict == "incomplete"
    assert not report.complete
    assert report.ending == (
        "the budget of 300 evaluations of the equations of motion is used up; "
        f"ended at t = {time_text(cut.history.time[-1])}"
    )
    assert 250 < report.evaluations <= 300
    kept = len(cut.history.time) - 1
    assert 2 < kept < len(whole.history.time)
    assert cut.history.q[:kept] == pytest.approx(whole.history.q[:kept], abs=1e-8)
    assert simulate(vsa_3r(), short_motion(3), budget=300).report == report
    assert not report.joints[0].samples_over_limit


@pytest.mark.parametrize("feedback", ["state", "positions"])
@pytest.mark.parametrize("engine", ["numpy", "c"])
@pytest.mark.parametrize("budget", slow_but([1, 5, 17, 100], [1, 2, 5, 16, 17, 18, 60, 100, 333]))
def test_no_run_exceeds_its_budget(budget, engine, feedback):
    """A restart on the implicit method evaluates two Jacobians of 25 columns before its first step."""
    conditions = {"gains": GAINS, "feedback": feedback, "engine": engine}
    cut = simulate(vsa_3r(), short_motion(3), budget=budget, **conditions)
    assert cut.report.verdict == "incomplete"
    assert cut.report.evaluations <= budget
    assert np.isfinite(cut.history.q).all()
    assert len(cut.history.time) == cut.report.samples
    assert (cut.report.samples == 1) == cut.report.ending.endswith("t = 0.000 s, before the first step")


def test_a_run_that_ends_before_its_first_step_reports_no_error():
    report = simulate(vsa_3r(), short_motion(3), budget=5).report
    assert "largest q error" not in str(report)
    assert "largest q error" in str(simulate(vsa_3r(), short_motion(3), budget=300).report)


@pytest.mark.slow
def test_a_run_that_ends_within_its_budget_does_not_depend_on_it():
    free = simulate(vsa_3r(), short_motion(3))
    enough = simulate(vsa_3r(), short_motion(3), budget=4 * free.report.evaluations)
    assert methods(enough) == ["DOP853"]
    assert np.array_equal(enough.history.q, free.history.q)
    assert free.report.budget == 200_000  # more than 100 for each of 161 steps
    assert simulate(rigid_joint(2.0), step_of(1.0, rate=3000)).report.budget == 300_100


@pytest.mark.parametrize("stiffness", [1e14, 9e17])
def test_springs_that_double_precision_cannot_resolve_are_refused(stiffness):
    with pytest.raises(InputError, match=r"axis: its springs are too stiff .* or make the joint rigid"):
        simulate(elastic_joint(stiffness), step_of(1.0))


def test_poles_that_double_precision_cannot_resolve_are_refused():
    gains = Gains.from_poles([-1e6] * 4, [-20] * 2)
    with pytest.raises(InputError, match=r": its poles are too fast .* choose slower ones"):
        simulate(vsa_3r(), short_motion(3), gains=gains)


def test_a_budget_that_is_none_is_refused():
    with pytest.raises(InputError, match="the budget must be at least 1, not 0"):
        simulate(vsa_3r(), short_motion(3), budget=0)


def test_a_jacobian_is_finite_also_where_a_difference_steps_over_an_end():
    matrix = np.array([[0.0, 1.0], [-4e6, -0.3]])

    def function(_time, vectors):
        return np.where(vectors > 1.0, np.nan, vectors) @ matrix.T

    inside = difference_jacobian(function, 0.0, np.array([0.3, -0.7]))
    assert inside == pytest.approx(matrix, abs=0.1)  # rounding of 2.8e6, 5e-10, by the step of 1.5e-8
    at_the_end = difference_jacobian(function, 0.0, np.array([1.0, -0.7]))
    assert np.isfinite(at_the_end).all()
    assert at_the_end[:, 1] == pytest.approx(matrix[:, 1], abs=0.1)


def test_the_time_from_which_a_method_was_used_is_a_stamp(monkeypatch):
    quick = short_motion(3, duration=0.3)
    stamps = RecordedTimes(1e6 + quick.times.block(0, quick.samples))
    go_on_implicitly(monkeypatch, 0.1)
    explicit, implicit = simulate(
        vsa_3r(), Trajectory(stamps, quick.position, quick.commanded, name="late")
    ).report.methods
    assert explicit.start == 1e6
    assert 1e6 + 0.1 < implicit.start < 1e6 + 0.2


@pytest.mark.slow
def test_a_run_with_the_full_state_that_ends_early_is_told():
    trajectory = short_motion(3, rate=100, duration=0.3)
    report = simulate(vsa_3r(), trajectory, gains=GAINS, feedback="positions", budget=300).report
    assert report.verdict == "incomplete"
    assert report.warnings[-1].startswith("the same run with the full state: the budget of 300 evaluations")
