"""`vsacli validate`: every kind of file is told by its content, and every problem is reported."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from samples.command_line import REPOSITORY, REST_TO_REST, ROBOT, edited
from samples.marks import slow
from samples.shipped import EXAMPLES

from vsacli import InputError, __version__, load_trajectory
from vsacli.files.file_kinds import FileKind, recognize
from vsacli.files.limits_of_motion import unattainable
from vsacli.files.placeholder_robot import placeholder_robot

ROBOTS = sorted((REPOSITORY / "robots").glob("*.yaml"))
TRAJECTORIES = sorted((REPOSITORY / "trajectories").glob("*.yaml"))
POLES = "format: vsacli-poles/1\njoints:\n  - {name: base, position: -20}\n"
NO_ROBOT = "note: joint names, units and limits are not checked; give the robot file, too"


def samples(path: Path, **changes: str) -> Path:
    """A recording of the 3R arm at rest, over a second."""
    joints = ["base", "shoulder", "elbow"]
    header = ["time", *(f"{joint}.q" for joint in joints), *(f"{joint}.stiffness" for joint in joints)]
    rows = [[time, 0, 0, 0, 1000, 1000, 1000] for time in np.linspace(0, 1, 11)]
    lines = [",".join(changes.get(name, name) for name in header), *(",".join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("stems", [("mixed_3r", "rp_2", "tendon_1r"), slow(())], ids=["three", "all"])
def test_everything_that_comes_along_is_valid(vsacli: Any, stems: tuple[str, ...]) -> None:
    robots, trajectories = (
        [path for path in paths if path.stem in stems or not stems] for paths in (ROBOTS, TRAJECTORIES)
    )
    done = vsacli("validate", *robots, *trajectories)
    assert (done.code, done.err) == (0, "")
    assert done.out.count(": ok, robot ") == len(robots) >= 3
    assert done.out.count(": ok, trajectory ") == len(trajectories) >= 3
    assert vsacli("validate", *robots[:3], "-q").out == ""


@pytest.mark.parametrize("path", TRAJECTORIES, ids=lambda path: path.stem)
def test_a_trajectory_without_a_robot(vsacli: Any, path: Path) -> None:
    done = vsacli("validate", path)
    assert done.code == 0
    assert f"{path}: {NO_ROBOT}\n" in done.out


def test_each_kind_by_its_content(vsacli: Any, tmp_path: Path, feasible_result: Path, motion: Path) -> None:
    shutil.copy(ROBOT, "arm")  # names say nothing
    shutil.copy(feasible_result, "result")
    (tmp_path / "poles").write_text(POLES)
    (tmp_path / "tree").write_text("\ufeff\n<robot name='r'><link name='a'/></robot>", encoding="utf-8")
    motion.write_text(motion.read_text().replace("duration: 4.0", "duration: 0.5"))
    assert vsacli("simulate", ROBOT, motion, "-q", "-o", "simulated").code in (0, 3)
    found = {name: recognize(name) for name in ("arm", "result", "poles", "tree", "simulated", "move.yaml")}
    assert found == {
        "arm": FileKind.ROBOT,
        "result": FileKind.RESULT,
        "poles": FileKind.POLES,
        "tree": FileKind.URDF,
        "simulated": FileKind.SIMULATION,
        "move.yaml": FileKind.TRAJECTORY,
    }
    done = vsacli("validate", *found)
    assert "arm: ok, robot vsa-3r, 3 joints\n" in done.out
    assert "result: ok, result of vsa-3r, rest-to-rest, 401 samples, ok\n" in done.out
    assert "tree: ok, URDF of r, 0 joints\n" in done.out
    assert "simulated: ok, simulation of vsa-3r, " in done.out
    assert "poles: no poles for shoulder, elbow; each joint needs them\n" in done.out
    assert done.code == 2


def test_tables(vsacli: Any, tmp_path: Path) -> None:
    samples(tmp_path / "motion.csv")
    spring = REPOSITORY / "robots" / "measured_spring.csv"
    done = vsacli("validate", "motion.csv", spring, ROBOT)
    assert done.code == 0
    assert "motion.csv: ok, trajectory motion, 11 samples over 1 s\n" in done.out
    assert f"motion.csv: note: fits {ROBOT}\n" in done.out
    assert f"{spring}: ok, spring of 41 rows\n" in done.out


def test_all_problems_of_all_files(vsacli: Any, tmp_path: Path) -> None:
    edited(ROBOT, tmp_path / "arm.yaml", ("mass: 9.0478", "mas: 9.0478"), ("mass: 6.7858", "mass: -1"))
    edited(REST_TO_REST, tmp_path / "move.yaml", ("degree: 7", "degree: 6"), ("duration: 4.0", "duration: 0"))
    (tmp_path / "notes.txt").write_text("nothing of ours")
    done = vsacli("validate", "arm.yaml", "move.yaml", "notes.txt", "gone.csv")
    assert (done.code, done.err) == (2, "")
    lines = done.out.splitlines()
    assert [line.split(":")[0] for line in lines] == ["arm.yaml"] * 2 + ["move.yaml"] * 2 + [
        "notes.txt",
        "gone.csv",
    ]
    assert "unknown key 'mas'; did you mean 'mass'?" in lines[0]
    assert "duration: must be positive, not 0" in lines[2]
    assert lines[4] == (
        "notes.txt:1: expected a YAML file that begins with `format:`, one of "
        "vsacli-robot/1, vsacli-trajectory/1, vsacli-poles/1, vsacli-study/1, vsacli-columns/1"
    )
    assert lines[5] == "gone.csv: no such file"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name: a\njoints: []\n", "missing key 'format'; begin the file with `format: vsacli-robot/1`"),
        (
            "name: a\nposition: {}\n",
            "missing key 'format'; begin the file with `format: vsacli-trajectory/1`",
        ),
        (
            "name: a\n",
            "missing key 'format'; begin the file with `format: vsacli-robot/1` (or vsacli-trajectory/1, "
            "vsacli-poles/1, vsacli-study/1, vsacli-columns/1)",
        ),
        (
            "format: vsacli-robot/2\n",
            f"format: 'vsacli-robot/2' is newer than vsacli-robot/1, which vsacli {__version__} reads; "
            "update vsacli",
        ),
    ],
)
def test_a_format_that_is_missing_or_newer(vsacli: Any, tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "a.yaml").write_text(text)
    assert vsacli("validate", "a.yaml").out == f"a.yaml:1: {message}\n"


def test_as_json(vsacli: Any, tmp_path: Path) -> None:
    edited(ROBOT, tmp_path / "arm.yaml", ("mass: 9.0478", "mass: 0"), ("mass: 6.7858", "mass: 1"))
    (tmp_path / "b.yaml").write_text("format: vsacli-robots/1")
    done = vsacli("validate", "arm.yaml", "b.yaml", "gone.csv", "--json")
    assert done.code == 2
    assert json.loads(done.out) == [
        {
            "file": "arm.yaml",
            "line": 13,
            "message": "joints.base.link.mass is zero; give the mass of the link, in kg",
            "severity": "warning",
        },
        {
            "file": "b.yaml",
            "line": 1,
            "message": "format: expected one of vsacli-robot/1, vsacli-trajectory/1, vsacli-poles/1, "
            "vsacli-study/1, vsacli-columns/1, found 'vsacli-robots/1'; did you mean 'vsacli-robot/1'?",
            "severity": "error",
        },
        {"file": "gone.csv", "line": None, "message": "no such file", "severity": "error"},
    ]


def test_a_trajectory_fits_one_of_the_robots_or_none(vsacli: Any, tmp_path: Path) -> None:
    slide = REPOSITORY / "robots" / "rp_2.yaml"
    fitting = vsacli("validate", slide, ROBOT, REST_TO_REST)
    assert fitting.code == 0
    assert f"note: fits 1 of 2 robots: {ROBOT}" in fitting.out
    edited(REST_TO_REST, tmp_path / "move.yaml", ("end: [", "end: [0, "))
    done = vsacli("validate", ROBOT, slide, "move.yaml")
    assert done.code == 2
    assert "end: expected 3 values, one for each joint (base, shoulder, elbow), found 4" in done.out
    assert f"move.yaml: fits none of the 2 robots; the problems above are those with {ROBOT}\n" in done.out


def test_poles_with_integral_action_have_one_more(vsacli: Any, tmp_path: Path) -> None:
    names = ("base", "shoulder", "elbow")
    for count, code in ((4, 0), (5, 0), (6, 2)):
        position = ",".join(["-20"] * count)
        lines = [f"  - {{name: {name}, position: '{position}'}}" for name in names]
        (tmp_path / "poles.yaml").write_text("format: vsacli-poles/1\njoints:\n" + "\n".join(lines))
        assert vsacli("validate", ROBOT, "poles.yaml").code == code, count
    assert NO_ROBOT in vsacli("validate", "poles.yaml").out


def test_damage_in_the_values_of_a_result_is_found(vsacli: Any, feasible_result: Path) -> None:
    shutil.copy(feasible_result, "r.h5")
    with h5py.File("r.h5", "r+") as file:
        where = file["flags"].id.get_chunk_info(0).byte_offset
    with open("r.h5", "r+b") as raw:
        raw.seek(where)
        raw.write(b"no deflate stream")
    done = vsacli("validate", "r.h5")
    assert done.code == 2
    assert done.out.startswith("r.h5: variable flags")


def test_hdf5_of_others(vsacli: Any, tmp_path: Path) -> None:
    h5py.File(tmp_path / "other.h5", "w").close()
    (tmp_path / "text.h5").write_text("no HDF5")
    done = vsacli("validate", "other.h5", "text.h5")
    assert (
        "other.h5: is an HDF5 file, but its format is not one of vsacli-result/2, vsacli-simulation/2"
        in done.out
    )
    assert "text.h5: is not an HDF5 file; expected a result file, as invdyn or simulate writes it" in done.out


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_a_pipe_is_not_waited_for(vsacli: Any) -> None:
    os.mkfifo("pipe.h5")
    assert vsacli("validate", "pipe.h5").out == "pipe.h5: is not a regular file (a device, pipe or socket)\n"
    assert (
        vsacli("plot", "pipe.h5").err
        == "pipe.h5: is a pipe; expected a result file, as invdyn or simulate writes it\n"
    )


def joints_of(text: str, path: Path) -> list[tuple[str, str]]:
    path.write_text("format: vsacli-trajectory/1\nname: t\nduration: 1\n" + text)
    robot = placeholder_robot(path).robot
    load_trajectory(path, robot)
    return [(joint.name, joint.actuator_type) for joint in robot.joints]


SOFT, STIFF, RIGID = "antagonistic", "elastic", "rigid"


@pytest.mark.parametrize(
    ("text", "joints"),
    [
        ("position: {type: constant, value: 1}\nstiffness: {type: constant, value: 1}", [("joint_1", SOFT)]),
        (
            "position: {type: constant, value: {a: 1, b: 2}}\nstiffness: {type: constant, value: {b: 1}}",
            [("a", STIFF), ("b", SOFT)],
        ),
        (
            "position: {type: constant, value: [1, 2]}\nstiffness: {type: constant, value: [1, null]}",
            [("joint_1", SOFT), ("joint_2", STIFF)],
        ),
        (
            "position: {type: constant, value: [1, 2, 3]}\nstiffness: {type: constant, value: {joint_2: 1}}",
            [("joint_2", SOFT), ("joint_1", STIFF), ("joint_3", STIFF)],
        ),
        (
            "position: {type: polynomial, degree: 3, start: 0, end: [1, 2]}",
            [("joint_1", RIGID), ("joint_2", RIGID)],
        ),
    ],
)
def test_a_placeholder_has_the_joints_that_a_trajectory_speaks_of(
    text: str, joints: list[tuple[str, str]], tmp_path: Path
) -> None:
    assert joints_of(text, tmp_path / "move.yaml") == joints


def test_a_placeholder_has_the_joints_of_a_table(tmp_path: Path) -> None:
    robot = placeholder_robot(samples(tmp_path / "motion.csv")).robot
    assert robot.joint_names == ("base", "shoulder", "elbow")
    numbered = {f"{joint}.q": f"q{i}" for i, joint in enumerate(("base", "shoulder", "elbow"), 1)}
    numbered |= {
        f"{joint}.stiffness": f"stiffness{i}" for i, joint in enumerate(("base", "shoulder", "elbow"), 1)
    }
    assert len(placeholder_robot(samples(tmp_path / "numbered.csv", **numbered)).robot.joints) == 3


def test_what_does_not_fit_any_robot_is_found_without_one(tmp_path: Path) -> None:
    with pytest.raises(
        InputError,
        match=r"end: expected 3 values, one for each joint .*, found 2; is the file for another robot",
    ):
        joints_of(
            "position: {type: polynomial, degree: 7, start: [1, 2, 3], end: [1, 2]}", tmp_path / "m.yaml"
        )


def test_a_file_that_is_given_twice_is_checked_once(vsacli: Any) -> None:
    assert vsacli("validate", ROBOT, ROBOT).out.count("ok") == 1


def test_a_catalog_is_recognized_by_its_columns(vsacli: Any, tmp_path: Path) -> None:
    (tmp_path / "motors.csv").write_text("name,inertia,max_torque\na,1e-4,2\nb,2e-4,4\n")
    assert recognize("motors.csv") is FileKind.CATALOG
    assert vsacli("validate", "motors.csv").out == "motors.csv: ok, catalog of 2 motors\n"
    (tmp_path / "bad.csv").write_text("name,inertia,max_torque\na,0,2\n")
    assert vsacli("validate", "bad.csv").out == "bad.csv:2: inertia: must be positive, not 0 kg m^2\n"
    refused = vsacli("invdyn", ROBOT, "motors.csv")
    assert (refused.code, refused.err.startswith("motors.csv: is a motor catalog, but TRAJECTORY")) == (
        2,
        True,
    )
    assert "vsacli size ROBOT TRAJECTORY --catalog motors.csv" in vsacli("info", "motors.csv").err


def test_a_motion_beyond_its_robot_is_noted(vsacli: Any, tmp_path: Path) -> None:
    edited(REST_TO_REST, tmp_path / "move.yaml", ("start: 850", "start: 700"))
    limits = "limits: {position: [0.5, 2]}\n    actuator:"
    text = Path(ROBOT).read_text().replace("actuator:", limits, 1)
    (tmp_path / "arm.yaml").write_text(text)
    done = vsacli("validate", "arm.yaml", "move.yaml")
    advice = "check it with vsacli check-feasibility"
    assert done.code == 0
    assert done.out.splitlines()[2:] == [
        "move.yaml: note: position of base is 0 rad at t = 0.000 s, outside limits.position [0.5, 2] rad; "
        f"{advice}",
        "move.yaml: note: stiffness of base to elbow is 700 N m/rad at its lowest, below the minimum of "
        f"800 N m/rad without load; {advice}",
        "move.yaml: note: fits arm.yaml",
    ]


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_nothing_is_noted_of_bundled_motions(example: Any) -> None:
    for each in example.trajectories:
        assert list(unattainable(example.robot, load_trajectory(each.path, example.robot))) == []
