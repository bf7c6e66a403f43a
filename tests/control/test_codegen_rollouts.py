"""Rollouts by generated kernels, run on the host as C++, against the generated step and law in C."""

from __future__ import annotations

import re
import sys
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.generated_code import write_files
from samples.host_gpu import HostProject, contiguous, host_cupy, host_project, record_of
from samples.marks import needs, needs_compiler, slow_but
from samples.shipped import shipped_robot, shipped_run

from vsacli import Gains, State, inverse_dynamics, state_derivative
from vsacli.control.codegen.project import generate
from vsacli.control.codegen.self_test import Arrays

pytestmark = [needs_compiler, needs("g++", "g++"), pytest.mark.filterwarnings("ignore:dt = ")]

RUNS = {"tendon_1r": "tendon_1r", "vsa_3r": "rest_to_rest", "maccepa_vd_1r": "maccepa_vd_1r"}
"""Robots and trajectories at whose start they stand."""

SMALL = "tendon_1r"
DT = 1e-3
SAMPLES = 5
STEPS = 12
TOLERANCE = 1e-12
"""Of integrals and what follows from them: rounding of the stiffness in NumPy, times the gains."""


def start(name: str, seed: int = 1) -> tuple[Arrays, Arrays]:
    """States near the start of a trajectory, and torques near those that hold it, (samples, ...)."""
    robot, trajectory = shipped_run(name, RUNS[name])
    first, rng = inverse_dynamics(robot, trajectory), np.random.default_rng(seed)
    state = {
        part: np.nan_to_num(getattr(first, part)[:1]).repeat(SAMPLES, 0)
        for part in ("q", "dq", "theta", "dtheta")
    }
    for part in ("q", "dq"):
        state[part] += rng.uniform(-1e-3, 1e-3, state[part].shape)
    torque = np.nan_to_num(first.tau_motor[:1]) * rng.uniform(0.9, 1.1, (SAMPLES, len(robot.joints), 2))
    acting = {"tau_motor": torque}
    if "damping" in host_project(name).cpu.Input.names:
        acting["damping"] = np.full((SAMPLES, len(robot.joints)), 0.1)
    return state, acting


def steps_in_c(
    project: HostProject, state: Any, acting: list[Any], *parameters: Any, every: int = 1
) -> tuple[list[Any], Any]:
    """States after each `every` steps, and the flags of all steps together."""
    states, flags = [], np.zeros(len(state), np.uint32)
    for held in acting:
        state, of_step = project.cpu.step(state, held, DT, *parameters)
        states.append(state)
        flags |= of_step
    return states[every - 1 :: every], flags


def assert_states(found: Arrays, expected: list[Any]) -> None:
    """States (instants, ..., samples) are records, one array for each instant."""
    for name, values in found.items():
        np.testing.assert_array_equal(
            np.moveaxis(np.asarray(values), -1, 1), [each[name] for each in expected]
        )


@pytest.mark.parametrize("name", slow_but({SMALL}, RUNS))
def test_a_rollout_is_the_steps_in_c_to_the_bit(name: str) -> None:
    project, (state, acting) = host_project(name), start(name)
    records = record_of(project, "state", state), record_of(project, "input", acting)
    expected, expected_flags = steps_in_c(project, records[0], [records[1]] * STEPS, every=3)
    found, flags = project.gpu.rollout(contiguous(state), contiguous(acting), DT, STEPS, every=3)
    assert_states(found, expected)
    np.testing.assert_array_equal(flags, expected_flags)
    last, _ = project.gpu.rollout(state, acting, DT, STEPS, sample_axis=0)
    assert_states(last, expected[-1:])


def test_torques_over_time_shared_or_one_a_sample() -> None:
    project, (state, acting) = host_project(SMALL), start(SMALL)
    first = record_of(project, "state", state)
    over_time = (
        acting["tau_motor"] * np.linspace(0.9, 1.1, STEPS)[:, None, None, None]
    )  # (steps, samples, 1, 2)
    cases = {
        "shared": (over_time[:, 0, ..., None], over_time[:, :1].repeat(SAMPLES, 1)),
        "one a sample": (np.moveaxis(over_time, 1, -1), over_time),
        "constant and shared": (over_time[0, 0], over_time[:1, :1].repeat(SAMPLES, 1).repeat(STEPS, 0)),
    }
    for given, torques in cases.values():
        held = [record_of(project, "input", {"tau_motor": torque}) for torque in torques]
        expected, _ = steps_in_c(project, first, held, every=4)
        found, _ = project.gpu.rollout(contiguous(state), given, DT, STEPS, every=4)
        assert_states(found, expected)


def test_a_wrench_over_time() -> None:
    project, (state, acting) = host_project(SMALL, wrench="base"), start(SMALL)
    drawn = np.random.default_rng(2).uniform(-1, 1, (STEPS, 6))
    zero = np.zeros((SAMPLES, 6))
    current, flags = record_of(project, "state", state), np.zeros(SAMPLES, np.uint32)
    torques = record_of(project, "input", acting)
    for wrench in drawn:
        arrays = {"wrench": wrench[None].repeat(SAMPLES, 0), "dwrench": zero, "ddwrench": zero}
        current, of_step = project.cpu.step(current, torques, DT, record_of(project, "wrench", arrays))
        flags |= of_step
    given = {"wrench": drawn[..., None], "dwrench": 0, "ddwrench": 0}
    found, found_flags = project.gpu.rollout(contiguous(state), contiguous(acting), DT, STEPS, wrench=given)
    assert_states(found, [current])
    np.testing.assert_array_equal(found_flags, flags)


def reference(name: str, controls: int, period: float) -> Arrays:
    """Commands over time, (controls, joints), of which all joints have a stiffness."""
    robot, trajectory = shipped_run(name, RUNS[name])
    motion = trajectory.at(np.arange(controls) * period)
    values = motion.variables()
    zero = np.zeros((controls, len(robot.joints)))
    return {
        signal: np.nan_to_num(values.get(signal, zero)) for signal in host_project(name).cpu.Command.names
    }


def gains_of(name: str, integral: bool) -> Arrays:
    """Gains of all joints; with integral action one pole more."""
    gains = Gains.from_poles([-20.0] * (4 + integral), [-20.0] * (2 + integral))
    members = ("position", "stiffness", "position_integral", "stiffness_integral")
    joints = len(shipped_run(name, RUNS[name])[0].joints)
    return {part: getattr(gains, part).repeat(joints, 0) for part in members}


def stiffness_in_numpy(name: str, state: Any) -> np.ndarray:
    """Stiffness of the joints, (samples, joints)."""
    from vsacli.dynamics.forward import Plant

    drivetrain = Plant(shipped_run(name, RUNS[name])[0]).drivetrain
    return drivetrain.stiffness(state["q"], drivetrain.of_motors(state["theta"])[..., drivetrain.sprung])


class Loop(NamedTuple):
    """A loop of law and plant in C, the law in every `every`-th step, with further arguments of each."""

    name: str
    project: HostProject
    command: Arrays
    gains: Arrays
    every: int = 1
    plant: tuple[Any, ...] = ()
    law: tuple[Any, ...] = ()

    def run(self, state: Any) -> tuple[Any, Any, Any]:
        """Last state, flags of all steps together, integrals."""
        cpu = self.project.cpu
        gains = record_of(self.project, "gains", {part: each[None] for part, each in self.gains.items()})[0]
        integral, acting = np.zeros(len(state), cpu.Integral), np.zeros(len(state), cpu.Input)
        flags = np.zeros(len(state), np.uint32)
        for step in range(STEPS):
            if step % self.every == 0:
                at = {part: values[step // self.every][None] for part, values in self.command.items()}
                record = record_of(self.project, "command", at)
                control, of_law = cpu.feedback_linearization(state, record, gains, integral, *self.law)
                flags |= of_law
                for part in acting.dtype.names:
                    acting[part] = control[part] if part == "tau_motor" else record[part]
                period = DT * min(self.every, STEPS - step)
                integral["q"] += period * (record["q"] - state["q"])
                integral["stiffness"] += period * (record["stiffness"] - stiffness_in_numpy(self.name, state))
            state, of_step = cpu.step(state, acting, DT, *self.plant)
            flags |= of_step
        return state, flags, integral


@pytest.mark.parametrize("integral", [False, True])
@pytest.mark.parametrize("name", slow_but({SMALL}, RUNS))
def test_a_rollout_under_the_law_is_the_loop_in_c(name: str, integral: bool) -> None:
    project, (state, _) = host_project(name), start(name)
    command, gains = reference(name, 3, 5 * DT), gains_of(name, integral)
    loop = Loop(name, project, command, gains, every=5)
    expected, flags, integrals = loop.run(record_of(project, "state", state))
    shared = {part: values[..., None] for part, values in command.items()}
    found, found_flags, found_integrals = project.gpu.rollout_law(
        contiguous(state), shared, gains, DT, STEPS, control_every=5, every=4
    )
    for part, values in found.items():
        assert values.shape == (3, *contiguous(state)[part].shape)
        close = np.moveaxis(np.asarray(values[-1]), -1, 0)
        np.testing.assert_allclose(close, expected[part], rtol=TOLERANCE if integral else 0)
    np.testing.assert_array_equal(found_flags, flags)
    for part, values in found_integrals.items():
        wanted = integrals[part] if integral else np.zeros_like(integrals[part])
        np.testing.assert_allclose(np.broadcast_to(values, wanted.T.shape).T, wanted, rtol=TOLERANCE)


def test_plant_and_law_have_parameters_of_their_own() -> None:
    project, (state, _) = host_project(SMALL, patterns=("joints.*.link.mass",)), start(SMALL)
    nominal = project.cpu.NOMINAL_PARAMETERS
    (mass,) = nominal.dtype.names
    drawn = nominal[mass] * np.linspace(1, 1.3, SAMPLES)
    heavier = record_of(project, "parameters", {mass: drawn})
    command, gains = reference(SMALL, STEPS, DT), gains_of(SMALL, integral=False)
    shared = {part: values[..., None] for part, values in command.items()}
    last = []
    for plant, law in ((nominal, nominal), (heavier, nominal), (heavier, heavier)):
        loop = Loop(SMALL, project, command, gains, plant=(plant,), law=(law,))
        expected, _, _ = loop.run(record_of(project, "state", state))
        own = {
            key: {mass: drawn}
            for key, each in (("parameters", plant), ("law_parameters", law))
            if each is heavier
        }
        found, _, _ = project.gpu.rollout_law(contiguous(state), shared, gains, DT, STEPS, **own)
        assert_states(found, [expected])
        last.append(np.asarray(found["q"]))
    assert not np.array_equal(last[0], last[1])
    assert not np.array_equal(last[1], last[2])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"steps": 10, "every": 3}, "every is 3, expected a divisor of the number of steps, 10"),
        ({"steps": 0}, "every is 0, expected a divisor of the number of steps, 0"),
        (
            {"torques": np.zeros((7, 1, 2, 1))},
            r"input\.tau_motor has 7 steps, expected 12, or 1 if constant",
        ),
        (
            {"torques": np.zeros((12, 1, 2))},
            r"input\.tau_motor has the shape \(12, 1, 2\), expected \(1, 2\) or \(1, 2, samples\) or "
            r"\(steps, 1, 2, samples\)",
        ),
    ],
)
def test_wrong_steps(changes: dict[str, Any], message: str) -> None:
    state, acting = start(SMALL)
    given = {"torques": contiguous(acting), "steps": STEPS, **changes}
    with pytest.raises(ValueError, match=message):
        host_project(SMALL).gpu.rollout(contiguous(state), given.pop("torques"), DT, **given)


def test_controls_are_at_least_a_step_apart() -> None:
    state, _ = start(SMALL)
    with pytest.raises(ValueError, match="control_every is 0, expected 1 or more"):
        host_project(SMALL).gpu.rollout_law(contiguous(state), {}, {}, DT, STEPS, control_every=0)


def test_a_step_that_is_long_for_the_plant_is_told_once() -> None:
    """The fastest vibration is that of the linearized plant in NumPy."""
    project, (state, acting) = host_project(SMALL), start(SMALL)
    fastest = max(fastest_vibration(SMALL, state, acting, sample) for sample in range(SAMPLES))
    for dt, told in ((0.2 / fastest, False), (0.3 / fastest, True), (0.3 / fastest, False)):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            project.gpu.rollout(contiguous(state), contiguous(acting), dt, 1)
        assert [str(each.message) for each in caught] == [
            f"dt = {dt:g} s is long for the fastest vibration of the plant, {fastest:.3g} rad/s: a step of "
            f"this method requires dt below {0.25 / fastest:.2g} s, and is unstable from "
            f"{2.8 / fastest:.2g} s on"
        ] * told


def fastest_vibration(name: str, state: Arrays, acting: Arrays, sample: int) -> float:
    """Largest magnitude of the eigenvalues of the equations of motion at a sample, by differences, rad/s."""
    robot, _ = shipped_run(name, RUNS[name])
    at = np.concatenate([values[sample].ravel() for values in state.values()])
    ends = np.cumsum([values[sample].size for values in state.values()])[:-1]

    def rates(entries: np.ndarray) -> np.ndarray:
        parts = [
            part.reshape(values[sample].shape)
            for part, values in zip(np.split(entries, ends), state.values(), strict=True)
        ]
        return np.concatenate(
            [part.ravel() for part in state_derivative(robot, State(*parts), acting["tau_motor"][sample])]
        )

    columns = [(rates(at + 1e-6 * unit) - rates(at - 1e-6 * unit)) / 2e-6 for unit in np.eye(len(at))]
    return float(np.abs(np.linalg.eigvals(np.nan_to_num(np.transpose(columns)))).max())


@pytest.mark.slow
def test_the_million_arms_of_the_page(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With fewer arms, and the arrays of the host."""
    page = (REPOSITORY / "docs" / "million-arms.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"^```text\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    (count,) = re.findall(r"`ARMS = (\d+)`", page)
    source = (REPOSITORY / "docs" / "examples" / "million_arms.py").read_text(encoding="utf-8")
    assert "1_000_000" in source
    project = generate(shipped_robot("vsa_3r"), patterns=("joints.*.link.mass",))
    (tmp_path / "arms").mkdir()
    write_files(project, tmp_path / "arms")
    cupy: Any = host_cupy()
    cupy.abs, cupy.percentile = np.abs, np.percentile
    monkeypatch.setitem(sys.modules, "cupy", cupy)
    for name in ("robots", "trajectories"):
        (tmp_path / name).symlink_to(REPOSITORY / name)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    exec(compile(source.replace("1_000_000", count), "million_arms.py", "exec"), {"__name__": "arms"})
    assert capsys.readouterr().out == shown
