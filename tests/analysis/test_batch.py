"""Runs of a batch are what each is alone: robots that differ in numbers, along motions of any duration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from samples.marks import slow_but
from samples.robots import vsa_3r
from samples.shipped import shipped_run
from samples.trees import tree_run
from samples.valid_runs import valid_run

from vsacli import Robot, Trajectory, inverse_dynamics
from vsacli.analysis.batch import Batch
from vsacli.analysis.run import Run
from vsacli.analysis.variant_groups import PreparedRun, batches, numbers_as_rows
from vsacli.base.json_records import JsonObject
from vsacli.base.variables import Block
from vsacli.documents.record_values import with_numbers
from vsacli.robot.parameters import Parameter, numbers_of_robot, parameters
from vsacli.trajectory.times import UniformTimes

BUNDLED = [
    *("awas_1r", "cam_1r", "coupled_1r", "hand_3x2r", "hardening_1r", "maccepa_1r", "maccepa_vd_1r"),
    *("measured_1r", "mixed_3r", "panda_7r", "planar_2r", "puma_560", "rp_2", "scara_4", "shifted_cams_1r"),
    *("sliding_anchor_1r", "tendon_1r", "torso_2x3r", "ur5_6r"),
]
"""Robots with a trajectory of their name, with every kind of actuator."""

VARIANTS = 5
PEAK_SHARE = 1e-13
"""Deviation of a variable, relative to its peak: exact zeros and ones of constants are computed as rows."""


def drawn_run(seed: int) -> tuple[Robot, Trajectory]:
    """A chain or tree with actuators of any kind, prismatic joints and wrenches among them."""
    if seed % 2:
        return valid_run(seed)
    robot, motion = tree_run(seed, joints=2 + seed % 5)
    return robot, motion.trajectory(robot)


def drawn_variants(
    robot: Robot, trajectory: Trajectory, seed: int
) -> tuple[list[PreparedRun], Sequence[Parameter]]:
    """Robots with other values of some numbers, and motions of other durations with as many samples."""
    rng = np.random.default_rng(seed)
    available = list(numbers_of_robot(robot))
    chosen = [available[place] for place in rng.permutation(len(available))[:8]]
    varied = numbers_as_rows(robot, trajectory, chosen)
    runs = []
    for _ in range(VARIANTS):
        values = [each.value * (1 + 0.02 * rng.standard_normal()) for each in varied]
        runs.append(
            PreparedRun(with_numbers(robot, varied, values), stretched(trajectory, rng.choice([1, 1.5])))
        )
    return runs, varied


def stretched(trajectory: Trajectory, factor: float) -> Trajectory:
    """The motion in another duration, with as many samples."""
    times = UniformTimes(
        factor * trajectory.duration, (trajectory.samples - 1) / trajectory.duration / factor
    )
    changed = trajectory.changed(lambda _, profile: profile.stretched(factor), times)
    assert changed.samples == trajectory.samples
    return changed


def assert_equal_blocks(one: Block, other: Block) -> None:
    assert np.array_equal(one.flags, other.flags)
    for name, array in one.arrays().items():
        alone = getattr(other, name)
        peak = np.max(np.abs(alone), where=np.isfinite(alone), initial=0.0)
        np.testing.assert_allclose(array, alone, rtol=0, atol=PEAK_SHARE * peak, err_msg=name)


def assert_equal_reports(one: JsonObject, other: JsonObject) -> None:
    """The reports of JSON, whose numbers may differ by rounding; without the residuals of the self-check."""
    if isinstance(other, dict):
        assert one.keys() == other.keys()
        for key in other.keys() - {"self_check"}:
            assert_equal_reports(one[key], other[key])
    elif isinstance(other, list):
        assert len(one) == len(other)
        for pair in zip(one, other, strict=True):
            assert_equal_reports(*pair)
    elif isinstance(other, float):
        # A margin is a difference of stiffnesses, and so known to their rounding.
        assert one == pytest.approx(other, rel=1e-11, abs=1e-12, nan_ok=True)
    else:
        assert one == other


@pytest.mark.cases(4)
@pytest.mark.parametrize("seed", slow_but([1, 2], range(40)))
def test_a_batch_gives_what_each_run_gives(seed: int) -> None:
    robot, trajectory = drawn_run(seed)
    runs, varied = drawn_variants(robot, trajectory, seed)
    for variants, members in batches(runs, varied):
        batch = Batch(variants, [runs[index].trajectory for index in members])
        (block,) = batch
        for number, (index, own) in enumerate(zip(members, block.divided(len(members)), strict=True)):
            alone = Run(*runs[index], block_samples=10**6)
            (expected,) = alone
            assert_equal_blocks(own, expected)
            assert_equal_reports(batch.findings(number).as_json(), alone.findings(0).as_json())


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", slow_but(["coupled_1r"], BUNDLED))
def test_all_numbers_that_can_be_rows_differ_at_once(name: str) -> None:
    robot, trajectory = shipped_run(name, name)
    trajectory = trajectory.sampled(UniformTimes(trajectory.duration, 20 / trajectory.duration))
    varied = numbers_as_rows(robot, trajectory, list(numbers_of_robot(robot)))
    rng = np.random.default_rng(0)
    robots = [
        with_numbers(robot, varied, [(each.value or 0.01) * rng.uniform(0.98, 1.02) for each in varied])
        for _ in range(3)
    ]
    for variants, members in batches([PreparedRun(each, trajectory) for each in robots], varied):
        batch = Batch(variants, [trajectory] * len(members))
        (block,) = batch
        for number, (index, own) in enumerate(zip(members, block.divided(len(members)), strict=True)):
            alone = Run(robots[index], trajectory, block_samples=10**6)
            (expected,) = alone
            assert_equal_blocks(own, expected)
            assert_equal_reports(batch.findings(number).as_json(), alone.findings().as_json())


def test_variants_are_one_batch_and_other_structures_their_own() -> None:
    robot, trajectory = vsa_3r(), shipped_run("vsa_3r", "rest_to_rest")[1]
    heavy, limited = (
        robot.replace("joints.elbow.link.mass", 4),
        robot.replace("joints.elbow.actuator.motor.max_torque", 300),
    )
    varied = numbers_as_rows(robot, trajectory, parameters(robot, ["joints.*.link.mass"]))
    coarse = trajectory.sampled(UniformTimes(trajectory.duration, 100))
    runs = [PreparedRun(each, coarse) for each in (robot, limited, heavy)]
    found = list(batches([*runs, PreparedRun(robot, trajectory)], varied))
    assert [members for _, members in found] == [[0, 2], [1], [3]]


@pytest.mark.parametrize(
    ("robot", "path"),
    [
        ("maccepa_1r", "joints.elbow.actuator.mechanism.k"),  # enters tables
        ("puma_560", "joints.waist.actuator.motor.gear_ratio"),  # its sign exchanges both sizes of friction
    ],
)
def test_numbers_that_decide_on_the_equations_are_no_rows(robot: str, path: str) -> None:
    arm, trajectory = shipped_run(robot, robot)
    chosen = parameters(arm, [path, "joints.*.link.mass"])
    assert path not in map(str, numbers_as_rows(arm, trajectory, chosen))
    assert len(numbers_as_rows(arm, trajectory, chosen)) == len(chosen) - 1


def test_a_right_angle_is_exact_only_alone() -> None:
    robot, trajectory = shipped_run("vsa_3r", "rest_to_rest")
    varied = numbers_as_rows(robot, trajectory, parameters(robot, ["joints.base.dh.alpha"]))
    robots = [robot.replace("joints.base.dh.alpha", angle) for angle in ("89 deg", "90 deg", "91 deg")]
    found = batches([PreparedRun(each, trajectory) for each in robots], varied)
    assert [members for _, members in found] == [[0, 2], [1]]


def test_a_zero_and_an_infinite_limit_are_constants() -> None:
    robot, trajectory = shipped_run("vsa_3r", "rest_to_rest")
    robot = robot.replace({"joints.base.link.com.1": 0.1, "joints.base.actuator.motor.max_torque": 300})
    paths = ["joints.base.link.com.1", "joints.base.actuator.motor.max_torque"]
    numbers = {str(each): each for each in numbers_of_robot(robot)}
    varied = numbers_as_rows(robot, trajectory, [numbers[path] for path in paths])
    assert len(varied) == 2
    values = [(0.1, 300), (0.0, 300), (0.2, np.inf), (0.3, 200), (0.0, 100)]
    runs = [PreparedRun(with_numbers(robot, varied, each), trajectory) for each in values]
    assert [members for _, members in batches(runs, varied)] == [[0, 3], [1, 4], [2]]


def test_limits_differ_in_a_batch() -> None:
    """Some of the variants exceed theirs, at samples and between them."""
    robot, trajectory = shipped_run("vsa_3r", "rest_to_rest")
    trajectory = trajectory.sampled(UniformTimes(trajectory.duration, 20))
    peaks = {joint.name: joint for joint in inverse_dynamics(robot, trajectory).report.joints}
    limits = {
        f"joints.{name}.{path}": limit
        for name, joint in peaks.items()
        for path, limit in (
            ("actuator.motor.max_torque", max(joint.peak_tau_motor)),
            ("actuator.motor.max_velocity", max(joint.peak_dtheta)),
            ("limits.stiffness", [joint.commanded_min, joint.commanded_max]),
        )
    }
    robot = robot.replace(limits)
    bounds = [
        number
        for number in numbers_of_robot(robot)
        if not {"limits", "max_torque", "max_velocity"}.isdisjoint(number.path)
    ]
    varied = numbers_as_rows(robot, trajectory, bounds)
    assert len(varied) == 12
    rng = np.random.default_rng(3)
    robots = [
        with_numbers(robot, varied, [each.value * scale * rng.uniform(1, 1.01) for each in varied])
        for scale in (0.99, 0.995, 1, 1, 1.01)
    ]
    ((variants, _),) = batches([PreparedRun(each, trajectory) for each in robots], varied)
    batch = Batch(variants, [trajectory] * len(robots))
    list(batch)
    reports = [batch.findings(number) for number in range(len(robots))]
    for each, report in zip(robots, reports, strict=True):
        alone = Run(each, trajectory)
        list(alone)
        assert_equal_reports(report.as_json(), alone.findings().as_json())
    kinds = [frozenset(kind for joint in report.joints for kind in joint.worst) for report in reports]
    assert len(set(kinds)) > 2
    assert any(
        worst.between for report in reports for joint in report.joints for worst in joint.worst.values()
    )


def test_tools_with_limits_are_in_a_batch() -> None:
    robot, trajectory = shipped_run("torso_2x3r", "torso_2x3r")
    limited = f"tools.{robot.tool_names[0]}.min_stiffness"
    robots = [robot.replace({limited: 600.0, "joints.*.link.mass": mass}) for mass in (2, 2.2, 2.4)]
    varied = numbers_as_rows(robots[0], trajectory, parameters(robots[0], ["joints.*.link.mass"]))
    ((variants, _),) = batches([PreparedRun(each, trajectory) for each in robots], varied)
    batch = Batch(variants, [trajectory] * 3)
    (block,) = batch
    for number, part in enumerate(block.divided(3)):
        alone = Run(robots[number], trajectory, block_samples=10**6)
        (expected,) = alone
        assert np.array_equal(part.tool_flags, expected.tool_flags)
        assert_equal_reports(batch.findings(number).as_json(), alone.findings().as_json())
    assert batch.findings().tools[0].samples["over_limit"] > 0


def test_a_recorded_motion_is_alone() -> None:
    robot, trajectory = shipped_run("vsa_3r", "rest_to_rest")
    times = np.linspace(0, trajectory.duration, 401)
    motion = trajectory.at(times)
    noise = 1e-5 * np.random.default_rng(0).standard_normal(motion.q.shape)
    recorded = Trajectory.from_samples(times, motion.q + noise, motion.commanded["stiffness"], fit="smooth")
    masses = parameters(robot, ["joints.*.link.mass"])
    assert numbers_as_rows(robot, recorded, masses) == ()
    runs = [PreparedRun(robot, recorded)] * 2
    assert [members for _, members in batches(runs, masses)] == [[0], [1]]
