"""Placeholder springs and motors of a converted URDF: in proportion to what each joint carries."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.marks import slow
from samples.urdf import joint, link, random_serial, robot, write

from vsacli import (
    Placeholders,
    import_urdf,
    inverse_dynamics,
    link_torques,
    load_robot,
    load_trajectory,
    mass_matrix,
)
from vsacli.actuators.kinds import ACTUATORS
from vsacli.files.templates import trajectory_template
from vsacli.robot.model import PLACEHOLDER_WARNING, WITHOUT_MASSES
from vsacli.robot.urdf import converted_robot_text
from vsacli.robot.urdf.placeholders import UNLOADED

DESK_ARM = REPOSITORY / "robots" / "desk_arm.urdf"
STROKE = '<limit lower="-0.2" upper="0.5" velocity="1" effort="1"/>'
SIZED = re.compile(r'\b(mass value|effort|damping|i[x-z][x-z])="([^"]+)"')
"""What grows with the density of an arm."""

CASES = list(itertools.product(["RR", "RPR", "CRRPRRC"], range(3)))
QUICK = (("RR", 0), ("RPR", 1), ("CRRPRRC", 2))
POSES = 500
ROUNDING = 1 + 1e-14
"""A prismatic joint carries all masses beyond it exactly, but for their sum in another order."""
SIMPLE = (
    '<transmission name="{0}_gear"><type>transmission_interface/SimpleTransmission</type><joint name="{0}"/>'
    '<actuator name="{0}_motor"><mechanicalReduction>{1}</mechanicalReduction></actuator></transmission>'
)


def one_joint(rest="", letter="R", *beside):
    return robot(link("base"), link("arm"), joint("turn", "base", "arm", letter, rest=rest), *beside)


@pytest.mark.parametrize(("letters", "seed"), [case if case in QUICK else slow(*case) for case in CASES])
def test_no_pose_loads_a_joint_more_than_it_is_sized_for(tmp_path, letters, seed):
    """Against gravity torques and inertias in many poses, with gravity along many directions."""
    text = random_serial(letters, seed).replace("</joint>", f"{STROKE}</joint>")
    conversion = import_urdf(write(tmp_path / "arm.urdf", text))
    rng = np.random.default_rng(seed)
    low, high = np.array([(-0.2, 0.5) if letter == "P" else (-np.pi, np.pi) for letter in letters]).T
    q = rng.uniform(low, high, (POSES, len(letters)))
    directions = rng.normal(size=(6, 3))
    arms = [conversion.robot.replace("gravity", 9.81 * along / np.linalg.norm(along)) for along in directions]
    torques = np.array([link_torques(arm, q)[0] for arm in arms])
    inertias = np.diagonal(mass_matrix(conversion.robot, q), axis1=1, axis2=2)
    bounds = ROUNDING * np.array([(load.torque, load.inertia) for load in conversion.loads]).T
    assert np.all(abs(torques).max(axis=(0, 1)) <= bounds[0])
    assert np.all(inertias.max(axis=0) <= bounds[1])


def test_a_single_joint(tmp_path):
    (arm,) = import_urdf(write(tmp_path / "arm.urdf", one_joint())).robot.joints
    # 2 kg at 0.1 m from the axis and 0.03 kg m^2: 0.05 kg m^2 in all, so that 2 kg weigh 3.1 N m at 0.158 m.
    assert arm.actuator.motor[0].inertia == 0.025
    assert (arm.actuator.spring[0].k, arm.actuator.spring[0].k_c) == (16, 80)


def test_a_prismatic_joint(tmp_path):
    (arm,) = import_urdf(
        write(tmp_path / "arm.urdf", one_joint(letter="P")), placeholders=Placeholders("elastic")
    ).robot.joints
    assert arm.actuator.motor.inertia == 1  # half of 2 kg
    assert arm.actuator.stiffness == 2000  # 19.6 N over 0.01 m


@pytest.mark.parametrize("actuator", ACTUATORS)
@pytest.mark.parametrize("size", [1e-3, slow(1), 1e3])
def test_the_desk_arm_of_any_weight_can_move(tmp_path, actuator, size):
    text = SIZED.sub(lambda found: f'{found[1]}="{float(found[2]) * size!r}"', DESK_ARM.read_text())
    path = write(tmp_path / "arm.urdf", text)
    arm = import_urdf(path, tip="flange", placeholders=Placeholders(actuator)).robot
    motion = write(tmp_path / "move.yaml", trajectory_template(arm).replace("rate: 1000", "rate: 50  "))
    report = inverse_dynamics(arm, load_trajectory(motion, arm)).report
    assert (report.verdict, report.warnings[0]) == ("ok", PLACEHOLDER_WARNING)


def test_what_is_given_is_not_sized():
    given = Placeholders("antagonistic", motor_inertia=0.3, spring=(1.5, 2.5))
    conversion = import_urdf(DESK_ARM, tip="flange", placeholders=given)
    assert {each.actuator.motor[0].inertia for each in conversion.robot.joints} == {0.3}
    assert {each.actuator.spring[1].k_c for each in conversion.robot.joints} == {2.5}
    assert converted_robot_text(conversion).count("# placeholder: not from the URDF") == 8


def test_the_file_says_how_its_placeholders_were_found():
    text = converted_robot_text(import_urdf(DESK_ARM, tip="flange"))
    assert "# placeholder: 0.5 times the largest inertia that it moves; the URDF has an effort limit" in text
    assert "# placeholder: gives way by 0.1 rad under 17 N m, its largest load" in text
    assert "# placeholder: gives way by 0.01 m under 5.2 N, its largest load" in text


def test_a_robot_without_masses_is_told_in_one_line(tmp_path):
    text = robot(
        *(link(name, "") for name in "abc"), joint("one", "a", "b"), joint("two", "b", "c", rpy="1 0 0")
    )
    conversion = import_urdf(write(tmp_path / "arm.urdf", text))
    assert conversion.robot.warnings == (PLACEHOLDER_WARNING, WITHOUT_MASSES)
    actuator = conversion.robot.joints[0].actuator
    assert (actuator.motor[0].inertia, actuator.spring[0].k) == (UNLOADED.motor_inertia, UNLOADED.spring[0])
    some = import_urdf(
        write(tmp_path / "arm.urdf", text.replace('name="c">', f'name="c">{link("x")[15:-7]}'))
    )
    assert [warning for warning in some.robot.warnings if "link" in warning] == [
        "joints.one.link: mass and inertia are zero; give those of the link, the inertia about its center of "
        "mass"
    ]


@pytest.mark.parametrize("actuator", ["elastic", "rigid"])
@pytest.mark.parametrize(("ratio", "expected"), [("160", 160), ("-50", -50), ("1.0", None)])
def test_a_single_motor_takes_the_gear(tmp_path, actuator, ratio, expected):
    text = one_joint('<limit effort="32" velocity="1"/>', "C", SIMPLE.format("turn", ratio))
    conversion = import_urdf(write(tmp_path / "arm.urdf", text), placeholders=Placeholders(actuator))
    (arm,) = load_robot(write(tmp_path / "arm.yaml", converted_robot_text(conversion))).joints
    assert arm.actuator.motor.gear_ratio == expected
    assert arm.actuator.motor.side == (expected and "shaft")
    # Divided and multiplied by the ratio: a rounding or two; the inertia has two digits, on the shaft.
    assert arm.actuator.motors[0].max_torque == pytest.approx(32, rel=1e-15)
    assert arm.actuator.motors[0].inertia == pytest.approx(0.025, rel=0.05)
    assert arm.actuator.motor.inertia == float(f"{arm.actuator.motor.inertia:.1e}")
