"""`vsacli import-urdf`: the file it writes, its report, and what it refuses to replace."""

from __future__ import annotations

import math
import re

import pytest
from samples.command_line import REPOSITORY, contents
from samples.marks import slow
from samples.urdf import joint, link, random_serial, robot, serial, write

from vsacli import Antagonistic, Elastic, Placeholders, Rigid, import_urdf, load_robot
from vsacli.actuators.kinds import ACTUATORS
from vsacli.cli.import_urdf import import_urdf as command
from vsacli.files.device_actuators import DEVICES
from vsacli.files.examples import examples
from vsacli.robot.urdf import converted_robot_text

DESK_ARM = REPOSITORY / "robots" / "desk_arm.urdf"


def converted(vsacli, *options):
    done = vsacli("import-urdf", DESK_ARM, "--tip", "flange", "-o", "arm.yaml", *options)
    assert done.code == 0, done.err
    return done


def test_the_file_is_the_conversion(vsacli, tmp_path):
    done = converted(vsacli)
    conversion = import_urdf(DESK_ARM, tip="flange")
    assert load_robot(tmp_path / "arm.yaml") == conversion.robot
    assert (tmp_path / "arm.yaml").read_text() == converted_robot_text(conversion)
    assert (done.out, done.err) == (f"{conversion}\n", "wrote arm.yaml\n")


@pytest.mark.parametrize("actuator", ACTUATORS)
@pytest.mark.parametrize("seed", range(4))
def test_every_number_comes_back_from_the_file(tmp_path, actuator, seed):
    text = random_serial("RPRCR", seed).replace("</joint>", '<dynamics damping="0.1"/></joint>')
    limits = '<limit lower="-0.7" upper="1.1" velocity="2.3" effort="17.5"/>'
    path = write(tmp_path / "arm.urdf", text.replace("</joint>", f"{limits}</joint>"))
    conversion = import_urdf(path, placeholders=Placeholders(actuator, 0.3, 123.4, (1.5, 2.5)))
    loaded = load_robot(write(tmp_path / "arm.yaml", converted_robot_text(conversion)))
    assert loaded == conversion.robot


def test_right_angles_are_written_as_such(vsacli, tmp_path):
    converted(vsacli)
    rows = re.findall(r"alpha: (\S+), d: \S+ theta: (\S+)}", (tmp_path / "arm.yaml").read_text())
    assert rows == [("-pi/2", "0"), ("0", "0"), ("pi/2", "pi/2"), ("0", "0")]


def test_the_command_names_every_actuator():
    option = next(option for option in command.params if option.name == "actuator")
    assert tuple(option.type.choices) == (*ACTUATORS, *DEVICES)


@pytest.mark.parametrize("devices", [["vs_joint", "compact"], slow([*DEVICES])], ids=len)
def test_joints_have_the_actuators_of_devices(vsacli, tmp_path, devices):
    path = write(tmp_path / "arm.urdf", random_serial("R" * len(devices), 0))
    names, (usual, *words) = import_urdf(path).robot.joint_names, devices
    chosen = [f"--actuator={name}={word}" for name, word in zip(names[1:], words, strict=True)]
    (tmp_path / "new").mkdir()
    done = vsacli("import-urdf", path, "--actuator", usual.upper(), *chosen, "-o", "new/arm.yaml")
    assert done.code == 0, done.err
    assert f"actuators of devices, with their damping: {names[0]} {usual}, {names[1]} {words[0]}" in done.out
    driven = load_robot(tmp_path / "new" / "arm.yaml").joints
    bundled = {example.path.stem: example.robot.joints[-1] for example in examples(map(DEVICES.get, devices))}
    for of_urdf, device in zip(driven, devices, strict=True):
        expected = bundled[DEVICES[device]]
        assert (of_urdf.damper, of_urdf.damping) == (expected.damper, expected.damping)
        pathless = [re.sub("path='.*?'", "", repr(each.actuator)) for each in (of_urdf, expected)]
        assert pathless[0] == pathless[1]  # tables are copies next to the file


def test_a_device_that_no_joint_can_have_is_refused(vsacli, tmp_path):
    write(tmp_path / "arm.urdf", random_serial("RP", 0))
    turning, sliding = import_urdf(tmp_path / "arm.urdf").robot.joint_names
    for options, said in {
        ("fsj",): f"--actuator: {sliding}: fsj turns about an axis, and drives no prismatic joint",
        ("wrist=fsj",): f"--actuator: the robot has no joint 'wrist'; valid: {turning}, {sliding}",
        ("fjs",): "'vsaut_ii'; did you mean 'fsj'?",
        (f"{turning}=rigid",): f"expected {turning}=DEVICE, found '{turning}=rigid'",
        (
            "fsj",
            "--motor-inertia",
            1,
        ): "--motor-inertia needs --actuator antagonistic, elastic, rigid or serial, not fsj",
    }.items():
        done = vsacli("import-urdf", "arm.urdf", "--actuator", *options)
        assert (done.code, said in done.err) == (2, True), done.err
    assert not (tmp_path / "arm.yaml").exists()


def test_placeholders_are_marked_and_come_from_the_options(vsacli, tmp_path):
    converted(vsacli, "--motor-inertia", "0.5", "--spring", "300,900")
    text = (tmp_path / "arm.yaml").read_text()
    lines = [line for line in text.splitlines() if re.match(" +(motor|spring|stiffness):", line)]
    assert len(lines) == 8
    assert all("# placeholder" in line for line in lines)
    assert "placeholder: not from the URDF; the URDF has an effort limit of 30 N m (joint side)" in text
    actuator = load_robot(tmp_path / "arm.yaml").joints[0].actuator
    assert isinstance(actuator, Antagonistic)
    assert (actuator.motor[0].inertia, actuator.spring[0].k, actuator.spring[0].k_c) == (0.5, 300, 900)
    assert math.isinf(actuator.motor[0].max_torque)


@pytest.mark.parametrize(
    ("word", "kind", "options"), [("elastic", Elastic, ("--stiffness", "700")), ("rigid", Rigid, ())]
)
def test_one_motor_takes_the_effort_limit(vsacli, tmp_path, word, kind, options):
    converted(vsacli, "--actuator", word, *options)
    actuator = load_robot(tmp_path / "arm.yaml").joints[1].actuator
    assert isinstance(actuator, kind)
    assert actuator.motor.max_torque == 30
    assert getattr(actuator, "stiffness", 700) == 700
    assert "; with an effort limit of 30 N m (joint side)" in (tmp_path / "arm.yaml").read_text()


def test_limits_damping_and_names_are_taken_over(vsacli, tmp_path):
    converted(vsacli)
    turn, shoulder, _, quill = load_robot(tmp_path / "arm.yaml").joints
    assert (turn.limits.position, turn.limits.velocity) == ((-math.inf, math.inf), (-3, 3))
    assert (shoulder.limits.position, shoulder.damping) == ((-2, 1.2), 0.2)
    assert (quill.name, quill.type, quill.limits.position) == ("quill", "prismatic", (0, 0.1))


def test_the_report(vsacli):
    lines = converted(vsacli).out.splitlines()
    assert lines[0] == "desk-arm: 4 joints from table to flange"
    assert lines[4].split() == ["elbow", "0", "1.5708", "0", "1.5708", "1.18", "forearm", "+", "1"]
    assert "total mass of the moving links: 5.33 kg" in lines
    exactness = "the same as the URDF's, the tip within 1.0e-12 m and 1.0e-12 rad"
    assert f"forward kinematics: {exactness}" in lines
    assert "held at zero outside the chain, their links lumped: left_finger, right_finger" in lines
    assert "dry friction left out: turn" in lines


def test_side_branches_are_held(vsacli, tmp_path):
    done = converted(vsacli, "--hold", "left_finger=0.01 + 0.01")
    held = "left_finger at 0.02 m, right_finger at 0.02 m (follows left_finger)"
    assert f"held outside the chain, their links lumped: {held}" in done.out.splitlines()
    assert (
        load_robot(tmp_path / "arm.yaml")
        == import_urdf(DESK_ARM, None, "flange", hold={"left_finger": 0.02}).robot
    )
    outside = converted(vsacli, "--hold", "left_finger=0.04", "--overwrite").out
    assert "warning: left_finger at 0.04 m is outside its limits, 0 to 0.03 m" in outside


def test_a_snapped_axis_is_reported(vsacli, tmp_path):
    write(tmp_path / "arm.urdf", serial("RR", ["0 0 0", "0 1e-5 0"]))
    done = vsacli("import-urdf", "arm.urdf")
    assert "forward kinematics: not quite the URDF's, the tip within" in done.out
    assert "axis of j2 made parallel to the one before it, 1e-05 rad off" in done.out
    assert "axis of j2" not in vsacli("import-urdf", "arm.urdf", "--snap", "1e-6", "--overwrite").out


def test_implausible_links_are_reported(vsacli, tmp_path):
    text = robot(link("a"), link("b", ""), link("c"), joint("turn", "a", "b"), joint("nod", "b", "c"))
    write(tmp_path / "arm.urdf", text)
    assert (
        "warning: joints.turn.link: mass and inertia are zero; give those of the link"
        in vsacli("import-urdf", "arm.urdf").out
    )


def test_names_stay_in_their_place(tmp_path):
    text = robot(link("a"), link("b # } é"), joint("turn: [", "a", "b # } é"))
    conversion = import_urdf(write(tmp_path / "arm.urdf", text.replace('"sample"', '"a &quot;b: #c\\"')))
    loaded = load_robot(write(tmp_path / "arm.yaml", converted_robot_text(conversion)))
    assert loaded == conversion.robot
    assert (loaded.name, loaded.joint_names) == ('a "b: #c\\', ("turn___",))


def test_the_result_runs(vsacli, tmp_path):
    converted(vsacli, "--actuator", "rigid")
    write(
        tmp_path / "move.yaml",
        "format: vsacli-trajectory/1\nname: move\nduration: 2\nrate: 100\n"
        "position: {type: polynomial, degree: 9, start: 0, end: [1, 0.5, 0.5, 0.05]}\n",
    )
    assert vsacli("invdyn", "arm.yaml", "move.yaml").code == 0


@pytest.mark.parametrize("existing", ["arm.yaml", "link.yaml"])
def test_nothing_is_replaced(vsacli, tmp_path, existing):
    write(tmp_path / "arm.urdf", serial("RR"))
    write(tmp_path / "arm.yaml", "mine")
    (tmp_path / "link.yaml").symlink_to(tmp_path / "arm.urdf")
    before = contents(tmp_path)
    done = vsacli("import-urdf", "arm.urdf", "-o", existing)
    assert (done.code, done.out) == (4 if existing == "arm.yaml" else 2, "")
    assert re.match(f"{existing}: (exists already|is an input of this command)", done.err)
    assert contents(tmp_path) == before


def test_overwriting(vsacli, tmp_path):
    write(tmp_path / "arm.yaml", "mine")
    converted(vsacli, "--overwrite")
    assert load_robot(tmp_path / "arm.yaml").name == "desk-arm"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--motor-inertia", "-1"], "must be positive, not -1; expected an inertia in kg m^2 (kg)"),
        (["--spring", "400"], "expected two coefficients k and k_c, e.g. 400,2000, found 1"),
        (["--spring", "0,1"], "--spring: k: must be positive, not 0"),
        (["--snap", "1"], "must be at most 0.1, not 1; expected an angle in rad"),
        (["--actuator", "hydraulic"], "'hydraulic' is not one of 'antagonistic', 'elastic', 'rigid'"),
        (["--hold", "left_finger"], "expected JOINT=VALUE, e.g. finger=0.02, found 'left_finger'"),
        (["--hold", "left_finger=0", "--hold", "left_finger=1"], "'left_finger' is held twice"),
        (
            ["--hold", "left_finger=1 deg"],
            "'1 deg' is an angle",
        ),
        (["--tip", "flang"], "--tip: there is no link 'flang'; did you mean 'flange'?"),
    ],
)
def test_options_that_cannot_be(vsacli, tmp_path, options, message):
    done = vsacli("import-urdf", DESK_ARM, "--tip", "flange", *options)
    assert (done.code, done.out) == (2, "")
    assert message in done.err
    assert list(tmp_path.iterdir()) == []
