"""Generated functions that take numbers of the robot as an argument, against robots with these numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from samples.codegen import CLOSE, commands, expected_of, motion_of, with_springs
from samples.generated_code import STRICT, compile_c, compiled_robot, write_files
from samples.marks import needs_compiler, slow, slow_but
from samples.shipped import shipped_robot

from vsacli import Elastic, Friction, InputError, Motor, Robot, State, motor_torques, state_derivative
from vsacli.base.variables import Block
from vsacli.control.codegen.parameters import PARAMETERS, check_parameters, with_parameters
from vsacli.control.codegen.plant_functions import state_derivative_function
from vsacli.control.codegen.project import generate
from vsacli.control.codegen.robot_functions import inverse_dynamics_function, link_torques_function
from vsacli.control.codegen.self_test import CASES, ReferenceResults
from vsacli.robot.parameters import Parameter, parameters

SAMPLES = 30


def with_friction() -> Robot:
    """An elastic joint whose motor has smooth friction and windings."""
    robot = shipped_robot("vsa_3r")
    motor = Motor(inertia=0.5, damping=0.1, friction=Friction(coulomb=(0.5, 0.6), offset=0.1, width=0.1))
    elastic = Elastic(motor=motor, stiffness=800.0)
    joints = (*robot.joints[:2], replace(robot.joints[2], actuator=elastic))
    return replace(robot, name="elastic elbow", joints=joints)


ROBOTS: dict[str, Robot] = {
    "3R": shipped_robot("vsa_3r"),
    "prismatic": shipped_robot("rp_2"),
    "friction": with_friction(),
    "7R": shipped_robot("lwr_7r_vsa"),
    "mixed": shipped_robot("mixed_3r"),
    "tendon": shipped_robot("tendon_1r"),
    "quadratic": with_springs("quadratic"),
    "carried motor": shipped_robot("awas_1r"),
}


def possible(robot: Robot) -> list[Parameter]:
    """All numbers that may be parameters."""
    chosen = list(parameters(robot))
    try:
        with_parameters(inverse_dynamics_function, robot, None, chosen)
    except NotImplementedError:
        with pytest.raises(InputError) as refusal:
            check_parameters(robot, None, chosen)
        refused = {problem.message.split()[0] for problem in refusal.value.problems}
        return [each for each in chosen if str(each) not in refused]
    return chosen


def argument(chosen: Sequence[Parameter], values: Mapping[str, float]) -> dict[str, np.ndarray]:
    """The structure of the parameters over all samples."""
    return {"_".join(each.by_index): np.full(SAMPLES, values[str(each)]) for each in chosen}


def close(found: Mapping[str, np.ndarray], block: Block) -> None:
    """Sums are added up in another order where numbers are not folded, which costs some roundings."""
    for name, values in found.items():
        expected = expected_of(block, name)
        if name == "flags":
            np.testing.assert_array_equal(values, expected)
            continue
        np.testing.assert_array_equal(np.isnan(values), np.isnan(expected), err_msg=name)
        there = np.isfinite(expected)
        atol = 10 * CLOSE * np.abs(expected[there]).max(initial=0)
        np.testing.assert_allclose(values[there], expected[there], rtol=0, atol=atol, err_msg=name)


@pytest.mark.cases(2)
@needs_compiler
@pytest.mark.parametrize("name", slow_but({"tendon"}, ROBOTS))
def test_results_are_those_of_a_robot_with_these_numbers(name: str, tmp_path: Path) -> None:
    robot, rng = ROBOTS[name], np.random.default_rng(4)
    chosen = possible(robot)
    function = with_parameters(inverse_dynamics_function, robot, None, chosen)
    code = compiled_robot(tmp_path / "c", robot, [function], "double")
    command = commands(robot, SAMPLES, seed=2)
    command["stiffness"][:6] *= 1.1  # off the border, where a rounding decides
    nominal = {str(each): each.value for each in chosen}
    others = {path: value * rng.uniform(1, 1.03) for path, value in nominal.items()}
    for values in (nominal, others):
        found, _ = code(function, command, argument(chosen, values))
        close(found, motor_torques(robot.replace(values), motion_of(command)))


@pytest.mark.cases(2)
@needs_compiler
@pytest.mark.parametrize("name", slow_but({"tendon"}, ROBOTS))
def test_the_plant_is_that_of_a_robot_with_these_numbers(name: str, tmp_path: Path) -> None:
    robot, rng = ROBOTS[name], np.random.default_rng(4)
    chosen = possible(robot)
    function = with_parameters(state_derivative_function, robot, None, chosen)
    code = compiled_robot(tmp_path / "c", robot, [function], "double")
    state, acting = ReferenceResults(robot).inputs(state_derivative_function(robot))
    acting["tau_motor"] *= 0.1  # below the largest torque of the motors, which `state_derivative` ignores
    nominal = {str(each): each.value for each in chosen}
    others = {path: value * rng.uniform(1, 1.03) for path, value in nominal.items()}
    for values in (nominal, others):
        given = {"_".join(each.by_index): np.full(CASES, values[str(each)]) for each in chosen}
        found, _ = code(function, state, acting, given)
        expected = state_derivative(robot.replace(values), State(**state), acting["tau_motor"])
        for part, rates in expected._asdict().items():
            there = np.isfinite(rates)
            atol = CLOSE * np.abs(rates[there]).max()
            np.testing.assert_allclose(found[part][there], rates[there], rtol=0, atol=atol, err_msg=part)


@needs_compiler
def test_the_constant_holds_the_numbers_of_the_file(tmp_path: Path) -> None:
    robot = ROBOTS["3R"]
    chosen = parameters(robot, ["joints.*.link.mass", "joints.2.link.com.*"])
    function = with_parameters(link_torques_function, robot, None, chosen)
    module = compiled_robot(tmp_path / "c", robot, [function], "double").module
    assert module.NOMINAL_PARAMETERS.dtype == module.Parameters
    assert module.NOMINAL_PARAMETERS.tolist() == tuple(each.value for each in chosen)


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("precision", ["double", "float"])
def test_the_project_compiles_and_its_self_test_covers_two_sets(precision: str, tmp_path: Path) -> None:
    robot, patterns = ROBOTS["3R"], ["joints.2.link.mass", "joints.*.actuator.spring.k"]
    write_files(generate(robot, precision, patterns=patterns), tmp_path)
    flags = ("-Wconversion", "-Wdouble-promotion")
    compile_c(tmp_path, *STRICT, *flags, "-c", "vsa_3r.c", "-o", "robot.o")
    compile_c(tmp_path, *STRICT, "vsa_3r_test.c", "robot.o", "-o", "test", "-lm")
    compile_c(tmp_path, "-c", "vsa_3r.c", "-o", "robot.o")
    given = ReferenceResults(robot, parameters(robot, patterns))
    function = with_parameters(inverse_dynamics_function, robot, None, parameters(robot, patterns))
    (*_, numbers) = given.inputs(function)
    assert all(len(set(values)) == 2 and len(values) == CASES for values in numbers.values())


def test_a_function_that_depends_on_none_of_them_takes_no_such_argument() -> None:
    robot = ROBOTS["3R"]
    springs = parameters(robot, ["joints.*.actuator.spring.*"])
    assert with_parameters(link_torques_function, robot, None, springs).arguments[-1][0] == "motion"
    assert with_parameters(inverse_dynamics_function, robot, None, springs).arguments[-1][0] == PARAMETERS


@pytest.mark.parametrize(
    ("name", "path"),
    [
        ("sliding_anchor_1r", "joints.elbow.actuator.mechanism.range.phi.0"),
        slow("devices/jack_spring", "joints.joint.actuator.mechanism.setting.0"),
        slow("qbmove_arm_manual", "joints.pan.actuator.spring.0.k"),
        slow("maccepa_1r", "joints.elbow.actuator.mechanism.k"),
    ],
)
def test_what_decides_about_the_code_is_refused(name: str, path: str) -> None:
    with pytest.raises(InputError, match=rf"^{path} of .* cannot be a parameter: its value decides"):
        generate(shipped_robot(name), patterns=["joints.*.link.mass", path])


def test_a_path_that_fits_nothing() -> None:
    with pytest.raises(InputError) as caught:
        generate(ROBOTS["3R"], patterns=["joints.2.link.mas"])
    message = "no parameter of the robot matches 'joints.2.link.mas'; did you mean 'joints.*.link.mass'?"
    assert str(caught.value) == message
