"""Wrenches on several tools: declared, recorded or given as arrays, each with its own frame."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from samples.command_line import Outcome
from samples.fixes import written
from samples.two_hands import HOLD, PUSH, pushed_motion, two_hands, wrenches

from vsacli import InputError, Trajectory, inverse_dynamics, jacobian, load_robot, load_trajectory
from vsacli.base.wrench import WRENCH_AXES, WRENCH_NAMES, frames_by_tool
from vsacli.dynamics.uncertainty import MARGIN, Uncertainty
from vsacli.studies.search.fix_report import Fix

TIMES = np.linspace(0, 1, 7)
Command = Callable[..., Outcome]


def loaded(folder: Path, *lines: str, tools: tuple[str, ...] = ()) -> Trajectory:
    return load_trajectory(pushed_motion(folder, *lines), load_robot(two_hands(folder, *tools)))


def assert_same_wrench(found: Trajectory, expected: Trajectory) -> None:
    a, b = found.at(TIMES).wrench, expected.at(TIMES).wrench
    assert a.frame == b.frame
    for name in WRENCH_NAMES:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_each_tool_has_its_own_declaration_and_frame_in_the_order_of_the_robot(tmp_path: Path) -> None:
    both = loaded(tmp_path, wrenches(right_hand=PUSH, left_hand=HOLD))
    wrench = both.at(TIMES).wrench
    assert wrench.frame == ("end_effector", "base")
    assert wrench.wrench.shape == (7, 12)
    np.testing.assert_array_equal(wrench.wrench[:, :6], np.tile([1, 2, 3, 0.1, 0, 0.2], (7, 1)))
    np.testing.assert_array_equal(wrench.wrench[[0, -1], 6:], [[0] * 6, [5, 1, -2, 0, 0.1, 0]])
    assert wrench.dwrench[3, 6] == pytest.approx(5 * 30 / 16)  # the slope of the quintic in the middle
    one = loaded(tmp_path, wrenches(right_hand=PUSH)).at(TIMES).wrench
    assert one.frame == (None, "base")
    assert not one.wrench[:, :6].any()
    assert loaded(tmp_path).wrench is None
    slower = both.stretched(2).at(2 * TIMES).wrench
    np.testing.assert_allclose(2 * slower.dwrench, wrench.dwrench, atol=1e-13)  # some 10 eps of the peak


def test_torques_change_by_the_transposed_jacobian_of_each_tool(tmp_path: Path) -> None:
    robot = load_robot(two_hands(tmp_path))
    free, both = (
        inverse_dynamics(robot, loaded(tmp_path, *lines))
        for lines in ((), (wrenches(left_hand=HOLD, right_hand=PUSH),))
    )
    wrench = both.wrench.reshape(len(both.time), 2, 6)
    change = -sum(
        np.einsum("tij,ti->tj", jacobian(robot, both.q, frame, tool=tool), wrench[:, index])
        for index, (tool, frame) in enumerate((("left_hand", "end_effector"), ("right_hand", "base")))
    )
    np.testing.assert_allclose(both.tau_e - free.tau_e, change, atol=1e-13 * np.abs(both.tau_e).max())
    assert both.report.verdict == "ok"


@pytest.mark.parametrize(
    ("lines", "tools", "problem"),
    [
        (
            wrenches(left_hnd=HOLD),
            (),
            r":7: wrenches.left_hnd: .* no tool 'left_hnd'; did you mean",
        ),
        (
            f"wrench: {HOLD}",
            (),
            r":7: wrench: .* the tools left_hand, right_hand; give `wrenches: ",
        ),
        (
            f"wrench: {HOLD}\n{wrenches(left_hand=HOLD)}",
            ("left_hand",),
            r":7: wrench: give `wrench` or `wrenches`",
        ),
        (
            wrenches(left_hand=HOLD.replace("end_effector", "bas")),
            (),
            r":7: frame: unknown word 'bas'",
        ),
        (wrenches(left_hand=HOLD.replace("1, 2, 3", "1")), (), r":7: value: .*6"),
        (wrenches(left_hand="{frame: base}"), (), r":7: wrenches.left_hand: missing key 'type'"),
        ("wrenches: {}", (), r":7: wrenches: expected a mapping with at least one name"),
        (
            "wrenches: {type: constant, value: [0, 0, 0, 0, 0, 0], frame: base}",
            (),
            r":7: wrenches: name the tool first, as in wrenches: {TOOL: {type: ..., value: ..., frame",
        ),
        (
            wrenches(left_hand=PUSH.replace("polynomial", "steps").replace("start", "levels")),
            (),
            r":7: unknown key 'end'",
        ),
    ],
)
def test_problems_have_their_line_and_say_which_tools_there_are(
    tmp_path: Path, lines: str, tools: tuple[str, ...], problem: str
) -> None:
    with pytest.raises(InputError, match=problem):
        loaded(tmp_path, lines, tools=tools)


def test_a_robot_without_tools_takes_no_wrench(tmp_path: Path) -> None:
    robot = two_hands(tmp_path)
    robot.write_text(robot.read_text().partition("tools:")[0])
    for lines in (f"wrench: {HOLD}", wrenches(left_hand=HOLD)):
        with pytest.raises(InputError, match=r":7: wrench(es)?: the robot has no tools; name them"):
            load_trajectory(pushed_motion(tmp_path, lines), load_robot(robot))


@pytest.mark.parametrize("declared", [PUSH, "{type: csv, frame: base, file: push.csv}"])
def test_a_robot_with_one_tool_takes_either_key(tmp_path: Path, declared: str) -> None:
    time = np.linspace(0, 1, 101)
    rows = np.outer(np.sin(time), np.arange(1.0, 7.0))
    table = np.column_stack([time, rows, rows])
    header = ",".join(["time", *WRENCH_AXES, *(f"left_hand.{axis}" for axis in WRENCH_AXES)])
    np.savetxt(tmp_path / "push.csv", table, delimiter=",", header=header, comments="")
    one, named = (
        loaded(tmp_path, lines, tools=("left_hand",))
        for lines in (f"wrench: {declared}", wrenches(left_hand=declared))
    )
    assert_same_wrench(named, one)
    assert named.wrench.frame == "base"
    assert [name for name in named.uncertain if "wrench" in name] == [
        name for name in one.uncertain if "wrench" in name
    ]


def recorded_pushes(folder: Path, *, rows: np.ndarray, header: list[str]) -> str:
    time = np.linspace(0, 1, len(rows))
    np.savetxt(
        folder / "push.csv",
        np.column_stack([time, rows]),
        delimiter=",",
        header=",".join(["time", *header]),
        comments="",
    )
    csv = "{type: csv, frame: base, file: push.csv}"
    return wrenches(right_hand=csv, left_hand=csv.replace("base", "end_effector"))


def columns_of(*names: str, unit: str = "") -> list[str]:
    return [f"{name}{axis}{unit if axis[0] == 'f' else ''}" for name in names for axis in WRENCH_AXES]


def test_a_table_has_columns_by_tool_each_with_derivatives_and_units(tmp_path: Path) -> None:
    time = np.linspace(0, 1, 101)[:, None]
    left, right = np.sin(time) * np.arange(1, 7), np.cos(2 * time) * np.arange(2, 8)
    rates = np.cos(time) * np.arange(1, 7)
    in_kilonewtons = left / np.array([1000] * 3 + [1] * 3)
    header = columns_of("left_hand.", unit="[kN]") + columns_of("left_hand.d", "right_hand.")
    lines = recorded_pushes(tmp_path, rows=np.hstack([in_kilonewtons, rates, right]), header=header)
    trajectory = loaded(tmp_path, lines)
    motion = trajectory.block(0, 101)
    assert motion.wrench.frame == ("end_effector", "base")
    np.testing.assert_allclose(motion.wrench.wrench, np.hstack([left, right]), rtol=1e-15)
    np.testing.assert_array_equal(motion.wrench.dwrench[:, :6], rates)
    # C4 splines of 100 intervals of smooth sines: 1e-8 inside, one or two digits less at the ends
    np.testing.assert_allclose(
        motion.wrench.dwrench[:, 6:], -2 * np.sin(2 * time) * np.arange(2, 8), atol=1e-5
    )
    said = " ".join(trajectory.warnings)
    assert "left_hand.ddwrench comes from" in said
    assert "right_hand.dwrench, right_hand.ddwrench come from" in said


@pytest.mark.parametrize(
    ("header", "problem"),
    [
        (columns_of("left_hand.", "rigth_hand."), r"columns: rigth_hand.fx, .* did you mean right_hand.fx, "),
        ([*columns_of("left_hand."), "right_hand.fx"], "the columns right_hand.fy, .*are missing"),
        ([*columns_of("left_hand.", "right_hand."), "fx"], "unknown column 'fx'"),
        (
            [*columns_of("left_hand.", "right_hand."), "right_hand.dfx"],
            "right_hand.dwrench is given for all axes or for none",
        ),
    ],
)
def test_headers_of_wrenches_by_tool(tmp_path: Path, header: list[str], problem: str) -> None:
    lines = recorded_pushes(tmp_path, rows=np.ones((11, len(header))), header=header)
    with pytest.raises(InputError, match=problem):
        loaded(tmp_path, lines)


def sampled(**wrench: object) -> Trajectory:
    time = np.linspace(0, 1, 11)
    return Trajectory.from_samples(time, np.outer(time, [1, 2, 3]), np.full((11, 3), 900.0), **wrench)


def test_arrays_have_an_axis_of_tools_or_are_flat() -> None:
    rng = np.random.default_rng(0)
    push, rates = rng.uniform(-1, 1, (2, 11, 2, 6))
    frames = ("base", "end_effector")
    by_tool = sampled(wrench=push, dwrench=rates, wrench_frame=frames)
    flat = sampled(wrench=push.reshape(11, 12), dwrench=rates.reshape(11, 12), wrench_frame=frames)
    assert_same_wrench(by_tool, flat)
    np.testing.assert_array_equal(by_tool.block(0, 11).wrench.wrench, push.reshape(11, 12))
    push[:, 0] = 0
    idle = sampled(wrench=push, wrench_frame=(None, "base")).block(0, 11).wrench
    assert idle.frame == (None, "base")
    np.testing.assert_array_equal(idle.wrench, push.reshape(11, 12))
    assert sampled(wrench_frame=(None, None)).wrench is None
    with pytest.raises(InputError, match=r"wrench has the shape \(11, 6\), expected \(11, 2, 6\)"):
        sampled(wrench=push[:, 0], wrench_frame=frames)
    with pytest.raises(InputError, match="a wrench is given for tool 1, which has no frame"):
        sampled(wrench=push, wrench_frame=("base", None))


def test_arrays_for_another_number_of_tools_are_refused_by_the_robot(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the wrench is for 3 tools, the robot has 2: left_hand, right_hand"):
        inverse_dynamics(
            load_robot(two_hands(tmp_path)), sampled(wrench=np.zeros((11, 18)), wrench_frame=("base",) * 3)
        )


@pytest.mark.slow
def test_deviations_are_those_of_the_same_recording_at_the_only_tool(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    rows = np.sin(np.linspace(0, 1, 101))[:, None] * np.arange(1, 7) + 0.01 * rng.standard_normal((101, 6))
    recorded_pushes(tmp_path, rows=rows, header=columns_of("right_hand."))
    csv = "{type: csv, frame: base, file: push.csv}"
    both = loaded(tmp_path, wrenches(left_hand=HOLD, right_hand=csv))
    alone = loaded(tmp_path, wrenches(right_hand=csv), tools=("right_hand",))
    held = np.array([0.3, 0.7])
    found = Uncertainty(load_robot(two_hands(tmp_path)), both).at(held)
    expected = Uncertainty(load_robot(two_hands(tmp_path, "right_hand")), alone).at(held)
    assert both.uncertain == alone.uncertain
    assert found.keys() == expected.keys() == {*both.uncertain, MARGIN}
    for name in WRENCH_NAMES:
        assert np.isnan(found[name][:, :6]).all()
        np.testing.assert_array_equal(found[name][:, 6:], expected[name])
    # differences of torques of another size are rounded differently: eps of the peak over the deviation
    np.testing.assert_allclose(found["tau_e"], expected["tau_e"], rtol=1e-8, atol=1e-12)


def test_fixes_declare_wrenches_by_tool_again(tmp_path: Path) -> None:
    robot = load_robot(two_hands(tmp_path))
    rows = np.sin(np.linspace(0, 1, 101))[:, None] * np.arange(1, 7)
    recorded_pushes(tmp_path, rows=rows, header=columns_of("right_hand."))
    csv = "{type: csv, frame: base, file: push.csv, fit: interpolate}"
    arrays = {"wrench": np.hstack([0 * rows[:11], rows[:11]]), "wrench_frame": (None, "base")}
    for given in (
        loaded(tmp_path, wrenches(left_hand=HOLD, right_hand=PUSH)),
        loaded(tmp_path, wrenches(right_hand=csv, left_hand=HOLD)),
        sampled(**arrays),
    ):
        fix = Fix(size=0.0, robot=robot, declared=given)
        document, *_ = written(fix, tmp_path / "fixed.yaml", overwrite=True)
        again = load_trajectory(document, robot)
        assert "\nwrenches:\n" in document.read_text()
        assert "tool_" not in document.read_text()
        assert_same_wrench(again, given)
        assert frames_by_tool(again.wrench.frame) == frames_by_tool(given.wrench.frame)


def test_descriptions_have_a_line_for_each_tool(vsacli: Command, tmp_path: Path) -> None:
    motion = pushed_motion(tmp_path, wrenches(right_hand=PUSH, left_hand=HOLD))
    for arguments in (("--robot", two_hands(tmp_path)), ()):
        described = vsacli("info", motion, *arguments)
        assert described.code == 0, described.err
        assert (
            "wrench on left_hand along the axes of end_effector, N and N m: fx 1, fy 2, fz 3" in described.out
        )
        assert "wrench on right_hand along the axes of base, N and N m: fx 0 to 5, fy 0 to 1" in described.out


def test_a_value_of_a_tool_is_changed_by_its_path(tmp_path: Path) -> None:
    robot = load_robot(two_hands(tmp_path))
    path = pushed_motion(tmp_path, wrenches(right_hand=PUSH, left_hand=HOLD))
    changed = load_trajectory(path, robot, {"wrenches.right_hand.end.2": 7})
    assert changed.at(1.0).wrench.wrench[8] == 7
    with pytest.raises(InputError, match="wrenches has no 'hand'"):
        load_trajectory(path, robot, {"wrenches.hand.end.2": 7})
