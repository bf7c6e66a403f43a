"""`vsacli check-feasibility --write-fix`: causes, fixes of some joints, transitions, text that is kept."""

from __future__ import annotations

import json

import numpy as np
import pytest
from samples.command_line import REPOSITORY

from vsacli import load_robot, load_trajectory, motor_torques
from vsacli.base.flags import LIMITS

ROBOT = REPOSITORY / "robots" / "vsa_3r.yaml"
FAST = """\
# Tuned by hand.
format: vsacli-trajectory/1
name: fast                        # for the demonstration
duration: 0.45                    # s
position:
  type: polynomial
  degree: 7
  start: 0
  end: [90 deg, 45 deg, -60 deg]  # as in the paper
stiffness:
  type: constant
  value:                          # N m/rad
    - 850                         # base
    - 830
    - 850                         # elbow
"""
CHANGING = """\
format: vsacli-trajectory/1
name: changing
duration: 2
rate: 200
position: {type: constant, value: [10 deg, 20 deg, 30 deg]}
stiffness:
  type: steps
  degree: 5
  levels: [900, 1200, 950]
  times: [0.3, 1.2]
  transition: 0.05                # s, much too short
"""


COURSE = np.polynomial.Polynomial([0, 0, 0, 0, 35, -84, 70, -20])
"""From 0 to 1 at rest."""


def recorded_motion(path, rate, start=0.0, derivatives=0):
    """The motion of the paper in 0.45 s, too fast for 850 N m/rad, as a recording with even stamps."""
    time = np.arange(round(0.45 * rate) + 1) / rate
    columns = {"time": start + time}
    for order, name in enumerate(("q", "dq", "ddq", "d3q", "d4q")[: derivatives + 1]):
        for joint, end in (("base", np.pi / 2), ("shoulder", np.pi / 4), ("elbow", -np.pi / 3)):
            columns[f"{joint}.{name}"] = end * COURSE.deriv(order)(time / 0.45) / 0.45**order
    for joint, stiffness in (("base", 850), ("shoulder", 830), ("elbow", 850)):
        columns[f"{joint}.stiffness"] = np.full(len(time), float(stiffness))
    table = np.stack(list(columns.values()), axis=1)
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")


def changed_lines(before, after):
    return [line for line in after.splitlines() if line not in before.splitlines()]


def robot_with(folder, **limits):
    """The arm with limits of its motors: joints with a number in the same place."""
    robot = load_robot(ROBOT)
    lines = iter(ROBOT.read_text().splitlines())
    text, joint = [], -1
    for line in lines:
        joint += line.lstrip().startswith("- name:")
        name = robot.joint_names[joint] if joint >= 0 else ""
        if name in limits and "motor: {" in line:
            line = line.replace("motor: {", f"motor: {{max_torque: {limits[name]}, ")
        text.append(line)
    path = folder / "robot.yaml"
    path.write_text("\n".join(text) + "\n")
    return path


def written(vsacli, robot, task, text, kind, number):
    """What is said of the fix of this number, which takes one kind of change alone, and the file with it."""
    task.write_text(text)
    done = vsacli("check-feasibility", robot, task, "--write-fix", number, "-o", "fixed.yaml", "--json")
    assert done.code == 0, done.err
    fixes = json.loads(done.out)["fixes"]["fixes"]
    numbers = [
        place for place, each in enumerate(fixes, 1) if each.keys() == {"size", "motors", kind, "text"}
    ]
    assert number == numbers[0]
    return fixes[number - 1]["text"], (task.parent / "fixed.yaml").read_text()


@pytest.mark.slow
def test_values_change_where_they_stand(tmp_path, vsacli):
    said, text = written(vsacli, ROBOT, tmp_path / "fast.yaml", FAST, "stiffness_offset", 3)
    assert said.startswith("raise the stiffness of base by")
    name, base, shoulder = changed_lines(FAST, text)
    assert name == 'name: "fast-fixed"                        # for the demonstration'
    assert base.startswith("    - 90")
    assert base.endswith(" # base")
    assert len(base.split()[1]) <= 7, "four decimal places behind the leading digit"
    assert shoulder.startswith("    - 8")
    assert vsacli("check-feasibility", ROBOT, "fixed.yaml").code == 0


@pytest.mark.slow
def test_a_slower_motion_lasts_whole_periods(tmp_path, vsacli):
    text = FAST.replace("duration: 0.45 ", "rate: 500\nduration: 0.45 ")
    said, fixed = written(vsacli, ROBOT, tmp_path / "fast.yaml", text, "slow_down", 4)
    assert said.startswith("slow down by a factor ")
    name, duration = changed_lines(text, fixed)
    assert name.startswith("name: ")
    assert duration.endswith("                    # s")
    periods = float(duration.split()[1]) * 500
    assert periods == pytest.approx(round(periods), abs=1e-6)
    assert vsacli("invdyn", ROBOT, "fixed.yaml", "-o", "fixed.h5").code == 0
    assert vsacli("export", "fixed.h5", "--rate", 500, "-o", "fixed.csv").code == 0


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("rate", "start", "derivatives", "asked"),
    [
        (250, 0.0, 0, None),
        (963, 1.7e9, 0, None),
        (500, 0.0, 4, None),
        (1000, 0.0, 0, 500),
    ],
    ids=["record", "963 Hz since 1970", "all derivatives", "with a rate"],
)
def test_a_slower_recording_keeps_its_rate_over_whole_periods(
    tmp_path, vsacli, rate, start, derivatives, asked
):
    """It had as many samples, further apart: 500 Hz became 487.013 Hz, at which nothing runs."""
    recorded_motion(tmp_path / "fast.csv", rate, start, derivatives)
    task, recorded = "fast.csv", rate
    if asked:
        task, rate = "fast.yaml", asked
        (tmp_path / task).write_text(
            f"format: vsacli-trajectory/1\nname: fast\nrate: {asked}\n"
            "position: {type: csv, file: fast.csv}\nstiffness: {type: csv, file: fast.csv}\n"
        )
    done = vsacli("check-feasibility", ROBOT, task, "--fixes", "--json")
    fixes = json.loads(done.out)["fixes"]["fixes"]
    slower = [number for number, each in enumerate(fixes, 1) if "slow_down" in each]
    assert {"slow_down", "stiffness_offset"} <= {key for number in slower for key in fixes[number - 1]}
    for number in {frozenset(fixes[number - 1]): number for number in slower}.values():
        written = ("--write-fix", number, "-o", f"fixed-{number}.yaml")
        assert vsacli("check-feasibility", ROBOT, task, *written).code == 0
        assert vsacli("check-feasibility", ROBOT, f"fixed-{number}.yaml").code == 0
        assert vsacli("invdyn", ROBOT, f"fixed-{number}.yaml", "-o", f"fixed-{number}.h5").code == 0
        export = vsacli("export", f"fixed-{number}.h5", "--rate", rate, "-o", f"again-{number}.csv")
        assert export.code == 0, export.err
        trajectory = load_trajectory(tmp_path / f"fixed-{number}.yaml", load_robot(ROBOT))
        periods = fixes[number - 1]["slow_down"]["duration"] * rate
        assert periods == pytest.approx(round(periods), abs=1e-6)
        assert trajectory.samples == round(periods) + 1
        if not asked:  # then a changed stiffness makes known steps of it
            assert bool(trajectory.estimates) == (not derivatives)
        # through the same positions, later: stamps since 1970 are off by 1e-7 s, the motion has 8 rad/s
        moved = trajectory.at(trajectory.times.block(0, trajectory.samples)).q[:, 0]
        lasted = round(0.45 * recorded) / recorded / 0.45
        expected = np.pi / 2 * COURSE(np.linspace(0, lasted, trajectory.samples))
        np.testing.assert_allclose(moved, expected, rtol=0, atol=2e-6)


@pytest.mark.slow
def test_another_profile_leaves_the_rest_of_the_file(tmp_path, vsacli):
    _, fixed = written(vsacli, ROBOT, tmp_path / "fast.yaml", FAST, "stiffness_profile", 1)
    assert "  end: [90 deg, 45 deg, -60 deg]  # as in the paper" in fixed
    assert "# duration: 0.45                    # s" in fixed
    assert 'stiffness: {type: csv, file: "fixed.csv"}' in fixed
    assert fixed.startswith("# Tuned by hand.\n")
    assert vsacli("check-feasibility", ROBOT, "fixed.yaml").code == 0


@pytest.mark.slow
def test_each_cause_is_one_sentence_and_other_joints_are_fixed(tmp_path, vsacli):
    robot = robot_with(tmp_path, shoulder=2)
    (tmp_path / "fast.yaml").write_text(FAST)
    done = vsacli("check-feasibility", robot, "fast.yaml", "--write-fix", 1, "-o", "fixed.yaml")
    assert done.code == 3  # the shoulder stays as it is
    base, shoulder, heading, *fixes = done.out.splitlines()
    assert base.startswith("base: stiffness is 850 N m/rad at t = 0.12")
    # statics of the two outer links, with both springs tight, as the report of the arm at rest has it
    assert shoulder.startswith("shoulder: joint-side torque of motor 1 is ")
    assert (
        "even at rest, above its limit of 2 N m: no slower motion and no constant stiffness helps" in shoulder
    )
    # of the 819.4 N m/rad that gravity asks for at rest, with a margin of 1 %
    assert ", since with 827.8 N m/rad, the least it may have, joint-side torque of motor 1 is " in shoulder
    assert shoulder.endswith(" s, above its limit of 2 N m")
    assert heading.startswith("fixes; with any of them every sample of all joints but shoulder has a margin")
    assert fixes
    trajectory = load_trajectory("fixed.yaml", load_robot(ROBOT))
    block = motor_torques(load_robot(ROBOT), trajectory.block(0, trajectory.samples))
    room = (block.stiffness - block.stiffness_min) / block.stiffness
    assert room[:, [0, 2]].min() >= 0.01 - 1e-9


@pytest.mark.slow
def test_the_stiffness_that_helps_is_said(tmp_path, vsacli):
    """A motor too weak for its springs is so at any speed, unless they are softer."""
    robot = robot_with(tmp_path, base=20)
    task = tmp_path / "slow.yaml"
    slow = FAST.replace("0.45", "4") + "rate: 100\n"
    task.write_text(slow)
    done = vsacli("check-feasibility", robot, task, "--fixes", "--json")
    (cause,) = json.loads(done.out)["fixes"]["causes"]
    what, helps = cause["text"].rsplit(": ", 1)
    assert what.endswith("at t = 0.000 s, even at rest, above its limit of 20 N m")
    assert helps.startswith("no slower motion helps, a stiffness of at most ")
    value = float(helps.split()[-4])
    for stiffness, code in ((value, 0), (value + 0.05, 3)):
        task.write_text(slow.replace("- 850                         # base", f"- {stiffness}"))
        assert vsacli("check-feasibility", robot, task).code == code


@pytest.mark.slow
def test_transitions_that_are_too_short_are_lengthened_alone(tmp_path, vsacli):
    robot = robot_with(tmp_path, base=120, shoulder=120, elbow=120)
    said, fixed = written(vsacli, robot, tmp_path / "changing.yaml", CHANGING, "transition", 1)
    assert said.startswith("lengthen the transitions of the stiffness from 0.05 s to 0.17")
    name, transition = changed_lines(CHANGING, fixed)
    assert name == 'name: "changing-fixed"'
    assert transition.endswith("                # s, much too short")
    found = float(transition.split()[1])
    arm = load_robot(robot)

    def kept(length):
        (tmp_path / "tried.yaml").write_text(CHANGING.replace("transition: 0.05", f"transition: {length}"))
        trajectory = load_trajectory(tmp_path / "tried.yaml", arm)
        block = motor_torques(arm, trajectory.at(np.linspace(0, 2, 2001)))
        return not np.any(block.flags & int(LIMITS))

    assert kept(found)
    assert not any(kept(length) for length in np.linspace(0.05, found - 2e-4, 6))


def test_all_joints_that_fail_something_are_counted(tmp_path, vsacli):
    robot = robot_with(tmp_path, elbow=2)
    (tmp_path / "fast.yaml").write_text(FAST)
    done = vsacli("check-feasibility", robot, "fast.yaml")
    assert done.out.splitlines()[0].endswith("; 2 of 3 joints infeasible, 1 over a limit")
