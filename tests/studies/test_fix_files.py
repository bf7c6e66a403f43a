"""The files of fixes: slower formulas and recordings, robots with another branch."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.fixes import written

from vsacli import InputError, Trajectory, load_robot, load_trajectory
from vsacli.studies.search import Fix
from vsacli.studies.search.changed_motion import with_raised_stiffness
from vsacli.studies.search.fix_report import OtherBranch

FACTOR = 1.4142
ROBOT = REPOSITORY / "robots" / "vsa_3r.yaml"
FORMULAS = ("rest_to_rest", "vsa_3r_via", "vsa_3r_pick_and_place", "vsa_3r_excitation")


def shipped(name: str) -> Trajectory:
    return load_trajectory(REPOSITORY / "trajectories" / f"{name}.yaml", load_robot(ROBOT))


def same(one: Trajectory, other: Trajectory, bound: float) -> None:
    """Equal at every step, within a share of the peak of each variable."""
    assert one.samples == other.samples
    before, after = (each.block(0, each.samples).variables() for each in (one, other))
    assert before.keys() == after.keys()
    for name, expected in before.items():
        np.testing.assert_allclose(after[name], expected, rtol=0, atol=bound * np.abs(expected).max())


@pytest.mark.parametrize("name", FORMULAS)
def test_slower_and_stiffer_formulas_stay_formulas(tmp_path: Path, name: str) -> None:
    robot, trajectory = load_robot(ROBOT), shipped(name)
    fixed = with_raised_stiffness(trajectory.stretched(FACTOR), {1: 12.5})
    paths = written(Fix(0.0, robot, fixed), tmp_path / "fixed.yaml")
    assert paths == (tmp_path / "fixed.yaml",)
    # shares of the duration and times are rounded differently; up to four derivatives are taken
    same(fixed, load_trajectory(paths[0], robot), 1e-10)
    stiffness = fixed.block(0, 1).commanded["stiffness"] - trajectory.block(0, 1).commanded["stiffness"]
    np.testing.assert_array_equal(stiffness, [[0.0, 12.5, 0.0]])


@pytest.mark.slow
def test_slower_recordings_have_scaled_derivatives_and_wrench(tmp_path: Path) -> None:
    robot, declared = load_robot(ROBOT), shipped("vsa_3r_pick_and_place")
    motion = declared.block(0, declared.samples)
    assert motion.wrench is not None
    recorded = Trajectory.from_samples(
        motion.time + 2.0,
        motion.q,
        motion.commanded["stiffness"],
        wrench=motion.wrench.wrench,
        wrench_frame="base",
        **{name: motion.of_joints[name] for name in ("dq", "ddq", "d3q", "d4q", "dstiffness", "ddstiffness")},
    )
    paths = written(Fix(0.0, robot, recorded.stretched(FACTOR)), tmp_path / "fixed.yaml")
    assert paths == (tmp_path / "fixed.yaml", tmp_path / "fixed.csv")
    again = load_trajectory(paths[0], robot)
    slower = again.block(0, again.samples)
    assert (slower.time[0], slower.time[-1]) == (2.0, pytest.approx(2.0 + FACTOR * 8.5))
    for order, name in enumerate(("q", "dq", "ddq", "d3q", "d4q")):
        expected = motion.of_joints[name] / FACTOR**order
        np.testing.assert_allclose(slower.of_joints[name], expected, rtol=1e-12)
    assert slower.wrench is not None
    np.testing.assert_array_equal(slower.wrench.wrench, recorded.block(0, recorded.samples).wrench.wrench)
    peak = np.abs(motion.wrench.dwrench).max() / FACTOR
    # the spline through the samples stands in for the derivatives that were not given
    np.testing.assert_allclose(slower.wrench.dwrench, motion.wrench.dwrench / FACTOR, atol=1e-3 * peak)


def fix_with(robot_path: Path, joint: str, branch: str) -> Fix:
    robot = load_robot(robot_path)
    changed = robot.replace(f"joints.{joint}.actuator.branch", branch)
    trajectory = load_trajectory(REPOSITORY / "trajectories" / f"{robot_path.stem}.yaml", robot)
    return Fix(0.0, changed, trajectory, branch=OtherBranch({joint: branch}))


def test_robot_with_another_branch_keeps_its_comments(tmp_path: Path) -> None:
    source = REPOSITORY / "robots" / "lwr_7r_vsa.yaml"
    trajectory = load_trajectory(REPOSITORY / "trajectories" / "lwr_7r.yaml", load_robot(source))
    robot = load_robot(source).replace("joints.elbow.actuator.branch", "negative")
    fix = Fix(0.0, robot, trajectory, branch=OtherBranch({"elbow": "negative"}))
    paths = written(fix, tmp_path / "fixed.yaml")
    assert paths[-1] == tmp_path / "fixed-robot.yaml"
    again = load_robot(paths[-1])
    assert [joint.actuator for joint in again.joints] == [joint.actuator for joint in robot.joints]
    before, after = (path.read_text().splitlines() for path in (source, paths[-1]))
    assert [line for line in after if line not in before] == ["      branch: negative"]
    assert [line for line in before if line not in after] == []


def test_branch_of_a_mechanism_is_changed_where_it_stands(tmp_path: Path) -> None:
    text = (REPOSITORY / "robots" / "shifted_cams_1r.yaml").read_text()
    (tmp_path / "cams.yaml").write_text(
        text.replace("type: shifted_cams", "type: shifted_cams\n        branch: positive")
    )
    trajectory = load_trajectory(
        REPOSITORY / "trajectories" / "shifted_cams_1r.yaml", robot := load_robot(tmp_path / "cams.yaml")
    )
    changed = robot.replace("joints.elbow.actuator.mechanism.branch", "negative")
    fix = Fix(0.0, changed, trajectory, branch=OtherBranch({"elbow": "negative"}))
    *_, path = written(fix, tmp_path / "fixed.yaml")
    assert load_robot(path).joints == changed.joints


@pytest.mark.slow
def test_files_that_the_robot_names_are_found_from_elsewhere(tmp_path: Path) -> None:
    fix = fix_with(REPOSITORY / "robots" / "measured_1r.yaml", "elbow", "negative")
    *_, path = written(fix, tmp_path / "fixed.yaml")
    assert load_robot(path).joints[0].actuator.branch == "negative"


@pytest.mark.slow
def test_robot_that_has_no_file_cannot_be_written(tmp_path: Path) -> None:
    fix = fix_with(REPOSITORY / "robots" / "measured_1r.yaml", "elbow", "negative")
    fix = dataclasses.replace(fix, robot=dataclasses.replace(fix.robot, sources=()))
    with pytest.raises(InputError, match="measured-1r: was not read from a file that could be changed"):
        written(fix, tmp_path / "fixed.yaml")
    assert not list(tmp_path.iterdir())
