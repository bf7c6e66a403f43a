"""Faults of records: each is told, with its column, and nothing is fitted in silence."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.excited import Excitation, Recorded, excited
from samples.marks import slow_but
from samples.shipped import shipped_robot

from vsacli import InputError, Robot, identify
from vsacli.documents.columns_file import load_columns
from vsacli.studies.identification.recordings import read_motor_recording

MOTION = Excitation(position=[0, 0, 0], reach=[0.4] * 3, stiffness=[1400] * 3, swing=[300] * 3, duration=12)


@pytest.fixture(scope="module")
def arm() -> Robot:
    return shipped_robot("vsa_3r")


@pytest.fixture(scope="module")
def record(arm: Robot) -> Recorded:
    return excited(arm, MOTION).noisy(seed=1)


def changed(record: Recorded, **changes: Callable[[Any], Any]) -> Recorded:
    """A record in which some arrays are others; changes work in place, or return what is new."""
    arrays = {name: values.copy() for name, values in record._asdict().items()}
    for name, change in changes.items():
        new = change(arrays[name])
        arrays[name] = arrays[name] if new is None else new
    return Recorded(**arrays)


def put(place: Any, value: Any) -> Callable[[Any], None]:
    """A change in place: what is at a place becomes a value, or what a function makes of what is there."""

    def change(values: Any) -> None:
        values[place] = value(values[place]) if callable(value) else value

    return change


ELBOW, SHOULDER = 2, 1

STOPPING = {
    "gap": (
        lambda record: Recorded(*(np.delete(each, np.s_[1000:1200], axis=0) for each in record)),
        r"column 'base.q', as 14 more, has a gap of 804 ms from t = 3.996 s on.*cut the file there and give "
        "both parts as recordings: lines 1 to 1001, and line 1 with those from 1002 on",
    ),
    "degrees": (
        lambda record: changed(record, q=np.degrees, theta=np.degrees),
        r"column 'elbow.theta_1' goes to [\d.]+ rad; is it in deg\? Write \[deg\] after its name",
    ),
    "wrapped": (
        lambda record: changed(record, q=lambda q: (q + 3 + np.pi) % (2 * np.pi) - np.pi),
        r"column 'elbow.q' jumps by 2 pi at t = [\d.]+ s, a wrapped angle: set unwrap: true in the file of",
    ),
    "not connected": (
        lambda record: changed(record, theta=put(np.s_[:, SHOULDER, 0], 0.1)),
        r"column 'shoulder.theta_1' is 0.1 throughout, while 'shoulder.q' changes: a sensor that is not",
    ),
    "torque of nothing": (
        lambda record: changed(record, tau_motor=put(np.s_[:, SHOULDER, 1], 0.0)),
        r"column 'shoulder.tau_motor_2' is 0 throughout, while 'shoulder.q' changes",
    ),
    "still joint": (
        lambda record: changed(
            record, **{name: put(np.s_[:, ELBOW], 0.25) for name in ("q", "theta", "tau_motor")}
        ),
        "record.csv: joint elbow does not move, so nothing can be identified; remove its columns, or record",
    ),
    "milliseconds": (
        lambda record: changed(record, time=lambda time: 1000 * time),
        r"record.csv: time looks like ms.*write time\[ms\] in the header",
    ),
    "a glimpse": (
        lambda record: Recorded(*(each[:150] for each in record)),
        "has 150 rows with a value in column 'base.q'; identification needs at least 200",
    ),
}
"""Changes of a record, and what is then said."""


@pytest.mark.parametrize("fault", STOPPING)
def test_what_nothing_can_be_made_of_stops_the_fit(
    fault: str, arm: Robot, record: Recorded, tmp_path: Path
) -> None:
    change, words = STOPPING[fault]
    with pytest.raises(InputError, match=words):
        identify(arm, change(record).write(tmp_path / "record.csv", arm))


@pytest.mark.slow
def test_wrapped_angles_are_unwrapped_on_demand(arm: Robot, record: Recorded, tmp_path: Path) -> None:
    """Joint and motors jump at different times, and the motors begin in another turn than their joint."""
    wrapped = changed(
        record,
        q=lambda q: (q + 3 + np.pi) % (2 * np.pi) - np.pi,
        theta=lambda theta: (theta + 3) % (2 * np.pi),
    )
    (tmp_path / "columns.yaml").write_text("format: vsacli-columns/1\nunwrap: true\n")
    path = wrapped.write(tmp_path / "wrapped.csv", arm)
    fit = ["joints.elbow.actuator.spring.*"]
    told = identify(arm, path, fit, columns=tmp_path / "columns.yaml").numbers
    expected = identify(arm, record.write(tmp_path / "record.csv", arm), fit).numbers
    # nine digits in the files, and filters that turn rounding into 1e-5 of the values
    assert [each.value for each in told] == pytest.approx([each.value for each in expected], rel=1e-4)


def test_a_gap_is_cut_where_the_message_says(arm: Robot, record: Recorded, tmp_path: Path) -> None:
    """The parts have no gap; below a preamble and above the rows is a line of units, which both need."""
    path = Recorded(*(np.delete(each, np.s_[1000:1020], axis=0) for each in record)).write(
        tmp_path / "record.csv", arm
    )
    header, *rows = path.read_text().splitlines()
    lines = ["of the laboratory", "", header, ";".join("units"), *rows]
    path.write_text("\n".join(lines))
    mapping = tmp_path / "columns.yaml"
    mapping.write_text("format: vsacli-columns/1\nskip_rows: [1, 4]\n")
    with pytest.raises(InputError, match="gap of 84 ms") as refused:
        identify(arm, path, columns=mapping)
    said = re.search(r"lines 1 to (\d+), and lines 1 to (\d+) with those from (\d+) on", str(refused.value))
    assert said is not None
    last, head, first = map(int, said.groups())
    assert (last, head, first) == (1004, 4, 1005)
    parts = [tmp_path / name for name in ("part1.csv", "part2.csv")]
    for part, chosen in zip(parts, (lines[:last], lines[:head] + lines[first - 1 :]), strict=True):
        part.write_text("\n".join(chosen))
        read_motor_recording(arm, part, load_columns(mapping))


def test_missing_columns_are_named(arm: Robot, record: Recorded, tmp_path: Path) -> None:
    path = record.write(tmp_path / "record.csv", arm)
    path.write_text(path.read_text().replace("elbow.tau_motor_2", "elbow.torque_2", 1))
    with pytest.raises(
        InputError, match=r"the column elbow.tau_motor_2 \(motor torques\) is missing; record torques or"
    ):
        identify(arm, path)


def test_missing_columns_of_all_joints_are_one_message(arm: Robot, record: Recorded, tmp_path: Path) -> None:
    path = record.write(tmp_path / "record.csv", arm)
    path.write_text(path.read_text().replace(".q,", ".position,"))
    with pytest.raises(InputError) as error:
        identify(arm, path)
    (problem,) = error.value.problems
    listed = "base.q, shoulder.q, elbow.q (joint positions)"
    assert problem.message == f"the columns {listed} are missing; if they have other names, use --columns"


def test_columns_with_little_time_in_common_stop_the_fit(
    arm: Robot, record: Recorded, tmp_path: Path
) -> None:
    path = record.write(tmp_path / "record.csv", arm)
    header, *rows = path.read_text().splitlines()
    torques = ["tau_motor" in name for name in header.split(",")]
    halves = [
        ",".join(
            cell if at == 0 or torques[at] == (number > len(rows) // 2) else ""
            for at, cell in enumerate(row.split(","))
        )
        for number, row in enumerate(rows)
    ]
    path.write_text("\n".join([header, *halves]) + "\n")
    with pytest.raises(InputError, match=r"column '\w+.tau_motor_1' begins at .* are fewer than 200 samples"):
        identify(arm, path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("elbo", "5 unknown columns: elbo.q, elbo.theta_1, elbo.tau_motor_1, ...; did you mean elbow.q, "),
        ("wrist", "joint 'wrist' is not in vsa-3r (base, shoulder, elbow): is this the recording of another"),
    ],
)
def test_unknown_joints_are_unreliable(
    name: str, words: str, arm: Robot, record: Recorded, tmp_path: Path
) -> None:
    path = record.write(tmp_path / "record.csv", arm)
    path.write_text(path.read_text().replace("elbow.", f"{name}."))
    found = identify(arm, path, fit=["springs"])
    assert found.verdict == "unreliable"
    assert found.records[0].doubts[0].startswith(words)
    assert f"ignored columns: {name}.q, {name}.theta_1" in found.notes[0]


@pytest.mark.slow
def test_a_recording_of_another_robot_is_unreliable(arm: Robot, record: Recorded, tmp_path: Path) -> None:
    path = record.write(tmp_path / "record.csv", arm)
    springs = {f"joints.*.actuator.spring.{name}": 10 * value for name, value in (("k", 400), ("k_c", 2000))}
    found = identify(arm.replace(springs), path, fit=["springs"])
    assert found.verdict == "unreliable"
    assert any(
        "from the file by more than a factor of 3: is it the recording of another robot?" in note
        for note in found.notes
    )


def frozen_in_motion(theta: np.ndarray) -> None:
    """A hundred rows of motor 1 of the shoulder stand still where it is fastest."""
    rows = 100
    moved = theta[rows:, SHOULDER, 0] - theta[:-rows, SHOULDER, 0]
    first = int(np.argmax(np.abs(moved[rows:-rows]))) + rows
    theta[first : first + rows, SHOULDER, 0] = theta[first, SHOULDER, 0]


DOUBTS = {
    "torques in mN m": (
        lambda record: changed(record, tau_motor=lambda torque: 1000 * torque),
        "base.tau_motor_1 looks as if it is in thousandths of the unit",
    ),
    "a sign of a torque": (
        lambda record: changed(record, tau_motor=put(np.s_[:, SHOULDER, 0], np.negative)),
        "shoulder.tau_motor_1 runs the other way",
    ),
    "a sign of a motor": (
        lambda record: changed(record, theta=put(np.s_[:, SHOULDER, 0], np.negative)),
        "columns 'shoulder.theta_1' and 'shoulder.q' run against each other",
    ),
    "a sign of a joint": (
        lambda record: changed(record, q=put(np.s_[:, SHOULDER], np.negative)),
        "columns 'shoulder.theta_2' and 'shoulder.q' run against each other",
    ),
    "torques of other motors": (
        lambda record: changed(record, tau_motor=lambda torque: torque[:, [2, 1, 0]]),
        "columns look exchanged: base.tau_motor_1 is like elbow.tau_motor_1 computed",
    ),
    "positions of other motors": (
        lambda record: changed(record, theta=lambda theta: theta[:, [1, 0, 2]]),
        "column 'base.theta_1' follows 'shoulder.q', not 'base.q': columns look exchanged",
    ),
    "motors exchanged": (
        lambda record: changed(
            record,
            **{
                name: put(np.s_[:, ELBOW], lambda each: each[:, ::-1].copy())
                for name in ("theta", "tau_motor")
            },
        ),
        "the springs of elbow are deflected as on the branch negative: the columns of motors 1 and 2",
    ),
    "cut off": (
        lambda record: changed(record, tau_motor=put(np.s_[:, 0, 0], lambda torque: np.minimum(torque, 120))),
        r"column 'base.tau_motor_1' is cut off at 120, \d+ times, first at t = [\d.]+ s",
    ),
    "an outlier": (
        lambda record: changed(record, tau_motor=put(np.s_[1500, SHOULDER, 0], 900.0)),
        r"column 'shoulder.tau_motor_1' is off at t = 6.000 s",
    ),
    "frozen": (
        lambda record: changed(record, theta=frozen_in_motion),
        r"column 'shoulder.theta_1' is frozen at t = [\d.]+ s, for 396 ms",
    ),
    "repeated rows": (
        lambda record: Recorded(
            record.time, *(np.repeat(each[::2], 2, axis=0)[: len(record.time)] for each in record[1:])
        ),
        "column 'base.q', as 14 more, has each value in 2 rows",
    ),
}
"""Also of those that only make the numbers unreliable."""


@pytest.mark.cases(4)
@pytest.mark.parametrize("fault", slow_but(("torques in mN m", "motors exchanged"), DOUBTS))
def test_what_looks_wrong_is_told(fault: str, arm: Robot, record: Recorded, tmp_path: Path) -> None:
    change, words = DOUBTS[fault]
    path = change(record).write(tmp_path / "record.csv", arm)
    told = identify(arm, path, fit=["joints.*.actuator.spring.k"])
    assert told.verdict == "unreliable"
    told_of = told.records[0].doubts
    assert any(re.search(words, doubt) for doubt in told_of), told_of


@pytest.mark.slow
@pytest.mark.parametrize("exchanged", [True, False])
def test_torques_that_pull_against_each_other_are_exchanged_or_reversed_not_both(
    exchanged: bool, arm: Robot, tmp_path: Path
) -> None:
    """While hardly anything but the stiffness moves, each torque is nearly the other one's negative."""
    quiet = excited(arm, MOTION._replace(reach=[0.05] * 3)).noisy(seed=1)
    change = put(np.s_[:, 0], (lambda each: each[:, ::-1].copy()) if exchanged else np.negative)
    path = changed(quiet, tau_motor=change).write(tmp_path / "record.csv", arm)
    (found,) = identify(arm, path, fit=["joints.*.actuator.spring.k"]).records
    told_of = " ".join(found.doubts)
    assert (
        "columns look exchanged: base.tau_motor_1 is like base.tau_motor_2 computed" in told_of
    ) == exchanged
    assert ("base.tau_motor_1 runs the other way" in told_of) == (not exchanged)


@pytest.mark.slow
def test_a_clean_record_is_not_doubted(arm: Robot, record: Recorded, tmp_path: Path) -> None:
    """Nor one whose positions come from encoders with 14 bits, whose torques come at a fifth of the rate."""
    rounded = changed(record, q=read_by_encoders, theta=read_by_encoders)
    path = rounded.write(tmp_path / "record.csv", arm)
    header, *rows = path.read_text().splitlines()
    slow = ["tau" in name for name in header.split(",")]
    cells = [
        ["" if each and number % 5 else cell for each, cell in zip(slow, row.split(","), strict=True)]
        for number, row in enumerate(rows)
    ]
    path.write_text("\n".join((header, *map(",".join, cells), "")))
    told = identify(arm, path, fit=["springs", "motors"])
    assert told.records[0].doubts == ()
    assert told.verdict == "ok"
    for number in told.numbers:
        assert abs(number.value - number.before) < 4 * number.standard_error


def read_by_encoders(positions: np.ndarray) -> np.ndarray:
    step = 2 * np.pi / 2**14
    return np.asarray(step * np.round(positions / step))


@pytest.mark.slow
@pytest.mark.usefixtures("own_folder")
def test_motors_of_joints_that_move_alike_follow_their_own(vsacli: Any) -> None:
    """Fingers close together, one less far: a share of its own joint is as near to a motor as the other."""
    inputs = [REPOSITORY / folder / "hand_3x2r.yaml" for folder in ("robots", "trajectories")]
    vsacli("invdyn", *inputs, "--set", "rate=200", "-o", "grasp.h5")
    vsacli("export", "grasp.h5", "--variables", "q,theta,tau_motor", "-o", "grasp.csv")
    done = vsacli("identify", inputs[0], "grasp.csv", "--fit", "springs")
    assert "from 1 recording" in done.out
    assert "exchanged" not in done.out
