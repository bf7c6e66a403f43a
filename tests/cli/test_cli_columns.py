"""`--columns` of `compare` and `identify`: recordings with other people's headers."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path

import pytest
from samples.command_line import ROBOT, Outcome, rest_to_rest
from samples.excited import Excitation, excited

from vsacli import load_robot

Command = Callable[..., Outcome]

COLUMNS = """\
format: vsacli-columns/1
columns:
  time: "%time"
{lines}
ignore: rest
"""

MOTION = Excitation(
    position=[0] * 3, reach=[0.4] * 3, stiffness=[1400] * 3, swing=[300] * 3, duration=6, rate=100
)


def foreign(path: Path, header: dict[str, str]) -> None:
    """The file with other names, a column of texts, and rows in between that are of another topic."""
    with path.open() as file:
        names, *rows = csv.reader(file)
    with (path.parent / "log.csv").open("w") as file:
        writer = csv.writer(file)
        writer.writerow([header[name] for name in names] + ["frame", "voltage"])
        for index, row in enumerate(rows):
            writer.writerow([*row, "base, fixed", ""])
            if index % 50 == 0:
                writer.writerow([f"{float(row[0]) + 1e-4!r}", *[""] * len(row[1:]), "", "24.1"])


def columns_file(path: Path, header: dict[str, str]) -> None:
    lines = (f"  {name}: {stranger}" for name, stranger in header.items() if name != "time")
    path.write_text(COLUMNS.format(lines="\n".join(lines)))


def renamed(path: Path, target: Path) -> None:
    """A log with names of its own, and the file that says what they stand for."""
    with path.open() as file:
        names = next(csv.reader(file))
    header = {name: "%time" if name == "time" else f"field{number}" for number, name in enumerate(names)}
    foreign(path, header)
    columns_file(target, header)


@pytest.mark.slow
def test_compare(vsacli: Command, tmp_path: Path) -> None:
    rest_to_rest(tmp_path / "motion.yaml")
    assert vsacli("invdyn", ROBOT, "motion.yaml", "-o", "r.h5").code == 0
    assert vsacli("export", "r.h5", "--variables", "q,tau_motor", "-o", "plain.csv").code == 0
    renamed(tmp_path / "plain.csv", tmp_path / "columns.yaml")
    expected = json.loads(vsacli("compare", "r.h5", "plain.csv", "--json").out)
    found = json.loads(vsacli("compare", "r.h5", "log.csv", "--columns", "columns.yaml", "--json").out)
    assert found["signals"] == expected["signals"]
    assert "not compared" not in str(found["notes"])
    names = tmp_path / "columns.yaml"
    names.write_text(names.read_text().replace("ignore: rest", "ignore: [frame]"))
    found = json.loads(vsacli("compare", "r.h5", "log.csv", "--columns", "columns.yaml", "--json").out)
    assert "not compared, as the result has none of that name: voltage" in str(found["notes"])


@pytest.mark.slow
def test_identify(vsacli: Command, tmp_path: Path) -> None:
    lab = load_robot(ROBOT).replace({"joints.base.actuator.spring.k": 380})
    excited(lab, MOTION).noisy(seed=0).write(tmp_path / "plain.csv", lab)
    renamed(tmp_path / "plain.csv", tmp_path / "columns.yaml")
    options = ("--fit", "springs", "--json")
    mapping = tmp_path / "columns.yaml"  # a mapping for other commands, too, may have further variables
    mapping.write_text(mapping.read_text().replace("ignore", "  base.stiffness: voltage\nignore"))
    expected = json.loads(vsacli("identify", ROBOT, "plain.csv", *options).out)
    found = json.loads(vsacli("identify", ROBOT, "log.csv", "--columns", "columns.yaml", *options).out)
    numbers, others = ([each["numbers"] for each in report["systems"]] for report in (found, expected))
    assert numbers[0][0]["value"] == pytest.approx(others[0][0]["value"], rel=1e-9)  # fewer stamps in a grid
    assert found["verdict"] == expected["verdict"]


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("columns: {time: t}\n", "columns.yaml:1: missing key 'format'"),
        (
            "format: vsacli-columns/1\n",
            "columns.yaml:1: says nothing: give columns, ignore, skip_rows, rate or unwrap",
        ),
        (
            "format: vsacli-columns/1\nignore: all\n",
            "columns.yaml:2: ignore: expected rest or a list of",
        ),
        (
            "format: vsacli-columns/1\ncolumns: {base.p: t}\n",
            "columns.yaml:2: columns: unknown name 'base.p'",
        ),
        ("format: vsacli-columns/1\nignore: [t]\n", "log.csv:1: there is no column 'time'"),
    ],
)
def test_what_is_wrong_with_the_file(vsacli: Command, tmp_path: Path, content: str, sentence: str) -> None:
    rest_to_rest(tmp_path / "motion.yaml")
    assert vsacli("invdyn", ROBOT, "motion.yaml", "-o", "r.h5").code == 0
    (tmp_path / "log.csv").write_text("t,base.q\n0,1\n1,2\n2,3\n3,4\n4,5\n")
    (tmp_path / "columns.yaml").write_text(content)
    done = vsacli("compare", "r.h5", "log.csv", "--columns", "columns.yaml")
    assert (done.code, done.out) == (2, "")
    assert sentence in done.err


def test_validate_and_schema_know_the_format(vsacli: Command, tmp_path: Path) -> None:
    (tmp_path / "columns.yaml").write_text("format: vsacli-columns/1\ncolumns: {time: 1, base.q: 2}\n")
    assert "columns of recordings, 2 names" in vsacli("validate", "columns.yaml").out
    assert "nanoseconds" in vsacli("schema", "columns").out
