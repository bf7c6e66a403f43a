"""`vsacli info` of recordings of other programs: what they hold, their health, and a mapping that works."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples.command_line import REPOSITORY, Outcome
from samples.exports import EXPORTS, FIRST, motion, plain

from vsacli import load_robot, load_trajectory
from vsacli.files.info import render
from vsacli.files.recordings import describe_recording

Command = Callable[..., Outcome]

ROBOT = REPOSITORY / "robots" / "planar_2r.yaml"
ARM = load_robot(ROBOT)

UNRECOGNIZABLE = ("writematrix", "spreadsheet")
"""Exports whose columns have no name, or one in another language."""


def recording(folder: Path, content: str, robot=None):
    path = folder / "log.csv"
    path.write_text(content, newline="")
    return describe_recording(path, robot)


def columns_of(described):
    return {column["number"]: column for column in described["columns"]}


@pytest.mark.parametrize("name", [name for name in EXPORTS if name not in UNRECOGNIZABLE])
def test_the_trajectory_that_is_printed_gives_the_motion(vsacli: Command, tmp_path: Path, name: str) -> None:
    recorded = motion()
    (tmp_path / "plain.csv").write_text(plain(recorded))
    (tmp_path / "plain.yaml").write_text(
        "format: vsacli-trajectory/1\nname: plain\nposition: {type: csv, file: plain.csv}\n"
        "stiffness: {type: constant, value: 10000}\n"
    )
    (tmp_path / "log.csv").write_text(EXPORTS[name](recorded).content, newline="")
    printed = vsacli("info", "log.csv", "--robot", ROBOT, "--field", "trajectory")
    assert printed.code == 0
    (tmp_path / "motion.yaml").write_text(printed.out)
    found, expected = (load_trajectory(tmp_path / f"{stem}.yaml", ARM) for stem in ("motion", "plain"))
    np.testing.assert_array_equal(found.block(0, 61).q, expected.block(0, 61).q)
    np.testing.assert_array_equal(found.block(0, 61).time, expected.block(0, 61).time)
    assert found.block(0, 61).of_joints["stiffness"].min() > 0


@pytest.mark.parametrize("name", UNRECOGNIZABLE)
def test_what_cannot_be_told_is_left_open(tmp_path: Path, name: str) -> None:
    described = recording(tmp_path, EXPORTS[name](motion()).content, ARM)
    assert "# shoulder.q: ..." in described["mapping"]
    assert "# elbow.q: ..." in described["mapping"]


def test_what_is_there(tmp_path: Path) -> None:
    described = recording(tmp_path, EXPORTS["rostopic"](motion()).content)
    assert described["rows"] == 61
    assert described["time"]["first"] == FIRST
    assert described["time"]["unit"] == "ns"
    assert described["time"]["rate"] == pytest.approx(100, rel=0.05)
    columns = columns_of(described)
    holds = [columns[number]["holds"] for number in range(1, 13)]
    assert "# rate: 100  # stamps jitter" in described["trajectory"]
    assert holds == [
        "numbers",
        "numbers",
        "time",
        "nothing",
        "text",
        "text",
        *["numbers"] * 4,
        *["nothing"] * 2,
    ]
    positions = np.array(motion().positions)
    assert [columns[7]["min"], columns[8]["max"]] == [positions[:, 0].min(), positions[:, 1].max()]


def signal(samples: int = 3000) -> tuple[list[float], list[float]]:
    time = np.arange(samples) / 500
    noise = np.random.default_rng(2).normal(0, 1e-4, samples)
    return time.tolist(), (np.sin(2 * time) + noise).tolist()


def table(time: list[float], **columns: list[float]) -> str:
    rows = zip(time, *columns.values(), strict=True)
    lines = [",".join(map(repr, row)) for row in rows]
    return "\n".join([",".join(["stamp", *columns]), *lines]) + "\n"


def test_health_of_each_column_is_told(tmp_path: Path) -> None:
    time, q = signal()
    off, wrapped = list(q), list(q)
    off[1200] += 0.05
    wrapped[2000:] = [value - 2 * np.pi for value in wrapped[2000:]]
    described = recording(tmp_path, table(time, a_pos=off, b_pos=wrapped, c_pos=q))
    assert [warning[:26] for warning in described["warnings"]] == [
        "log.csv:1202: a_pos is off",
        "log.csv:2002: b_pos jumps ",
    ]


def test_stamps_that_go_back_are_told_with_their_line(tmp_path: Path) -> None:
    time, q = signal(100)
    time[60] = time[58]
    described = recording(tmp_path, table(time, a_pos=q))
    message = (
        "log.csv:62: time must increase, but 0.116 s follows 0.118 s; correct these stamps, or set rate: "
    )
    assert described["warnings"][0].startswith(message + "500 ")
    assert "100 rows, 0.198 s, 500 Hz\n" in render(described)


def test_degrees_are_offered_and_never_taken(tmp_path: Path) -> None:
    time, q = signal(100)
    degrees = np.degrees(q).tolist()
    content = table(
        time, **{"Elbow (deg)": degrees, "shoulder_pos [deg]": degrees, "wrist.position": degrees}
    )
    mapping = recording(tmp_path, content.replace("Elbow (deg)", "Elbow Position (deg)"))["mapping"]
    assert 'Elbow.q: {column: "Elbow Position (deg)", unit: deg}' in mapping.replace("joint_1", "Elbow")
    assert 'shoulder.q: {column: "shoulder_pos [deg]", unit: deg}' in mapping
    assert "wrist.q: wrist.position" in mapping
    assert "if these are degrees, add unit: deg" in mapping


def test_names_of_robot_and_order(tmp_path: Path) -> None:
    time, q = signal(100)
    names = {"/target/elbow/position": q, "/joint_states/elbow/position": q, "/joint_states/arm/position": q}
    mapping = recording(tmp_path, table(time, **names), ARM)["mapping"]
    assert "elbow.q: /joint_states/elbow/position" in mapping
    assert "shoulder.q: /joint_states/arm/position" not in mapping or "guessed" in mapping


def test_a_trajectory_by_its_names_is_told_as_one(vsacli: Command, tmp_path: Path) -> None:
    time, q = signal(100)
    content = table(time, **{"a.q": q, "a.stiffness": [900.0] * 100}).replace("stamp", "time")
    (tmp_path / "log.csv").write_text(content)
    assert json.loads(vsacli("info", "log.csv", "--json").out)["kind"] == "trajectory"
    (tmp_path / "log.csv").write_text(content.replace("a.stiffness", "k"))
    assert json.loads(vsacli("info", "log.csv", "--json").out)["kind"] == "recording"


@pytest.mark.slow
def test_more_columns_than_are_read_at_a_time(tmp_path: Path) -> None:
    time, q = signal(200)
    described = recording(tmp_path, table(time, **{f"j{index}_pos": q for index in range(40)}))
    assert all(column["rows"] == 200 for column in described["columns"][1:])
    assert described["mapping"].count("_pos") == 40


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("stamp,a\n0,1\n1,2,3\n", "log.csv:3: expected 2 values, one for each column of the header, found 3"),
        ("stamp,a\n", "no rows of values"),
        ("", "log.csv: is empty"),
    ],
)
def test_what_is_no_table(vsacli: Command, tmp_path: Path, content: str, sentence: str) -> None:
    (tmp_path / "log.csv").write_text(content)
    done = vsacli("info", "log.csv")
    assert (done.code, done.out) == (2, "")
    assert sentence in done.err


def test_the_mapping_is_what_compare_takes(vsacli: Command, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(EXPORTS["rostopic"](motion()).content)
    mapping = vsacli("info", "log.csv", "--field", "mapping").out
    (tmp_path / "columns.yaml").write_text(mapping)
    assert "columns of recordings, 3 names" in vsacli("validate", "columns.yaml").out
