"""Logs as laboratories keep them: what is taken for times and for joints, and what is not."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.command_line import REPOSITORY, Outcome

from vsacli import load_robot, load_trajectory
from vsacli.files import templates
from vsacli.files.info import render
from vsacli.files.recordings import describe_recording
from vsacli.trajectory.recorded.header_words import JointNames, words_of_column_name

Command = Callable[..., Outcome]

ROBOT = REPOSITORY / "robots" / "planar_2r.yaml"
ROWS = 200
TIME = np.arange(ROWS) / 100
POSITION = np.sin(3 * TIME)
CLOCK = [f"22:30:0{1 + i // 100}:{i % 100 * 10000 + 720:06d}" for i in range(ROWS)]
JOINTS = [f"joint{number}" for number in range(1, 8)]


class Arm:
    """What a description asks of a robot: names of joints, here of any kind."""

    def __init__(self, names: Sequence[str]) -> None:
        self.joint_names = tuple(names)
        self.joint_types = ("revolute",) * len(names)
        self.joints = ()
        self.tool_names = ("end_effector",)


@pytest.fixture(autouse=True)
def _no_stiffness_for_arms(monkeypatch: pytest.MonkeyPatch) -> None:
    genuine = templates.first_stiffnesses
    monkeypatch.setattr(
        templates, "first_stiffnesses", lambda robot: {} if isinstance(robot, Arm) else genuine(robot)
    )


def log(folder: Path, **columns: Any) -> Path:
    """A log; `_` in place of a name is none."""
    names = ["" if name == "_" else name.replace("__", ".") for name in columns]
    rows = zip(*columns.values(), strict=True)
    path = folder / "log.csv"
    path.write_text("\n".join([",".join(names), *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


def described(folder: Path, joints: Sequence[str] = (), **columns: Any) -> Any:
    robot: Any = Arm(joints) if joints else None
    return describe_recording(log(folder, **columns), robot)


def taken(description: Any) -> dict[str, str]:
    """The lines of the mapping that are no comments, by what the columns stand for."""
    lines = description["mapping"].partition("columns:\n")[2].splitlines()
    entries = (line.partition("#")[0].strip() for line in lines if not line.lstrip().startswith("#"))
    return dict(entry.split(": ", 1) for entry in entries if not entry.startswith("ignore"))


@pytest.mark.parametrize("name", ["_", "index", "Unnamed: 0"])
def test_an_index_is_no_time(tmp_path: Path, name: str) -> None:
    found = described(tmp_path, **{name: range(ROWS), "elbow_pos": POSITION})
    assert found["time"] is None
    assert found["columns"][0]["holds"] == "index"
    assert taken(found) == {"elbow.q": "elbow_pos"}
    assert "# rate: ...  # rows per second: no column holds times" in found["trajectory"]


def test_an_index_beside_times_is_none_either(tmp_path: Path) -> None:
    found = described(tmp_path, _=range(ROWS), t=TIME, elbow_pos=POSITION)
    assert taken(found) == {"time": "t", "elbow.q": "elbow_pos"}


def test_a_clock_is_a_time(tmp_path: Path) -> None:
    """And no coordinate that happens to rise is taken for one."""
    found = described(tmp_path, Time=CLOCK, current_pos_x=TIME * 0.7)
    assert found["columns"][0]["holds"] == "time"
    assert taken(found)["time"] == "Time"
    assert (found["time"]["rate"], found["time"]["first"]) == (pytest.approx(100, rel=1e-6), CLOCK[0])


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        (
            [f"row {i}" for i in range(ROWS)],
            "column 'Time' is called a time, but holds 'row 0'; expected a number, ",
        ),
        ([1.5] * ROWS, "column 'Time' is called a time, but is the same in all rows"),
    ],
)
def test_a_column_that_is_called_a_time_and_is_none_is_named(
    tmp_path: Path, cells: Sequence[Any], message: str
) -> None:
    found = described(tmp_path, Time=cells, drift=TIME)
    assert found["time"] is None
    assert message in found["warnings"][0]


def test_a_nameless_time_is_guessed_and_nearly_even(tmp_path: Path) -> None:
    jitter = np.random.default_rng(1).normal(0, 1e-3, ROWS)
    found = described(tmp_path, a=np.sort(POSITION) + 1e-6 * TIME, b=TIME + jitter, elbow_pos=POSITION)
    assert "time: b" in found["mapping"]
    assert "# guessed: it increases in nearly even steps" in found["mapping"]
    uneven = described(tmp_path, a=np.cumsum(np.exp(2 * np.sin(9 * TIME))), elbow_pos=POSITION)
    assert uneven["time"] is None
    rising = described(tmp_path, elbow_pos=TIME)
    assert rising["time"] is None


def test_a_name_that_ends_with_the_letter_of_times_is_none(tmp_path: Path) -> None:
    found = described(tmp_path, shoulder_lift=TIME**2, t=TIME, elbow_pos=POSITION)
    assert taken(found)["time"] == "t"
    assert described(tmp_path, shoulder_lift=TIME**2, elbow_pos=POSITION)["time"] is None


@pytest.mark.parametrize("rest", ["nanosec", "nsec", "nsecs"])
def test_seconds_and_nanoseconds_by_their_names(tmp_path: Path, rest: str) -> None:
    """Those of a simulation count from zero."""
    seconds, nanoseconds = np.divmod(np.round(TIME * 1e9).astype(int), 10**9)
    columns = {"header__stamp__sec": seconds, "seq": range(ROWS), f"header__stamp__{rest}": nanoseconds}
    found = described(tmp_path, **columns, elbow_pos=POSITION)
    assert taken(found)["time"] == f"{{column: header.stamp.sec, nanoseconds: header.stamp.{rest}}}"
    assert found["time"]["rate"] == pytest.approx(100)


@pytest.mark.parametrize(
    "names", [[f"joint_{i}" for i in range(1, 8)], [f"Joint-{i:02d}" for i in range(1, 8)], JOINTS]
)
@pytest.mark.parametrize("joints", [JOINTS, [f"panda_{name}" for name in JOINTS]], ids=["plain", "prefix"])
def test_names_are_matched_whatever_separates_their_words(
    tmp_path: Path, names: list[str], joints: list[str]
) -> None:
    """Beside them poses and forces stand, of which none is a joint's."""
    others = dict.fromkeys(("current_pos_x", "current_pos_y", "current_pos_z", "torque_x"), POSITION)
    found = described(tmp_path, joints, t=TIME, **others, **dict.fromkeys(names, POSITION))
    expected = dict(zip((f"{joint}.q" for joint in joints), names, strict=True))
    plain = {name: entry.strip('"') for name, entry in taken(found).items()}
    assert plain == {"time": "t", **expected}
    assert "torque_x" not in found["mapping"]
    assert "guessed" not in found["mapping"]


def test_columns_that_are_called_as_the_joints(tmp_path: Path) -> None:
    found = described(
        tmp_path, ["shoulder", "elbow"], t=TIME, shoulder=POSITION, Elbow=POSITION, load=POSITION
    )
    assert taken(found) == {"time": "t", "shoulder.q": "shoulder", "elbow.q": "Elbow"}
    found = described(tmp_path, ["elbow"], t=TIME, elbow=POSITION, elbow_position=POSITION)
    assert taken(found) == {"time": "t", "elbow.q": "elbow_position"}


@pytest.mark.slow
def test_a_quantity_that_is_not_known_is_no_position(tmp_path: Path) -> None:
    """Whatever numbers and joints its columns are called after."""
    names = [
        f"{what}_{i}" for what in ("current", "motor", "temperature", "joint_state") for i in range(1, 8)
    ]
    found = described(tmp_path, JOINTS, t=TIME, **dict.fromkeys(names, POSITION))
    assert taken(found) == {"time": "t"}
    found = described(tmp_path, ["shoulder", "elbow"], t=TIME, elbow_current=POSITION, elbow_deg=POSITION)
    assert taken(found) == {"time": "t", "elbow.q": "{column: elbow_deg, unit: deg}"}


def test_numbers_and_clocks_by_turns_are_named(tmp_path: Path) -> None:
    cells = [f"{i}" if i % 2 else CLOCK[i] for i in range(ROWS)]
    found = described(tmp_path, Time=cells, elbow_pos=POSITION)
    assert f"column 'Time' is called a time, but holds '{CLOCK[0]}'" in found["warnings"][0]


def test_a_pose_is_of_no_joint(tmp_path: Path) -> None:
    pose = dict.fromkeys(("current_pos_x", "current_pos_y"), POSITION)
    for joints in ([], ["shoulder", "elbow"]):
        assert taken(described(tmp_path, joints, t=TIME, **pose)) == {"time": "t"}


def test_names_come_before_the_order(tmp_path: Path) -> None:
    """A column whose name fits no joint is not given to the joint that is left."""
    found = described(tmp_path, ["shoulder", "elbow"], t=TIME, gripper_pos=POSITION, elbow_pos=POSITION)
    assert taken(found) == {"time": "t", "elbow.q": "elbow_pos"}


def test_numbers_from_zero_are_no_names_of_joints_from_one(tmp_path: Path) -> None:
    columns = {f"position[{i}]": POSITION for i in range(3)}
    found = described(tmp_path, ["joint1", "joint2", "joint3"], t=TIME, **columns)
    assert taken(found) == {"time": "t", **{f"joint{i + 1}.q": f'"position[{i}]"' for i in range(3)}}
    assert found["mapping"].count("by the order alone") == 3


def test_order_counts_only_where_there_are_as_many(tmp_path: Path) -> None:
    columns = {f"position[{i}]": POSITION for i in range(3)}
    assert taken(described(tmp_path, ["shoulder", "elbow"], t=TIME, **columns)) == {"time": "t"}


@pytest.mark.parametrize(
    ("joints", "column", "expected"),
    [
        (["shoulder_pan_joint", "elbow_joint"], "ShoulderPan.actual", "shoulder_pan_joint"),
        (["left_arm_1", "right_arm_1"], "RIGHT-ARM-01", "right_arm_1"),
        (["wrist_1", "wrist_10"], "wrist_10", "wrist_10"),
        (["joint1", "joint2"], "wrist_1_force", ""),
        (["elbow"], "elbow_pan", "elbow"),
        (["elbow"], "elbows", ""),
    ],
)
def test_joints_in_names(joints: list[str], column: str, expected: str) -> None:
    assert JointNames(joints).in_words(words_of_column_name(column)) == expected


ARM = ["base", "shoulder", "elbow"]


def columns_of_motors(motion: str, torque: str) -> dict[str, Any]:
    """Columns of both motors of each joint, by templates with the joint's number or name, and the motor."""
    kinds = {motion: POSITION, torque: 10 * POSITION}
    return {
        template.format(joint=joint, number=number, motor=motor, letter="ab"[motor - 1]): values
        for number, joint in enumerate(ARM, 1)
        for motor in (1, 2)
        for template, values in kinds.items()
    }


@pytest.mark.parametrize(
    ("motion", "torque"),
    [
        ("mot{number}{letter}_deg", "trq{number}{letter}"),
        ("theta_{number}_{motor}", "tau_motor_{number}_{motor}"),
        ("{joint}__theta_measured_{motor}", "{joint}__tau_motor_{motor}"),
        ("{joint} motor {letter} position", "{joint}_torque_{letter}"),
        ("motor_encoder_{number}_{letter}", "effort_{number}_{letter}"),
    ],
)
def test_both_motors_are_proposed_for_compare_and_identify(tmp_path: Path, motion: str, torque: str) -> None:
    columns = columns_of_motors(motion, torque)
    positions = {f"enc{number}": POSITION for number in (1, 2, 3)}
    stiffness = {f"K{number}": POSITION + 2 for number in (1, 2, 3)}
    found = described(tmp_path, ARM, t=TIME, **columns, **positions, **stiffness)
    named = {name: re.sub(r"^{column: |, unit: deg}$|\"", "", entry) for name, entry in taken(found).items()}
    of_motors = {
        f"{joint}.{variable}_{motor}": column
        for (joint, motor, variable), column in zip(
            itertools.product(ARM, (1, 2), ("theta", "tau_motor")), columns, strict=True
        )
    }
    joints = {f"{joint}.q": f"enc{number}" for number, joint in enumerate(ARM, 1)}
    stiff = {f"{joint}.stiffness": f"K{number}" for number, joint in enumerate(ARM, 1)}
    expected = {name: column.replace("__", ".") for name, column in of_motors.items()}
    assert named == {"time": "t", **joints, **stiff, **expected}
    trajectory = found["trajectory"].partition("ignore:")[0]
    assert "theta" not in trajectory.replace(motion.split("_")[0], "")
    assert "motor_1" not in trajectory


def test_numbers_of_joints_are_not_those_of_motors(tmp_path: Path) -> None:
    """Nor are gains, or counters that fall below zero, stiffnesses."""
    names = [f"panda_joint{number}" for number in range(1, 3)]
    torques = {f"{name}_torque": POSITION for name in names}
    gains = {"Kp1": TIME + 1, "k_d_2": TIME + 1, "K1": POSITION, "K2": POSITION}
    found = described(tmp_path, names, t=TIME, **torques, **gains)
    assert taken(found) == {"time": "t"}
    assert "# panda_joint2.tau_motor_1: panda_joint2_torque" in found["mapping"]
    assert "tau_motor_2" not in found["mapping"]


@pytest.mark.parametrize(
    ("columns", "heading"),
    [
        (["shoulder_pos", "elbow_pos"], "check the columns:"),
        (["pos1", "pos2"], "check the columns, some of which are guessed:"),
    ],
)
def test_guesses_are_announced_where_there_are_some(tmp_path: Path, columns: list[str], heading: str) -> None:
    log(tmp_path, t=TIME, **dict.fromkeys(columns, POSITION))
    text = render(describe_recording(tmp_path / "log.csv", load_robot(ROBOT)))
    assert f"trajectory file for this recording; {heading}\n" in text


def trajectory_of(folder: Path, text: str) -> Any:
    path = folder / "recorded.yaml"
    path.write_text(text)
    return load_trajectory(path, load_robot(ROBOT))


def test_a_log_without_times_has_a_rate(vsacli: Command, tmp_path: Path) -> None:
    """By the option of `info`, whose proposal gives what a log with times would."""
    log(tmp_path, _=range(ROWS), shoulder=POSITION, elbow=POSITION / 2)
    printed = vsacli("info", "log.csv", "--robot", ROBOT, "--rate", "100", "--field", "trajectory")
    assert (printed.code, "rate: 100\n" in printed.out) == (0, True)
    unstamped = trajectory_of(tmp_path, printed.out)
    log(tmp_path, t=TIME, shoulder=POSITION, elbow=POSITION / 2)
    stamped = trajectory_of(
        tmp_path, vsacli("info", "log.csv", "--robot", ROBOT, "--field", "trajectory").out
    )
    np.testing.assert_array_equal(unstamped.block(0, ROWS).q, stamped.block(0, ROWS).q)
    np.testing.assert_array_equal(unstamped.block(0, ROWS).time, TIME)


@pytest.mark.slow
def test_the_rate_is_an_option_of_invdyn(vsacli: Command, tmp_path: Path) -> None:
    """What is computed once more from the result alone is the same."""
    columns = {"shoulder__q": POSITION, "elbow__q": POSITION / 2}
    columns |= {f"{joint}__stiffness": [20000] * ROWS for joint in ("shoulder", "elbow")}
    log(tmp_path, **columns)
    refused = vsacli("invdyn", ROBOT, "log.csv", "-o", "r.h5")
    assert refused.code == 2
    assert (
        "there is no column 'time'; if the rows are equally spaced, give their rate: --set rate=HZ"
        in refused.err
    )
    assert vsacli("invdyn", ROBOT, "log.csv", "--rate", "100", "-o", "r.h5", "-q").code in (0, 3)
    assert vsacli("validate", "r.h5", "--recompute").out.endswith("equal bit for bit\n")
    log(tmp_path, time=TIME, **columns)
    assert vsacli("invdyn", ROBOT, "log.csv", "-o", "s.h5", "-q").code in (0, 3)
    tables = [vsacli("export", name).out for name in ("r.h5", "s.h5")]
    assert tables[0] == tables[1]


@pytest.mark.parametrize("rate", ["0", "-1", "nan", "inf"])
def test_a_rate_that_is_none(vsacli: Command, tmp_path: Path, rate: str) -> None:
    log(tmp_path, shoulder=POSITION, elbow=POSITION)
    done = vsacli("info", "log.csv", "--rate", rate)
    assert (done.code, "expected samples per second, e.g. 1000" in done.err) == (2, True)
    assert vsacli("invdyn", ROBOT, "log.csv", "--rate", rate).code == 2


def test_a_rate_beside_times_is_refused_by_info(vsacli: Command, tmp_path: Path) -> None:
    log(tmp_path, t=TIME, elbow_pos=POSITION)
    done = vsacli("info", "log.csv", "--rate", "100")
    assert (done.code, done.err) == (2, "log.csv: has times in column 't'; leave --rate out\n")
    done = vsacli("info", ROBOT, "--rate", "100")
    assert (done.code, "is a robot; --rate is only for recordings without a column of times" in done.err) == (
        2,
        True,
    )


def test_a_clock_gives_the_motion_of_its_seconds(vsacli: Command, tmp_path: Path) -> None:
    log(tmp_path, Time=CLOCK, shoulder=POSITION, elbow=POSITION / 2)
    clocked = trajectory_of(
        tmp_path, vsacli("info", "log.csv", "--robot", ROBOT, "--field", "trajectory").out
    )
    assert any(f"log.csv: times count from its first stamp, {CLOCK[0]}" in note for note in clocked.notes)
    log(tmp_path, t=TIME, shoulder=POSITION, elbow=POSITION / 2)
    plain = trajectory_of(tmp_path, vsacli("info", "log.csv", "--robot", ROBOT, "--field", "trajectory").out)
    np.testing.assert_array_equal(clocked.block(0, ROWS).time, plain.block(0, ROWS).time)
    np.testing.assert_array_equal(clocked.block(0, ROWS).q, plain.block(0, ROWS).q)


def test_the_rate_in_a_file_of_columns(vsacli: Command, tmp_path: Path) -> None:
    log(tmp_path, shoulder=POSITION, elbow=POSITION / 2)
    mapping = vsacli("info", "log.csv", "--robot", ROBOT, "--rate", "100", "--field", "mapping").out
    (tmp_path / "columns.yaml").write_text(mapping)
    assert vsacli("validate", "columns.yaml").code == 0
    log(tmp_path, t=TIME, shoulder=POSITION, elbow=POSITION / 2)
    (tmp_path / "recorded.yaml").write_text(
        vsacli("info", "log.csv", "--robot", ROBOT, "--field", "trajectory").out
    )
    assert vsacli("invdyn", ROBOT, "recorded.yaml", "-o", "r.h5", "-q").code in (0, 3)
    log(tmp_path, shoulder=POSITION, elbow=POSITION / 2)
    found = vsacli("compare", "r.h5", "log.csv", "--columns", "columns.yaml", "--time-offset", "0", "--json")
    assert found.code in (0, 3), found.err
    assert json.loads(found.out)


@pytest.mark.parametrize("extra", [[], ["q", "dq"], ["time", "joint1_q", "shoulder_q"]])
def test_foreign_headers_end_in_one_message(vsacli: Command, tmp_path: Path, extra: list[str]) -> None:
    names = [*extra, *(f"actual_{kind}_{i}" for kind in ("pos", "vel", "torque") for i in range(8))]
    log(tmp_path, **dict.fromkeys(names, POSITION))
    done = vsacli("invdyn", ROBOT, "log.csv")
    assert done.code == 2
    assert len(done.err.splitlines()) == 1
    advice = "vsacli info log.csv --robot ROBOT --field trajectory writes a file to use in its place"
    assert done.err.endswith(f"expected columns such as time, shoulder.q; {advice}\n")
    assert vsacli("plot", "log.csv", "--robot", ROBOT).err.endswith(f"{advice}\n")


def test_columns_without_use_beside_known_ones_are_one_message(vsacli: Command, tmp_path: Path) -> None:
    known = {
        f"{joint}__{name}": [0.5 if name == "q" else 2e4] * ROWS
        for joint in ("shoulder", "elbow")
        for name in ("q", "stiffness")
    }
    log(tmp_path, time=TIME, **known, **{f"voltage{i}": TIME for i in range(25)})
    done = vsacli("invdyn", ROBOT, "log.csv")
    assert len(done.err.splitlines()) == 1
    assert (
        "25 unknown columns: voltage0, voltage1, voltage2, ...; to leave columns out or to rename them"
        in done.err
    )
