"""Recorded equations of motion evaluate what their text does, however they are carried out."""

from __future__ import annotations

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from oracles import pinocchio
from samples.closed_loops import MADE, SHIPPED, Loop, loop_of, made_loop, shipped_loop
from samples.drives import joint_with, springs, with_joint
from samples.marks import needs_compiler, slow, slow_but
from samples.plants import all_rigid, with_actuators
from samples.robots import vsa_3r
from samples.shipped import shipped_run
from samples.simulated import short_motion
from samples.single_joint import single_joint, step_of
from scipy.integrate import DOP853

from vsacli import (
    Friction,
    Gains,
    InitialError,
    InputError,
    Motor,
    Rigid,
    laws,
    perturbed,
    simulate,
    simulate_perturbed,
)
from vsacli.compute.engine import compiler
from vsacli.control.simulation.compiled_loop import LARGEST_GROWTH, dop853_with_stages
from vsacli.control.simulation.ending import Budget
from vsacli.control.simulation.loop_code import loop_code, record_loop
from vsacli.control.simulation.loop_equations import Computing, LoopEquations, RecordedEquations

AGREEMENT = 1e-11
"""Relative to the largest rate: rounding of 1e-16 times the condition of M, up to 1e4 with seven joints."""

PLAIN = {"engine": "numpy", "compiler": "", "threads": "1"}
GAINS = Gains.from_poles([-20] * 4, [-20] * 2)
QUICK = ("cubic springs", "a measured spring", "prismatic joints", "a damped transmission")
ENGINES = ("numpy", pytest.param("c", marks=needs_compiler))


def equations(case: Loop, engine: str) -> RecordedEquations:
    """Those of a loop, recorded already."""
    made = RecordedEquations(
        case.loop, case.boundaries, Budget(None, np.array([0.0, 1.0])), Computing(engine)
    )
    while np.isfinite(made._next_change):
        made.budget.used = int(made._next_change) + 1
        made._change_backend(*next(iter(case.states(1))))
    return made


def assert_agree(case: Loop, engine: str) -> None:
    """Rates and distances of a recorded loop are those of the text."""
    found = equations(case, engine)
    for time, state in case.states(10):
        expected = case.loop.derivative(time, state)
        assert np.abs(found(time, state) - expected).max() < AGREEMENT * np.abs(expected).max()
        nearest = min((float(each.distance(state)) for each in case.boundaries), default=1.0)
        assert found.distance(state) == pytest.approx(nearest, rel=1e-12, abs=1e-12)
    several = case.start + 1e-4 * np.eye(len(case.start))
    expected = case.loop.derivative(0.1, several)
    assert np.abs(found(0.1, several) - expected).max() < AGREEMENT * np.abs(expected).max()


@pytest.mark.cases(6)
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("what", slow_but(QUICK, SHIPPED))
def test_recorded_rates_are_those_of_the_text(what, engine):
    assert_agree(shipped_loop(what), engine)


@pytest.mark.cases(2)
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("what", slow_but(["wrench"], MADE))
def test_recorded_controllers_are_those_of_the_text(what, engine):
    assert_agree(made_loop(what), engine)


@pytest.mark.cases(2)
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("what", [slow("smooth friction, seven joints"), slow("a lever"), slow("tendons")])
def test_recorded_feedback_is_that_of_the_text(what, engine):
    assert_agree(shipped_loop(what, feedback=True), engine)


@pytest.mark.parametrize("engine", ENGINES)
def test_recorded_rates_are_those_of_pinocchio(engine):
    """Of an arm without springs, whose motors add their inertia and damping to the joints."""
    robot = all_rigid("RPRR", seed=4)
    case = loop_of(robot, short_motion(4))
    model = pinocchio.build(robot)
    data = model.createData()
    motors = [joint.actuator.motor for joint in robot.joints]
    model.armature = np.array([motor.inertia for motor in motors])
    found = equations(case, engine)
    for time, state in case.states(5):
        q, dq = state[:4], state[4:8]
        torque = case.loop.controller.torque(time, case.loop.packing.unpack(state))
        torque = torque - np.array([motor.damping for motor in motors]) * dq - _damping_of(robot) * dq
        expected = pin.aba(model, data, q, dq, torque)
        np.testing.assert_allclose(found(time, state)[4:8], expected, rtol=1e-9, atol=1e-9)


def _damping_of(robot):
    return np.array([joint.damping for joint in robot.joints])


@pytest.mark.slow
@needs_compiler
def test_the_code_of_robots_that_differ_in_numbers_is_one():
    """Equal numbers of two joints may make the exact robot's a special one, but not those of errors."""
    robot, trajectory = vsa_3r(), short_motion(3)
    cases = [loop_of(robot, trajectory, GAINS, model=perturbed(robot, 0.05, seed)) for seed in (1, 2)]
    (first, numbers), (second, others) = (
        loop_code(record_loop(case.loop, case.boundaries)) for case in cases
    )
    assert first == second
    assert len(numbers) == len(others)
    assert (numbers != others).any()
    for case in cases:
        assert_agree(case, "c")


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("gains", [None, GAINS])
def test_engines_find_the_same_motion(gains):
    conditions = {"gains": gains, "initial_error": InitialError(0.01 if gains else 0.0)}
    runs = [_run(engine, **conditions) for engine in ("numpy", "auto", *(["c"] if _has_compiler() else []))]
    text = _run_text(**conditions)
    for run in runs:
        assert run.report.verdict == text.report.verdict
        # steps follow rounding, but every 1e3 evaluations some 10 differ
        assert run.report.evaluations == pytest.approx(text.report.evaluations, rel=0.02)
        for name in ("q", "dq", "theta", "tau_motor_cmd"):
            found, expected = getattr(run.history, name), getattr(text.history, name)
            # tolerances of 1e-9, which the open loop magnifies; torques of 100 N m
            assert found == pytest.approx(expected, rel=1e-6, abs=1e-7, nan_ok=True)


def _has_compiler() -> bool:
    try:
        compiler.system_compiler()
    except compiler.CompilerError:
        return False
    return True


def _run(engine, **conditions):
    return simulate(vsa_3r(), short_motion(3), engine=engine, **conditions)


def _run_text(**conditions):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RecordedEquations, "_change_backend", lambda *_: None)
        return _run("numpy", **conditions)


@pytest.mark.slow
@needs_compiler
def test_controllers_that_hold_their_torques_are_recorded_too():
    conditions = {"gains": GAINS, "feedback": "positions"}
    trajectory = short_motion(3, rate=100, duration=0.2)
    runs = [simulate(vsa_3r(), trajectory, engine=engine, **conditions) for engine in ("c", "numpy")]
    assert runs[0].provenance["engine"] == "c"
    assert runs[0].history.q == pytest.approx(runs[1].history.q, abs=1e-8)


@pytest.mark.parametrize("engine", ENGINES)
def test_recorded_controllers_that_hold_their_torques_ask_for_those_of_the_text(engine):
    case = made_loop("wrench")
    held = 10 * np.random.default_rng(2).standard_normal(6)
    case.loop.hold(np.zeros(6))
    found = equations(case, engine)
    case.loop.hold(held)
    for time, state in case.states(5):
        expected = case.loop.controller.torque(time, case.loop.packing.unpack(state))
        assert np.abs(found.torques(time, state) - expected).max() < AGREEMENT * np.abs(expected).max()
        rates = case.loop.derivative(time, state)
        assert np.array_equal(case.loop.demand(time, state), held)
        assert np.abs(found(time, state) - rates).max() < AGREEMENT * np.abs(rates).max()


@needs_compiler
def test_steps_are_those_of_scipy(monkeypatch):
    """The same times, to rounding: who computes the stages has no part in the control of the steps."""
    monkeypatch.setattr("vsacli.control.simulation.compiled_loop.LARGEST_GROWTH", 10.0)  # SciPy's own
    case = shipped_loop("cubic springs")
    fast = equations(case, "c")
    options = {"rtol": 1e-9, "atol": 1e-10}
    ours = dop853_with_stages()(fast, 0.0, case.start, 1.0, stages=fast.stages, **options)
    theirs = DOP853(case.loop.derivative, 0.0, case.start, 1.0, **options)
    for _ in range(20):
        ours.step()
        theirs.step()
        assert ours.t == pytest.approx(theirs.t, rel=1e-3)  # of small differences, which rounding changes
        middle = (theirs.t_old + theirs.t) / 2
        assert ours.dense_output()(middle) == pytest.approx(theirs.dense_output()(middle), abs=1e-9)
    assert fast.budget.used >= theirs.nfev


def test_steps_grow_no_faster_than_the_ones_before():
    """From t = 1 to 2 the error estimate is zero; SciPy alone lengthens its steps tenfold there."""

    def rates(time, _state):
        return np.array([0.0 if 1 < time < 2 else np.cos(40 * time)])

    options = {"rtol": 1e-9, "atol": 1e-10, "max_step": 0.3}
    growths = {}
    for method, more in ((dop853_with_stages(), {"stages": lambda *_: None}), (DOP853, {})):
        solver, lengths = method(rates, 0.0, np.zeros(1), 3.0, **options, **more), []
        while solver.status == "running":
            solver.step()
            lengths.append(solver.step_size)
        growths[method] = np.divide(lengths[11:-1], lengths[10:-2]).max()
    ours, theirs = growths.values()
    assert ours <= LARGEST_GROWTH * (1 + 1e-6)  # lengths are differences of times a million times larger
    assert theirs > 2


@needs_compiler
def test_steps_start_from_states_that_lie_apart_in_memory():
    case = shipped_loop("cubic springs")
    columns = np.stack((case.start, -case.start), axis=1)
    options = {"stages": equations(case, "c").stages, "rtol": 1e-9, "atol": 1e-10}
    apart, alone = (
        dop853_with_stages()(case.loop.derivative, 0.0, start, 1.0, **options)
        for start in (columns[:, 0], case.start)
    )
    apart.step()
    alone.step()
    assert np.array_equal(apart.y, alone.y)


@pytest.mark.slow
@pytest.mark.parametrize("processes", [1, 2])
def test_runs_with_errors_of_the_model_are_those_of_one_by_one(processes):
    robot, trajectory = vsa_3r(), short_motion(3, rate=100, duration=0.2)
    conditions = {"gains": GAINS, "initial_error": InitialError(0.01), "engine": "numpy"}
    reports = simulate_perturbed(robot, trajectory, 0.02, [4, 5], processes=processes, **conditions)
    for seed, report in zip([4, 5], reports, strict=True):
        alone = simulate(robot, trajectory, model=perturbed(robot, 0.02, seed), **conditions).report
        assert report.as_json() == alone.as_json()
    with pytest.raises(InputError, match="there must be at least 1 process, not 0"):
        next(simulate_perturbed(robot, trajectory, 0.02, [4], processes=0))


@pytest.mark.slow
@needs_compiler
def test_code_that_serves_many_runs_is_compiled_sooner(monkeypatch):
    """Compiling takes as long as 4000 evaluations of this robot's program, more than a run has."""
    asked = []

    def load(_code, _opened, _compiler, _tell, _trying, worthwhile):
        asked.append(worthwhile(1))

    monkeypatch.setattr("vsacli.control.simulation.loop_equations.load", load)
    alone = simulate(vsa_3r(), short_motion(3), gains=GAINS)
    assert asked == [False]
    simulate(vsa_3r(), short_motion(3), gains=GAINS, runs=100)
    assert asked == [False, False, True]
    assert alone.provenance == PLAIN


def test_without_a_compiler_runs_go_on(monkeypatch):
    monkeypatch.setenv("CC", "nocc")
    assert _run("auto", gains=GAINS).provenance == PLAIN
    with pytest.raises(InputError, match=r"no C compiler 'nocc'"):
        _run("c")


def test_an_engine_that_there_is_not_is_refused():
    with pytest.raises(InputError, match="unknown engine 'C'"):
        _run("C")


@pytest.mark.slow
def test_motors_that_stick_are_left_to_the_text():
    sharp = Rigid(motor=Motor(inertia=0.5, friction=Friction(coulomb=(2.0, 2.0))))
    robot, trajectory = single_joint(sharp), step_of(1.0)
    auto, plain = (simulate(robot, trajectory, engine=engine) for engine in ("auto", "numpy"))
    assert np.array_equal(auto.history.q, plain.history.q)
    with pytest.raises(InputError, match=r"motors with sharp friction stick and slide; take .* numpy"):
        simulate(robot, trajectory, engine="c")


@dataclasses.dataclass(frozen=True)
class _Own(laws.Cubic):
    """A law whose text takes what arrays of numbers have, and arrays of symbols have not."""

    def torque(self, phi):
        return super().torque(phi.clip(-3, 3))


@dataclasses.dataclass(frozen=True)
class _Deciding(laws.Cubic):
    """One that decides by a number."""

    def torque(self, phi):
        return super().torque(phi if float(np.max(phi)) < 3 else 0 * phi)


@pytest.mark.slow
@pytest.mark.parametrize("law", [_Own, _Deciding])
def test_laws_that_cannot_be_recorded_are_left_to_the_text(law):
    both = [each(k=380.0, k_c=3500.0) for each in (law, laws.Cubic)]
    robot, plain = (with_joint(vsa_3r(), 1, joint_with(springs(each, each))) for each in both)
    own, usual = (simulate(each, short_motion(3), engine="auto") for each in (robot, plain))
    assert own.history.q == pytest.approx(usual.history.q, abs=1e-8)
    assert own.provenance == PLAIN
    with pytest.raises(InputError, match=r"this cannot be compiled: .*; take the engine numpy"):
        simulate(robot, short_motion(3), engine="c")


@pytest.mark.slow
def test_potentials_are_left_to_the_text():
    robot, trajectory = shipped_run("sliding_anchor_1r", "sliding_anchor_1r")
    auto, plain = (simulate(robot, trajectory, engine=engine) for engine in ("auto", "numpy"))
    assert np.array_equal(auto.history.q, plain.history.q)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_link_without_mass_is_named_by_every_engine(engine):
    """Where numbers are not finite, the text says why."""
    robot = with_actuators(vsa_3r(), {})
    weightless = dataclasses.replace(robot.joints[2].link, mass=0.0, inertia=_no_inertia(robot))
    joints = (*robot.joints[:2], dataclasses.replace(robot.joints[2], link=weightless))
    with pytest.raises(InputError, match="elbow: the inertia it moves is not positive"):
        simulate(dataclasses.replace(robot, joints=joints), short_motion(3), engine=engine)


def _no_inertia(robot):
    inertia = robot.joints[2].link.inertia
    return dataclasses.replace(inertia, xx=0.0, yy=0.0, zz=0.0, xy=0.0, xz=0.0, yz=0.0)


def test_equations_from_text_count_what_they_evaluate():
    case = shipped_loop("one spring")
    plain = LoopEquations(case.loop, case.boundaries, Budget(None, np.array([0.0, 1.0])))
    plain(0.0, np.tile(case.start, (3, 1)))
    assert plain.budget.used == 3
    assert plain.provenance == PLAIN
