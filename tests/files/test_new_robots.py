"""New robots of every kind of actuator and mechanism, and of mixed ones, move without any editing."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import click
import pytest
from samples.marks import slow, slow_but

from vsacli import (
    Antagonistic,
    DenavitHartenberg,
    Elastic,
    InputError,
    Joint,
    Limits,
    Link,
    Motor,
    Serial,
    inverse_dynamics,
    laws,
    load_robot,
    load_trajectory,
    mechanisms,
)
from vsacli.actuators.kinds import ACTUATORS, TENDONS, mechanisms_of
from vsacli.cli.new import new
from vsacli.documents.fields import declared_fields
from vsacli.files.device_actuators import DEVICES
from vsacli.files.examples import tables_named_in
from vsacli.files.robot_template import SOURCES, robot_template
from vsacli.files.templates import trajectory_template

RECORDS = (Antagonistic, DenavitHartenberg, Elastic, Joint, Limits, Link, Motor, Serial)
"""Records of a robot file whose values have a source."""

EVERY_ACTUATOR = tuple(
    word for kind in ACTUATORS for word in (kind, *(f"{kind}:{each}" for each in mechanisms_of(kind)))
)
ON_NO_SLIDE = {
    f"{kind}:{each}"
    for kind, names in (
        *(("antagonistic", ("four_bar", "table")), ("elastic", ("four_bar", "table"))),
        ("serial", ("awas", "lever", "maccepa", "cam")),
    )
    for each in names
}
"""Mechanisms that turn, and spring laws without an example in m and N."""


def verdict_of(joints: str, actuators: str | tuple[str, ...], folder: Path) -> str:
    """The verdict of a new trajectory of a new robot, whose tables are copied next to it."""
    text = robot_template(joints, actuators)
    for table in tables_named_in(text):
        shutil.copy(table, folder)
    (folder / "arm.yaml").write_text(text)
    robot = load_robot(folder / "arm.yaml")
    (folder / "move.yaml").write_text(trajectory_template(robot).replace("rate: 1000", "rate: 50  "))
    return str(inverse_dynamics(robot, load_trajectory(folder / "move.yaml", robot)).report.verdict)


@pytest.mark.parametrize("actuator", EVERY_ACTUATOR)
def test_every_kind_and_mechanism_moves_as_written(actuator: str, tmp_path: Path) -> None:
    assert verdict_of("RR", actuator, tmp_path) == "ok"


@pytest.mark.parametrize("count", slow_but([3, 7], range(2, 8)))
def test_mixed_arms_move_as_written(count: int, tmp_path: Path) -> None:
    mixed = ("rigid", "serial", "antagonistic", "elastic", "serial:cam", "elastic:sinh", "serial:maccepa")
    assert verdict_of("RRPRRPR"[:count], mixed[:count], tmp_path) == "ok"


@pytest.mark.cases(4)
@pytest.mark.parametrize("letter", "RP")
@pytest.mark.parametrize("count", [slow(7)])
@pytest.mark.parametrize("actuator", EVERY_ACTUATOR)
def test_every_kind_and_mechanism_of_seven_joints(
    actuator: str, count: int, letter: str, tmp_path: Path
) -> None:
    if letter == "P" and actuator in ON_NO_SLIDE:
        with pytest.raises(
            InputError, match=r"joint_1: .* prismatic joint; choose (cubic|variable_ratio) or"
        ):
            robot_template(letter * count, actuator)
    else:
        assert verdict_of(letter * count, actuator, tmp_path) == "ok"


@pytest.mark.cases(2)
@pytest.mark.parametrize("actuator", [slow(actuator) for actuator in EVERY_ACTUATOR])
def test_every_kind_and_mechanism_carries_others(actuator: str, tmp_path: Path) -> None:
    """The second joint of an arm carries most; the others are the ones that follow in the list."""
    at = EVERY_ACTUATOR.index(actuator)
    first, *others = (EVERY_ACTUATOR * 2)[at + 1 : at + 7]
    arm = (first, actuator, *others)
    assert verdict_of("R" * len(arm), arm, tmp_path) == "ok", arm


def test_tendons_are_the_laws_that_only_pull() -> None:
    pulling = [name for name, law in laws.LAWS.items() if issubclass(law, laws.Tendon)]
    assert sorted(pulling) == sorted(TENDONS)


def test_every_law_has_an_example_and_a_kind_that_is_made_of_it() -> None:
    assert all("revolute" in law.examples for law in laws.LAWS.values())
    assert set(mechanisms_of("antagonistic")) == set(laws.LAWS)
    assert set(mechanisms_of("serial")) == set(mechanisms.MECHANISMS)


def test_a_later_joint_explains_what_is_new_about_it() -> None:
    text = robot_template("RRR", ("rigid", "serial:lever", "serial:lever"), ("base", "elbow", "wrist"))
    elbow, wrist = text.partition("  - name: elbow\n")[2].split("  - name: wrist\n")
    assert "    dh: {a: 0.24, alpha: 0}\n" in elbow  # known from the first joint
    assert re.search(
        r"^      motor: \{inertia: 0.5, damping: 0.01\} +# motor 1, which carries", elbow, re.MULTILINE
    )
    assert re.search(r"^        pivot: \[0.03, 0.08\] +# m; ", elbow, re.MULTILINE)
    assert re.search(r"^#       coupled_inertia: 0 ", elbow, re.MULTILINE)
    assert (
        "    actuator: {type: serial, motor: {inertia: 0.5, damping: 0.01}, mechanism: {type: lever, "
        in wrist
    )
    assert "#" not in wrist.partition("# convention")[0]


def test_each_source_of_a_value_is_said_once_of_a_field_that_exists() -> None:
    text = robot_template("R" * len(ACTUATORS), tuple(ACTUATORS))
    said = " ".join(re.sub(r"^.*?# ", "", line) for line in text.splitlines() if "# " in line)
    for field, source in SOURCES.items():
        name, _, key = field.partition(".")
        (cls,) = (each for each in RECORDS if each.__name__ == name)
        assert key in declared_fields(cls)
        assert said.replace("no- load", "no-load").count(f". {source}") == 1, field


@pytest.mark.parametrize("name", ["no", "Yes", "null", "on"])
def test_a_joint_whose_name_yaml_would_read_as_another_value(name: str, tmp_path: Path) -> None:
    (tmp_path / "arm.yaml").write_text(robot_template("R", joint_names=[name]))
    assert [joint.name for joint in load_robot(tmp_path / "arm.yaml").joints] == [name]


def completions(option: str, incomplete: str) -> list[str]:
    command = new.commands["robot"]
    (parameter,) = (each for each in command.params if option in each.opts)
    context = click.Context(command)
    return [each.value for each in parameter.type.shell_complete(context, parameter, incomplete)]


def test_every_kind_of_actuator_is_completed() -> None:
    assert set(completions("--actuator", "")) == {*EVERY_ACTUATOR, *mechanisms.MECHANISMS, *DEVICES}
    assert completions("--actuator", "serial:v") == ["serial:variable_ratio"]
    assert completions("--joint", "elbow:ri") == ["elbow:rigid"]
    assert completions("--joint", "elb") == []


@pytest.mark.slow
def test_a_mixed_arm_by_the_commands_that_each_one_proposes(vsacli: Any) -> None:
    chosen = (
        "base:rigid",
        "shoulder:antagonistic:sinh",
        "slide:elastic",
        "elbow:serial:cam",
        "wrist:maccepa",
    )
    options = [word for joint in chosen for word in ("--joint", joint)]
    command = ["new", "robot", *options, "--joints", "rrPRR", "-o", "my arm.yaml"]
    outcomes = []
    while command[0] == "new":
        outcomes.append(vsacli(*command))
        assert outcomes[-1].code == 0, outcomes[-1].err
        command = shlex.split(outcomes[-1].err.partition("next: vsacli ")[2])
    assert command == ["invdyn", "my arm.yaml", "move.yaml"]
    assert vsacli("validate", *command[1:]).code == 0
    done = vsacli(*command)
    assert (done.code, done.out.partition(" ")[0]) == (0, "OK")
    joints = load_robot("my arm.yaml").joints
    assert [joint.name for joint in joints] == [joint.partition(":")[0] for joint in chosen]
    assert [joint.type[0] for joint in joints] == list("rrprr")
    kinds = [joint.actuator_type for joint in joints]
    assert kinds == ["rigid", "antagonistic", "elastic", "serial", "serial"]


CONTRADICTIONS = {
    "": "give --joints, e.g. --joints RRP, or --joint for each joint",
    "--joint a:rigid --joint a:elastic": "--joint: the name 'a' is given twice; each joint has its own",
    "--joint a:rigid --actuator rigid": "--actuator is that of every joint, but --joint names one for each",
    "--joint a:rigid --joints RR": "--joints has 2 letters, but --joint is given 1 time; give a letter",
    "--joint RRP": "NAME:KIND:MECHANISM or NAME:DEVICE, e.g. elbow:serial:lever, found 'RRP'",
    "--joint a:": "NAME:KIND:MECHANISM or NAME:DEVICE, e.g. elbow:serial:lever, found 'a:'",
    "--joint 1a:rigid": "the name must be made of letters, digits, _ and -, beginning with a letter",
    "--joint a:seral": "'seral' is not a kind of actuator; did you mean 'serial'?",
    "--joint a:serial:leaver": "is not a mechanism or spring law of serial actuators; did you mean 'lever'?",
    "--joint a:elastic:quadratic": "is not a mechanism or spring law of elastic actuators; valid: cubic",
    "--joint a:rigid:x": "'x' is not a mechanism or spring law of rigid actuators; write rigid alone",
    "--joint a:cubic": "'cubic' is not a kind of actuator; write antagonistic:cubic or elastic:cubic",
    "--joints R --actuator elastc": "'elastc' is not a kind of actuator; did you mean 'elastic'?",
}


@pytest.mark.parametrize("options", CONTRADICTIONS)
def test_options_that_contradict_each_other(vsacli: Any, tmp_path: Path, options: str) -> None:
    done = vsacli("new", "robot", *options.split(), "-o", "arm.yaml")
    assert (done.code, done.out, list(tmp_path.iterdir())) == (2, "", [])
    assert done.err.startswith("Usage: vsacli new robot ")
    assert CONTRADICTIONS[options] in done.err


def test_a_joint_that_its_mechanism_does_not_drive_is_named(vsacli: Any) -> None:
    done = vsacli("new", "robot", "--joint", "slide:serial:lever", "--joints", "P")
    reason = "lever turns about an axis, and drives no prismatic joint"
    others = "variable_ratio or potential or shifted_cams"
    assert (done.code, done.out) == (2, "")
    assert done.err == f"--joints: slide: {reason}; choose {others}\n"
