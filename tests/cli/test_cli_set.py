"""`--set PATH=VALUE`: one value of the robot or the trajectory is another one, in a single run."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from samples.command_line import REPOSITORY, ROBOT, edited
from samples.marks import slow

from vsacli import load_robot, load_trajectory
from vsacli.documents.reading import read_changes

MIXED = REPOSITORY / "robots" / "mixed_3r.yaml"
PANDA = REPOSITORY / "robots" / "panda_7r.yaml"

SAME: dict[str, tuple[str, str, tuple[str, str]]] = {
    "one spring of several behind an anchor": (
        "robot",
        "joints.elbow.actuator.spring.k=410",
        ("      spring: *spring             # the same springs as at the base\n", ""),
    ),
    "all links": ("robot", "joints.*.damping=2e-5", ("damping: 1e-5  ", "damping: 2e-5  ")),
    "a list": ("robot", "gravity=[0, 0, -1.62]", ("[0, 0, -9.81]", "[0, 0, -1.62]")),
    "an expression": ("robot", "joints.0.dh.alpha=80 deg", ("alpha: pi/2", "alpha: 80 deg")),
    "a number of the motion": ("trajectory", "duration=3", ("duration: 4.0", "duration: 3")),
    "one joint of a scalar": (
        "trajectory",
        "stiffness.end.elbow=1100",
        ("end: 1275 ", "end: [1275, 1275, 1100] "),
    ),
    "one of a list": ("trajectory", "position.end.1=30 deg", ("45 deg", "30 deg")),
    "a value by joint": (
        "trajectory",
        "stiffness.end={base: 1200, shoulder: 1275, elbow: 1100}",
        ("end: 1275 ", "end: [1200, 1275, 1100] "),
    ),
    "a whole signal": (
        "trajectory",
        "stiffness={type: constant, value: 900}",
        ("type: polynomial                # its", "type: constant\n  value: 900 # its"),
    ),
}
"""What is set, and the text of the file that says the same."""


def edited_by_hand(file: str, case: str, source: Path, target: Path) -> Path:
    change = SAME[case][2]
    if file == "robot" and case.startswith("one spring"):  # the last of those that refer to the anchor
        head, tail = source.read_text().rsplit(change[0].rstrip("\n"), 1)
        target.write_text(f"{head}      spring: {{type: cubic, k: 410, k_c: 2000}}{tail}")
        return target
    more = [
        ("  degree: 3\n  start: 850                      # N m/rad, every joint\n", ""),
        ("  end: 1275", "  #"),
    ]
    return edited(source, target, change, *(more if case == "a whole signal" else []))


@pytest.mark.parametrize("case", SAME)
def test_what_is_read_is_the_changed_file(own_folder: Path, motion: Path, case: str) -> None:
    file, change, _ = SAME[case]
    changes = read_changes([change])
    if file == "robot":
        by_hand = edited_by_hand(file, case, ROBOT, own_folder / "other.yaml")
        assert load_robot(ROBOT, changes) == load_robot(by_hand) != load_robot(ROBOT)
    else:
        robot, by_hand = load_robot(ROBOT), edited_by_hand(file, case, motion, own_folder / "other.yaml")
        first, second = load_trajectory(motion, robot, changes), load_trajectory(by_hand, robot)
        assert first.times.span == second.times.span
        for key, position in (("position", first.position), *first.commanded.items()):
            other = second.position if key == "position" else second.commanded[key]
            time = np.linspace(0, first.duration, 7)
            np.testing.assert_array_equal(position.at(time), other.at(time))


@pytest.mark.parametrize(
    ("command", "told"),
    [
        ("check-feasibility", "rest-to-rest: 31 samples, 0.3 s"),
        slow("simulate", "rest-to-rest: feedforward, 0.3 s"),
        ("sensitivity --json", '"path": "joints.elbow.link.mass",\n   "value": 5.25,'),
    ],
)
def test_several_values_are_set(vsacli: Any, motion: Path, command: str, told: str) -> None:
    settings = ("joints.elbow.link.mass=5.25", "position.end=0.001", "duration=0.3")
    done = vsacli(*command.split(), ROBOT, motion, *(part for each in settings for part in ("--set", each)))
    assert done.code == 0
    assert told in done.out


def test_a_path_is_set_once(vsacli: Any, motion: Path) -> None:
    done = vsacli("check-feasibility", ROBOT, motion, "--set", "duration=5", "--set", "duration = 0.3")
    assert (done.code, done.out) == (2, "")
    assert done.err == "--set duration = 0.3: duration is also set to '5'; set it once\n"


def test_a_result_remembers_what_was_set(vsacli: Any, motion: Path) -> None:
    """It is computed again, and its inputs with what is told beside them give it once more."""
    changes = ["joints.elbow.link.com=[-0.1, 0, 1e-3]", "stiffness.end.elbow=1100", "rate=10"]
    options = [part for change in changes for part in ("--set", change)]
    assert vsacli("invdyn", ROBOT, motion, *options, "-o", "r.h5", "-q").code == 0
    assert vsacli("validate", "r.h5", "--recompute").out.endswith("equal bit for bit\n")
    shown = vsacli("info", "r.h5").out
    assert all(f"  with --set {change}\n" in shown for change in changes)
    told = vsacli("info", "r.h5", "--extract", "again").err
    twice = vsacli("info", "r.h5", "--extract", "again")
    assert (twice.code, twice.err.partition(": ")[2]) == (
        4,
        "exists already; choose another name, or remove it first\n",  # there is no --overwrite
    )
    again = shlex.split(told.partition("computed from them with ")[2])
    assert again == options
    robot, trajectory = (next(Path("again").rglob(each.name)) for each in (ROBOT, motion))
    assert vsacli("invdyn", robot, trajectory, *again, "-o", "s.h5", "-q").code == 0
    with h5py.File("r.h5") as first, h5py.File("s.h5") as second:
        np.testing.assert_array_equal(first["tau_motor"][...], second["tau_motor"][...])


def test_paths_lead_into_the_file_as_it_is_written(own_folder: Path) -> None:
    """Rows of the modified convention are changed before they are made standard ones."""
    text = PANDA.read_text()
    line = next(line for line in text.splitlines() if "d: 0.333" in line)
    edited(PANDA, own_folder / "high.yaml", (line, line.replace("0.333", "0.4")))
    assert load_robot(PANDA, {"joints.0.dh.d": 0.4}) == load_robot("high.yaml") != load_robot(PANDA)


@pytest.mark.slow
def test_a_file_in_a_value_lies_beside_the_document(vsacli: Any) -> None:
    Path("arms").mkdir()
    for name in ("measured_1r.yaml", "measured_spring.csv"):
        (Path("arms") / name).write_bytes((REPOSITORY / "robots" / name).read_bytes())
    (Path("arms") / "other.csv").write_bytes((REPOSITORY / "robots" / "measured_spring.csv").read_bytes())
    run = ("invdyn", "arms/measured_1r.yaml", REPOSITORY / "trajectories" / "measured_1r.yaml")
    assert (
        vsacli(
            *run, "--set", "joints.*.actuator.spring.file=other.csv", "--set", "rate=20", "-o", "r.h5", "-q"
        ).code
        == 0
    )
    assert vsacli("validate", "r.h5", "--recompute").code == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            "joint.0.damping=1",
            "neither robot nor trajectory has 'joint' at the top level; did you mean 'joints'?",
        ),
        (
            "mass=2",
            "neither robot nor trajectory has 'mass' at the top level; did you mean joints.*.link.mass?",
        ),
        (
            "link.mass=2",
            "neither robot nor trajectory has 'link' at the top level; did you mean joints.*.link.mass?",
        ),
        (
            "elbow.link.mass=2",
            "neither robot nor trajectory has 'elbow' at the top level; did you mean joints.*.link.mass?",
        ),
        ("foo=2", "neither robot nor trajectory has 'foo' at the top level; valid: placeholder, gravity, "),
        ("name=x", "the name of a file cannot be changed here; edit the file"),
        ("format=x", "the format of a file cannot be changed here; edit the file"),
        ("joints.elbow.link.mas=1", "joints.elbow.link has no"),
        ("joints.elbow.link.mass=-1", "must be zero or positive, not -1 kg"),
        ("joints.elbow.link.mass=heavy", "expected a number in kg, found 'heavy'"),
        ("position.degree=4", "must be odd, from 7 to 15"),
        ("joints.*.link.mass=-1", "joints.base.link.mass: must be zero or positive, not -1 kg"),
        (
            "joints.elbow=2",
            "joints.elbow is a mapping",
        ),
        ("position.end.5=1", "position.end has no '5'; valid: base, shoulder, elbow or 0 to 2"),
        (
            "position.type=via",
            "the type cannot be",
        ),
        ("joints.elbow.link.mass", "expected PATH=VALUE, e.g. joints.*.link.mass=2.5"),
        ("gravity=[1, 2", "not valid YAML: "),
    ],
)
def test_a_change_that_cannot_be_made(vsacli: Any, motion: Path, change: str, message: str) -> None:
    done = vsacli("check-feasibility", ROBOT, motion, "--set", change)
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith(f"--set {change}: {message}")


def test_joints_that_take_no_stiffness_get_none(vsacli: Any) -> None:
    run = (
        "check-feasibility",
        MIXED,
        REPOSITORY / "trajectories" / "mixed_3r.yaml",
        "--set",
        "rate=10",
        "--set",
    )
    assert vsacli(*run, "stiffness.end=900").code == vsacli(*run, "stiffness.end.*=900").code == 0
    refused = vsacli(*run, "stiffness.end.base=900")
    assert (refused.code, refused.err.partition(": no value goes there: ")[0]) == (
        2,
        "--set stiffness.end.base=900",
    )


def test_sides_that_differ_need_a_word_for_one(vsacli: Any, motion: Path) -> None:
    one = "joints.elbow.actuator.spring.0.k=390"
    refused = vsacli("invdyn", ROBOT, motion, "--set", one, "--set", "joints.elbow.actuator.spring.k=400")
    assert refused.code == 2
    assert "its two sides differ; say which by 0, 1 or *" in refused.err


@pytest.mark.slow
def test_a_table_has_nothing_to_set_but_a_rate(vsacli: Any, motion: Path) -> None:
    assert vsacli("invdyn", ROBOT, motion, "-o", "r.h5", "-q").code == 0
    assert vsacli("export", "r.h5", "--variables", "q,stiffness", "-o", "m.csv", "-q").code == 0
    refused = vsacli("check-feasibility", ROBOT, "m.csv", "--set", "duration=3")
    assert (refused.code, "whose rate alone can be set" in refused.err) == (2, True)


def test_a_fixed_file_starts_from_the_files(vsacli: Any, too_soft: Path) -> None:
    done = vsacli(
        "check-feasibility", ROBOT, too_soft, "--set", "duration=3", "--write-fix", 1, "-o", "f.yaml"
    )
    assert (done.code, "change them instead" in done.err) == (2, True)


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (
            ["--rate", "1e9"],
            "--rate: duration 4 s times rate 1e+09 Hz gives 4e+09 samples; at most 1e+09 are possible; "
            "lower rate or duration",
        ),
        (["--set", "rate=-5"], "--set rate=-5: must be positive, not -5 1/s"),
        (["--rate", "5", "--set", "duration=-1"], "--set duration=-1: must be positive, not -1 s"),
    ],
)
def test_an_impossible_rate_is_one_problem_of_its_option(
    vsacli: Any, motion: Path, option: list[str], message: str
) -> None:
    done = vsacli("invdyn", ROBOT, motion, *option)
    assert (done.code, done.err) == (2, f"{message}\n")


def test_a_rate_that_a_recording_cannot_have_names_its_option(vsacli: Any) -> None:
    columns = [f"{joint}.{name}" for joint in ("base", "shoulder", "elbow") for name in ("q", "stiffness")]
    rows = [",".join(map(str, [0.1 * row, *[0, 900] * 3])) for row in range(10)]
    Path("log.csv").write_text("\n".join([",".join(["time", *columns]), *rows, ""]))
    signals = "".join(f"{key}: {{type: csv, file: log.csv}}\n" for key in ("position", "stiffness"))
    Path("log.yaml").write_text(f"format: vsacli-trajectory/1\nname: log\n{signals}")
    for trajectory in ("log.csv", "log.yaml"):
        done = vsacli("invdyn", ROBOT, trajectory, "--rate", "1e12")
        assert (done.code, done.err.startswith("--rate: duration 0.9 s times rate 1e+12 Hz")) == (2, True)
