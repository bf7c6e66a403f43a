"""The generated plant against the equations of motion in NumPy, and against integrators of SciPy."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from samples.codegen import with_springs
from samples.command_line import REPOSITORY, Outcome
from samples.generated_code import STRICT, Compiled, compile_c, compiled_robot, write_files
from samples.long_chains import random_chain
from samples.marks import needs_compiler, slow_but
from samples.plants import elastic, random_state, rigid, with_actuators
from samples.shipped import shipped_robot, shipped_run
from samples.trees import random_tree
from scipy.integrate import solve_ivp

from vsacli import (
    Flag,
    Gains,
    InitialError,
    Rigid,
    Robot,
    State,
    Wrench,
    inverse_dynamics,
    link_torques,
    mass_matrix,
    simulate,
    state_derivative,
)
from vsacli.base.wrench import WRENCH_NAMES, WrenchFrame
from vsacli.control.codegen import interface
from vsacli.control.codegen.parameters import with_parameters
from vsacli.control.codegen.plant_functions import state_derivative_function, step_function
from vsacli.control.codegen.project import generate
from vsacli.control.codegen.self_test import ReferenceResults
from vsacli.robot.parameters import parameters

pytestmark = needs_compiler

PARTS = ("q", "dq", "theta", "dtheta")
RATES = ("dq", "ddq", "dtheta", "ddtheta")

ROUNDING = 1e-13
"""Of the peak: rounding of 1e-16 times the condition of M, up to 1e3 here; 1e-15 is seen."""

Arrays = dict[str, np.ndarray]


def peak_error(found: Arrays, expected: Arrays) -> float:
    """Largest difference relative to the peak of its array; NaN must be at the same places."""
    errors = [0.0]
    for name, values in expected.items():
        np.testing.assert_array_equal(np.isnan(found[name]), np.isnan(values), err_msg=name)
        difference = np.abs(found[name] - values)[np.isfinite(values)]
        errors.append(difference.max(initial=0.0) / np.abs(values[np.isfinite(values)]).max(initial=1e-300))
    return max(errors)


def clipped(robot: Robot, torque: np.ndarray) -> np.ndarray:
    """Torques, (..., joints, 2), none beyond the largest of its motor."""
    largest = np.zeros((len(robot.joints), 2))
    for of_joint, joint in zip(largest, robot.joints, strict=True):
        of_joint[: joint.actuator.motor_count] = [motor.max_torque for motor in joint.actuator.motors]
    return np.clip(torque, -largest, largest)


def rates_in_numpy(robot: Robot, state: Arrays, acting: Arrays, wrench: Wrench | None = None) -> Arrays:
    """The rates by `vsacli.state_derivative`, whose motors have no largest torque."""
    rates = state_derivative(
        robot, State(**state), clipped(robot, acting["tau_motor"]), wrench, damping=acting.get("damping")
    )
    return rates._asdict()


def wrench_on(robot: Robot, frame: WrenchFrame, arrays: Arrays) -> Wrench:
    """The wrench of the argument of a function, zero on tools without a frame."""
    tools = [f"_{name.replace('-', '_')}" for name in robot.tool_names] if len(robot.tool_names) > 1 else [""]
    idle = np.zeros((len(next(iter(arrays.values()))), 6))
    parts = [np.hstack([arrays.get(f"{name}{tool}", idle) for tool in tools]) for name in WRENCH_NAMES]
    return Wrench(*parts, frame=frame)


def check_derivative(robot: Robot, folder: Path, frame: WrenchFrame | None = None) -> None:
    function = state_derivative_function(robot, frame)
    state, acting, *wrenches = ReferenceResults(robot, (), frame).inputs(function)
    code = compiled_robot(folder / "c", robot, [function], "double")
    found, flags = code(function, state, acting, *wrenches)
    wrench = None if frame is None else wrench_on(robot, frame, wrenches[0])
    assert peak_error(found, rates_in_numpy(robot, state, acting, wrench)) < ROUNDING
    np.testing.assert_array_equal(flags, np.bitwise_or.reduce(found["flags"], axis=1))


BUNDLED = sorted(
    str(path.relative_to(REPOSITORY / "robots").with_suffix(""))
    for path in (REPOSITORY / "robots").rglob("*.yaml")
    if path.stem != "puma_560"
)
"""Robots whose motors have no sharp friction."""

MIXED = with_actuators(shipped_robot("torso_2x3r"), {0: rigid(), 3: elastic()})

ROBOTS: dict[str, Robot] = {
    "3R": shipped_robot("vsa_3r"),
    "branches": shipped_robot("hand_3x2r"),
    "mixed": MIXED,
    "a link damper": shipped_robot("maccepa_vd_1r"),
    "a damped transmission": shipped_robot("compact_1r"),
    "coupled rotors": shipped_robot("awas_1r"),
    "iteration": shipped_robot("sliding_anchor_1r"),
    "table": with_springs("table"),
}


@pytest.mark.cases(5)
@pytest.mark.parametrize("name", slow_but({"branches", "mixed", "a damped transmission"}, ROBOTS))
def test_the_derivative_is_that_of_the_equations_of_motion(name: str, tmp_path: Path) -> None:
    check_derivative(ROBOTS[name], tmp_path)


def smooth_tree(seed: int) -> Robot:
    """A random tree whose motors do not stick."""
    changes: dict[str, Any] = {}
    robot = random_tree(seed)
    for joint in robot.joints:
        for side, motor in enumerate(joint.actuator.motors):
            if motor.friction and motor.friction.sharp:
                many = len(joint.actuator.motors) > 1
                path = f"joints.{joint.name}.actuator.motor{f'.{side}' if many else ''}.friction.width"
                changes[path] = 0.5
    return robot.replace(changes)


@pytest.mark.slow
@pytest.mark.cases(4)
@pytest.mark.parametrize("seed", range(20))
def test_random_trees_with_wrenches_on_their_tools(seed: int, tmp_path: Path) -> None:
    robot = smooth_tree(seed)
    frames = ("base", *("end_effector",) * len(robot.tool_names))[: len(robot.tool_names)]
    check_derivative(robot, tmp_path, frames if len(frames) > 1 else frames[0])


class PlantInC(NamedTuple):
    """The compiled plant of a robot, with constant arguments beside the state."""

    module: Any
    acting: Any

    @classmethod
    def of(cls, robot: Robot, folder: Path, torque: np.ndarray) -> PlantInC:
        """Compile both functions; dampers stand at the least of their range."""
        folder.mkdir(exist_ok=True)
        derivative = state_derivative_function(robot)
        functions = [derivative, step_function(robot, derivative)]
        module = compiled_robot(folder / "c", robot, functions, "double").module
        acting = np.zeros((), module.Input)
        acting["tau_motor"] = torque
        if "damping" in acting.dtype.names:
            acting["damping"] = [joint.damper.range[0] if joint.damper else 0 for joint in robot.joints]
        return cls(module, acting)

    def state(self, arrays: Arrays) -> Any:
        """Return the record of a state."""
        record = np.zeros((), self.module.State)
        for name in PARTS:
            record[name] = arrays[name]
        return record

    def steps(self, start: Any, duration: float, count: int) -> Any:
        """Return the state after steps of equal length."""
        state = start
        for _ in range(count):
            state, _ = self.module.step(state, self.acting, duration / count)
        return state


RUNS = {
    "vsa_3r": "rest_to_rest",
    "lwr_7r_vsa": "lwr_7r",
    **{name: name for name in ("torso_2x3r", "mixed_3r", "scara_4", "compact_1r", "maccepa_vd_1r", "rp_2")},
}
"""Robots with smooth laws, and trajectories at whose start they stand."""


def pushed(name: str) -> tuple[Robot, Arrays, np.ndarray]:
    """A robot in the equilibrium at the start of its trajectory, its joints pushed, and its torques."""
    robot, trajectory = shipped_run(name, RUNS[name])
    first = inverse_dynamics(robot, trajectory)
    start = {part: np.nan_to_num(getattr(first, part)[0]) for part in PARTS}
    start["dq"] += 0.2
    start["dtheta"][[isinstance(joint.actuator, Rigid) for joint in robot.joints]] = 0.2
    return robot, start, np.nan_to_num(first.tau_motor[0])


def vector_of(record: Any) -> np.ndarray:
    return np.concatenate([np.ravel(record[name]) for name in PARTS])


def exact_end(robot: Robot, start: Arrays, torque: np.ndarray, duration: float) -> np.ndarray:
    """The state at the end by DOP853 of SciPy and the equations in NumPy."""
    shapes = {name: start[name].shape for name in PARTS}
    ends = np.cumsum([np.prod(shape) for shape in shapes.values()])[:-1]

    def derivative(_time: float, vector: np.ndarray) -> np.ndarray:
        parts = zip(shapes.items(), np.split(vector, ends), strict=True)
        state = State(**{name: part.reshape(shape) for (name, shape), part in parts})
        return np.nan_to_num(
            np.concatenate([np.ravel(rate) for rate in state_derivative(robot, state, torque)])
        )

    begin = np.concatenate([start[name].ravel() for name in PARTS])
    run = solve_ivp(derivative, (0, duration), begin, "DOP853", rtol=3e-14, atol=1e-16)
    return np.asarray(run.y[:, -1])


def fastest_rate(robot: Robot, start: Arrays, torque: np.ndarray) -> float:
    """Largest |eigenvalue| of the equations of motion about a state, 1/s."""
    begin = np.concatenate([start[name].ravel() for name in PARTS])
    shifts = 1e-6 * np.vstack([np.eye(begin.size), -np.eye(begin.size)])
    rows = begin + shifts
    joints = len(robot.joints)
    q, dq, theta, dtheta = np.split(rows, [joints, 2 * joints, 4 * joints], axis=1)
    motors = (-1, joints, 2)
    state = State(q, dq, theta.reshape(motors), dtheta.reshape(motors))
    rates = state_derivative(robot, state, np.broadcast_to(torque, (len(rows), joints, 2)))
    values = np.nan_to_num(np.hstack([rate.reshape(len(rows), -1) for rate in rates]))
    slopes = (values[: begin.size] - values[begin.size :]).T / 2e-6
    return float(np.abs(np.linalg.eigvals(slopes)).max())


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", slow_but({"mixed_3r", "compact_1r"}, RUNS))
def test_the_error_of_a_step_falls_with_the_fourth_power_of_its_duration(name: str, tmp_path: Path) -> None:
    robot, start, torque = pushed(name)
    plant = PlantInC.of(robot, tmp_path, torque)
    duration = 6.0 / fastest_rate(robot, start, torque)
    expected = exact_end(robot, start, torque, duration)
    ends = [vector_of(plant.steps(plant.state(start), duration, 96 * 2**halving)) for halving in range(4)]
    errors = [np.nanmax(np.abs(end - expected)) for end in ends]
    ratios = [coarse / fine for coarse, fine in pairwise(errors)]
    assert min(ratios) > 14, errors
    assert max(ratios) < 18, errors


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", BUNDLED)
def test_every_bundled_robot_moves_as_in_numpy(name: str, tmp_path: Path) -> None:
    """From states of the self-test, in steps short against the fastest vibration, by another integrator."""
    robot = shipped_robot(name)
    drawn, acting = ReferenceResults(robot).inputs(state_derivative_function(robot))
    for case in range(3):
        start = {part: np.nan_to_num(drawn[part][case]) for part in PARTS}
        rigid_joints = [isinstance(joint.actuator, Rigid) for joint in robot.joints]
        start["theta"][rigid_joints, 0] = start["q"][rigid_joints]
        start["dtheta"][rigid_joints, 0] = start["dq"][rigid_joints]
        torque = clipped(robot, 0.1 * acting["tau_motor"][case])
        plant = PlantInC.of(robot, tmp_path / str(case), torque)
        duration = min(0.002, 0.5 / fastest_rate(robot, start, torque))
        end = vector_of(plant.steps(plant.state(start), duration, 50))
        expected = exact_end(robot, start, torque, duration)
        # (dt rate)^5/120 = 1e-12 a step, more where springs are stiffer or have corners; 1e-10 is seen
        assert np.nanmax(np.abs(end - expected)) < 1e-8 * np.abs(expected).max(), case


def test_a_step_may_write_over_its_state(tmp_path: Path) -> None:
    (tmp_path / "main.c").write_text(
        '#include "vsa_3r.h"\n#include <string.h>\n'
        "int main(void)\n{\n"
        "    vsa_3r_state state = {.q = {0.1, 0.2, 0.3}, .dtheta = {{1, 2}, {3, 4}, {5, 6}}}, next;\n"
        "    const vsa_3r_input input = {.tau_motor = {{9, -8}, {7, -6}, {5, -4}}};\n"
        "    const unsigned flags = vsa_3r_step(&state, &input, 1e-3, &next);\n"
        "    const unsigned again = vsa_3r_step(&state, &input, 1e-3, &state);\n"
        "    return flags || again || memcmp(&state, &next, sizeof next);\n"
        "}\n"
    )
    write_files(generate(shipped_robot("vsa_3r")), tmp_path)
    compile_c(tmp_path, *STRICT, "main.c", "vsa_3r.c", "-o", "main", "-lm")
    assert subprocess.run(["./main"], cwd=tmp_path, check=False).returncode == 0


def undamped() -> Robot:
    """The 3R arm without any loss."""
    losses = {"joints.*.damping": 0.0, "joints.*.actuator.motor.damping": 0.0}
    return shipped_robot("vsa_3r").replace(losses)


def energy(robot: Robot, record: Any) -> float:
    """Of links, motors and springs, J; the springs are those of Table I."""
    q, dq = record["q"], record["dq"]
    kinetic = dq @ mass_matrix(robot, q) @ dq / 2
    inertia = np.array([[motor.inertia for motor in joint.actuator.motors] for joint in robot.joints])
    phi = record["theta"] - q[:, None]
    springs = (200 * phi**2 + 500 * phi**4).sum()
    return float(kinetic + (inertia * record["dtheta"] ** 2).sum() / 2 + springs + height_energy(robot, q))


def height_energy(robot: Robot, q: np.ndarray) -> float:
    """The potential of gravity, J, as the integral of the torques that hold the links, from q = 0."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    path = (nodes[:, None] + 1) / 2 * q
    none = np.zeros_like(path)
    holding = link_torques(robot, path, none, none, none, none)[0]
    return float(weights @ (holding @ q) / 2)


def test_the_energy_of_an_undamped_arm_drifts_with_the_fourth_power_of_a_step(tmp_path: Path) -> None:
    robot = undamped()
    plant = PlantInC.of(robot, tmp_path, np.zeros((3, 2)))
    q = np.array([0.3, -0.4, 0.5])
    theta = q[:, None] + [[0.1, -0.05]] * 3
    start = plant.state({"q": q, "dq": 0 * q, "theta": theta, "dtheta": 0 * theta})
    begin = energy(robot, start)
    drifts = [abs(energy(robot, plant.steps(start, 0.4, count)) - begin) for count in (200, 400, 800)]
    assert min(coarse / fine for coarse, fine in pairwise(drifts)) > 14, drifts


def test_a_plant_of_ones_own(tmp_path: Path) -> None:
    """M by differences of link torques, springs and motors of Table I, and one's own steps."""
    robot = shipped_robot("vsa_3r")
    inertia = np.array([[3.20] * 2, [3.05] * 2, [1.98] * 2])
    torque = np.random.default_rng(4).uniform(-50, 50, (3, 2))

    def torques(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        none = np.zeros((len(ddq), 3))
        return link_torques(robot, none + q, none + dq, ddq, none, none)[0]

    def derivative(x: np.ndarray) -> np.ndarray:
        q, dq, theta, dtheta = x[:3], x[3:6], x[6:12].reshape(3, 2), x[12:].reshape(3, 2)
        bias, *columns = torques(q, dq, np.vstack([np.zeros(3), np.eye(3)]))
        phi = theta - q[:, None]
        spring = 400 * phi + 2000 * phi**3
        ddq = np.linalg.solve(np.array(columns).T - bias[:, None], spring.sum(axis=1) - bias)
        return np.concatenate(
            [dq, ddq, dtheta.ravel(), ((torque - 1e-4 * dtheta - spring) / inertia).ravel()]
        )

    def step(x: np.ndarray, h: float) -> np.ndarray:
        one = derivative(x)
        two = derivative(x + h / 2 * one)
        three = derivative(x + h / 2 * two)
        return x + h / 6 * (one + 2 * two + 2 * three + derivative(x + h * three))

    plant = PlantInC.of(robot, tmp_path, torque)
    state = random_state(robot, 1, seed=3)
    record = plant.state({part: getattr(state, part)[0] for part in PARTS})
    x = vector_of(record)
    for _ in range(100):
        x = step(x, 1e-3)
    # M by differences of torques some 1e3 times its own, which the vibration does not amplify
    np.testing.assert_allclose(
        vector_of(plant.steps(record, 0.1, 100)), x, rtol=0, atol=1e-9 * np.abs(x).max()
    )


@pytest.mark.slow
def test_the_closed_loop_is_that_of_a_simulation(tmp_path: Path) -> None:
    """Law and plant, both generated, under an integrator of SciPy; `simulate` has one of its own."""
    robot, trajectory = shipped_run("vsa_3r", "rest_to_rest")
    gains, error = Gains.from_poles([-20] * 4, [-20] * 2), 0.01
    write_files(generate(robot), tmp_path)
    module = Compiled(tmp_path, "vsa_3r").module
    of_gains = np.zeros((), module.Gains)
    for name in ("position", "stiffness"):
        of_gains[name] = getattr(gains, name)
    command, acting = np.zeros((), module.Command), np.zeros((), module.Input)
    state, still = np.zeros((), module.State), np.zeros((), module.Integral)

    def derivative(time: float, vector: np.ndarray) -> np.ndarray:
        for name, part in zip(PARTS, np.split(vector, [3, 6, 12]), strict=True):
            state[name] = part.reshape(state[name].shape)
        reference = trajectory.at(np.array([time]))
        for name in command.dtype.names:
            command[name] = reference.variables()[name][0]
        control, _ = module.feedback_linearization(state, command, of_gains, still)
        acting["tau_motor"] = control["tau_motor"]
        return np.concatenate([np.ravel(module.state_derivative(state, acting)[0][name]) for name in RATES])

    found = simulate(robot, trajectory, gains=gains, initial_error=InitialError(q=error)).history
    times = found.time[:: len(found.time) // 8]
    begin = np.concatenate([np.ravel(getattr(found, name)[0]) for name in PARTS])
    run = solve_ivp(derivative, (times[0], times[-1]), begin, "DOP853", times, rtol=1e-10, atol=1e-12)
    expected = found.q[:: len(found.time) // 8]
    # simulate's tolerance is 1e-9 of the state, which the law contracts
    np.testing.assert_allclose(run.y[:3].T, expected, rtol=0, atol=1e-8)
    assert np.abs(expected[0] - trajectory.at(times[:1]).q[0]).max() == pytest.approx(error)


@pytest.mark.parametrize("name", ["3R", "mixed"])
def test_parameters_are_those_of_another_robot(name: str, tmp_path: Path) -> None:
    robot, rng = ROBOTS[name], np.random.default_rng(4)
    patterns = ["joints.*.link.mass", "joints.*motor*inertia", "joints.*spring*k"]
    chosen = parameters(robot, patterns)
    derivative = with_parameters(state_derivative_function, robot, None, chosen)
    functions = [derivative, step_function(robot, derivative)]
    code = compiled_robot(tmp_path / "c", robot, functions, "double")
    state, acting = ReferenceResults(robot).inputs(state_derivative_function(robot))
    changed = {str(each): each.value * rng.uniform(1, 1.2) for each in chosen}
    samples = len(state["q"])
    given = {"_".join(each.by_index): np.full(samples, changed[str(each)]) for each in chosen}
    found, _ = code(derivative, state, acting, given)
    assert peak_error(found, rates_in_numpy(robot.replace(changed), state, acting)) < ROUNDING
    later, _ = code(functions[1], state, acting, 1e-7, given)
    # to first order in dt: the next term is 1e-7^2 times the rates of the rates
    assert peak_error({"q": (later["q"] - state["q"]) / 1e-7}, {"q": found["dq"]}) < 1e-3


@pytest.mark.slow
def test_feedback_linearization_takes_parameters(tmp_path: Path) -> None:
    project = generate(shipped_robot("vsa_3r"), patterns=["joints.elbow.link.mass", "joints.*.spring.k"])
    assert project.omitted == []
    write_files(project, tmp_path)
    compile_c(tmp_path, *STRICT, "vsa_3r.c", "vsa_3r_test.c", "-o", "test", "-lm")
    done = subprocess.run(["./test"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout == "all values agree\n"
    header = " ".join(project.files["vsa_3r.h"].split())
    assert "vsa_3r_integral *integral, const vsa_3r_parameters *parameters, vsa_3r_control *c" in header
    assert "vsa_3r_input *input, double dt, const vsa_3r_parameters *parameters, vsa_3r_state *n" in header


def test_numbers_that_are_none_and_springs_beyond_their_law_are_flagged(tmp_path: Path) -> None:
    robot = shipped_robot("tendon_1r")
    plant = PlantInC.of(robot, tmp_path, np.zeros((1, 2)))
    pulled = plant.state({"q": [0.0], "dq": [0.0], "theta": [[0.3, -0.3]], "dtheta": [[0.0, 0.0]]})
    rates, flags = plant.module.state_derivative(pulled, plant.acting)
    assert flags == rates["flags"][0] == 0
    slack = pulled.copy()
    slack["theta"][0, 0] = -0.3
    rates, flags = plant.module.state_derivative(slack, plant.acting)
    assert flags == rates["flags"][0] == Flag.INFEASIBLE
    lost = pulled.copy()
    lost["dtheta"][0, 1] = np.nan
    for function, further in ((plant.module.state_derivative, ()), (plant.module.step, (1e-3,))):
        _, flags = function(lost, plant.acting, *further)
        assert flags & Flag.NOT_FINITE
        assert flags & Flag.INFEASIBLE


def test_a_motor_exerts_at_most_its_largest_torque(tmp_path: Path) -> None:
    robot = shipped_robot("vsa_3r").replace({"joints.*.actuator.motor.max_torque": 10.0})
    function = state_derivative_function(robot)
    state, acting = ReferenceResults(robot).inputs(function)
    code = compiled_robot(tmp_path / "c", robot, [function], "double")
    at_most, _ = code(function, state, {"tau_motor": np.clip(acting["tau_motor"], -10, 10)})
    found, _ = code(function, state, acting)
    assert np.abs(acting["tau_motor"]).max() > 10
    np.testing.assert_array_equal(found["ddtheta"], at_most["ddtheta"])


def test_sharp_friction_leaves_the_plant_out(vsacli: Callable[..., Outcome]) -> None:
    joints = "waist, shoulder, elbow, forearm, wrist, flange"
    done = vsacli("codegen", REPOSITORY / "robots" / "puma_560.yaml", "-o", "c")
    assert done.code == 0
    reason = f"no state_derivative and no step: the motors of {joints} have friction without a width"
    assert reason in done.err
    readme = Path("c/README.md").read_text().replace("\\", "")
    assert f"There is {reason}" in readme
    assert "_step(" not in Path("c/puma_560.c").read_text()


def test_the_documents_count_operations() -> None:
    readme = generate(shipped_robot("vsa_3r")).files["README.md"]
    assert "| `state_derivative` | 377 | 13 | 0 |" in readme
    assert "| `step` | 1,726 | 52 | 0 |" in readme


@pytest.mark.slow
def test_a_long_arm_of_calls_steps_as_well(tmp_path: Path, most_operations: Callable[..., None]) -> None:
    robot = random_chain(6)
    derivative = state_derivative_function(robot)
    inputs = ReferenceResults(robot).inputs(derivative)
    found = []
    for folder, most in (("written_out", interface.MOST_WRITTEN_OUT), ("calls", 500)):
        most_operations(most)
        derivative = state_derivative_function(robot)
        step = step_function(robot, derivative)
        code = compiled_robot(tmp_path / folder, robot, [derivative, step], "double")
        found.append(code(step, *inputs, 1e-3)[0])
    for part in PARTS:
        np.testing.assert_array_equal(found[0][part], found[1][part])
