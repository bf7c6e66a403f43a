"""Compiled code beside NumPy: every variable, at every kind of step, for every kind of robot."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from samples.drives import ALIKE, joint_with, motion, springs
from samples.engines import assert_agree, demands, kinds_of_steps, program, random_wrench
from samples.marks import needs_compiler, slow, slow_but
from samples.robots import MotionArrays, random_motion, random_robot, vsa_3r

from vsacli import Antagonistic, Flag, Robot, laws, link_torques, load_robot
from vsacli.analysis.run import Run
from vsacli.compute.engine import choose_engine
from vsacli.compute.engine.engines import Engine
from vsacli.dynamics.deflection_rows import IntegratedRows
from vsacli.dynamics.inverse import InverseDynamics, block_of, compute_block

pytestmark = needs_compiler

ROBOTS = Path(__file__).parents[2] / "robots"
SAMPLES = 400


@pytest.fixture(autouse=True, scope="module")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("programs")


@pytest.fixture
def quickly(programs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile without optimization, for code that is run on a few samples only."""
    monkeypatch.setenv("CC", str(program(programs, "quickcc", 'exec cc "$@" -O0')))


def compiled(robot: Robot, threads: int = 1, frame: str | None = None) -> Engine:
    return choose_engine("c", InverseDynamics(robot, frame), 1, threads).engine


def one_joint(*two_laws: laws.SpringLaw) -> Robot:
    return Robot(name="one-joint", joints=(joint_with(springs(*two_laws)),))


@pytest.mark.slow
@pytest.mark.usefixtures("quickly")
@pytest.mark.parametrize(
    "name", ["vsa_3r", "rp_2", "mixed_3r", "tendon_1r", slow("maccepa_1r"), slow("cam_1r")]
)
def test_example_robots_agree(name: str):
    robot = load_robot(ROBOTS / f"{name}.yaml")
    motion = demands(robot, SAMPLES)
    assert_agree(compute_block(robot, motion, engine=compiled(robot)), compute_block(robot, motion))


@pytest.mark.slow
def test_seven_joints_agree():
    """With the flags of a real run: contracted and vectorized."""
    robot = load_robot(ROBOTS / "lwr_7r_vsa.yaml")
    motion = demands(robot, 5000)
    expected = compute_block(robot, motion)
    steps = kinds_of_steps(expected)
    assert all(steps[flag] > 100 for flag in (Flag.INFEASIBLE, Flag.SINGULAR, Flag.NEAR_SINGULAR))
    assert_agree(compute_block(robot, motion, engine=compiled(robot)), expected)


PAIRS = {
    "cubic": (ALIKE, ALIKE),
    "cubics": (ALIKE, laws.Cubic(k=440, k_c=2000)),
    "polynomial": (laws.Polynomial(c1=400, c3=900, c5=9000), laws.Polynomial(c1=400, c3=900, c5=9000)),
    "sinh": (laws.Sinh(k=5, a=7), laws.Sinh(k=6, a=7)),
    "sinhs": (laws.Sinh(k=5, a=7), laws.Sinh(k=6, a=8)),
    "exponential": (laws.Exponential(c=5, a=7), laws.Exponential(c=5, a=7)),
    "quadratic": (laws.Quadratic(k=800), laws.Quadratic(k=800)),
    "four_bar": (laws.FourBar(k=400, ratio=1.5), laws.FourBar(k=400, ratio=1.5)),
}


STRETCH_MARGIN = {"stiffness_max": 1e-9}
"""At the end of the four-bar's domain one unit in the last place of a deflection changes it by 1e-10."""


@pytest.mark.cases(2)
@pytest.mark.usefixtures("quickly")
@pytest.mark.parametrize("pair", slow_but({"cubic", "sinh", "exponential", "quadratic"}, PAIRS))
def test_spring_laws_agree(pair: str):
    robot = one_joint(*PAIRS[pair])
    motion = demands(robot, SAMPLES)
    expected = compute_block(robot, motion)
    steps = kinds_of_steps(expected)
    assert SAMPLES / 40 < steps[Flag.INFEASIBLE] < SAMPLES / 2
    found = compute_block(robot, motion, engine=compiled(robot))
    assert_agree(found, expected, STRETCH_MARGIN if pair == "four_bar" else None)


@pytest.mark.slow
@pytest.mark.usefixtures("quickly")
def test_measured_springs_agree():
    robot = load_robot(ROBOTS / "measured_1r.yaml")
    motion = demands(robot, SAMPLES)
    assert_agree(compute_block(robot, motion, engine=compiled(robot)), compute_block(robot, motion))


@pytest.mark.slow
@pytest.mark.usefixtures("quickly")
def test_other_branch_and_followed_deflections_agree():
    robot = one_joint(ALIKE, ALIKE)
    actuator = robot.joints[0].actuator
    assert isinstance(actuator, Antagonistic)
    turned = Robot(name="turned", joints=(joint_with(replace(actuator, branch="negative")),))
    motion = demands(turned, SAMPLES)
    expected = compute_block(turned, motion)
    assert_agree(compute_block(turned, motion, engine=compiled(turned)), expected)
    integrated = {"phi": np.moveaxis(expected.phi, 0, -1).reshape(2, -1) * 1.001}
    kernel = InverseDynamics(turned, prescribed=(IntegratedRows(),))
    engine = choose_engine("c", kernel, 1, 1).engine
    found = block_of(kernel, motion, engine, integrated)
    assert_agree(found, block_of(kernel, motion, further=integrated))


@pytest.mark.slow
@pytest.mark.usefixtures("quickly")
@pytest.mark.parametrize("frame", ["end_effector", "base"])
def test_wrench_counts_in_either_frame(frame: str):
    robot = load_robot(ROBOTS / "rp_2.yaml")
    wrench = random_wrench(SAMPLES, frame)
    motion = demands(robot, SAMPLES, wrench=wrench)
    found = compute_block(robot, motion, engine=compiled(robot, frame=frame))
    assert_agree(found, compute_block(robot, motion))
    assert not np.allclose(found.tau_e, compute_block(robot, demands(robot, SAMPLES)).tau_e)


@pytest.mark.slow
@pytest.mark.usefixtures("quickly")
def test_robots_that_differ_in_a_limit_alone_are_told_apart():
    """The springs have equal torques, so that pairs of them are alike."""
    motion = demands(one_joint(ALIKE, ALIKE), SAMPLES)
    beyond = []
    for largest in (0.3, 0.4):
        limited = replace(ALIKE, max_deflection=largest)
        robot = one_joint(limited, limited)
        expected = compute_block(robot, motion)
        beyond.append(kinds_of_steps(expected)[Flag.DEFLECTION_LIMIT])
        assert_agree(compute_block(robot, motion, engine=compiled(robot)), expected)
    assert beyond[0] > beyond[1] > 0


def joined(robot: Robot, motion: MotionArrays, starts: list[int]) -> np.ndarray:
    parts = [
        np.array(link_torques(robot, *(array[start:stop] for array in motion), engine="c"))
        for start, stop in zip(starts, [*starts[1:], None], strict=True)
    ]
    return np.concatenate(parts, axis=1)


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() != "x86_64", reason="names processors of that kind")
@pytest.mark.parametrize("processor", ["x86-64", slow("haswell")])
def test_shorter_vectors_agree(processor: str, programs: Path, monkeypatch: pytest.MonkeyPatch):
    """2 lanes without, 4 with functions of math.h for vectors; any number of samples is left over."""
    monkeypatch.setenv("CC", str(program(programs, f"cc-{processor}", f'exec cc "$@" -march={processor}')))
    robot = one_joint(ALIKE, laws.Cubic(k=440, k_c=2000))
    for samples in (SAMPLES, SAMPLES + 1, 3):
        motion = demands(robot, samples)
        assert_agree(compute_block(robot, motion, engine=compiled(robot)), compute_block(robot, motion))


@pytest.mark.slow
def test_results_depend_neither_on_blocks_nor_on_threads():
    """To the last bit: each sample is computed by the same instructions, in whatever lane."""
    robot = random_robot("RPR", seed=4)
    motion = random_motion(robot, 8207, seed=1)
    whole = np.array(link_torques(robot, *motion, engine="c"))
    np.testing.assert_array_equal(joined(robot, motion, [0, 1, 3, 6, 10, 17, 26, 4097]), whole)
    kernel = InverseDynamics(robot)
    demanded = demands(robot, 8207)
    one, three = (
        compute_block(robot, demanded, engine=choose_engine("c", kernel, 1, threads).engine)
        for threads in (1, 3)
    )
    for name, array in one.arrays().items():
        np.testing.assert_array_equal(three.arrays()[name], array)


@pytest.mark.slow
@pytest.mark.usefixtures("quickly")
@pytest.mark.parametrize("stop", [False, True])
def test_runs_depend_neither_on_blocks_nor_on_threads(stop: bool):
    """Nor does what they sum up and report, although a thread computes ahead of it."""
    infeasible = motion(stiffness=(850, 850, 830), end_stiffness=(850, 850, 790), duration=2)
    runs = [
        Run(vsa_3r(), infeasible, engine="c", threads=threads, block_samples=samples, stop_on_infeasible=stop)
        for threads, samples in ((1, 1000), (2, 7), (3, 64))
    ]
    one, *others = ([block.arrays() for block in run] for run in runs)
    assert runs[0].report().verdict == "infeasible"
    for run, blocks in zip(runs[1:], others, strict=True):
        assert len(blocks) > 1
        for name, array in one[0].items():
            np.testing.assert_array_equal(np.concatenate([block[name] for block in blocks]), array)
        assert run.report().as_json() == runs[0].report().as_json()


@pytest.mark.slow
def test_link_torques_of_no_samples():
    empty = np.empty((0, 3))
    for torques in link_torques(vsa_3r(), *[empty] * 5, engine="c"):
        assert torques.shape == (0, 3)


def test_memory_layout_does_not_matter():
    robot = vsa_3r()
    motion = random_motion(robot, 20, seed=2)
    strided = [np.repeat(array, 2, axis=0)[::2] for array in motion]
    np.testing.assert_array_equal(
        link_torques(robot, *strided, engine="c"), link_torques(robot, *motion, engine="c")
    )
