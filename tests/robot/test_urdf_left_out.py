"""What a URDF says besides links and joints: taken over, named as left out, or refused with its line."""

from __future__ import annotations

import re

import pytest
from samples.urdf import joint, link, robot, serial, write

from vsacli import InputError, Placeholders, import_urdf
from vsacli.robot.urdf import converted_robot_text

LIMIT = '<limit effort="32" velocity="1"/>'

UNATTACHED = "warning: arm.urdf:5: the transmission of joint 'nod', which does not exist, is ignored"


def transmission(joints="turn", reductions=(50,), kind="transmission_interface/SimpleTransmission", motors=1):
    ends = "".join(f'<joint name="{name}"/>' for name in joints.split())
    motor = '<actuator name="motor">' + "".join(
        f"<mechanicalReduction>{value}</mechanicalReduction>" for value in reductions
    )
    content = f"<type>{kind}</type>{ends}{(motor + '</actuator>') * motors}"
    return f'<transmission name="gear">{content}</transmission>'


@pytest.fixture
def notes(tmp_path, monkeypatch):
    """The lines of the report that are not about rows and kinematics, for a file of one joint and more."""
    monkeypatch.chdir(tmp_path)

    def of(rest="", *beside, actuator="elastic", kind="R", tip=None):
        text = robot(link("base"), link("arm"), joint("turn", "base", "arm", kind, rest=rest), *beside)
        path = write(tmp_path / "arm.urdf", text).name
        conversion = import_urdf(path, tip=tip, placeholders=Placeholders(actuator))
        return [line for line in str(conversion).splitlines()[5:] if "placeholder" not in line]

    return of


@pytest.mark.parametrize(
    ("rest", "beside", "expected"),
    [
        ("", "", []),
        ('<dynamics damping="1" friction="0"/>', "", []),
        ('<dynamics friction="0.1"/>', "", ["dry friction left out: turn"]),
        ('<dynamics K="7000" D="1"/>', "", ["K, D of <dynamics> left out: turn"]),
        ('<safety_controller k_velocity="10"/>', "", []),
        (
            '<safety_controller soft_upper_limit="1"/>',
            "",
            ["soft limits (<safety_controller>) left out: turn"],
        ),
        ('<calibration rising="0.1"/>', "", ["reference position (<calibration>) left out: turn"]),
        (
            "",
            '<gazebo reference="turn"><springStiffness>3</springStiffness></gazebo>',
            ["spring parallel to the drive (<springStiffness>) left out: turn"],
        ),
        ("", '<gazebo reference="turn"><selfCollide>1</selfCollide></gazebo>', []),
        (LIMIT, "", ["effort limits (joint side) taken over: turn"]),
        ("", transmission(), ["gear reductions taken over: turn 50"]),
        ("", transmission(reductions=[1.0]), []),
        ("", transmission(reductions=[]), []),
        (
            "",
            transmission().replace("mechanicalReduction", "mechanical_reduction"),
            ["gear reductions taken over: turn 50"],
        ),
        (
            "",
            f"<ros2_control>{transmission().replace('type>', 'plugin>')}</ros2_control>",
            ["gear reductions taken over: turn 50"],
        ),
        (
            "",
            transmission(kind="").replace("name=", 'type="SimpleTransmission" name=', 1),
            ["gear reductions taken over: turn 50"],
        ),
        ("", transmission("turn nod"), [UNATTACHED, "transmission that is not simple left out: turn"]),
        (
            "",
            transmission(kind="a/DifferentialTransmission"),
            ["transmission that is not simple left out: turn"],
        ),
        ("", transmission(motors=2), ["transmission that is not simple left out: turn"]),
        ("", transmission(reductions=[50, 2]), ["transmission that is not simple left out: turn"]),
        (
            "",
            transmission() * 2,
            ["gear reductions taken over: turn 50", "transmission that is not simple left out: turn"],
        ),
        ("", transmission("nod"), [UNATTACHED]),
        (
            "",
            transmission(reductions=[]).replace('name="motor"', 'name="motor" mechanicalReduction="50"'),
            ["gear reductions taken over: turn 50"],
        ),
    ],
)
def test_what_is_said_of_a_joint(notes, rest, beside, expected):
    assert notes(rest, beside) == expected


NOT_POSITIVE = "limits not taken over, since they are not positive: turn"
REVERSED = "position limits not taken over, since lower is not below upper: turn"
CONTINUOUS = "position limits not taken over, since the joint is continuous: turn"


@pytest.mark.parametrize(
    ("kind", "limit", "expected"),
    [
        ("R", 'lower="2" upper="-2"', [f"{REVERSED} 2 to -2 rad (line 4)"]),
        ("P", 'lower="0" upper="0"', [f"{REVERSED} 0 to 0 m (line 4)"]),
        ("R", 'lower="1"', [f"{REVERSED} 1 to 0 rad (line 4)"]),
        ("C", 'lower="-1" upper="1"', [f"{CONTINUOUS} -1 to 1 rad (line 4)"]),
        ("P", 'velocity="0"', [f"velocity {NOT_POSITIVE} 0 m/s (line 4)"]),
        (
            "R",
            'velocity="-2" effort="-1e-3"',
            [f"velocity {NOT_POSITIVE} -2 rad/s (line 4)", f"effort {NOT_POSITIVE} -1e-3 N m (line 4)"],
        ),
        ("R", 'lower="-inf" upper="inf" velocity="inf" effort="1e16"', []),
        ("C", 'lower="-1e16" upper="1e16"', []),
        ("R", "", []),
        ("R", 'lower="-1" upper="1" jerk="3" acceleration="inf"', ["jerk of <limit> left out: turn"]),
    ],
)
def test_limits_that_cannot_be_ones_are_named(notes, kind, limit, expected):
    assert notes(f"<limit {limit}/>", kind=kind) == expected


def test_limits_of_held_joints_are_named_where_they_matter(notes):
    """Their positions are compared with their limits; their velocity is none."""
    side = joint("nod", "arm", "head", rest='<limit lower="1" upper="-1" velocity="0"/>')
    lines = notes("", link("head"), side, tip="arm")
    assert "position limits not taken over, since lower is not below upper: nod 1 to -1 rad (line 6)" in lines
    assert not any("velocity" in line for line in lines)


def test_two_motors_do_not_take_what_holds_for_one(notes, tmp_path):
    assert notes(LIMIT, transmission(), actuator="antagonistic") == [
        "effort limits (joint side) not taken over, since two motors share a joint: turn",
        "gear reductions not taken over, since two motors share a joint: turn 50",
    ]
    text = converted_robot_text(import_urdf(tmp_path / "arm.urdf"))
    assert "the URDF has an effort limit of 32 N m (joint side) and a gear reduction of 50" in text


@pytest.mark.parametrize("reduction", ["0", "nan", "inf", "5O", "", "1_0", "1e10", "${ratio}"])
def test_a_reduction_that_is_none(notes, reduction):
    message = f"arm.urdf:5: mechanicalReduction: expected a number that is not zero, found {reduction!r}"
    with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
        notes("", transmission(reductions=[reduction]))


@pytest.mark.parametrize("missing", ["mass", "inertia"])
def test_only_links_that_move_need_whole_inertial_data(tmp_path, monkeypatch, vsacli, missing):
    monkeypatch.chdir(tmp_path)
    lines = serial("RR").splitlines()
    flawed = re.sub(rf"<{missing} [^>]*/>", "", lines[1])
    write(tmp_path / "arm.urdf", "\n".join([lines[0], flawed, *lines[2:]]))
    assert import_urdf("arm.urdf").robot == import_urdf(write(tmp_path / "arm.urdf", serial("RR"))).robot
    message = f"inertial of 'l1': there is no <{missing}> in it"
    write(
        tmp_path / "arm.urdf",
        "\n".join([*lines[:2], re.sub(rf"<{missing} [^>]*/>", "", lines[2]), *lines[3:]]),
    )
    with pytest.raises(InputError, match=f"^arm.urdf:3: {message}$"):
        import_urdf("arm.urdf")
    checked = vsacli("validate", "arm.urdf")
    assert (checked.code, f"arm.urdf:3: warning: {message}" in checked.out) == (0, True)
