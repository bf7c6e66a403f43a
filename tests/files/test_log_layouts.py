"""Logs as the world writes them: the proposal of `info` runs, or `info` says why there is none."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from samples.command_line import REPOSITORY, Outcome
from samples.random_logs import random_log

from vsacli import InputError, load_robot, load_trajectory
from vsacli.documents.columns_file import load_columns
from vsacli.files.recordings import describe_recording
from vsacli.trajectory.recorded.problems import find_disorder

Command = Callable[..., Outcome]

ROBOT = REPOSITORY / "robots" / "planar_2r.yaml"
ROWS = 120
TIME = np.arange(ROWS) / 100
MOTION: dict[str, Any] = {
    "shoulder_position": 0.4 * np.sin(2 * TIME),
    "elbow_position": 0.5 - 0.2 * np.cos(3 * TIME),
}
STAMPS = [f"{stamp:.3f}" for stamp in TIME]


def table(stamps: Any = None, name: str = "time", separator: str = ",", **columns: Any) -> list[str]:
    """The lines of a log with stamps and the positions of both joints, or other columns."""
    values = {name: STAMPS if stamps is None else stamps, **(columns or MOTION)}
    cells = [
        [cell if isinstance(cell, str) else f"{cell:.9g}" for cell in column] for column in values.values()
    ]
    return [separator.join(values), *(separator.join(row) for row in zip(*cells, strict=True))]


def run_proposal(vsacli: Command, lines: list[str], folder: Path, file: str = "log.csv") -> np.ndarray:
    """Write a log; return the positions of the trajectory that `info` proposes, as a run reads them."""
    (folder / file).write_text("\n".join(lines) + "\n")
    printed = vsacli("info", file, "--robot", ROBOT, "--field", "trajectory")
    assert printed.code == 0, printed.err
    assert "not complete" not in printed.out
    (folder / "recorded.yaml").write_text(printed.out)
    trajectory = load_trajectory(folder / "recorded.yaml", load_robot(ROBOT))
    motion = trajectory.block(0, trajectory.samples)
    np.testing.assert_allclose(
        motion.time - motion.time[0], TIME[: len(motion.time)], atol=1e-8
    )  # nine digits
    return motion.q


def assert_motion(q: np.ndarray) -> None:
    """Nine digits are written; the smoothing spline differs from them by less than the noise it finds."""
    np.testing.assert_allclose(q, np.transpose(list(MOTION.values())), atol=1e-6)


@pytest.mark.parametrize("separator", [" ", "\t", ";"])
def test_blanks_separate_as_other_marks_do(vsacli: Command, tmp_path: Path, separator: str) -> None:
    assert_motion(run_proposal(vsacli, table(separator=separator), tmp_path))


def test_the_advised_savetxt_is_read(vsacli: Command, tmp_path: Path) -> None:
    np.save(tmp_path / "log.npy", np.column_stack([TIME, *MOTION.values()]))
    refused = vsacli("info", "log.npy").err
    advised = re.search(r"numpy\.savetxt\('log.csv', numpy\.load\('log.npy'\), delimiter=','\)", refused)
    assert advised is not None
    np.savetxt(tmp_path / "log.csv", np.load(tmp_path / "log.npy"))  # blanks, if the delimiter is forgotten
    assert "time: 1  " in vsacli("info", "log.csv", "--robot", ROBOT).out


def test_a_row_of_units_is_skipped_and_used(vsacli: Command, tmp_path: Path) -> None:
    degrees = {name: np.degrees(values) for name, values in MOTION.items()}
    lines = table([f"{1000 * stamp:.0f}" for stamp in TIME], **degrees)
    lines.insert(1, "ms,degrees,deg")
    assert_motion(run_proposal(vsacli, lines, tmp_path))
    assert "skip_rows: [2]" in (tmp_path / "recorded.yaml").read_text()


def test_a_first_row_of_missing_numbers_is_no_row_of_units(vsacli: Command, tmp_path: Path) -> None:
    lines = table()
    lines.insert(1, "NA,NA,NA")
    (tmp_path / "log.csv").write_text("\n".join(lines))
    assert "skip_rows" not in vsacli("info", "log.csv", "--robot", ROBOT).out


@pytest.mark.slow
def test_skipped_rows_are_skipped_by_compare(vsacli: Command, tmp_path: Path) -> None:
    lines = table()
    run_proposal(vsacli, lines, tmp_path)
    vsacli("invdyn", ROBOT, "recorded.yaml", "-o", "r.h5")
    compared = vsacli(
        "compare", "r.h5", "log.csv", "--columns", mapping_of(vsacli, tmp_path), "--time-offset", "0"
    )
    lines.insert(1, "s,rad,rad")
    (tmp_path / "log.csv").write_text("\n".join(lines))
    columns = mapping_of(vsacli, tmp_path)
    assert "skip_rows: [2]" in (tmp_path / columns).read_text()
    assert (
        vsacli("compare", "r.h5", "log.csv", "--columns", columns, "--time-offset", "0").out == compared.out
    )
    assert '"skip_rows"' in vsacli("schema", "columns").out


def mapping_of(vsacli: Command, folder: Path) -> str:
    (folder / "columns.yaml").write_text(
        vsacli("info", "log.csv", "--robot", ROBOT, "--field", "mapping").out
    )
    return "columns.yaml"


def test_a_preamble_is_skipped(vsacli: Command, tmp_path: Path) -> None:
    lines = ["Recorder,3.1", "Rate,100 Hz", "", *table()]
    assert_motion(run_proposal(vsacli, lines, tmp_path))
    assert "skip_rows: [1, 2]" in (tmp_path / "recorded.yaml").read_text()
    plain = (tmp_path / "recorded.yaml").read_text().replace("skip_rows", "# skip_rows")
    (tmp_path / "recorded.yaml").write_text(plain)
    refused = vsacli("invdyn", ROBOT, "recorded.yaml").err
    assert "has 2 lines above the header in line 4; leave them out by skip_rows: [1, 2]" in refused


@pytest.mark.parametrize("row", ["time;shoulder_position", "s,rad,rad"])
def test_lines_skipped_amid_rows_are_not_read(tmp_path: Path, row: str) -> None:
    lines = table()
    lines.insert(60, row)
    (tmp_path / "log.csv").write_text("\n".join(lines))
    text = (
        "format: vsacli-trajectory/1\nname: a\nposition:\n  type: csv\n  file: log.csv\n  skip_rows: [61]\n"
    )
    columns = "{shoulder.q: shoulder_position, elbow.q: elbow_position}"
    (tmp_path / "a.yaml").write_text(
        f"{text}  columns: {columns}\nstiffness: {{type: constant, value: 2e4}}\n"
    )
    trajectory = load_trajectory(tmp_path / "a.yaml", load_robot(ROBOT))
    assert trajectory.samples == ROWS


@pytest.mark.parametrize("word", ["NA", "-nan(ind)", "null", "", "NaN", "n/a"])
def test_missing_values_are_missing_whatever_says_so(vsacli: Command, tmp_path: Path, word: str) -> None:
    lines = table()
    lines[-3:] = [f"{line.partition(',')[0]},{word},{word}" for line in lines[-3:]]
    q = run_proposal(vsacli, lines, tmp_path)
    assert len(q) == ROWS - 3


def test_columns_without_numbers_are_left_out(vsacli: Command, tmp_path: Path) -> None:
    columns: dict[str, Any] = {
        f"{joint}.q": values for joint, values in zip(("shoulder", "elbow"), MOTION.values(), strict=True)
    }
    columns |= {f"{joint}.stiffness": [2e4] * ROWS for joint in ("shoulder", "elbow")}
    hollow: dict[str, Any] = {f"{joint}.dq": ["nan"] * ROWS for joint in ("shoulder", "elbow")}
    (tmp_path / "log.csv").write_text("\n".join(table(**columns, **hollow)))
    done = vsacli("check-feasibility", ROBOT, "log.csv")
    assert "left out, as they hold no number: shoulder.dq, elbow.dq" in done.out
    (tmp_path / "log.csv").write_text("\n".join(table(**{**columns, "elbow.q": ["nan"] * ROWS})))
    done = vsacli("check-feasibility", ROBOT, "log.csv")
    assert (done.code, "column 'elbow.q' holds no number" in done.err) == (2, True)


def separate_rows(apart: float) -> list[str]:
    lines = [f"__time,{','.join(MOTION)}"]
    for stamp, one, other in zip(TIME + 100, *MOTION.values(), strict=True):
        lines += [f"{stamp:.9f},{one:.9g},", f"{stamp + apart:.9f},,{other:.9g}"]
    return lines


@pytest.mark.parametrize("apart", [0, 1e-9, 1e-7])
def test_joints_on_rows_of_nearly_equal_times_are_joined(
    vsacli: Command, tmp_path: Path, apart: float
) -> None:
    assert_motion(run_proposal(vsacli, separate_rows(apart), tmp_path))


def test_joints_with_times_of_their_own_are_named(vsacli: Command, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("\n".join(separate_rows(4e-3)))
    out = vsacli("info", "log.csv", "--robot", ROBOT).out
    assert "no complete trajectory file" in out
    assert "have no numbers in the same rows, as signals with stamps of their own" in out


def test_a_log_that_is_too_short_is_not_complete(vsacli: Command, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("\n".join(table()[:6]))
    out = vsacli("info", "log.csv", "--robot", ROBOT).out
    assert (
        "no complete trajectory file for this recording: log.csv: q has 5 samples; a trajectory needs" in out
    )


def test_lists_in_cells_are_named(vsacli: Command, tmp_path: Path) -> None:
    cells = [f'"({one:.6f}, {other:.6f})"' for one, other in zip(*MOTION.values(), strict=True)]
    (tmp_path / "log.csv").write_text("\n".join(table(position=cells)))
    out = vsacli("info", "log.csv", "--robot", ROBOT).out
    assert (
        "column 'position' holds lists of 2 values in its cells; split it into 2 columns, one for each" in out
    )
    assert "no complete trajectory file for this recording: no column is recognized as the position of" in out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stamps", "cause"),
    [
        ([f"{(2**32 - 600000 + 10000 * i) % 2**32}" for i in range(ROWS)], "as a 32-bit counter that wraps"),
        ([f"{9.5 + stamp:.3g}" for stamp in TIME], "stamps with too few digits, in steps of 0.1 s"),
        ([f"{i // 10 / 10:.1f}" for i in range(ROWS)], "stamps with too few digits, in steps of 0.1 s"),
    ],
)
def test_rows_are_neither_sorted_nor_thinned(
    vsacli: Command, tmp_path: Path, stamps: list[str], cause: str
) -> None:
    name = "time[us]" if int(float(stamps[0])) > 1000 else "time"
    q = run_proposal(vsacli, table(stamps, name), tmp_path)
    assert len(q) == ROWS
    assert_motion(q)
    shown = vsacli("info", "log.csv", "--robot", ROBOT).out
    assert cause in shown
    assert "recording log.csv: 120 rows, 1.19 s, 100 Hz\n" in shown
    proposal = (tmp_path / "recorded.yaml").read_text()
    (tmp_path / "recorded.yaml").write_text(re.sub("ignore: .*", "ignore: rest", proposal))
    done = vsacli("check-feasibility", ROBOT, "recorded.yaml")  # a rate near that of the rows replaces stamps
    assert "rate stands in place of the stamps" in done.out
    wrong = re.sub("rate: 100 .*", "rate: 500", (tmp_path / "recorded.yaml").read_text())
    (tmp_path / "recorded.yaml").write_text(wrong)
    assert "set rate: 100 in place of the stamps" in vsacli("invdyn", ROBOT, "recorded.yaml").err


@pytest.mark.parametrize("words", ["the recording begins again", "bag played in a loop; cut the file in two"])
def test_a_recording_that_begins_again_is_to_be_cut(vsacli: Command, tmp_path: Path, words: str) -> None:
    stamps = [*STAMPS[: ROWS // 2], *STAMPS[: ROWS // 2]]
    (tmp_path / "log.csv").write_text("\n".join(table(stamps)))
    out = vsacli("info", "log.csv", "--robot", ROBOT).out
    assert words in out
    assert "log.csv:62: time must increase" in out
    assert "no complete trajectory file for this recording: time must increase" in out
    assert "rate:" not in out
    stated = vsacli("info", "log.csv", "--robot", ROBOT, "--rate", "100").out
    assert words in stated  # a rate does not make one motion of two
    assert "-0." not in out.split("\n", maxsplit=1)[0]


def test_no_disorder_of_random_stamps_is_sorted_or_thinned() -> None:
    """Late stamps and repeats among others: the count is that of the rows, the rate that of most rows."""
    random = np.random.default_rng(4)
    for _ in range(50):
        rate = float(random.choice([50, 200, 1000]))
        stamps = np.arange(2000) / rate
        late = random.choice(np.arange(10, 1990, 3), 261, replace=False)
        stamps[late] = stamps[late - 1]
        disorder = find_disorder(stamps)
        assert disorder is not None
        assert "(261 such rows)" in disorder.cause
        assert disorder.rate == pytest.approx(rate)
        assert not {"sort", "delete"} & set(disorder.message.split())


def test_the_clock_that_is_usable_is_proposed(vsacli: Command, tmp_path: Path) -> None:
    """Stamps of sensors come before those of loggers, unless rows repeat them."""
    stamps = 16 * 10**17 + 10**7 * np.arange(ROWS)
    repeated = np.where(np.arange(ROWS) % 40 == 7, np.roll(stamps, 1), stamps)
    columns: dict[str, Any] = {"header.stamp": list(map(str, repeated)), **MOTION}
    assert_motion(run_proposal(vsacli, table(list(map(str, stamps)), "%time", **columns), tmp_path))
    assert 'time: {column: "%time"' in (tmp_path / "recorded.yaml").read_text()


def test_a_unit_that_is_guessed_is_marked(vsacli: Command, tmp_path: Path) -> None:
    """Postures every 17 s are not a motion at 58 Hz."""
    (tmp_path / "log.csv").write_text("\n".join(table([f"{25 + 17.3 * i:.2f}" for i in range(ROWS)], "t")))
    out = vsacli("info", "log.csv", "--robot", ROBOT).out
    assert "time, ms (guessed)" in out
    assert "# unit guessed: steps of 17.3 are hardly seconds" in out


@pytest.mark.parametrize(
    ("measured", "commanded"),
    [
        ("q{}", "q_des{}"),
        ("joint_position_{}", "joint_position_cmd_{}"),
        ("tau_meas{}", "tau_con{}"),
        ("enc{}", "qref{}"),
        ("/joint_states/position[{}]", "/controller/desired/positions[{}]"),
    ],
)
def test_measured_columns_come_before_commands(tmp_path: Path, measured: str, commanded: str) -> None:
    names = [pattern.format(number) for pattern in (commanded, measured) for number in (1, 2)]
    values = dict(zip(names, [*MOTION.values(), *MOTION.values()], strict=True))
    (tmp_path / "log.csv").write_text("\n".join(table(**values)))
    for robot in (None, load_robot(ROBOT)):
        mapping = describe_recording(tmp_path / "log.csv", robot)["mapping"]
        assert all(name in mapping for name in names[2:]), mapping
        assert "joint_3" not in mapping
        assert not any(f": {name}\n" in mapping + "\n" for name in names[:2])


def test_variants_of_a_signal_are_one_joint_and_commands_no_measurements(tmp_path: Path) -> None:
    held = np.where(np.arange(ROWS) > 60, 0.3, MOTION["shoulder_position"])
    kinds = ("position", "position_raw", "position_filtered", "position_desired", "position_error")
    columns: dict[str, Any] = {
        f"{kind}_{number}": MOTION["elbow_position"] for kind in kinds for number in (1, 2)
    }
    (tmp_path / "log.csv").write_text("\n".join(table(**columns, VelocityCmptd1=held)))
    found = describe_recording(tmp_path / "log.csv")
    entries = [" ".join(line.split()) for line in found["mapping"].splitlines() if ".q:" in line]
    assert entries == [
        f"joint_{number}.q: position_{number} # guessed: by the order alone" for number in (1, 2)
    ]
    assert "VelocityCmptd1" not in "".join(found["warnings"])
    commands = {f"q_des{number}": MOTION["elbow_position"] for number in (1, 2)}
    (tmp_path / "log.csv").write_text("\n".join(table(**commands)))
    assert (
        "a command, not a measurement"
        in describe_recording(tmp_path / "log.csv", load_robot(ROBOT))["mapping"]
    )


def sides(*patterns: str) -> list[str]:
    return [pattern.format(joint) for pattern in patterns for joint in (1, 2)]


@pytest.mark.parametrize(
    ("names", "motors", "unknown"),
    [
        (
            sides("enc{}", "encL{}", "encR{}", "tauL{}", "tauR{}"),
            sides("theta_1: encL{}", "theta_2: encR{}", "tau_motor_1: tauL{}", "tau_motor_2: tauR{}"),
            [],
        ),
        (sides("pos{}", "torque_left_{}", "torque_right_{}"), sides("tau_motor_2: torque_right_{}"), []),
        (sides("posL{}", "posR{}"), [], []),  # may be two arms
        ([*sides("pos{}"), "tauL1", "tauR1", "tauL2"], [], ["tauL1", "tauR1", "tauL2"]),
    ],
)
def test_both_sides_of_a_joint_are_its_motors(
    vsacli: Command, tmp_path: Path, names: list[str], motors: list[str], unknown: list[str]
) -> None:
    values = dict.fromkeys(names, MOTION["elbow_position"])
    (tmp_path / "log.csv").write_text("\n".join(table(**values)))
    mapping = vsacli("info", "log.csv", "--robot", ROBOT, "--field", "mapping").out
    joints = ("shoulder", "elbow")
    for entry in motors:
        joint = joints[int(entry[-1]) - 1]
        assert re.search(rf"^  {joint}.{entry} +# guessed: .*sides taken for motors 1 and 2", mapping, re.M)
    assert ("theta" in mapping) == any("theta" in entry for entry in motors)
    assert re.findall(r"^# (\S+): not recognized$", mapping, re.M) == unknown
    (tmp_path / "columns.yaml").write_text(mapping)
    load_columns(tmp_path / "columns.yaml")


@pytest.mark.slow
def test_numbered_columns_of_the_format_for_named_joints(vsacli: Command, tmp_path: Path) -> None:
    names = {"q1": MOTION["shoulder_position"], "q2": MOTION["elbow_position"], "dq1": TIME, "dq2": TIME}
    assert_motion(run_proposal(vsacli, table(**names), tmp_path))
    assert "ignore: [dq1, dq2]" in (tmp_path / "recorded.yaml").read_text()
    mapping = vsacli("info", "log.csv", "--robot", ROBOT, "--field", "mapping").out
    (tmp_path / "columns.yaml").write_text(mapping)
    vsacli("invdyn", ROBOT, "recorded.yaml", "-o", "r.h5")
    compared = vsacli("compare", "r.h5", "log.csv", "--columns", "columns.yaml", "--time-offset", "0").out
    assert "shoulder.q" in compared
    assert not [line for line in compared.splitlines() if re.match(r"(shoulder|elbow)\.dq", line)]


@pytest.mark.slow
def test_columns_that_have_the_names_of_the_format_are_a_trajectory(vsacli: Command, tmp_path: Path) -> None:
    columns: dict[str, Any] = {
        f"{joint}.q": values for joint, values in zip(("shoulder", "elbow"), MOTION.values(), strict=True)
    }
    columns |= {f"{joint}.stiffness": [2e4] * ROWS for joint in ("shoulder", "elbow")}
    assert_motion(run_proposal(vsacli, table(**columns), tmp_path))
    assert vsacli("info", "log.csv", "--field", "mapping").code == 0
    lines = table([f"{9.5 + stamp:.3g}" for stamp in TIME], **columns)
    assert_motion(run_proposal(vsacli, lines, tmp_path))


def test_a_large_text_file_is_described_as_it_is_read(vsacli: Command, tmp_path: Path) -> None:
    """As a table with names ending in `.csv` is."""
    lines = table(**MOTION, remark=["x" * 12000] * ROWS)
    assert_motion(run_proposal(vsacli, lines, tmp_path, "log.txt"))
    assert (tmp_path / "log.txt").stat().st_size > 1_000_000


def test_the_rate_of_the_warning_is_that_of_the_file(vsacli: Command, tmp_path: Path) -> None:
    stamps = np.cumsum(np.random.default_rng(3).choice([0.8e-3, 1.0e-3, 1.25e-3], ROWS))
    (tmp_path / "log.csv").write_text("\n".join(table([f"{stamp:.6f}" for stamp in stamps])))
    out = vsacli("info", "log.csv", "--robot", ROBOT).out
    (warned,) = re.findall(r"set rate: (\S+) in a trajectory file", " ".join(out.split()))
    assert f"# rate: {warned}  # stamps jitter" in out


def test_columns_without_names_are_counted(vsacli: Command, tmp_path: Path) -> None:
    lines = [line + "," * 24 for line in table()]
    (tmp_path / "log.csv").write_text("\n".join(lines))
    (tmp_path / "r.yaml").write_text(vsacli("info", "log.csv", "--robot", ROBOT, "--field", "trajectory").out)
    done = vsacli("check-feasibility", ROBOT, "r.yaml")
    assert "ignored: 24 columns without names\n" in done.out


@pytest.mark.slow
@pytest.mark.cases(2)  # which have every kind of header, layout and fault
@pytest.mark.parametrize("part", range(5))
@pytest.mark.parametrize("half", [0, 100])  # the second one was not used to choose words
def test_random_headers_and_layouts(tmp_path: Path, half: int, part: int) -> None:
    robot = load_robot(ROBOT)
    for seed in range(half + part, half + 100, 5):
        log = random_log(seed)
        (tmp_path / "log.csv").write_text(log.content)
        found = describe_recording(tmp_path / "log.csv", robot)
        (tmp_path / "recorded.yaml").write_text(found["trajectory"])
        columns = yaml.safe_load(found["trajectory"])["position"].get("columns", {})
        entries = [columns.get(f"{joint}.q") for joint in robot.joint_names]
        taken = [entry["column"] if isinstance(entry, dict) else entry for entry in entries]
        if log.positions:
            assert not {"commanded", "error"} & {log.roles.get(str(name)) for name in taken}, seed
        try:
            load_trajectory(tmp_path / "recorded.yaml", robot)
            assert not found["refusal"], seed
        except InputError:
            assert found["refusal"], seed
            assert log.unusable or not log.positions, seed
