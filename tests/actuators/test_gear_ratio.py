"""Motors given on their own shafts: the same dynamics as on the joint side, and results on either side."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from vsacli import (
    InputError,
    Motor,
    Robot,
    State,
    inverse_dynamics,
    load_robot,
    load_trajectory,
    open_result,
    state_derivative,
)

HEAD = "format: vsacli-robot/1\nname: rig\njoints:\n"
JOINT = """\
  - name: {name}
    type: {type}
    dh: {{a: 0.2, alpha: 90 deg}}
    link: {{mass: 2, com: [0.1, 0, 0], inertia: {{xx: 0.1, yy: 0.2, zz: 0.2}}}}
    actuator: {actuator}
"""
SPRING = "spring: {type: cubic, k: 400, k_c: 2000}"

# Each motor on its shaft, and the same on the joint side, multiplied by hand.
SHAFT = [
    "{inertia: 0.02, damping: 0.01, max_torque: 20, max_velocity: 5, gear_ratio: -10, side: shaft}",
    "{inertia: 0.001, damping: 0.002, max_torque: 1, max_velocity: 30, gear_ratio: 40, side: shaft}",
    "{inertia: 5e-5, damping: 1e-4, max_torque: 0.12, max_velocity: 200, gear_ratio: 200, side: shaft}",
    "{inertia: 0.004, gear_ratio: 20, side: shaft}",
]
REFLECTED = [
    "{inertia: 2, damping: 1, max_torque: 200, max_velocity: 0.5}",
    "{inertia: 1.6, damping: 3.2, max_torque: 40, max_velocity: 0.75}",
    "{inertia: 2, damping: 4, max_torque: 24, max_velocity: 1}",
    "{inertia: 1.6}",
]
TRAJECTORY = """\
format: vsacli-trajectory/1
name: move
duration: 1
rate: 50
position: {type: polynomial, degree: 9, start: 0, end: [0.6, 0.3, 0.4]}
stiffness: {type: polynomial, degree: 5, start: {a: 900}, end: {a: 1200}}
"""
ROUNDING = 1e-12
"""Relative: both ways multiply the same numbers in another order, and the solution of (14) magnifies it."""


@pytest.fixture(autouse=True)
def _in_own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("move.yaml").write_text(TRAJECTORY)


def rig(motors: list[str], name: str = "rig.yaml") -> Robot:
    """An antagonistic joint whose motors differ, an elastic slide and a rigid joint."""
    first, second, slide, turn = motors
    joints = [
        ("a", "revolute", f"{{type: antagonistic, motor: [{first}, {second}], {SPRING}}}"),
        ("b", "prismatic", f"{{type: elastic, motor: {slide}, stiffness: 3000}}"),
        ("c", "revolute", f"{{type: rigid, motor: {turn}}}"),
    ]
    texts = [JOINT.format(name=name, type=kind, actuator=actuator) for name, kind, actuator in joints]
    Path(name).write_text(HEAD + "".join(texts))
    return load_robot(name)


def columns(path: str) -> dict[str, np.ndarray]:
    with Path(path).open() as file:
        header, *rows = csv.reader(file)
    return dict(zip(header, np.array(rows, dtype=float).T, strict=True))


def same(found: np.ndarray, expected: np.ndarray) -> None:
    scale = np.nanmax(np.abs(expected), initial=0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING * scale)


def test_the_dynamics_are_those_of_the_motor_on_the_joint_side():
    robots = rig(SHAFT), rig(REFLECTED)
    geared, reflected = (inverse_dynamics(robot, load_trajectory("move.yaml", robot)) for robot in robots)
    for name in ("theta", "dtheta", "ddtheta", "tau_transmission", "tau_motor"):
        same(getattr(geared, name), getattr(reflected, name))
    np.testing.assert_array_equal(geared.flags, reflected.flags)
    assert {"motor_torque_limit", "motor_velocity_limit"} <= geared.report.joints[0].first_time.keys()


def test_accelerations_are_those_of_the_motor_on_the_joint_side():
    q, dq = np.array([0.3, 0.1, -0.2]), np.array([1.0, -0.5, 2.0])
    theta, dtheta = (np.stack((values + 0.1, values - 0.1), axis=-1) for values in (q, dq))
    rates = [
        state_derivative(rig(motors), State(q, dq, theta, dtheta), np.full((3, 2), 7.0))
        for motors in (SHAFT, REFLECTED)
    ]
    for geared, reflected in zip(*rates, strict=True):
        same(geared, reflected)


def exported(vsacli: Callable[..., Any], *options: str) -> dict[str, np.ndarray]:
    """Columns of a result of the geared rig."""
    rig(SHAFT)
    assert vsacli("invdyn", "rig.yaml", "move.yaml", "-o", "result.h5", "--overwrite").code in (0, 3)
    assert vsacli("export", "result.h5", "-o", "out.csv", "--overwrite", *options).code == 0
    return columns("out.csv")


def test_what_is_exported_obeys_the_equation_of_the_shaft(vsacli: Callable[..., Any]):
    """J theta'' + D theta' + tau_transmission/n = tau, with the numbers of the datasheet."""
    names = "theta,dtheta,ddtheta,tau_transmission,tau_motor"
    table = exported(vsacli, "--side", "motor", "--variables", names)
    motors = {
        "a_1": (0.02, 0.01, -10),
        "a_2": (0.001, 0.002, 40),
        "b_1": (5e-5, 1e-4, 200),
        "c_1": (0.004, 0, 20),
    }
    for motor, (inertia, damping, ratio) in motors.items():
        joint, number = motor.split("_")
        shaft = {name: table[f"{joint}.{name}_shaft_{number}"] for name in ("dtheta", "ddtheta", "tau_motor")}
        spring = table[f"{joint}.tau_transmission_{number}"]
        same(inertia * shaft["ddtheta"] + damping * shaft["dtheta"] + spring / ratio, shaft["tau_motor"])


def test_the_shaft_turns_as_the_gear_says_and_power_passes_it(vsacli: Callable[..., Any]):
    names = ("--variables", "q,theta,dtheta,tau_motor")
    at_joint, on_shaft = exported(vsacli, *names), exported(vsacli, *names, "--side", "motor")
    ratios = {"a": (-10, 40), "b": (200,), "c": (20,)}
    for joint, of_joint in ratios.items():
        np.testing.assert_array_equal(on_shaft[f"{joint}.q"], at_joint[f"{joint}.q"])
        for number, ratio in enumerate(of_joint, start=1):
            turned = on_shaft[f"{joint}.theta_shaft_{number}"]
            same(turned, ratio * at_joint[f"{joint}.theta_{number}"])
            power = [
                table[f"{joint}.dtheta{place}_{number}"] * table[f"{joint}.tau_motor{place}_{number}"]
                for table, place in ((at_joint, ""), (on_shaft, "_shaft"))
            ]
            same(power[1], power[0])


def test_the_default_side_is_that_of_the_joint(vsacli: Callable[..., Any]):
    assert exported(vsacli).keys() == exported(vsacli, "--side", "joint").keys()
    assert "a.tau_motor_1" in columns("out.csv")


def test_without_a_ratio_nothing_is_guessed(vsacli: Callable[..., Any]):
    rig([SHAFT[0], REFLECTED[1], SHAFT[2], REFLECTED[3]])
    vsacli("invdyn", "rig.yaml", "move.yaml", "-o", "result.h5")
    outcome = vsacli("export", "result.h5", "--side", "motor")
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.startswith(
        "result.h5: --side motor needs the gear_ratio of a, c in the robot file (1 without a gear)"
    )
    assert "add it and run invdyn again, or use --side joint" in outcome.err
    assert vsacli("export", "result.h5", "--side", "motor", "--variables", "q,tau_transmission").code == 0


def test_the_result_holds_the_joint_side_and_the_ratio(vsacli: Callable[..., Any]):
    exported(vsacli)
    with h5py.File("result.h5") as file:
        joints = file["inputs/robot/joints"]
        ratio, inertia = joints["actuator_motor_gear_ratio"], joints["actuator_motor_inertia"]
        np.testing.assert_array_equal(ratio[...], [[-10, 40], [200, np.nan], [20, np.nan]])
        assert ratio.attrs["units_prismatic"] == "rad/m"
        np.testing.assert_allclose(inertia[...], [[2, 1.6], [2, np.nan], [1.6, np.nan]], rtol=1e-15)
        assert inertia.attrs["units_prismatic"] == "kg"


def test_a_robot_with_single_motors_stores_its_ratios_too(vsacli: Callable[..., Any]):
    actuator = f"{{type: rigid, motor: {SHAFT[3]}}}"
    Path("rig.yaml").write_text(HEAD + JOINT.format(name="a", type="revolute", actuator=actuator))
    Path("move.yaml").write_text(TRAJECTORY.replace("[0.6, 0.3, 0.4]", "0.6").partition("stiffness")[0])
    vsacli("invdyn", "rig.yaml", "move.yaml", "-o", "result.h5")
    assert vsacli("export", "result.h5", "-o", "joint.csv").code == 0
    assert vsacli("export", "result.h5", "-o", "motor.csv", "--side", "motor").code == 0
    with open_result("result.h5") as result:
        np.testing.assert_array_equal(result.gear_ratio, [[20, np.nan]])
    same(20 * columns("motor.csv")["a.tau_motor_shaft_1"], columns("joint.csv")["a.tau_motor_1"])


@pytest.mark.parametrize(
    ("number", "problem"),
    [
        ("0", "gear_ratio: must be finite and not zero, not 0"),
        ("1e20", "motor: gear_ratio: makes the inertia on the joint side 2e+38, too far from anything built"),
        (
            "1e-20",
            "motor: gear_ratio: makes the inertia on the joint side 2e-42, too far from anything built",
        ),
        ("ten", "gear_ratio: expected a number, found 'ten'"),
    ],
)
def test_ratios_that_are_none(number: str, problem: str):
    with pytest.raises(InputError) as caught:
        rig([SHAFT[0].replace("-10", number), *SHAFT[1:]])
    assert str(caught.value).startswith(f"rig.yaml:8: {problem}")


def test_on_the_shaft_units_are_rotary_at_a_slide_too():
    assert rig([*SHAFT[:2], SHAFT[2].replace("max_velocity: 200", "max_velocity: 90 deg"), SHAFT[3]])
    with pytest.raises(InputError, match=r"13: inertia: expected a number in kg m\^2, found 'heavy'"):
        rig([*SHAFT[:2], SHAFT[2].replace("5e-5", "heavy"), SHAFT[3]])
    with pytest.raises(InputError, match="13: inertia: expected a number in kg, found 'heavy'"):
        rig([*SHAFT[:2], "{inertia: heavy}", SHAFT[3]])


def test_a_motor_knows_both_sides():
    motor = Motor(inertia=0.01, gear_ratio=-100, side="shaft")
    assert (motor.inertia, motor.at_joint.inertia) == (0.01, pytest.approx(100))
    assert motor.at_joint.max_torque == np.inf
    with pytest.raises(InputError, match="Motor: gear_ratio: must be finite and not zero, not nan"):
        Motor(inertia=0.01, gear_ratio=float("nan"))
