"""A wrench in trajectory files and result files."""

from __future__ import annotations

import csv
import io
import warnings

import h5py
import numpy as np
import pytest
import xarray
from samples.command_line import ROBOT as ARM_FILE
from samples.robots import vsa_3r

from vsacli import InputError, Trajectory, inverse_dynamics, load_robot, load_trajectory
from vsacli.base.wrench import WRENCH_AXES, WRENCH_NAMES
from vsacli.results.charts.stored import StoredCharts
from vsacli.results.store.reader import open_stored

MOTION = """format: vsacli-trajectory/1
name: reach
duration: 2
rate: 100
position: {type: polynomial, degree: 7, start: 0, end: [1.5, 0.7, -1]}
stiffness: {type: polynomial, degree: 3, start: 850, end: 1275}
"""
RECORDED = """format: vsacli-trajectory/1
name: reach
position: {type: polynomial, degree: 7, start: 0, end: [1.5, 0.7, -1]}
stiffness: {type: polynomial, degree: 3, start: 850, end: 1275}
"""


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Load a trajectory file of this text for the 3R arm."""
    monkeypatch.chdir(tmp_path)

    def load_text(text: str) -> Trajectory:
        (tmp_path / "move.yaml").write_text(text)
        return load_trajectory("move.yaml", vsa_3r())

    return load_text


def write_table(path: str, columns: dict[str, np.ndarray]) -> None:
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    text = "".join(",".join(map(repr, row)) + "\n" for row in rows)
    with open(path, "w") as file:
        file.write(",".join(columns) + "\n" + text)


def push_table(*names: str) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    return {"time": np.linspace(0, 2, 21), **{name: rng.uniform(-9, 9, 21) for name in names}}


def test_a_constant_wrench(load) -> None:
    block = load(MOTION + "wrench: {frame: base, type: constant, value: [1, 2, 3, 4, 5, 1/2]}\n").block(
        0, 201
    )
    assert block.wrench.frame == "base"
    np.testing.assert_array_equal(block.wrench.wrench, np.tile([1, 2, 3, 4, 5, 0.5], (201, 1)))
    assert not block.wrench.dwrench.any()
    assert not block.wrench.ddwrench.any()


@pytest.mark.parametrize("degree", [3, 5, 15])
def test_a_polynomial_wrench(load, degree: int) -> None:
    course = f"type: polynomial, degree: {degree}, start: [0, 1, 2, 3, 4, 5], end: [6, 5, 4, 3, 2, 1]"
    block = load(f"{MOTION}wrench: {{frame: end_effector, {course}}}\n").block(0, 201)
    assert block.wrench.frame == "end_effector"
    assert block.wrench.wrench[[0, 100, 200]].tolist() == [[0, 1, 2, 3, 4, 5], [3] * 6, [6, 5, 4, 3, 2, 1]]
    assert not block.wrench.dwrench[[0, 200]].any()


def test_a_recorded_wrench(load) -> None:
    table = push_table(*WRENCH_AXES)
    write_table("push.csv", table)
    trajectory = load(RECORDED + "wrench: {frame: base, type: csv, file: push.csv, fit: interpolate}\n")
    block = trajectory.block(0, 21)
    np.testing.assert_array_equal(block.wrench.wrench.T, [table[axis] for axis in WRENCH_AXES])
    np.testing.assert_array_equal(block.time, table["time"])
    assert trajectory.warnings == (
        "dwrench, ddwrench come from a C4 spline through wrench;"
        " derivatives are unreliable in the first 0.5 s and the last 0.5 s",  # 5 steps of 0.1 s
    )
    assert [source.path for source in trajectory.sources] == ["move.yaml", "push.csv"]


def test_a_recorded_wrench_with_derivatives_beside_a_recorded_motion(load) -> None:
    derivatives = [f"{prefix}{axis}" for prefix in ("d", "dd") for axis in WRENCH_AXES]
    joints = [f"{joint}.q" for joint in vsa_3r().joint_names]
    table = push_table(*WRENCH_AXES, *derivatives, *joints)
    write_table("all.csv", table)
    text = "format: vsacli-trajectory/1\nname: reach\n"
    text += "position: {type: csv, file: all.csv, fit: interpolate}\n"
    text += "stiffness: {type: constant, value: 900}\nwrench: {frame: base, type: csv, file: all.csv}\n"
    block = load(text).block(0, 21)
    np.testing.assert_array_equal(block.wrench.ddwrench.T, [table[f"dd{axis}"] for axis in WRENCH_AXES])
    np.testing.assert_array_equal(block.q.T, [table[name] for name in joints])


def test_columns_of_a_wrench_that_nobody_asked_for_are_noted(load) -> None:
    joints = [f"{joint}.q" for joint in vsa_3r().joint_names]
    write_table("all.csv", push_table(*joints, *WRENCH_AXES))
    text = "format: vsacli-trajectory/1\nname: reach\nposition: {type: csv, file: all.csv}\n"
    trajectory = load(text + "stiffness: {type: constant, value: 900}\n")
    assert trajectory.wrench is None
    assert "all.csv: its columns of wrench are not used" in trajectory.notes


@pytest.mark.parametrize(
    ("wrench", "problem"),
    [
        (
            "{frame: base, type: constant, value: [1, 2, 3]}",
            "move.yaml:7: value: expected 6 numbers in N (forces), N m (moments), found 3",
        ),
        (
            "{frame: base, type: constant, value: 5}",
            "move.yaml:7: value: expected a list of 6 numbers in N (forces), N m (moments), found '5'",
        ),
        (
            "{frame: base, type: constant, value: [a, 0, 0, 0, 0, 0]}",
            "move.yaml:7: value: expected a number in N (forces), N m (moments), found 'a'",
        ),
        (
            "{frame: bas, type: constant, value: [1, 2, 3, 4, 5, 6]}",
            "move.yaml:7: frame: unknown word 'bas'; did you mean 'base'?",
        ),
        (
            "{type: constant, value: [1, 2, 3, 4, 5, 6]}",
            "move.yaml:7: wrench: missing key 'frame' (frame in whose",
        ),
        (
            "{frame: base, type: sine}",
            "move.yaml:7: wrench.type: unknown word 'sine'; valid: polynomial, steps, constant",
        ),
        (
            "{frame: base, type: polynomial, degree: 1, start: [0, 0, 0, 0, 0, 0], end: [0, 0, 0, 0, 0, 0]}",
            "move.yaml:7: degree: must be odd, from 3 to 15 (its rate must vanish at both ends",
        ),
        (
            "{frame: base, type: polynomial, degree: 3, start: [0, 0], end: [0, 0, 0, 0, 0, 0]}",
            "move.yaml:7: start: expected 6 numbers in N (forces), N m (moments), found 2",
        ),
        (
            "[1, 2, 3, 4, 5, 6]",
            "move.yaml:7: wrench: expected a mapping with the key 'type', found a list of 6",
        ),
    ],
)
def test_a_problem_of_a_wrench_is_named_with_its_line(load, wrench: str, problem: str) -> None:
    with pytest.raises(InputError) as refusal:
        load(f"{MOTION}wrench: {wrench}\n")
    (line,) = str(refusal.value).splitlines()
    assert line.startswith(problem)


def test_duration_beside_a_recorded_wrench_is_refused(load) -> None:
    with pytest.raises(InputError, match=r"move.yaml:3: duration: the times come from the CSV file"):
        load(MOTION + "wrench: {frame: base, type: csv, file: push.csv}\n")


@pytest.mark.parametrize(
    ("columns", "problem"),
    [
        (["fx", "fy", "mz"], "push.csv:1: the columns fz, mx, my are missing; columns: time,"),
        (
            [*WRENCH_AXES, "dfx"],
            "push.csv:1: the columns dfy, dfz, dmx, dmy, dmz are missing; dwrench is given for all axes",
        ),
        ([*WRENCH_AXES[:5], "m_z"], "push.csv:1: unknown column 'm_z'; did you mean 'mz'?"),
    ],
)
def test_a_table_without_the_columns_of_a_wrench_is_refused(load, columns: list[str], problem: str) -> None:
    write_table("push.csv", push_table(*columns))
    with pytest.raises(InputError) as refusal:
        load(RECORDED + "wrench: {frame: base, type: csv, file: push.csv}\n")
    assert str(refusal.value).startswith(problem)


@pytest.fixture
def result(vsacli, tmp_path):
    """The file of a run under a wrench in base axes."""
    course = "type: polynomial, degree: 3, start: [0, 4, -8, 0.5, 0, 1], end: [9, -3, 6, 0, -1.5, 2]"
    (tmp_path / "push.yaml").write_text(f"{MOTION}wrench: {{frame: base, {course}}}\n")
    assert vsacli("invdyn", ARM_FILE, "push.yaml", "-o", "push.h5").code == 0
    return tmp_path / "push.h5"


def test_forces_and_moments_have_charts_of_their_own(result) -> None:
    with open_stored(result) as stored:
        forces, moments = StoredCharts([stored]).charts_of("wrench")
    assert [chart.unit for chart in (forces, moments)] == ["N", "N m"]
    assert [{line.label for line in chart.lines} for chart in (forces, moments)] == [
        {"fx", "fy", "fz"},
        {"mx", "my", "mz"},
    ]


def computed(tmp_path):
    robot = load_robot(ARM_FILE)
    return inverse_dynamics(robot, load_trajectory(tmp_path / "push.yaml", robot))


@pytest.mark.slow
def test_the_file_holds_the_wrench_by_axis(result, tmp_path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with xarray.open_dataset(result, engine="h5netcdf") as data:
            data.load()
    for name in WRENCH_NAMES:
        assert data[name].dims == ("time", "wrench_axis")
        np.testing.assert_array_equal(data[name], getattr(computed(tmp_path), name))
    assert data.wrench.sel(wrench_axis="mz")[-1] == 2
    assert data.wrench_axis.attrs["frame"] == "base"
    assert data.dwrench.attrs["units"] == "see wrench_axis"
    assert (data.dwrench.attrs["units_force"], data.dwrench.attrs["units_moment"]) == ("N/s", "N m/s")


def test_a_run_without_a_wrench_leaves_no_trace_of_one(vsacli, tmp_path) -> None:
    (tmp_path / "free.yaml").write_text(MOTION)
    assert vsacli("invdyn", ARM_FILE, "free.yaml", "-o", "free.h5").code == 0
    with h5py.File(tmp_path / "free.h5") as file:
        assert not {*WRENCH_NAMES, "wrench_axis"} & file.keys()


def test_storing_a_wrench_that_is_not_there_is_refused(vsacli, tmp_path) -> None:
    (tmp_path / "free.yaml").write_text(MOTION)
    done = vsacli("invdyn", ARM_FILE, "free.yaml", "--variables", "tau_motor,dwrench", "-o", "free.h5")
    assert done.code == 2
    assert "there is no dwrench: the trajectory has no wrench" in done.err
    assert not (tmp_path / "free.h5").exists()


def test_exported_columns_read_back_as_a_wrench(vsacli, result, load, tmp_path) -> None:
    done = vsacli("export", result, "--variables", "wrench,dwrench,ddwrench", "-o", "push.csv")
    assert done.code == 0
    header = next(csv.reader(io.StringIO((tmp_path / "push.csv").read_text())))
    assert header == ["time", *(f"{prefix}{axis}" for prefix in ("", "d", "dd") for axis in WRENCH_AXES)]
    read = load(RECORDED + "wrench: {frame: base, type: csv, file: push.csv}\n").block(0, 201).wrench
    expected = computed(tmp_path)
    for name in WRENCH_NAMES:
        np.testing.assert_array_equal(getattr(read, name), getattr(expected, name))
