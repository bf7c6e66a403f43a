"""Columns of CSV tables as motion and stiffness of a robot's joints."""

import hashlib
from pathlib import Path

import numpy as np
import pytest

from vsacli import InputError
from vsacli.base.signals import POSITION, STIFFNESS
from vsacli.robot.commanded_joints import CommandedJoints
from vsacli.trajectory.fits import FitChoice
from vsacli.trajectory.recorded.columns import RATE_INSTEAD
from vsacli.trajectory.recorded.recording import read_recorded_signals, recorded_trajectory

JOINTS = CommandedJoints({"base": "revolute", "elbow": "revolute"}, exempt={})
TIME = np.arange(8) / 10
NAMES = [*POSITION.names, *STIFFNESS.names]


@pytest.fixture
def csv(tmp_path):
    def write(columns, name="motion.csv"):
        path = tmp_path / name
        rows = zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True)
        lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
        path.write_text("\n".join(lines) + "\n")
        return path

    return write


def columns(*names, time=TIME):
    """Positive columns of random doubles after the times."""
    numbers = np.random.default_rng(0).uniform(800, 1000, (len(names), len(time)))
    return {"time": time, **dict(zip(names, numbers, strict=True))}


def by_joint(*names):
    return [f"{joint}.{name}" for joint in JOINTS.names for name in names]


def by_number(*names):
    return [f"{name}{number}" for number in (1, 2) for name in names]


def problems(path, wanted=(POSITION, STIFFNESS)):
    with pytest.raises(InputError) as caught:
        read_recorded_signals(path, JOINTS, dict.fromkeys(wanted, FitChoice()))
    assert {problem.file for problem in caught.value.problems} == {str(path)}
    return [(problem.line, problem.message) for problem in caught.value.problems]


@pytest.mark.parametrize("naming", [by_joint, by_number])
def test_columns_are_read_bit_for_bit(csv, naming):
    content = columns(*naming(*NAMES))
    motion = recorded_trajectory(csv(content), JOINTS).block(0, 8)
    np.testing.assert_array_equal(motion.time, TIME)
    for name in NAMES:
        expected = np.transpose([content[column] for column in naming(name)])
        np.testing.assert_array_equal(motion.of_joints[name], expected)


def test_order_of_columns_is_free(csv):
    content = columns(*by_joint("stiffness", "q"))
    reverse = dict(reversed(content.items()))
    forth, back = (recorded_trajectory(csv(c, f"{i}.csv"), JOINTS) for i, c in enumerate((content, reverse)))
    np.testing.assert_array_equal(forth.block(0, 8).q, back.block(0, 8).q)


def test_trajectory_is_named_after_the_file_and_says_what_was_fitted(csv):
    path = csv(columns(*by_joint("q", "dq", "stiffness")), "swing-up.csv")
    trajectory = recorded_trajectory(path, JOINTS)
    assert trajectory.name == "swing-up"
    few = "on so few knots, derivatives are unreliable far into the record from both ends"
    assert any(each.startswith("ddq, d3q, d4q") and few in each for each in trajectory.warnings)
    assert any("dstiffness, ddstiffness" in each for each in trajectory.warnings)
    (source,) = trajectory.sources
    assert (source.path, source.text) == (str(path), path.read_text())
    assert source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_only_wanted_signals_are_needed_and_unused_ones_are_noted(csv):
    position = read_recorded_signals(csv(columns(*by_joint("q"))), JOINTS, {POSITION: FitChoice()})
    assert [profile.signal for profile in position.profiles] == [POSITION]
    assert position.notes == ()

    path = csv(columns(*by_joint("q", "stiffness", "dq")))
    stiffness = read_recorded_signals(path, JOINTS, {STIFFNESS: FitChoice()})
    assert [profile.signal for profile in stiffness.profiles] == [STIFFNESS]
    assert stiffness.notes == (f"{path}: its columns of q are not used",)


def test_profiles_come_in_the_order_asked_for(csv):
    recording = read_recorded_signals(
        csv(columns(*by_joint("q", "stiffness"))), JOINTS, dict.fromkeys([STIFFNESS, POSITION], FitChoice())
    )
    assert [profile.signal for profile in recording.profiles] == [STIFFNESS, POSITION]


def test_all_problems_of_a_header_at_once(csv):
    names = ["base.q", "elbow_q", "bsae.dq", "base.stiffness", "elbow.stiffness", "elbow.ddq"]
    content = columns(*names)
    content["t"] = content.pop("time")
    assert problems(csv(content)) == [
        (1, "unknown column 'elbow_q'; did you mean 'elbow.q'?"),
        (1, "unknown column 'bsae.dq'; did you mean 'base.dq'?"),
        (1, "unknown column 't'; did you mean 'time'?"),
        (1, "the column elbow.dq is missing; dq is given for all joints or for none"),
        (1, "the column base.ddq is missing; ddq is given for all joints or for none"),
    ]


def test_missing_times_may_follow_from_a_rate(csv):
    content = columns(*by_joint("q", "stiffness"))
    del content["time"]
    assert problems(csv(content)) == [(1, f"there is no column 'time'; {RATE_INSTEAD}")]


def test_unknown_and_missing_columns_are_one_problem(csv):
    (found,) = problems(csv(columns("base.q", "elbow.pos", *by_joint("stiffness"))))
    assert found[1].startswith(
        "the column elbow.q is missing (position of joint elbow); unknown column 'elbow.pos'; if it has "
    )


def test_a_missing_column_is_named_with_its_meaning(csv):
    (found,) = problems(csv(columns("base.q", *by_joint("stiffness"))))
    assert found[1].startswith(
        "the column elbow.q is missing (position of joint elbow); columns: time, base.q, base.stiffness, "
        "elbow.stiffness; if it has another name, use a trajectory file as printed by vsacli info "
    )


def test_columns_of_the_same_joint_are_not_proposed_for_each_other(csv):
    further = [
        f"{joint}.{name}_{motor}"
        for joint in ("base", "elbow")
        for name in ("theta", "tau")
        for motor in (1, 2)
    ]
    (found,) = problems(csv(columns(*by_joint("q", "stiffness"), *further)))
    assert found[1].startswith(
        "8 unknown columns: base.theta_1, base.theta_2, base.tau_1, ...; to leave columns out"
    )


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (
            ["base.q", "elbwo.q", "base.stiffness", "elbwo.stiffness"],
            "2 unknown columns: elbwo.q, elbwo.stiffness; did you mean elbow.q, elbow.stiffness?",
        ),
        (
            ["base.q", "elbow.q", "base.stifness", "elbow.stifness"],
            "2 unknown columns: base.stifness, elbow.stifness; did you mean base.stiffness, elbow.stiffness?",
        ),
        (
            ["base.q", "elbow.q (deg)", "base.stiffness", "elbow.stiffness"],
            "'elbow.q (deg)': units are written in square brackets, elbow.q [deg]",
        ),
    ],
)
def test_one_mistake_is_one_problem(csv, names, message):
    assert problems(csv(columns(*names))) == [(1, message)]


def test_numbers_of_joints_start_at_one(csv):
    found = problems(csv(columns("q0", "q1", "stiffness0", "stiffness1")))
    assert found[0][1] == "unknown column 'stiffness0'; did you mean 'stiffness2'?"
    assert found[1][1].startswith(
        "the column q2 is missing (position of joint elbow); unknown column 'q0'; if it has another name"
    )
    assert len(found) == 2


def test_absent_signal_is_named_by_joint(csv):
    path = csv(columns(*by_joint("q")))
    assert problems(path) == [
        (
            1,
            "the columns base.stiffness, elbow.stiffness are missing; a YAML trajectory can combine the "
            f"motion of this file (position: {{type: csv, file: {path}}}) with a stiffness",
        )
    ]


def test_two_ways_of_naming_are_not_mixed(csv):
    assert problems(csv(columns("q1", "q2", "base.stiffness", "elbow.stiffness"))) == [
        (1, "columns are named both by joint and by number ('base.stiffness' and 'q1'); use one way")
    ]


def test_result_variables_that_are_no_input_are_refused(csv):
    found = problems(csv(columns(*by_joint("q", "stiffness"), "base.tau_motor_1")))
    assert found[0][0] == 1
    assert found[0][1].startswith("unknown column 'base.tau_motor_1'")


@pytest.mark.parametrize(
    ("again", "text"),
    [
        (0.3, "0.3 s appears twice"),
        (0.1, "0.1 s follows 0.3 s"),
    ],
)
def test_time_that_does_not_increase(csv, again, text):
    time = [0.0, 0.1, 0.2, 0.3, again, 0.4, 0.5, 0.6]
    found = problems(csv(columns(*by_joint("q", "stiffness"), time=time)))
    advice = "correct these stamps, or set rate: 10 in their place if the rows are equally spaced"
    assert found == [(6, f"time must increase, but {text}; {advice}")]


def test_all_problems_of_the_rows_at_once(csv):
    content = columns(*by_joint("q", "stiffness"), time=[0.0, 0.1, 0.2, 0.3, 0.25, 0.5, 0.6, 0.7])
    content["elbow.stiffness"][3:5] = -1.0
    content["base.stiffness"][0] = 0.0
    (line, order), *others = problems(csv(content))
    assert (line, order[:48]) == (6, "time must increase, but 0.25 s follows 0.3 s; co")
    assert others == [
        (2, "base.stiffness must be positive, not 0 (t = 0.000 s)"),
        (5, "elbow.stiffness must be positive, not -1 (t = 0.300 s; 2 such samples)"),
    ]


def test_too_few_rows(csv):
    found = problems(csv(columns(*by_joint("q", "stiffness"), time=TIME[:3])))
    assert found == [(0, "q has 3 samples; a trajectory needs at least 8")]


def recording(csv, time, name):
    return read_recorded_signals(
        csv(columns(*by_joint("q"), time=time), name), JOINTS, {POSITION: FitChoice()}
    )


def test_files_with_equal_times_may_be_combined(csv):
    recording(csv, TIME, "a.csv").check_times(recording(csv, TIME.copy(), "b.csv"))


def test_files_with_different_times_are_refused_at_the_first_row(csv):
    later = TIME.copy()
    later[5:] += 1e-15
    first, second = recording(csv, TIME, "a.csv"), recording(csv, later, "b.csv")
    with pytest.raises(
        InputError, match=r"b\.csv:7: time is 0\.5\d* s, but 0\.5 s in the same row of .*a\.csv"
    ):
        first.check_times(second)


def test_files_with_different_numbers_of_rows_are_refused(csv):
    longer = np.append(TIME, 0.8)
    first, second = recording(csv, TIME, "a.csv"), recording(csv, longer, "b.csv")
    with pytest.raises(InputError, match=r"b\.csv: the file has 9 rows, but .*a\.csv has 8"):
        first.check_times(second)


def test_problems_of_the_table_come_through(tmp_path):
    path = Path(tmp_path / "motion.csv")
    path.write_text("time,base.q,elbow.q\n0,1,2\n1,x,2\n")
    assert problems(path) == [(3, "column 'base.q': expected a number, found 'x'")]
