"""Numbers that are hardly what was meant are named with line, value and unit; what may be meant passes."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from samples.command_line import REPOSITORY, REST_TO_REST, ROBOT, edited
from samples.shipped import EXAMPLES, shipped_robot
from samples.slips import FURTHER, REST, TYPICAL, Slip

from vsacli import Robot, Trajectory, load_robot, load_trajectory
from vsacli.base.errors import Problem
from vsacli.robot.plausibility import ROBOT_RULES, robot_rules_with_findings
from vsacli.trajectory.plausibility import TRAJECTORY_RULES

RULES = {rule.name: rule for rule in (*ROBOT_RULES, *TRAJECTORY_RULES)}
EVERY = [*TYPICAL, *FURTHER, *REST]


@pytest.fixture
def loaded(tmp_path):
    """Load the files of a slip with the slip in them."""

    def load(slip: Slip) -> tuple[Robot, Trajectory]:
        shutil.copy(REPOSITORY / "robots" / "measured_spring.csv", tmp_path)
        files = []
        for kind, name in (("robots", slip.robot), ("trajectories", slip.trajectory)):
            text = (REPOSITORY / kind / f"{name}.yaml").read_text()
            for right, wrong in slip.wrong.items():
                text = text.replace(right, wrong)
            files.append(tmp_path / f"{kind}.yaml")
            files[-1].write_text(text)
        robot = load_robot(files[0])
        return robot, load_trajectory(files[1], robot)

    return load


def named(slip: Slip, problem: Problem) -> bool:
    """Whether a warning is the one of the rule, on the field."""
    words = re.split(r"\{\w+\}", RULES[slip.rule].finding)
    component = "( .(x|y|z|lower|upper).)?" if re.search(r"\.\d$", slip.field) else ""
    found = ".*".join(map(re.escape, words))
    return bool(re.search(rf"^\S*{slip.field}{component}( = .*)? {found}; ", problem.message))


@pytest.mark.parametrize("slip", EVERY, ids=lambda slip: slip.what)
def test_a_slip_is_named_with_its_line_and_what_it_looks_like(slip, loaded):
    robot, trajectory = loaded(slip)
    problems = [each for each in (*robot.located_warnings, *trajectory.located_warnings) if named(slip, each)]
    assert problems, (*robot.warnings, *trajectory.warnings)
    line = Path(problems[0].file).read_text().splitlines()[problems[0].line - 1]
    written = [part.strip() for wrong in slip.wrong.values() for part in wrong.splitlines()]
    assert any(part in line for part in written) or f"{slip.field}:" in line
    assert slip.looks in problems[0].message


def test_as_many_slips_as_were_written_down():
    assert (len(TYPICAL), len(FURTHER)) == (34, 15)
    assert len({slip.what for slip in EVERY}) == len(EVERY)


def test_every_rule_finds_one_of_the_slips():
    assert {slip.rule for slip in EVERY} == RULES.keys()


def test_a_rule_is_explained_by_rules_that_come_before():
    order = list(RULES)
    assert len(order) == len(ROBOT_RULES) + len(TRAJECTORY_RULES)
    for name, rule in RULES.items():
        assert all(order.index(other) < order.index(name) for other in rule.explained_by), name


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_no_rule_finds_anything_in_what_comes_along(example):
    robot = example.robot
    for subtree in robot.checked_subtrees:
        assert robot_rules_with_findings(robot.checked, subtree, robot.sources) == frozenset()
    for each in example.trajectories:
        trajectory = load_trajectory(each.path, example.robot)
        assert [warning for warning in trajectory.located_warnings if warning.line] == []


def test_validate_says_the_line_and_a_report_the_file(vsacli):
    edited(ROBOT, Path("arm.yaml"), ("alpha: pi/2", "alpha: 90"))
    edited(REST_TO_REST, Path("move.yaml"), ("rate: 1000 ", "rate: 100 "))
    warning = "joints.base.dh.alpha = 90 rad is 14.3 turns; did you mean 90 deg?"
    assert f"arm.yaml:11: warning: {warning}\n" in vsacli("validate", "arm.yaml", "move.yaml").out
    done = vsacli("invdyn", "arm.yaml", "move.yaml")
    assert done.code in (0, 3)
    assert f"warning: arm.yaml:11: {warning}\n" in done.out
    assert f"warning: arm.yaml:11: {warning}\n" in vsacli("info", "arm.yaml").out


def test_warnings_come_before_the_advice_that_follows_from_the_number(vsacli):
    soft = edited(
        REST_TO_REST, Path("move.yaml"), ("start: 850 ", "start: 14.8 "), ("end: 1275", "end: 22.3")
    )
    out = vsacli("check-feasibility", ROBOT, soft).out
    assert out.index("did you mean 14.8 N m/deg") < out.index("increase it")


@pytest.mark.parametrize("end", ["6*pi", "(3*360) deg", "18.85", "-12.566370614"])
def test_many_turns_may_be_meant(end, tmp_path):
    motion = edited(REST_TO_REST, tmp_path / "move.yaml", ("[90 deg, 45 deg, -60 deg]", f"[{end}, 0, 0]"))
    assert load_trajectory(motion, load_robot(ROBOT)).warnings == ()


def test_turns_that_are_meant_explain_no_duration(tmp_path):
    changes = [("[90 deg, 45 deg, -60 deg]", "[720 deg, 0, 0]"), ("duration: 4.0", "duration: 0.1")]
    motion = edited(REST_TO_REST, tmp_path / "move.yaml", *changes)
    (warning,) = load_trajectory(motion, load_robot(ROBOT)).warnings
    assert "duration = 0.1 s makes what is farthest from base accelerate at up to 5660 m/s^2" in warning


def test_positions_within_the_limits_of_the_joint_may_be_meant(tmp_path):
    robot = load_robot(ROBOT).replace("joints.base.limits.position", "40*pi")
    motion = edited(REST_TO_REST, tmp_path / "move.yaml", ("[90 deg, 45 deg, -60 deg]", "[100, 45 deg, 0]"))
    assert load_trajectory(motion, robot).warnings == ()
    assert len(load_trajectory(motion, load_robot(ROBOT)).warnings) == 1


@pytest.mark.slow
def test_with_several_robots_the_one_counts_that_it_suits_best(vsacli):
    robots = sorted((REPOSITORY / "robots").glob("*.yaml"))
    done = vsacli("validate", REPOSITORY / "trajectories" / "tendon_1r.yaml", *robots)
    assert "tendon_1r.yaml:" not in done.out.replace("tendon_1r.yaml: ", "")


def test_without_a_robot_angles_are_looked_at(vsacli):
    edited(REST_TO_REST, Path("move.yaml"), ("[90 deg, 45 deg, -60 deg]", "[90, 45 deg, -60 deg]"))
    out = vsacli("validate", "move.yaml").out
    assert out.count("warning") == 1
    assert "= 90 rad is 14.3 turns" in out


def test_a_robot_of_modified_rows_is_named_by_the_rows_of_its_file(tmp_path):
    changes = [
        ("dh: {a: 0, alpha: 0, d: 0.333", "dh: {a: 0, alpha: 45, d: 0.333"),
        ("alpha: 90 deg, d: 0.316", "alpha: 90, d: 0.316"),
    ]
    panda = edited(REPOSITORY / "robots" / "panda_7r.yaml", tmp_path / "arm.yaml", *changes)
    lines = panda.read_text().splitlines()
    (warning,) = load_robot(panda).located_warnings
    (also,) = re.findall(r"\(line (\d+)\)", warning.message)
    numbers = (warning.line, int(also))
    assert [re.search(r"alpha: (\d+)", lines[number - 1])[1] for number in numbers] == ["45", "90"]


def test_what_was_changed_in_python_has_no_line():
    robot = shipped_robot("vsa_3r").replace("joints.base.dh.alpha", 90)
    (found,) = robot.located_warnings
    assert (found.file, found.line) == ("", 0)
    assert robot.replace("joints.base.dh.alpha", "pi/2").warnings == ()


@pytest.mark.parametrize(("stiffness", "named_as"), [(54.99, None), (54990, "54990 N mm/rad")])
def test_what_springs_harden_to_under_their_load_is_no_other_unit(vsacli, tmp_path, stiffness, named_as):
    """Exponential springs that hold an arm are a thousand times as stiff as at rest."""
    joints = ["--joint", "shoulder:qbmove", "--joint", "elbow:qbmove"]
    arm = vsacli("new", "robot", *joints, "--length", "0.3,0.25", "--mass", "1.2,0.7", "-o", "arm.yaml")
    assert arm.code == 0, arm.err
    edited(tmp_path / "arm.yaml", tmp_path / "arm.yaml", ("placeholder: true", "placeholder: false"))
    (tmp_path / "move.yaml").write_text(
        "format: vsacli-trajectory/1\nname: move\nduration: 1\nrate: 100\n"
        "position: {type: polynomial, degree: 7, start: 0, end: [0.2, 0.2]}\n"
        f"stiffness: {{type: constant, value: [{stiffness}, 15]}}\n"
    )
    said = " ".join(load_trajectory(tmp_path / "move.yaml", load_robot(tmp_path / "arm.yaml")).warnings)
    assert (said == "") if named_as is None else f"did you mean {named_as}" in said, said
