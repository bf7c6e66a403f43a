"""The profile of a fix as a trajectory file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from samples.fixes import pushed, rest_to_rest, written
from samples.robots import vsa_3r

from vsacli import InputError, StorageError, Trajectory, inverse_dynamics, load_trajectory
from vsacli.base.outputs import Outputs
from vsacli.base.signals import POSITION, WRENCH
from vsacli.studies.search import Fix, check_fixed_target
from vsacli.studies.search.acceptance import Acceptance, verify_fix
from vsacli.studies.search.changed_motion import with_changed_stiffness
from vsacli.studies.search.task import AS_IT_IS, Task
from vsacli.trajectory.curves import ConstantProfile, RestToRest
from vsacli.trajectory.curves.steps import profile_of_levels
from vsacli.trajectory.curves.via_points import ViaPoints
from vsacli.trajectory.profile import WrenchProfile


def still_and_soft():
    trajectory = rest_to_rest(1.0, 790.0, end=(0.0, 0.0, 0.0), rate=200)
    position = ConstantProfile(signal=POSITION, span=trajectory.times.span, value=(0.1, 1e-5, -2.0))
    return Trajectory(trajectory.times, position, trajectory.commanded, name="still: & 'soft'")


def samples_of(trajectory, *given):
    motion = trajectory.block(0, trajectory.samples)
    columns = {name: motion.of_joints[name] for name in given}
    if motion.wrench is not None:
        columns |= {"wrench": motion.wrench.wrench, "wrench_frame": motion.wrench.frame}
    return Trajectory.from_samples(motion.time + 3.0, motion.q, motion.commanded["stiffness"], **columns)


def through_points(trajectory):
    """The motion through a point, with a wrench in steps: formulas with times."""
    span, nothing = trajectory.times.span, (0.0,) * 6
    points = ((0.0, 0.0, 0.0), (0.1, 0.1, -0.1), (0.1, 0.3, 0.2))
    position = ViaPoints(signal=POSITION, span=span, degree=9, shares=(0.0, 0.6, 1.0), points=points)
    push = profile_of_levels(WRENCH, span, 5, [nothing, (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)], [(0.1, 0.4)])
    return Trajectory(
        trajectory.times, position, trajectory.commanded, wrench=WrenchProfile(push, "base"), name="via"
    )


SOFT = rest_to_rest(0.5, rate=200)
TASKS = {
    "polynomial": SOFT,
    "constant": still_and_soft(),
    "recorded": samples_of(SOFT),
    "recorded with derivatives": samples_of(SOFT, "dq", "ddq", "d3q", "d4q"),
    "via points and steps": through_points(SOFT),
    "pushed": pushed(SOFT),
    "pushed and recorded": samples_of(pushed(SOFT, "end_effector")),
}


def fixed(trajectory):
    """A fix that a run confirms; each pass misses the margin by a tenth of the one before."""
    task = Task(Acceptance(vsa_3r(), 0.01), trajectory)
    for _ in range(6):
        fix = task.with_profiles(AS_IT_IS)
        _, short = verify_fix(task.acceptance, fix)
        if short is None:
            return fix
        task = replace(
            task, acceptance=replace(task.acceptance, between=np.union1d(task.acceptance.between, short))
        )
    raise AssertionError("no pass was confirmed")


@pytest.mark.cases(3)
@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS)
def test_files_read_back_bit_for_bit_and_run_clean(tmp_path, task):
    robot, fix = vsa_3r(), fixed(TASKS[task])
    trajectory, paths = fix.trajectory, written(fix, tmp_path / "fixed.yaml")
    assert paths == (tmp_path / "fixed.yaml", tmp_path / "fixed.csv")
    assert sorted(tmp_path.iterdir()) == sorted(paths)
    again = load_trajectory(paths[0], robot)
    assert again.name == trajectory.name
    # what was recorded is fitted again
    expected = ("beyond its via points", "spline") if trajectory.estimates else ("beyond its via points",)
    assert all(any(each in warning for each in expected) for warning in again.warnings), again.warnings
    before, after = (each.block(0, each.samples) for each in (trajectory, again))
    assert after.variables().keys() == before.variables().keys()
    for name, array in after.variables().items():
        # shares of the span and times are rounded differently
        expected = before.variables()[name]
        bound = 1e-12 * np.abs(expected).max() if task == "via points and steps" else 0.0
        np.testing.assert_allclose(array, expected, rtol=0, atol=bound)
    report = inverse_dynamics(robot, again).report
    assert report.verdict == "ok"
    assert all(joint.samples["near_singular"] == 0 for joint in report.joints)


@pytest.mark.slow
@pytest.mark.parametrize(("task", "kind"), [("polynomial", RestToRest), ("constant", ConstantProfile)])
def test_position_stays_a_formula(tmp_path, task, kind):
    robot = vsa_3r()
    path, table = written(fixed(TASKS[task]), tmp_path / "fixed.yml")
    assert load_trajectory(path, robot).position == TASKS[task].position
    assert isinstance(TASKS[task].position, kind)
    assert ".q" not in table.read_text().splitlines()[0]


def test_many_steps_are_written_block_by_block(tmp_path):
    robot = vsa_3r()
    trajectory = with_changed_stiffness(rest_to_rest(4.0, rate=5000), {1: np.ones((3, 20_001))})
    path, _ = written(Fix(0.0, robot, trajectory), tmp_path / "long.yaml")
    again = load_trajectory(path, robot)
    assert again.samples == 20_001
    np.testing.assert_array_equal(
        again.block(0, 20_001).commanded["stiffness"], [[850.0, 851.0, 850.0]] * 20_001
    )


@pytest.mark.parametrize("existing", ["fixed.yaml", "fixed.csv"])
def test_neither_file_is_replaced_unless_asked(tmp_path, existing):
    (tmp_path / existing).write_text("mine")
    robot = vsa_3r()
    fix = Fix(0.0, robot, with_changed_stiffness(SOFT, {}))
    for act in (
        lambda: check_fixed_target(tmp_path / "fixed.yaml", Outputs(overwrite=False)),
        lambda: written(fix, tmp_path / "fixed.yaml"),
    ):
        with pytest.raises(StorageError, match=rf"{existing}: exists already; .*--overwrite"):
            act()
    assert [path.name for path in tmp_path.iterdir()] == [existing]
    assert (tmp_path / existing).read_text() == "mine"
    written(fix, tmp_path / "fixed.yaml", overwrite=True)
    assert load_trajectory(tmp_path / "fixed.yaml", robot).samples == SOFT.samples


@pytest.mark.parametrize("name", ["fixed", "fixed.csv", "fixed.h5"])
def test_name_must_be_that_of_a_yaml_file(tmp_path, name):
    with pytest.raises(InputError, match=rf"{name}: .*give a name that ends in \.yaml"):
        check_fixed_target(tmp_path / name, Outputs(overwrite=True))
