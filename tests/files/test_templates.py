"""Templates: what `vsacli new` writes is understood, computes without trouble, and explains every key."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from samples.command_line import REPOSITORY, contents
from samples.marks import slow

from vsacli import InputError, Joint, Robot, inverse_dynamics, load_robot, load_trajectory
from vsacli.actuators.kinds import ACTUATORS
from vsacli.documents.commented import WIDTH
from vsacli.documents.fields import OneOf, PairOf, RecordOf, declared_fields
from vsacli.files.robot_template import MOST_JOINTS, robot_template
from vsacli.files.templates import trajectory_template
from vsacli.robot.file import RobotFile
from vsacli.robot.model import PLACEHOLDER_WARNING
from vsacli.trajectory.file import OF_ANY_ROBOT

ROBOTS = sorted((REPOSITORY / "robots").glob("*.yaml"))
LONG = ("cam_1r", "compact_1r", "lwr_7r_vsa", "measured_1r", "panda_7r", "puma_560", "sliding_anchor_1r")
"""Robots whose runs take longer than others."""


def robot_of(text: str, folder: Path) -> Robot:
    (folder / "robot.yaml").write_text(text)
    return load_robot(folder / "robot.yaml")


def report_of(robot: Robot, text: str, folder: Path) -> Any:
    """The report of a run at 50 samples a second."""
    assert "rate: 1000" in text
    (folder / "move.yaml").write_text(text.replace("rate: 1000", "rate: 50  "))
    return inverse_dynamics(robot, load_trajectory(folder / "move.yaml", robot)).report


@pytest.mark.parametrize("actuator", ACTUATORS)
@pytest.mark.parametrize("joints", ["R", "P", "RRP", "prp", slow("RRRRRRR")])
def test_a_new_robot_executes_its_new_trajectory(joints: str, actuator: str, tmp_path: Path) -> None:
    robot = robot_of(robot_template(joints, actuator), tmp_path)
    assert "".join(joint.type[0] for joint in robot.joints) == joints.lower()
    assert {joint.actuator_type for joint in robot.joints} == {actuator}
    assert robot.warnings == (PLACEHOLDER_WARNING,)
    report = report_of(robot, trajectory_template(robot), tmp_path)
    assert (report.verdict, report.warnings) == ("ok", (PLACEHOLDER_WARNING,))


def test_a_mechanism_that_turns_drives_no_slide(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="awas turns about an axis, and drives no prismatic joint"):
        robot_template("RP", "awas")
    text = robot_template("R", "awas").replace("type: revolute ", "type: prismatic")
    with pytest.raises(InputError, match=r"robot.yaml:\d+: .*actuator.mechanism.type: .*variable_ratio"):
        robot_of(text, tmp_path)


def test_without_a_robot_it_suits_new_ones_with_revolute_joints(tmp_path: Path) -> None:
    for joints in ("R", "RRRRRR"):
        robot = robot_of(robot_template(joints), tmp_path)
        assert report_of(robot, trajectory_template(), tmp_path).verdict == "ok"


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    "path", [slow(path) if path.stem in LONG else path for path in ROBOTS], ids=lambda path: path.stem
)
def test_a_new_trajectory_suits_every_robot_that_comes_along(path: Path, tmp_path: Path) -> None:
    robot = load_robot(path)
    assert report_of(robot, trajectory_template(robot), tmp_path).verdict == "ok"


@pytest.mark.parametrize("joints", ["R", "P"])
@pytest.mark.parametrize("limits", [(-0.436332, 0.436332), (0.5, 0.6), (-3.01, -2.99), (0.12344, 1)])
def test_a_new_trajectory_is_not_rounded_beyond_limits(
    joints: str, limits: tuple[float, float], tmp_path: Path
) -> None:
    robot = robot_of(robot_template(joints), tmp_path).replace("joints.0.limits.position", limits)
    assert report_of(robot, trajectory_template(robot), tmp_path).verdict == "ok"


def test_a_robot_too_weak_for_the_usual_time_gets_more_of_it(tmp_path: Path) -> None:
    robot = load_robot(REPOSITORY / "robots" / "vsa_3r.yaml")
    weak = robot.replace({"joints.*.actuator.motor.*.max_velocity": 0.1})
    text = trajectory_template(weak)
    report = report_of(weak, text, tmp_path)
    assert report.verdict == "ok"
    assert 4.0 < report.duration <= 20.0
    said = " ".join(line.removeprefix("# ") for line in text.splitlines()[:8])
    assert (
        "It does not take 4 s, since then the joint-side velocity of motor 1 of base is 0.3455 rad/s" in said
    )
    faster = text.replace(f"duration: {report.duration:g}", f"duration: {0.95 * report.duration:g}")
    assert report_of(weak, faster, tmp_path).verdict == "over_limit"


def test_a_robot_that_cannot_hold_itself_is_told_so(tmp_path: Path) -> None:
    robot = load_robot(REPOSITORY / "robots" / "vsa_3r.yaml").replace(
        "joints.1.actuator.motor.*.max_torque", 1
    )
    text = trajectory_template(robot)
    said = " ".join(line.removeprefix("# ") for line in text.splitlines()[:8])
    assert "This robot cannot execute it, nor more slowly: even at rest, under gravity alone, " in said
    assert report_of(robot, text, tmp_path).verdict == "over_limit"


def torque_steps(robot: Robot, text: str, folder: Path) -> list[float]:
    """The jump of each motor torque at the start."""
    return [
        abs(step) for joint in report_of(robot, text, folder).joints for step in joint.torque_discontinuity
    ]


def test_its_torques_start_without_a_step(tmp_path: Path) -> None:
    robot = robot_of(robot_template("RRP"), tmp_path)
    text = trajectory_template(robot)
    smooth = torque_steps(robot, text, tmp_path)
    # next to torques of up to 200 N m; what is left is rounding of ddtheta times the motor inertia
    assert max(smooth) < 1e-9
    rough = torque_steps(
        robot, text.replace("degree: 9", "degree: 7").replace("degree: 5", "degree: 3"), tmp_path
    )
    assert min(rough) > 0.01


OPTIONAL = re.compile(r"^# ( *(?:d|theta|xy|xz|yz|branch|convention): \S.*)$", re.MULTILINE)
"""Keys with a default that stand commented out beside others that do not."""


def test_what_stands_commented_out_is_the_default(tmp_path: Path) -> None:
    text = robot_template("RP")
    lines = list(OPTIONAL.finditer(text))
    assert len(lines) == 7
    for line in lines:
        assert robot_of(text[: line.start()] + line[1] + text[line.end() :], tmp_path) == robot_of(
            text, tmp_path
        )


def keys_of(cls: type, values: dict[str, Any]) -> Iterator[str]:
    """Every key that a record, and the records that are set in it, may have."""
    for name, (field, _) in declared_fields(cls).items():
        yield name
        content = values.get(name, {})
        match field.kind:
            case RecordOf(inner) | PairOf(RecordOf(inner)):
                yield from keys_of(inner, content)
            case OneOf(variants) | PairOf(OneOf(variants)) if content:
                yield from keys_of(variants[content["type"]], content)


def test_every_key_is_there_with_its_meaning() -> None:
    text = robot_template("R")
    values = yaml.safe_load(text)
    for key in [*keys_of(RobotFile, values), *keys_of(Joint, values["joints"][0])]:
        assert re.search(rf"^#? *(- )?{key}:.* # \w", text, re.MULTILINE), key
    for key in keys_of(OF_ANY_ROBOT, yaml.safe_load(trajectory_template())):
        assert re.search(rf"^#? *{key}:.* # \w", trajectory_template(), re.MULTILINE), key


def test_lines_are_not_too_long() -> None:
    for text in (robot_template("RPR"), trajectory_template()):
        assert max(map(len, text.splitlines())) <= WIDTH + 10  # further joints stand on a line each


@pytest.mark.parametrize(
    ("joints", "hint"),
    [
        ("", "found ''"),
        ("RRX", "found 'RRX'"),
        ("R R", "found 'R R'"),
        ("6", "for 6 revolute joints: --joints RRRRRR"),
        ("1", "for 1 revolute joint: --joints R"),
        ("500", "found '500'"),
    ],
)
def test_letters_that_are_no_joints(joints: str, hint: str) -> None:
    with pytest.raises(InputError) as error:
        robot_template(joints)
    expected = "expected a letter for each joint, R (revolute) or P (prismatic), e.g. RRP for 3 joints"
    assert str(error.value) == f"{expected}; {hint}"


def test_too_many_joints() -> None:
    with pytest.raises(InputError, match="expected at most 100 joints, found 101"):
        robot_template("R" * (MOST_JOINTS + 1))


NEXT_OF_ROBOT = "next: vsacli new trajectory --robot arm.yaml -o move.yaml\n"


def test_files_are_written_and_never_replaced_by_accident(vsacli: Any, tmp_path: Path) -> None:
    done = vsacli("new", "robot", "--joints", "RP", "-o", "arm.yaml")
    assert (done.code, done.out, done.err) == (0, "", f"wrote arm.yaml\n{NEXT_OF_ROBOT}")
    assert (tmp_path / "arm.yaml").read_text() == robot_template("RP")
    before = contents(tmp_path)
    again = vsacli("new", "robot", "--joints", "R", "-o", "arm.yaml")
    assert again.code == 4
    assert "exists already; choose another name, or replace it with --overwrite" in again.err
    assert contents(tmp_path) == before
    assert vsacli("new", "robot", "--joints", "R", "-o", "arm.yaml", "--overwrite", "-q").err == ""
    assert (tmp_path / "arm.yaml").read_text() == robot_template("R")


def test_from_nothing_to_torques(vsacli: Any) -> None:
    assert vsacli("new", "robot", "--joints", "PR", "--actuator", "elastic", "-o", "arm.yaml").code == 0
    assert vsacli("new", "trajectory", "--robot", "arm.yaml", "-o", "move.yaml").code == 0
    assert vsacli("validate", "arm.yaml", "move.yaml").code == 0
    assert vsacli("invdyn", "arm.yaml", "move.yaml", "-q").code == 0


def test_standard_output_is_the_file(vsacli: Any) -> None:
    robot, trajectory = vsacli("new", "robot", "--joints", "RP"), vsacli("new", "trajectory")
    assert (robot.out, robot.err) == (robot_template("RP"), NEXT_OF_ROBOT)
    assert (trajectory.out, trajectory.err) == (
        trajectory_template(),
        "next: vsacli invdyn arm.yaml move.yaml\n",
    )


def test_a_robot_that_cannot_be_read(vsacli: Any) -> None:
    done = vsacli("new", "trajectory", "--robot", "none.yaml")
    assert (done.code, done.out, done.err) == (2, "", "none.yaml: no such file\n")


@pytest.mark.parametrize("command", ["robot", "trajectory"])
def test_help_of_both(vsacli: Any, command: str) -> None:
    done = vsacli("new", command, "-h")
    assert done.code == 0
    assert f"vsacli new {command} " in done.out


def test_a_new_robot_with_cams_comes_with_their_profile(vsacli: Any, tmp_path: Path) -> None:
    command = ("new", "robot", "--joints", "R", "--actuator", "cam", "-o")
    assert vsacli(*command, str(tmp_path / "arm.yaml")).code == 0
    assert load_robot(tmp_path / "arm.yaml").joints[0].actuator_type == "serial"
    again = vsacli(*command, str(tmp_path / "other.yaml"))
    assert (again.code, "cam_profile.csv" in again.err) == (4, True)  # one of yours is not replaced
    assert not (tmp_path / "other.yaml").exists()


def test_a_new_trajectory_never_replaces_its_robot(vsacli: Any) -> None:
    Path("arm.yaml").write_text(robot_template("RP"))
    for output in ("arm.yaml", "./arm.yaml"):
        done = vsacli("new", "trajectory", "--robot", "arm.yaml", "-o", output, "--overwrite")
        assert done.code == 2
        assert done.err.endswith("is an input of this command; choose another name for the output\n")
    assert Path("arm.yaml").read_text() == robot_template("RP")


def test_a_robot_with_several_tools_is_offered_wrenches_by_tool_alone() -> None:
    hand, arm = (load_robot(REPOSITORY / "robots" / f"{name}.yaml") for name in ("hand_3x2r", "vsa_3r"))
    assert re.findall(r"# (wrench\w*):", trajectory_template(hand)) == ["wrenches"]
    assert re.findall(r"# (wrench\w*):", trajectory_template(arm)) == ["wrench", "wrenches"]
