"""`vsacli compare`: a recording, made here from exported columns, against its result."""

from __future__ import annotations

import contextlib
import csv
import hashlib
import json
import math
import re
import shutil

import numpy as np
import pytest
from samples.command_line import ROBOT, edited
from samples.pages import Page

from vsacli import InputError, compare
from vsacli.cli.main import run

BEGIN = 0.5137
"""Of the result in the recording, s; no multiple of the 2 ms between its rows."""

MOTION = """\
format: vsacli-trajectory/1
name: wave
duration: 3
rate: 500
position: {type: polynomial, degree: 7, start: [0, 0, 0], end: [0.9, 0.5, -0.7]}
stiffness: {type: polynomial, degree: 5, start: 900, end: 1200}
"""


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    """A folder with a result `r.h5`, its inputs, and a table of some of its variables."""
    folder = tmp_path_factory.mktemp("original")
    (folder / "wave.yaml").write_text(MOTION)
    edited(
        ROBOT,
        folder / "robot.yaml",
        ("motor: {inertia: 3.20", "motor: {gear_ratio: 50, side: shaft, inertia: 1.28e-3"),
    )
    with contextlib.chdir(folder):
        assert run(["invdyn", "robot.yaml", "wave.yaml", "-q", "-o", "r.h5"]) == 0
        assert run(["export", "r.h5", "--variables", "q,theta,tau_motor", "-o", "r.csv"]) == 0
    return folder


@pytest.fixture
def computed(original, own_folder):
    """Columns of a result `r.h5` by name; on a grid of 2 ms, shifted by BEGIN, they make a recording."""
    for name in ("wave.yaml", "robot.yaml", "r.h5"):
        shutil.copy(original / name, own_folder)
    header, *rows = csv.reader((original / "r.csv").read_text().splitlines())
    return dict(zip(header, np.array(rows, dtype=float).T, strict=True))


def recorded(computed, before=BEGIN, after=0.7, step=0.002, delay=0.0):
    """The columns as a laboratory has them: at rest before and after, at times of its own."""
    time = np.arange(-before, computed["time"][-1] + after, step)
    columns = {name: np.interp(time - delay, computed["time"], values) for name, values in computed.items()}
    return {**columns, "time": time + before}


def written(path, columns):
    with path.open("w") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    return path


@pytest.mark.slow
def test_figures_of_known_errors_come_out(computed, tmp_path):
    columns = recorded(computed)
    noise = np.random.default_rng(3).standard_normal(len(columns["time"]))
    columns["base.q"] = columns["base.q"] + 1e-3 * noise
    columns["elbow.tau_motor_1"] = 1.04 * columns["elbow.tau_motor_1"] + 2
    found = compare(tmp_path / "r.h5", written(tmp_path / "m.csv", columns))
    signals = {signal.column: signal for signal in found.signals}
    # The grid has 2 ms; between its points straight lines stand for curves, which moves nothing by 0.1 ms.
    assert found.time_offset == pytest.approx(BEGIN, abs=1e-4)
    assert found.compared == pytest.approx(3.0)
    assert signals["base.q"].rms == pytest.approx(1e-3, rel=0.05)  # of 1500 draws: 2 % is one deviation
    assert signals["shoulder.q"].rms < 1e-4  # 0.1 ms of 0.4 rad/s
    assert signals["elbow.tau_motor_1"].gain == pytest.approx(1.04, abs=2e-3)
    assert signals["elbow.tau_motor_1"].offset == pytest.approx(2, abs=0.2)


@pytest.mark.slow
def test_a_signal_that_lags_behind_the_others_is_told(computed, tmp_path):
    columns = recorded(computed)
    columns["base.tau_motor_2"] = recorded(computed, delay=0.006)["base.tau_motor_2"]
    found = compare(tmp_path / "r.h5", written(tmp_path / "m.csv", columns))
    lags = {signal.column: signal.lag for signal in found.signals}
    assert lags["base.tau_motor_2"] == pytest.approx(0.006, abs=5e-4)
    assert not abs(lags["base.tau_motor_1"]) >= 5e-4  # NaN says that there is none


@pytest.mark.slow
@pytest.mark.parametrize("cut", [(0.0, 1.2), (1.0, 2.2), (2.0, 3.6)])
def test_a_piece_cut_out_of_the_motion_is_found(computed, tmp_path, cut):
    columns = recorded(computed)
    kept = (columns["time"] >= BEGIN + cut[0]) & (columns["time"] <= BEGIN + cut[1])
    piece = {name: values[kept] for name, values in columns.items()}
    found = compare(tmp_path / "r.h5", written(tmp_path / "m.csv", piece))
    # A millionth of the motion's range are 0.1 ms near its ends, where it is slowest.
    assert found.time_offset == pytest.approx(BEGIN - columns["time"][kept][0], abs=2e-4)


@pytest.mark.slow
def test_errors_of_the_model_in_motors_do_not_move_the_beginning(computed, tmp_path):
    """Motors of a wrong model look late, each by some milliseconds; joints do as they were told."""
    columns = recorded(computed)
    draw = np.random.default_rng(5)
    for name in [name for name in columns if ".theta_" in name]:
        late = recorded(computed, delay=draw.uniform(1e-3, 4e-3))[name]
        columns[name] = 1.004 * late + 2e-4 * draw.standard_normal(len(late))
    for name in [name for name in columns if name.endswith(".q")]:
        columns[name] = columns[name] + 2e-4 * draw.standard_normal(len(columns[name]))
    found = compare(tmp_path / "r.h5", written(tmp_path / "m.csv", columns))
    assert abs(found.time_offset - BEGIN) < 3 * found.time_offset_error
    assert found.time_offset_error < 1e-4  # 2e-4 rad of 0.4 rad/s, over 1500 rows
    lags = [signal.lag for signal in found.signals if signal.variable == "theta"]
    assert all(0.9e-3 < lag < 4.2e-3 for lag in lags)


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.02, -0.02, 0.0])
def test_a_delay_between_torques_and_positions_is_said(computed, tmp_path, delay):
    columns, late = recorded(computed), recorded(computed, delay=delay)
    draw = np.random.default_rng(6)
    noise = 0.5 * draw.standard_normal((len(TORQUES), len(columns["time"])))
    columns |= {name: late[name] + each for name, each in zip(TORQUES, noise, strict=True)}
    found = compare(tmp_path / "r.h5", written(tmp_path / "m.csv", columns))
    said = [note for note in found.notes if "torques agree on a lag of" in note]
    assert len(said) == (delay != 0)
    for note in said:
        number = r"([-+]?[\d.]+)"
        figures = re.search(rf"lag of {number} \+- {number} ms behind .* --time-offset {number} is", note)
        lag, error, offset = map(float, figures.groups())
        assert lag == pytest.approx(1e3 * delay, abs=4 * error)  # the error has one digit
        assert offset == pytest.approx(BEGIN + lag / 1e3, abs=2e-4)  # of 0.1 ms
        assert "their sensors are late (vsacli identify ROBOT RECORDING removes such a delay)" in note


@pytest.mark.slow
def test_wrapped_angles_are_named_and_unwrapped_on_demand(vsacli, computed, tmp_path):
    columns = recorded(computed)
    shifted = {name: columns[name] + 6.0 for name in ("base.q", "base.theta_1", "base.theta_2")}
    columns |= {name: np.mod(values, 2 * np.pi) for name, values in shifted.items()}
    written(tmp_path / "m.csv", columns)
    wrapped = vsacli("compare", "r.h5", "m.csv")
    jump = r"base.q jumps by 2 pi at [\d.]+ s, a wrapped angle: set unwrap: true in the file of --columns\n"
    assert re.search(jump, wrapped.out)
    (tmp_path / "c.yaml").write_text("format: vsacli-columns/1\nunwrap: true\n")
    found = compare(tmp_path / "r.h5", tmp_path / "m.csv", columns=tmp_path / "c.yaml")
    base = [signal for signal in found.signals if signal.column in shifted]
    # 6 rad are a turn less 0.28 rad, and whole turns are those of the result
    assert [signal.offset for signal in base] == pytest.approx([6 - 2 * np.pi] * 3, abs=1e-3)
    assert [signal.gain for signal in base] == pytest.approx([1] * 3, abs=1e-3)


def test_left_out_columns_are_named_if_no_torque_was_compared(computed, tmp_path):
    columns = {"tauL1": computed["base.tau_motor_1"], **{name: computed[name] for name in ("time", "base.q")}}
    (tmp_path / "c.yaml").write_text("format: vsacli-columns/1\nignore: rest\n")
    found = compare(tmp_path / "r.h5", written(tmp_path / "m.csv", columns), columns=tmp_path / "c.yaml")
    assert "no torque was compared; if any of tauL1 is one, map it with --columns" in found.notes


TORQUES = tuple(f"{joint}.tau_motor_{motor}" for joint in ("base", "shoulder", "elbow") for motor in (1, 2))

SLIPS = {
    "base.q looks as if it is in degrees": lambda c: {"base.q": np.degrees(c["base.q"])},
    "base.q runs the other way": lambda c: {"base.q": -c["base.q"]},
    "base.q is +1 turns off": lambda c: {"base.q": c["base.q"] + 2 * np.pi},
    "base.q does not move": lambda c: {"base.q": 0 * c["base.q"]},
    "tau_motor_1 looks as if it is of the other side of the gear": lambda c: {
        "base.tau_motor_1": c["base.tau_motor_1"] / 50
    },
    "columns look exchanged: base.tau_motor_1 is like base.tau_motor_2 computed": lambda c: {
        "base.tau_motor_1": c["base.tau_motor_2"],
        "base.tau_motor_2": c["base.tau_motor_1"],
    },
    "not compared, as the result has none of that name: temperature": lambda c: {"temperature": c["time"]},
}


@pytest.mark.cases(4)
@pytest.mark.slow
@pytest.mark.parametrize("sentence", SLIPS)
def test_slips_are_named(computed, tmp_path, sentence):
    columns = recorded(computed)
    columns.update(SLIPS[sentence](columns))
    found = compare(tmp_path / "r.h5", written(tmp_path / "m.csv", columns))
    assert [note for note in found.notes if sentence in note], found.notes


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize(("scaled", "said"), [(("base.tau_motor_1",), False), (TORQUES, True)])
def test_gains_of_several_torques_point_to_the_model(computed, tmp_path, scaled, said):
    columns = recorded(computed)
    columns.update({name: 0.95 * columns[name] for name in scaled})
    found = compare(tmp_path / "r.h5", written(tmp_path / "m.csv", columns))
    assert any("the model may be wrong; run vsacli identify" in note for note in found.notes) == said


WRONG = {
    "offset": lambda c: {"base.q": c["base.q"] + 0.05},
    "sign": lambda c: {"shoulder.q": -c["shoulder.q"]},
    "unit": lambda c: {"elbow.theta_1": np.degrees(c["elbow.theta_1"])},
    "wild": lambda c: {"base.q": np.where(np.arange(len(c["time"])) == 900, -1e308, c["base.q"])},
    "late": lambda c: {"base.q": np.interp(c["time"] - 0.05, c["time"], c["base.q"])},
    "stuck": lambda c: {"base.q": 0 * c["base.q"] + 0.3},
}


@pytest.mark.cases(3)
@pytest.mark.slow
@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_column_moves_neither_the_alignment_nor_the_others(computed, tmp_path, wrong):
    columns = recorded(computed)
    noise = np.random.default_rng(5)
    columns = {
        name: values + (name != "time") * 1e-4 * np.ptp(values) * noise.standard_normal(len(values))
        for name, values in columns.items()
    }
    changed = WRONG[wrong](columns)
    columns.update(changed)
    found = compare(tmp_path / "r.h5", written(tmp_path / "m.csv", columns))
    assert abs(found.time_offset - BEGIN) <= 3 * found.time_offset_error
    assert (
        found.time_offset_error < 1e-5
    )  # 1e-4 of the range, at its speed, over the root of 1500 samples: 4e-6 s
    for signal in found.signals:
        if signal.column not in changed:
            # Of 14 columns, normal errors of one are beyond four once in a thousand tests.
            assert abs(signal.gain - 1) <= 4 * signal.gain_error
            assert abs(signal.offset) <= 4 * signal.offset_error
            assert abs(signal.lag) <= 4 * signal.lag_error


@pytest.mark.slow
def test_exchanged_columns_are_found_though_one_lacks_rows(computed, tmp_path):
    columns = recorded(computed)
    swapped = columns["base.theta_1"], columns["elbow.theta_1"]
    columns["elbow.theta_1"], columns["base.theta_1"] = swapped
    cells = np.array(columns["elbow.theta_1"], dtype=object)
    cells[::3] = ""
    columns["elbow.theta_1"] = cells
    found = compare(tmp_path / "r.h5", written(tmp_path / "m.csv", columns))
    (note,) = found.notes
    assert note.startswith("columns look exchanged: ")
    assert "base.theta_1 is like elbow.theta_1 computed" in note
    assert "elbow.theta_1 is like base.theta_1 computed" in note
    follows = {signal.column: signal.follows for signal in found.signals if signal.follows}
    assert follows == {"base.theta_1": "elbow.theta_1", "elbow.theta_1": "base.theta_1"}


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments", [["--json"], ["--plot", "figures"], ["--plot", "p", "--format", "html"]]
)
def test_one_wild_cell_is_said_and_nothing_fails(vsacli, computed, tmp_path, arguments):
    columns = recorded(computed)
    columns["base.q"][700] = -1e308
    written(tmp_path / "m.csv", columns)
    done = vsacli("compare", "r.h5", "m.csv", *arguments)
    assert done.code == 0
    assert "base.q has 1 sample far from all others" in done.out


@pytest.mark.slow
def test_joints_that_hold_still_judge_nothing(vsacli, tmp_path):
    (tmp_path / "wave.yaml").write_text(MOTION.replace("end: [0.9, 0.5, -0.7]", "end: [0, 0.5, 0]"))
    assert vsacli("invdyn", ROBOT, "wave.yaml", "-o", "r.h5").code == 0
    assert vsacli("export", "r.h5", "--variables", "q,theta", "-o", "m.csv").code == 0
    found = compare(tmp_path / "r.h5", tmp_path / "m.csv")
    still = [signal.column for signal in found.signals if signal.still]
    assert still == ["base.q", "elbow.q"]
    for signal in found.signals:
        if signal.still:
            assert np.isnan([signal.gain, signal.offset, signal.lag]).all()
    assert found.notes == (
        "base.q, elbow.q hold still as computed, up to rounding or noise: no gain, offset or lag follows",
    )


@pytest.mark.parametrize("moves", [True, False])
def test_a_robot_that_stands_still_is_not_aligned(vsacli, tmp_path, moves):
    (tmp_path / "wave.yaml").write_text(MOTION)
    if not moves:
        held = MOTION.replace("end: [0.9, 0.5, -0.7]", "end: 0").replace("end: 1200", "end: 900")
        (tmp_path / "wave.yaml").write_text(held)
    assert vsacli("invdyn", ROBOT, "wave.yaml", "-o", "r.h5").code == 0
    time = np.arange(0, 4, 0.002)
    noise = np.random.default_rng(1).standard_normal((3, len(time)))
    names = ("base.q", "shoulder.q", "elbow.tau_motor_1")
    columns = {"time": time, **dict(zip(names, 0.2 + 1e-4 * noise, strict=True))}
    written(tmp_path / "m.csv", columns)
    done = vsacli("compare", "r.h5", "m.csv")
    assert done.code == 2
    assert "does anything move? If the offset is known, give --time-offset" in done.err
    given = vsacli("compare", "r.h5", "m.csv", "--time-offset", "0")
    assert given.code == (3 if moves else 0)
    assert ("warning: the recording does not fit the result" in given.out) == moves
    assert ("base.q does not move, though q was computed to" in given.out) == moves
    assert (" hold still as computed" in given.out) != moves


def test_other_times_of_a_periodic_motion_are_listed(vsacli, tmp_path):
    waves = "{type: sinusoids, frequency: 1, offset: 0, sine: [[0.1, 0.05, 0.1]]}"
    (tmp_path / "wave.yaml").write_text(
        MOTION.replace("{type: polynomial, degree: 7, start: [0, 0, 0], end: [0.9, 0.5, -0.7]}", waves)
    )
    assert vsacli("invdyn", ROBOT, "wave.yaml", "-o", "r.h5").code in (0, 3)
    header, *rows = csv.reader(vsacli("export", "r.h5", "--variables", "q").out.splitlines())
    kept = [row for row in rows if float(row[0]) <= 1.6]
    written(tmp_path / "m.csv", dict(zip(header, np.array(kept, dtype=float).T, strict=True)))
    found = compare(tmp_path / "r.h5", tmp_path / "m.csv")
    (note,) = found.notes
    assert "as well, as in periodic motions; choose with --time-offset" in note
    assert found.time_offset % 1 == pytest.approx(0, abs=1e-3) or found.time_offset % 1 == pytest.approx(
        1, abs=1e-3
    )


@pytest.mark.slow
def test_nothing_is_said_of_what_agrees(computed, tmp_path):
    assert compare(tmp_path / "r.h5", written(tmp_path / "m.csv", recorded(computed))).notes == ()


def test_units_and_sides_of_the_gear_are_converted(computed, tmp_path):
    columns = recorded(computed)
    given = {
        "time [ms]": 1000 * columns["time"],
        "q1 [deg]": np.degrees(columns["base.q"]),
        "base.tau_motor_shaft_1 [mN m]": 1000 * columns["base.tau_motor_1"] / 50,
        "base.theta_shaft_2": 50 * columns["base.theta_2"],
    }
    found = compare(tmp_path / "r.h5", written(tmp_path / "m.csv", given))
    assert [signal.gain for signal in found.signals] == pytest.approx([1, 1, 1], abs=1e-3)


def test_currents_are_compared(vsacli, tmp_path):
    (tmp_path / "wave.yaml").write_text(MOTION)
    driven = (
        "motor: {inertia: 3.20",
        "motor: {gear_ratio: 50, side: shaft, torque_constant: 0.1, inertia: 1.28e-3",
    )
    edited(ROBOT, tmp_path / "robot.yaml", driven)
    assert vsacli("invdyn", "robot.yaml", "wave.yaml", "-o", "r.h5").code == 0
    printed = vsacli("export", "r.h5", "--variables", "q,current").out
    (tmp_path / "m.csv").write_text(printed.replace("base.current_1", "base.current_1 [mA]"))
    found = {signal.column: signal for signal in compare(tmp_path / "r.h5", tmp_path / "m.csv").signals}
    assert found["base.current_1"].gain == pytest.approx(1e-3)
    assert found["base.current_2"].gain == pytest.approx(1)
    assert found["base.current_2"].unit == "A"


@pytest.mark.slow
def test_report_figures_and_json(vsacli, computed, tmp_path):
    written(tmp_path / "m.csv", recorded(computed))
    done = vsacli("compare", "r.h5", "m.csv", "--plot", "figures")
    assert done.code == 0
    # What is left is the error of the spline through 500 samples a second.
    assert "; time offset +0.5137 +- 2e-08 s\n" in done.out
    assert "3 s of 3 s compared; time offset found from the signals" in done.out
    names = {"q", "theta", "tau_motor"}
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {f"r-m-{name}.png" for name in names}
    assert vsacli("compare", "r.h5", "m.csv", "--plot", "pages", "--format", "html").code == 0
    page = Page(tmp_path / "pages" / "r-m-comparison.html")
    assert {section["heading"] for section in page.data["sections"]} == names
    assert len(page.charts) == 2 * 15
    assert "time offset +0.5137 +- 2e-08 s" in page.text
    assert hashlib.sha256((tmp_path / "m.csv").read_bytes()).hexdigest() in page.text
    report = json.loads(vsacli("compare", "r.h5", "m.csv", "--json", "--time-offset", str(BEGIN)).out)
    assert report["format"] == "vsacli-comparison/2"
    assert (report["time_offset"], report["found"], len(report["signals"])) == (BEGIN, False, 15)


STILL = "time,base.q\n" + "".join(f"{t},1\n" for t in range(9))
WILD = "time,base.q\n" + "".join(f"{t},{t % 3}e200\n" for t in range(9))
SLOW = "time,base.q\n" + "".join(f"{1000 * t},{t}\n" for t in range(5))
SHORT = "time,base.q\n0,1\n1,2\n2,1\n"

BAD = {
    "there is no column 'time'; unknown column 'stamp'; if it has another name, use --columns": (
        "stamp,base.q\n0,1\n1,2\n",
        [],
    ),
    "there is no column 'time'; if the rows are equally spaced, give their rate in a file for --columns": (
        "base.q\n0\n1\n",
        [],
    ),
    "'base.q (deg)': units are written in square brackets, base.q [deg]": (
        "time,base.q (deg),elbow.q\n0,1,1\n1,2,2\n",
        [],
    ),
    "m.csv:1: column 'base.q' appears 2 times": ("time,base.q,base.q [deg]\n0,1,1\n1,2,2\n", []),
    "m.csv:1: unknown column 'bose.q'; did you mean 'base.q'?": (
        "time,bose.q\n0,1\n1,2\n",
        [],
    ),
    "joints 'a', 'b' are not in vsa-3r (base, shoulder, elbow): is this the recording of another robot?": (
        "time,a.q,b.q\n0,1,1\n1,2,1\n",
        [],
    ),
    "m.csv:1: expected columns such as time, base.q, base.tau_motor_1; if they have other names, use": (
        "t [s],m1\n0,1\n1,2\n",
        [],
    ),
    "m.csv:4: time must increase, but 1 s appears twice; correct these stamps, or set rate": (
        "time,base.q\n0,1\n1,2\n1,3\n",
        [],
    ),
    "m.csv:4: time must be finite, not nan": ("time,base.q\n,\n0,1\n,2\n2,3\n", []),
    "has 1 row; a recording needs at least 2": ("time,base.q\n0,1\n", []),
    "[N] is a force, expected an angle in rad, deg or rev": ("time,base.q [N]\n0,1\n1,2\n", []),
    "columns 'base.q' and 'q1' are the same signal; keep one": ("time,base.q,q1\n0,1,1\n1,2,2\n", []),
    "matches the result at no time offset; is it the recording of this motion": (STILL, []),
    "and does anything move?": (WILD, []),
    "write it in the header, e.g. time[ms]": (SLOW, []),
    "2 rows overlap the result (3 s): the recording spans -1 to 1 s of it; at least 4 rows must": (
        SHORT,
        ["--time-offset", "1"],
    ),
    "with a time offset of 50 s, no row overlaps the result (3 s)": (SHORT, ["--time-offset", "50"]),
}


@pytest.mark.parametrize("sentence", BAD)
@pytest.mark.usefixtures("computed")
def test_recordings_that_cannot_be_compared_are_refused(vsacli, tmp_path, sentence):
    content, options = BAD[sentence]
    (tmp_path / "m.csv").write_text(content)
    done = vsacli("compare", "r.h5", "m.csv", *options)
    assert (done.code, done.out) == (2, "")
    assert sentence in done.err
    assert "m.csv" in done.err


def test_a_time_offset_must_be_finite(computed, tmp_path):
    with pytest.raises(InputError, match="the time offset must be finite, not nan s"):
        compare(tmp_path / "r.h5", written(tmp_path / "m.csv", recorded(computed)), math.nan)


OTHER = """\
format: vsacli-trajectory/1
name: other
duration: 3
rate: 500
position: {type: sinusoids, frequency: 1/3, offset: 0, sine: [[0.1, -0.2, 0.1], [0.1, 0.1, 0.1]]}
stiffness: {type: constant, value: 1300}
"""


@pytest.mark.usefixtures("computed")
def test_a_recording_of_another_motion_is_reported_first(vsacli, tmp_path):
    (tmp_path / "other.yaml").write_text(OTHER)
    assert vsacli("invdyn", "robot.yaml", "other.yaml", "-o", "o.h5").code == 0
    assert vsacli("export", "o.h5", "--variables", "q,tau_motor", "-o", "m.csv").code == 0
    done = vsacli("compare", "r.h5", "m.csv", "--time-offset", "0")
    warning = done.out.splitlines()[1]
    assert done.code == 3
    assert warning.startswith("warning: the recording does not fit the result: ")
    assert warning.endswith("; is it the recording of another robot or motion?")


def test_mistaken_units_and_signs_are_no_other_robot(computed, tmp_path):
    columns = recorded(computed)
    columns |= {name: -np.degrees(values) for name, values in columns.items() if ".q" in name}
    columns = {name: values for name, values in columns.items() if name == "time" or ".q" in name}
    found = compare(tmp_path / "r.h5", written(tmp_path / "m.csv", columns))
    assert found.warnings == ()
    assert "base.q looks as if it is in degrees" in " ".join(found.notes)


@pytest.mark.slow
def test_joints_that_the_result_does_not_have_are_reported_unless_ignored(vsacli, computed, tmp_path):
    columns = recorded(computed)
    columns = {name.replace("elbow.", "wrist."): values for name, values in columns.items()}
    written(tmp_path / "m.csv", columns)
    done = vsacli("compare", "r.h5", "m.csv")
    assert done.code == 3
    assert "\nwarning: joint 'wrist' is not in vsa-3r (base, shoulder, elbow): is this the" in done.out
    (tmp_path / "names.yaml").write_text("format: vsacli-columns/1\nignore: rest\n")
    ignored = vsacli("compare", "r.h5", "m.csv", "--columns", "names.yaml")
    assert "wrist' is not in" not in ignored.out
    assert ignored.code == 0


def test_a_short_overlap_is_reported_first(vsacli, computed, tmp_path):
    columns = recorded(computed)
    early = columns["time"] < BEGIN + 0.1
    written(tmp_path / "m.csv", {name: values[early] for name, values in columns.items()})
    done = vsacli("compare", "r.h5", "m.csv", "--time-offset", str(BEGIN))
    assert done.code == 3
    assert "\nwarning: only 0.0983 s (50 rows) of 3 s overlap\n" in done.out


@pytest.mark.slow
@pytest.mark.usefixtures("computed")
def test_an_infeasible_result_is_reported_first(vsacli):
    soft = vsacli("invdyn", "robot.yaml", "wave.yaml", "--set", "stiffness.start=750", "-o", "bad.h5")
    assert soft.code == 3
    assert vsacli("export", "bad.h5", "--variables", "q", "-o", "m.csv").code == 0
    done = vsacli("compare", "bad.h5", "m.csv")
    assert done.code == 3
    assert re.search(r"\nwarning: bad.h5 is infeasible at \d+ of 1501 samples; its motors are not", done.out)
    assert json.loads(vsacli("compare", "bad.h5", "m.csv", "--json").out)["warnings"]
