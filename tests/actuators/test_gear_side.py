"""Motors on either side of their gears: `side` says which, and both give the same results."""

from __future__ import annotations

import dataclasses
import json
import re
from typing import Any

import numpy as np
import pytest
import yaml
from jsonschema import Draft202012Validator
from samples.command_line import REPOSITORY
from samples.excited import Excitation, excited
from samples.marks import slow
from samples.shipped import shipped_robot, shipped_run

from vsacli import Friction, InputError, Motor, Robot, identify, inverse_dynamics, load_robot, simulate
from vsacli.files.file_kinds import DOCUMENTS
from vsacli.robot.models.mjcf import mjcf_model
from vsacli.robot.models.urdf import urdf_model
from vsacli.robot.parameters import parameters

TOLERANCE = 1e-14
"""Relative to the peak: both ways multiply the same values in the same order."""

WINDINGS = {"torque_constant": 0.1, "resistance": 0.8, "max_current": 3, "max_voltage": 24}
MOVED = {
    "scara_4": "scara_4",  # antagonistic, a slide, and rigid
    "puma_560": "puma_560",  # friction, and gears that reverse the motion
    "maccepa_1r": "maccepa_1r",  # serial, one motor without a gear
}


def on_joint_side(motor: Motor) -> Motor:
    """The same motor with the values of the joint side, multiplied by the ratio and its square."""
    if motor.gear_ratio is None:
        return motor
    n = abs(motor.gear_ratio)
    values: dict[str, Any] = {
        "inertia": motor.inertia * n * n,
        "damping": motor.damping * n * n,
        "max_torque": motor.max_torque * n,
        "max_velocity": motor.max_velocity / n,
    }
    if motor.friction is not None:
        sizes = [n * size for size in motor.friction.coulomb]
        backward, forward = sizes if motor.gear_ratio > 0 else sizes[::-1]
        offset, width = motor.gear_ratio * motor.friction.offset, motor.friction.width / n
        values["friction"] = Friction(coulomb=(backward, forward), offset=offset, width=width)
    return dataclasses.replace(motor, side="joint", **values)


def both_ways(robot: Robot, **windings: float) -> tuple[Robot, Robot]:
    """A robot with motors on their shafts, with windings, and the same with the joint side's values."""
    ways: list[Robot] = []
    for change in (lambda motor: motor, on_joint_side):
        joints = []
        for joint in robot.joints:
            motors = joint.actuator.motor  # type: ignore[attr-defined]
            several = motors if isinstance(motors, tuple) else (motors,)
            wound = [dataclasses.replace(each, **windings) if each.gear_ratio else each for each in several]
            new = tuple(map(change, wound))
            motor = new if isinstance(motors, tuple) else new[0]
            joints.append(
                dataclasses.replace(joint, actuator=dataclasses.replace(joint.actuator, motor=motor))
            )
        ways.append(dataclasses.replace(robot, joints=tuple(joints)))
    return ways[0], ways[1]


def same(found: np.ndarray, expected: np.ndarray) -> None:
    peak = np.nanmax(np.abs(expected), initial=0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * peak)


@pytest.mark.parametrize("name", MOVED)
def test_both_sides_give_the_same_inverse_dynamics_and_verdict(name):
    robot, trajectory = shipped_run(name, MOVED[name])
    shaft, joint = (inverse_dynamics(each, trajectory) for each in both_ways(robot, **WINDINGS))
    names = {"theta", "tau_motor", "current", "voltage", "copper_loss", "motor_power"}
    if robot.joints[0].has_friction:
        names.add("dissipated_power")
    for variable in names:
        same(getattr(joint, variable), getattr(shaft, variable))
        assert np.nanmax(np.abs(getattr(shaft, variable))) > 0
    np.testing.assert_array_equal(joint.flags, shaft.flags)
    assert joint.report.as_json() == shaft.report.as_json()


def test_limits_of_both_sides_are_exceeded_by_the_same_steps():
    robot, trajectory = shipped_run("scara_4", "scara_4")
    weak = robot.replace(
        {"joints.0.actuator.motor.max_torque": 0.2, "joints.2.actuator.motor.max_velocity": 9}
    )
    shaft, joint = (inverse_dynamics(each, trajectory) for each in both_ways(weak, **WINDINGS))
    assert shaft.report.verdict == "over_limit"
    limits = [set(each.worst) for each in shaft.report.joints]
    assert "motor_torque_limit" in limits[0]
    assert "motor_velocity_limit" in limits[2]
    assert any("current_limit" in each for each in limits)
    assert joint.report.as_json() == shaft.report.as_json()


@slow
@pytest.mark.parametrize("name", ["puma_560", "scara_4"])
def test_both_sides_give_the_same_simulation(name):
    robot, trajectory = shipped_run(name, MOVED[name])
    shaft, joint = (simulate(each, trajectory).history for each in both_ways(robot, **WINDINGS))
    for variable in shaft.variables:
        same(getattr(joint, variable), getattr(shaft, variable))


def test_a_coupled_inertia_is_on_the_side_of_its_motors():
    robot = shipped_robot("maccepa_1r").replace("joints.0.actuator.coupled_inertia", 0.001)
    shaft, joint = both_ways(robot)
    ratio = robot.joints[0].actuator.motor[0].gear_ratio
    assert shaft.joints[0].actuator.coupled_rotors == 0.001 * ratio
    assert joint.joints[0].actuator.coupled_rotors == 0.001


SLIPS = {
    "velocity of a shaft": {"joints.0.actuator.motor.max_velocity": 5000},
    "velocity of the shaft of a slide": {"joints.2.actuator.motor.max_velocity": 8000},
    "velocity of the joint": {"joints.2.limits.velocity": 0.05, "joints.0.limits.velocity": 0.1},
    "light rotor": {"joints.0.actuator.motor.inertia": 8e-9},
    "heavy rotor": {"joints.2.actuator.motor.inertia": 2},
    "weak motor": {"joints.0.actuator.motor.max_torque": 1e-4},
    "strong motor": {"joints.2.actuator.motor.max_torque": 500},
    "friction": {"joints.0.actuator.motor.friction": {"coulomb": [5, 6]}},
}


@pytest.mark.parametrize(("velocity", "finds"), [(2400, False), (2600, True)])
def test_a_motor_is_as_fast_as_its_shaft(velocity, finds):
    """No motor turns faster than 24,000 turns a minute, however slow it makes the joint."""
    motor = {"inertia": 1e-4, "gear_ratio": 100, "side": "shaft", "max_velocity": velocity}
    robot = shipped_robot("planar_2r").replace("joints.0.actuator.motor", motor)
    assert any("turns a minute of the motor" in warning for warning in robot.warnings) == finds


@pytest.mark.parametrize("slip", SLIPS.values(), ids=SLIPS)
def test_plausibility_judges_the_right_side(slip):
    robot = shipped_robot("scara_4").replace(slip)
    ways = [way.warnings for way in both_ways(robot)]
    findings = [[_finding(each) for each in warnings] for warnings in ways]
    assert findings[0]
    # In one way the motor of the slide may be in the warning of others, whose units it has only there.
    assert findings[0] == findings[1][: len(findings[0])]
    shaft, joint = (re.findall(r"joints\.[a-z_]+\.\S+\w", " ".join(warnings)) for warnings in ways)
    assert shaft == joint


def _finding(warning: str) -> str:
    """A warning without line and value, which differ, and without advice on its unit."""
    warning = warning[warning.find("joints.") :]
    return re.sub(r" = \S+ [^;]*? (?=is|turns|lets)", " ", warning).partition(";")[0]


TEXT = """\
format: vsacli-robot/1
name: arm
joints:
  - name: turn
    type: {type}
    dh: {{a: 0.2, alpha: 0}}
    link: {{mass: 2, com: [0.1, 0, 0], inertia: {{xx: 0.1, yy: 0.2, zz: 0.2}}}}
    actuator:
      type: rigid
      motor: {{{motor}}}
"""

READINGS = {
    "one value": (
        "revolute",
        "inertia: 1e-4, gear_ratio: 100",
        "100 needs side: shaft or joint; inertia 0.0001 kg m^2 at the shaft = 1 kg m^2 at the joint, "
        "or 0.0001 kg m^2 at the joint = 1e-08 kg m^2 at the shaft",
    ),
    "a slide": (
        "prismatic",
        "inertia: 1e-4, gear_ratio: 100, max_torque: 2, max_velocity: 50",
        "100 needs side: shaft or joint; inertia 0.0001 kg m^2 at the shaft = 1 kg at the joint, "
        "or 0.0001 kg at the joint = 1e-08 kg m^2 at the shaft; max_torque 2 N m = 200 N, or = 0.02 N m; "
        "max_velocity 50 rad/s = 0.5 m/s, or = 5000 rad/s",
    ),
    "friction where the gear reverses the motion": (
        "revolute",
        "inertia: 0.01, gear_ratio: -10, damping: 2e-3, friction: {coulomb: [1, 2], offset: 0.1, width: 3}",
        "-10 needs side: shaft or joint; inertia 0.01 kg m^2 at the shaft = 1 kg m^2 at the joint, "
        "or 0.01 kg m^2 at the joint = 0.0001 kg m^2 at the shaft; "
        "damping 0.002 N m s/rad = 0.2 N m s/rad, or = 2e-05 N m s/rad; "
        "friction.coulomb [1, 2] N m = [20, 10] N m, or = [0.2, 0.1] N m; "
        "friction.offset 0.1 N m = -1 N m, or = -0.01 N m; friction.width 3 rad/s = 0.3 rad/s, or = 30 rad/s",
    ),
    "a reversed direct drive": (
        "revolute",
        "inertia: 2, gear_ratio: -1",
        "-1 needs side: shaft or joint; inertia 2 kg m^2 at the shaft = 2 kg m^2 at the joint, "
        "or 2 kg m^2 at the joint = 2 kg m^2 at the shaft",
    ),
}


@pytest.mark.parametrize(("kind", "motor", "message"), READINGS.values(), ids=READINGS)
def test_without_a_side_both_readings_are_shown(kind, motor, message, tmp_path):
    path = tmp_path / "arm.yaml"
    path.write_text(TEXT.format(type=kind, motor=motor))
    with pytest.raises(InputError) as caught:
        load_robot(path)
    assert str(caught.value) == f"{path}:10: motor: gear_ratio: {message}"


def test_without_a_side_python_says_the_same_with_both_units():
    with pytest.raises(InputError, match=r"= 1 kg m\^2 \(kg if prismatic\) at the joint, or"):
        Motor(inertia=1e-4, gear_ratio=100)


ACCEPTED = (
    "inertia: 1",
    "inertia: 1, gear_ratio: 1",
    "inertia: 1, gear_ratio: 1.0, torque_constant: 1",
    "inertia: 1, gear_ratio: 1, side: shaft",
    "inertia: 1, side: joint",
    "inertia: 1, side: shaft",
    "inertia: 1, gear_ratio: 50, side: joint",
    "inertia: 1, gear_ratio: -50.5, side: shaft",
    "inertia: 1, gear_ratio: 2*50, side: shaft",
)
REFUSED = (
    "inertia: 1, gear_ratio: 50",
    "inertia: 1, gear_ratio: -1",
    "inertia: 1, gear_ratio: 1.0001",
    "inertia: 1, gear_ratio: 50, side: motor",
    "inertia: 1, gear_ratio: 50, side: null",
    "inertia: 1, gear_ratio: 0, side: shaft",
)


@pytest.mark.parametrize("motor", ACCEPTED + REFUSED)
def test_reader_and_schema_accept_and_refuse_the_same(motor, tmp_path):
    text = TEXT.format(type="revolute", motor=motor)
    (tmp_path / "arm.yaml").write_text(text)
    schema = Draft202012Validator(DOCUMENTS["robot"].schema())
    assert schema.is_valid(yaml.safe_load(text)) == (motor in ACCEPTED)
    if motor in ACCEPTED:
        load_robot(tmp_path / "arm.yaml")
    else:
        with pytest.raises(InputError):
            load_robot(tmp_path / "arm.yaml")


@pytest.mark.parametrize("keys", [("side", "gear_ratio"), ("gear_ratio", "side")])
def test_both_keys_may_be_set_in_either_order(keys, vsacli, tmp_path):
    path = tmp_path / "arm.yaml"
    path.write_text(TEXT.format(type="revolute", motor="inertia: 1e-4"))
    values = {"side": "shaft", "gear_ratio": 100}
    changes = {f"joints.turn.actuator.motor.{key}": values[key] for key in keys}
    changed = load_robot(path).replace(changes)
    assert changed.joints[0].actuator.motors[0].inertia == pytest.approx(1)
    set_both = [f"--set={place}={value}" for place, value in changes.items()]
    (tmp_path / "move.yaml").write_text(
        "format: vsacli-trajectory/1\nname: move\nduration: 1\nrate: 50\n"
        "position: {type: polynomial, degree: 9, start: 0, end: 1}\n"
    )
    assert vsacli("invdyn", path, tmp_path / "move.yaml", *set_both).code in (0, 3)
    done = vsacli("invdyn", path, tmp_path / "move.yaml", "--set=joints.turn.actuator.motor.gear_ratio=100")
    assert done.code == 2
    assert (
        "--set joints.turn.actuator.motor.gear_ratio=100: 100 needs side: shaft or joint; inertia 0.0001"
        in (done.err)
    )


def test_keys_that_are_refused_in_any_order_are_named():
    robot = shipped_robot("scara_4")
    with pytest.raises(InputError, match=r"motor\.side: unknown word 'motor'; valid: joint, shaft"):
        robot.replace({"joints.1.actuator.motor.gear_ratio": 3, "joints.0.actuator.motor.side": "motor"})


def test_parameters_have_the_units_of_their_side():
    for way, inertia in zip(both_ways(shipped_robot("scara_4")), ("kg m^2", "kg"), strict=True):
        units = {str(each): each.unit for each in parameters(way, ["joints.slide.actuator.motor.*"])}
        assert units["joints.slide.actuator.motor.inertia"] == inertia
        assert units["joints.slide.actuator.motor.gear_ratio"] == "rad/m"


def test_info_says_the_side(vsacli, tmp_path):
    path = tmp_path / "arm.yaml"
    path.write_text(TEXT.format(type="prismatic", motor="inertia: 2, gear_ratio: 50, side: joint"))
    assert "motor: inertia 2 kg, gear_ratio 50 rad/m, side joint" in vsacli("info", path).out
    described = json.loads(vsacli("info", path, "--json").out)
    assert described["joints"][0]["actuator"]["motor"]["side"] == "joint"


@pytest.mark.parametrize("model", [mjcf_model, urdf_model])
def test_models_for_other_programs_are_the_same_for_both_sides(model):
    # MJCF has no friction that is smooth or differs by direction
    ways = both_ways(shipped_robot("scara_4"))
    first, second = map(model, ways)
    assert first == second


def test_a_new_robot_file_offers_the_side(vsacli):
    assert re.search(r"# +side: +# side of the gear", vsacli("new", "robot", "--joints", "R").out)


@pytest.mark.slow
def test_a_sized_robot_has_motors_on_their_shafts(vsacli, tmp_path):
    arm, swing = (REPOSITORY / name / "planar_2r.yaml" for name in ("robots", "trajectories"))
    (tmp_path / "m.csv").write_text("name,inertia,max_torque\nm,0.01,1000\n")
    target = tmp_path / "sized.yaml"
    assert vsacli("size", arm, swing, "--catalog", tmp_path / "m.csv", "-o", target).code == 0
    for joint in load_robot(target).joints:
        assert {each.side for each in joint.actuator.motor} == {"shaft"}


@slow
def test_values_are_identified_on_their_side(tmp_path):
    arm = shipped_robot("vsa_3r")
    motor = {"inertia": 3.2 / 2500, "damping": 1e-4, "gear_ratio": -50, "side": "shaft"}
    geared = dataclasses.replace(arm, joints=arm.joints[:1]).replace({"joints.0.actuator.motor": motor})
    record = excited(geared, Excitation(position=[0], reach=[0.4], stiffness=[1400], swing=[300]))
    path = record.noisy(seed=10).write(tmp_path / "record.csv", geared)
    shaft, joint = (identify(each, path, fit=["motors"]) for each in both_ways(geared))
    for on_shaft, at_joint in zip(shaft.numbers, joint.numbers, strict=True):
        assert at_joint.value == pytest.approx(2500 * on_shaft.value, rel=1e-6)


def test_an_identified_robot_keeps_the_side():
    from vsacli.studies.identification.motor_equations import with_friction

    for robot in both_ways(shipped_robot("scara_4")):
        sides = [each.actuator.motor for each in with_friction(robot, range(4)).joints]
        assert all(
            motor.side == robot.joints[0].actuator.motor[0].side
            for motors in sides
            for motor in (motors if isinstance(motors, tuple) else (motors,))
        )
