"""Files of a wrong kind and misspelled names: one error says what a file is, or what it may be called."""

from __future__ import annotations

import shutil

import pytest
from samples.command_line import REST_TO_REST, ROBOT


@pytest.fixture(autouse=True)
def _files(feasible_result, own_folder):
    """Files of several kinds, and a folder of robots."""
    shutil.copy(feasible_result, "run.h5")
    (own_folder / "robots").mkdir()
    for path in (ROBOT, own_folder / "robots" / "arm.yaml"):
        (own_folder / "robots" / path.name).write_text(ROBOT.read_text())
    (own_folder / "arm.yaml").write_text(ROBOT.read_text())
    (own_folder / "move.yaml").write_text(REST_TO_REST.read_text())
    (own_folder / "samples.csv").write_text("time,base.q\n0,0\n1,1\n")
    return own_folder


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("move.yaml", "arm.yaml"),
            "move.yaml: is a trajectory, but ROBOT must be a robot file (YAML); the order is ROBOT ",
        ),
        (
            ("arm.yaml", "arm.yaml"),
            "arm.yaml: is a robot, but TRAJECTORY must be a trajectory (YAML) or a CSV table; the order is ",
        ),
        (
            ("run.h5", "move.yaml"),
            "run.h5: is a result, but ROBOT must be a robot file (YAML); vsacli info run.h5 --extract ",
        ),
        (("samples.csv", "move.yaml"), "samples.csv: is a CSV table, but ROBOT must be a robot"),
        (("robot/arm.yaml", "move.yaml"), "robot/arm.yaml: no such file; did you mean 'robots/arm.yaml'?"),
        (("ARM.yaml", "move.yaml"), "ARM.yaml: no such file; did you mean 'arm.yaml'?"),
        (("panda.yaml", "move.yaml"), "panda.yaml: no such file\n"),
        (("-", "-"), "ROBOT and TRAJECTORY are both '-', but standard input can be read only once"),
    ],
    ids=["swapped", "robot twice", "result", "table", "folder", "case", "nothing similar", "input twice"],
)  # fmt: skip
def test_the_error_says_what_a_file_is(vsacli, arguments, message):
    for command in ("invdyn", "check-feasibility", "simulate", "optimize", "sensitivity"):
        outcome = vsacli(command, *arguments)
        assert outcome.code == 2
        assert message in outcome.err


_STORED = "a result, a simulation or a study table (HDF5)"
_DRAWN = (
    "FILE must be a robot file, a trajectory (YAML), a result, a simulation, a study table (HDF5) "
    "or a CSV table"
)
_RESULT = "RESULT must be a result or a simulation (HDF5)"
_COMPUTE = "to compute a result: vsacli invdyn arm.yaml TRAJECTORY"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            "identify arm.yaml run.h5",
            "is a result, but RECORDING must be a CSV table; vsacli export run.h5 writes",
        ),
        (
            "compare run.h5 arm.yaml",
            "is a robot, but RECORDING must be a CSV table or a result (HDF5); the order is RESULT RECORDING",
        ),
        ("compare arm.yaml samples.csv", f"is a robot, but {_RESULT}; {_COMPUTE}"),
        ("plot study.yaml", f"is a study, but {_DRAWN}; run it with vsacli study study.yaml"),
        ("plot motors.csv", f"is a motor catalog, but {_DRAWN}; give it to size as --catalog motors.csv"),
        (
            "info samples.csv --robot move.yaml",
            "is a trajectory, but --robot must be a robot file (YAML)\n",
        ),
        ("size arm.yaml move.yaml --catalog samples.csv", "samples.csv:1: missing columns 'name' ("),
        ("compare move.yaml samples.csv", f"{_RESULT}; to compute a result: vsacli invdyn ROBOT move.yaml"),
        ("info arm.yaml --extract x", f"is a robot, but FILE must be {_STORED}; {_COMPUTE}"),
        (
            "size arm.yaml move.yaml --catalog arm.yaml",
            "is a robot, but --catalog must be a motor catalog (CSV)",
        ),
        (
            "size arm.yaml arm.yaml",
            "is a robot, but TRAJECTORY must be a trajectory (YAML) or a CSV table; the order is",
        ),
        (
            "identify arm.yaml samples.csv --columns arm.yaml",
            "is a robot, but --columns must be a columns file (YAML)",
        ),
        ("import-urdf samples.csv", "is a CSV table, but URDF must be a URDF file"),
        ("study arm.yaml -o s.h5", f"is a robot, but STUDY must be a study file (YAML); {_COMPUTE}"),
        ("study --merge arm.yaml -o s.h5", "is a robot, but STUDY must be a study table (HDF5)"),
        (
            "invdyn arm.yaml photo.csv",
            "is a PNG image, but TRAJECTORY must be a trajectory (YAML) or a CSV table",
        ),
        ("invdyn plan.zip move.yaml", "is a ZIP archive, but ROBOT must be a robot file (YAML)"),
        ("plot photo.csv", f"is a PNG image, but {_DRAWN}"),
        ("info photo.csv", "is a PNG image; expected text"),
        ("invdyn robots move.yaml", "robots: is a folder"),
        (
            "sensitivity arm.yaml move.yaml --tolerances arm.yaml",
            "is a robot, but --tolerances must be a tolerances file (YAML, e.g. joints.*.link.mass: {",
        ),
        (
            "simulate arm.yaml move.yaml --controller feedback-linearization --poles move.yaml",
            "is a trajectory, but --poles must be a poles file (YAML)",
        ),
    ],
)
def test_every_argument_says_what_a_file_is(vsacli, own_folder, arguments, message):
    (own_folder / "photo.csv").write_bytes(b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR")
    (own_folder / "study.yaml").write_text("format: vsacli-study/1\n")
    (own_folder / "motors.csv").write_text("name,inertia\nm,1e-4\n")
    (own_folder / "plan.zip").write_bytes(b"PK\x03\x04\x14\x00")
    outcome = vsacli(*arguments.split())
    assert outcome.code == 2
    assert message in outcome.err
    assert outcome.err.count("\n") == 1


@pytest.mark.parametrize(
    "command", [("identify", "move.yaml", "samples.csv"), ("size", "move.yaml", "move.yaml")]
)
def test_other_commands_say_it_as_well(vsacli, command):
    outcome = vsacli(*command)
    assert outcome.code == 2
    assert "move.yaml: is a trajectory, but ROBOT must be a robot" in outcome.err


@pytest.mark.parametrize("name", ["a.jsonl", "a.cvs", "a.txt"])
def test_an_unknown_ending_is_refused_unless_the_format_is_named(vsacli, name):
    outcome = vsacli("export", "run.h5", "--rate", 10, "-o", name)
    assert outcome.code == 2
    assert (
        f"export of a result writes .csv, .mat, .parquet, .json, .yaml, .yml, not {name[1:]}" in outcome.err
    )
    assert vsacli("export", "run.h5", "--rate", 10, "--format", "csv", "-o", name).code == 0
    assert vsacli("invdyn", "arm.yaml", "move.yaml", "-o", name).code == 2
