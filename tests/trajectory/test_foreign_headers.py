"""Recordings with other people's headers: what is said of their columns, and that no digit is lost."""

import math

import numpy as np
import pytest
from jsonschema import ValidationError, validate
from samples.exports import EXPORTS, FIRST, motion, plain
from samples.shipped import shipped_robot

from vsacli import InputError, inverse_dynamics, load_trajectory
from vsacli.files.file_kinds import DOCUMENTS

ROBOT = shipped_robot("planar_2r")

TRAJECTORY = """\
format: vsacli-trajectory/1
name: recorded
position:
  type: csv
  file: {file}
  columns: {columns}
{ignore}
stiffness: {{type: constant, value: 30000}}
"""


def loaded(folder, content, columns, ignore=""):
    (folder / "log.csv").write_text(content, newline="")
    ignored = f"  ignore: {ignore}" if ignore else ""
    path = folder / "motion.yaml"
    path.write_text(TRAJECTORY.format(file="log.csv", columns=columns, ignore=ignored))
    return load_trajectory(path, ROBOT)


def as_plain(folder, content):
    return loaded(folder, content, "{time: time}")


@pytest.mark.parametrize("name", EXPORTS)
def test_exports_of_other_programs_give_the_same_torques_bit_for_bit(tmp_path, name):
    recorded = motion()
    expected = inverse_dynamics(ROBOT, as_plain(tmp_path, plain(recorded)))
    export = EXPORTS[name](recorded)
    trajectory = loaded(tmp_path, *export)
    result = inverse_dynamics(ROBOT, trajectory)
    np.testing.assert_array_equal(result.time, expected.time)
    np.testing.assert_array_equal(result.tau_motor, expected.tau_motor)
    assert np.isfinite(result.tau_motor).all()


def test_what_was_left_out_and_taken_off_is_said(tmp_path):
    trajectory = loaded(tmp_path, *EXPORTS["rostopic"](motion()))
    notes = [note.partition("log.csv: ")[2] for note in trajectory.notes]
    assert f"times count from its first stamp, {FIRST}" in notes
    ignored = "ignored: %time, field.header.seq, field.header.frame_id, field.name0, field.name1 and 4 more"
    assert ignored in notes
    trajectory = loaded(tmp_path, *EXPORTS["plotjuggler"](motion()))
    assert any("only the 61 rows are read in which these columns have numbers" in n for n in trajectory.notes)


def test_units_and_factors(tmp_path):
    recorded = motion()
    plainly = as_plain(tmp_path, plain(recorded)).block(0, 61)
    rows = zip(recorded.nanoseconds, recorded.positions, strict=True)
    lines = [f"{ns / 1e6!r},{math.degrees(q[0])!r},{-q[1] * 2048 / math.pi!r}" for ns, q in rows]
    columns = """
    time: {column: t, unit: ms}
    shoulder.q: {column: shoulder (deg), unit: deg}
    elbow.q: {column: ticks, factor: -2*pi/4096}"""
    block = loaded(tmp_path, "t,shoulder (deg),ticks\n" + "\n".join(lines), columns).block(0, 61)
    np.testing.assert_allclose(block.q, plainly.q, rtol=1e-14)  # three roundings
    np.testing.assert_allclose(block.time, plainly.time, rtol=1e-15, atol=1e-16)  # one rounding


PROBLEMS = {
    "no such column": (
        "time,a,b",
        "{shoulder.q: a, elbow.q: c}",
        ["motion.yaml:6: columns: ", "log.csv has no column 'c'; valid: time, a, b"],
    ),
    "unknown target": (
        "time,a,b",
        "{shoulder.q: a, elbw.q: b}",
        ["motion.yaml:6: columns: unknown name 'elbw.q'; did you mean 'elbow.q'?"],
    ),
    "repeated": (
        "time,a,a",
        "{shoulder.q: a, elbow.q: a}",
        ["columns: 'a' appears 2 times; give its number, 2 or 3"],
    ),
    "taken": (
        "time,a,b",
        "{shoulder.q: a, elbow.q: a}",
        ["columns: 'a' is already mapped to shoulder.q"],
    ),
    "its own": (
        "time,shoulder.q,a,elbow.q",
        "{shoulder.q: a}",
        ["log.csv has a column 'shoulder.q' of its own; leave this out, or ignore: [shoulder.q]"],
    ),
    "number too large": (
        "time,a,b",
        "{shoulder.q: 2, elbow.q: 4}",
        ["has 3 columns, none with the number 4"],
    ),
    "not used": ("time,a,b,c", "{shoulder.q: a, elbow.q: b}", ["log.csv:1: unknown column 'c'"]),
    "degrees in parentheses": (
        "time,Elbow (deg),b",
        "{shoulder.q: b, elbow.q: Elbow (deg)}",
        [
            "'Elbow (deg)' speaks of deg; if its numbers are, write",
            "elbow.q: {column: 'Elbow (deg)', unit: deg}",
        ],
    ),
    "degrees as a suffix": ("time,elbow_deg,b", "{shoulder.q: b, elbow.q: elbow_deg}", ["speaks of deg"]),
    "degrees in camel case": ("time,ElbowDeg,b", "{shoulder.q: b, elbow.q: ElbowDeg}", ["speaks of deg"]),
    "wrong unit": (
        "time,a,b",
        "{shoulder.q: {column: a, unit: mm}, elbow.q: b}",
        ["log.csv:1: column 'shoulder.q': [mm] is a length, expected an angle in rad, deg or rev"],
    ),
    "no header": (
        "0,1,2",
        "{shoulder.q: a, elbow.q: b}",
        ["found numbers; without one, columns are given by"],
    ),
    "number zero": ("time,a,b", "{shoulder.q: 0}", ["columns.shoulder.q: expected a column, counted from 1"]),
    "nanoseconds": (
        "time,a,b",
        "{shoulder.q: {column: a, nanoseconds: b}}",
        ["only time may have a column of nanoseconds"],
    ),
    "unit of nanoseconds": (
        "time,a,b",
        "{time: {column: time, unit: s, nanoseconds: b}}",
        ["nanoseconds: requires whole seconds, without unit or factor"],
    ),
    "brackets": ("time,a,b", "{time: {column: time, unit: '[ms]'}}", ["is written without brackets"]),
    "zero": ("time,a,b", "{time: {column: time, factor: 0}}", ["must be finite and not zero"]),
    "empty": ("time,a,b", "{}", ["columns: expected a mapping such as {time: stamp, elbow.q: position}"]),
    "list": ("time,a,b", "[a, b]", ["columns: expected a mapping such as"]),
}


@pytest.mark.parametrize("case", PROBLEMS)
def test_what_is_wrong_with_a_mapping_is_said_where_it_stands(tmp_path, case):
    header, columns, sentences = PROBLEMS[case]
    rows = "\n".join(f"{i / 100},0.1,0.2" + ",0" * header.count(",c") for i in range(20))
    rows = "\n".join(line + ",1" * (header.count(",") - line.count(",")) for line in rows.splitlines())
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, f"{header}\n{rows}\n", columns)
    for sentence in sentences:
        assert sentence in str(caught.value)


def test_stamps_that_are_no_seconds_need_a_unit(tmp_path):
    rows = "\n".join(f"{FIRST + i * 10**7},0.1,{i / 10}" for i in range(20))
    columns = "{time: '%time', shoulder.q: a, elbow.q: b}"
    with pytest.raises(InputError, match=f"times begin with {FIRST}, which are no seconds .* unit: ns"):
        loaded(tmp_path, f"%time,a,b\n{rows}\n", columns)


def test_cells_that_are_empty_in_some_columns_are_no_guess(tmp_path):
    rows = [f"{i / 100},0.1,{i / 10}" for i in range(20)]
    rows[7:9] = ["0.07,0.1,", "0.08,,0.8"]
    with pytest.raises(InputError, match=r"log.csv:9: column 'shoulder.q' has no number here, .* \(1 such"):
        loaded(tmp_path, "t,a,b\n" + "\n".join(rows[:7] + rows[8:]), "{time: t, shoulder.q: a, elbow.q: b}")
    with pytest.raises(InputError, match=r"log.csv:9: column 'elbow.q' has no number here"):
        loaded(tmp_path, "t,a,b\n" + "\n".join(rows), "{time: t, shoulder.q: a, elbow.q: b}")


def test_rows_with_another_number_of_cells_are_refused_though_columns_are_left_out(tmp_path):
    rows = [f"{i / 100},x,0.1,{i / 10}" for i in range(20)]
    rows[5], rows[6] = "0.05,x,y,0.1,0.5", "0.06,0.1,0.6"  # as many separators in all as there should be
    columns = "{time: t, shoulder.q: a, elbow.q: b}"
    with pytest.raises(
        InputError, match=r"log.csv:7: expected 4 values, one for each column of the header, found 5"
    ):
        loaded(tmp_path, "t,note,a,b\n" + "\n".join(rows), columns, "rest")


def test_position_and_stiffness_share_what_is_said_of_a_file(tmp_path):
    rows = "\n".join(f"{i / 100},{i / 1000},{i / 2000},{90 + i / 10},100" for i in range(20))
    (tmp_path / "log.csv").write_text(f"t,a,b,ka,kb\n{rows}\n")
    text = """\
format: vsacli-trajectory/1
name: recorded
position: {type: csv, file: log.csv, columns: {time: t, shoulder.q: a, elbow.q: b}}
stiffness:
  type: csv
  file: log.csv
  columns: {%sshoulder.stiffness: ka, elbow.stiffness: kb}
"""
    path = tmp_path / "motion.yaml"
    path.write_text(text % "")
    np.testing.assert_array_equal(
        load_trajectory(path, ROBOT).block(3, 4).of_joints["stiffness"], [[90.3, 100]]
    )
    path.write_text(text % "time: a, ")
    with pytest.raises(
        InputError, match=r"motion.yaml:7: columns: time is mapped to another column of the same file"
    ):
        load_trajectory(path, ROBOT)


def test_files_whose_stamps_begin_at_other_instants_are_not_combined(tmp_path):
    for name, first in (("a", FIRST), ("b", FIRST + 1)):
        rows = "\n".join(f"{first + i * 10**7},{i / 10 + 1},{i / 20 + 1}" for i in range(20))
        (tmp_path / f"{name}.csv").write_text(f"t,x,z\n{rows}\n")
    columns = "{time: {column: t, unit: ns}, shoulder.%s: x, elbow.%s: z}"
    (tmp_path / "motion.yaml").write_text(
        "format: vsacli-trajectory/1\nname: recorded\n"
        f"position: {{type: csv, file: a.csv, columns: {columns.replace('%s', 'q')}}}\n"
        f"stiffness: {{type: csv, file: b.csv, columns: {columns.replace('%s', 'stiffness')}}}\n"
    )
    with pytest.raises(InputError, match=rf"b.csv: times begin with {FIRST + 1}, but {FIRST} in .*a.csv"):
        load_trajectory(tmp_path / "motion.yaml", ROBOT)


def test_a_table_without_any_known_column_is_one_problem(tmp_path):
    (tmp_path / "log.csv").write_text(EXPORTS["rostopic"](motion()).content)
    with pytest.raises(InputError) as caught:
        load_trajectory(tmp_path / "log.csv", ROBOT)
    (problem,) = caught.value.problems
    assert problem.message.startswith(
        "is not a trajectory: expected columns such as time, shoulder.q; vsacli info "
    )


def test_an_editor_knows_what_may_be_said_of_columns():
    schema = DOCUMENTS["columns"].schema()
    said = {
        "time": {"column": "%time", "unit": "ns"},
        "a.q": 3,
        "b.q": {"column": "t", "factor": "2*pi/4096"},
    }
    validate({"format": "vsacli-columns/1", "columns": said, "ignore": ["c", 4]}, schema)
    for wrong in ({"columns": {}}, {"columns": {"time": {"colunm": "a"}}}, {"ignore": "all"}):
        with pytest.raises(ValidationError):
            validate({"format": "vsacli-columns/1", **wrong}, schema)
