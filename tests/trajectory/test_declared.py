"""Via points, sinusoids, sequences and steps in trajectory files: what they mean, and what is refused."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from samples.trajectories import (
    DWELL,
    FIRM,
    GO,
    HEAD,
    LASTING,
    ON,
    PUSH,
    ROOT,
    SEQUENCE,
    SINUSOIDS,
    SOFTENING,
    STANDING,
    STEPS,
    SWINGING,
    VIA,
    load,
    problems,
)

from vsacli import InputError, inverse_dynamics, load_robot, load_trajectory

pytestmark = pytest.mark.usefixtures("own_folder")


def test_via_points_are_passed_at_their_times_and_give_the_duration():
    trajectory = load(HEAD + "rate: 100\n" + VIA + "  times: [0, 1.5, 2.5]\n" + FIRM)
    assert (trajectory.samples, trajectory.duration, trajectory.warnings) == (251, 2.5, ())
    passed = trajectory.at(np.array([0, 1.5, 2.5]))
    np.testing.assert_array_equal(passed.q, [[0, 0], [math.radians(60), 0.2], [1, 0.1]])
    for derivative in (passed.dq, passed.ddq, passed.d3q):
        assert not derivative[[0, 2]].any()
        assert derivative[1].all()


def test_times_that_are_not_given_are_derived_and_reported():
    text = LASTING + "position: {type: via, degree: 9, points: [0, 0.1, 0.2]}\n" + SOFTENING
    trajectory = load(text)
    assert "position: passes its via points at t = 0, 2, 4 s" in trajectory.notes
    assert "stiffness: passes its via points at t = 0, 2, 4 s" in trajectory.notes
    assert trajectory.warnings == ()
    np.testing.assert_array_equal(trajectory.at(np.array([2.0])).commanded["stiffness"], [[900, 8000]])


def test_of_many_derived_times_the_first_and_last_are_reported():
    points = ", ".join(str(0.1 * k) for k in range(30))
    [note] = load(LASTING + f"position: {{type: via, degree: 7, points: [{points}]}}\n" + FIRM).notes
    assert re.fullmatch(r"position: passes .* at t = 0(, [\d.]+){5}, \.\.\.(, [\d.]+){5}, 4 s", note)


def test_a_spline_that_goes_far_beyond_its_points_is_reported():
    points = "[[0, 0], [1, 0], [1.001, 0], [0, 0]]"
    text = f"position: {{type: via, degree: 7, points: {points}, times: [0, 1, 3, 4]}}\n"
    [warning] = load(HEAD + text + FIRM).warnings
    found = re.fullmatch(r"position: arm goes ([\d.]+) rad beyond its via points, at t = ([\d.]+) s", warning)
    assert found
    trajectory = load(HEAD + text + FIRM)
    q = trajectory.block(0, trajectory.samples).q[:, 0]
    assert float(found[1]) == pytest.approx(q.max() - 1.001, abs=5e-3)  # three digits
    assert float(found[2]) == pytest.approx(q.argmax() / 1000, abs=1e-3)  # one step


def test_sinusoids():
    trajectory = load(
        LASTING + SINUSOIDS + "  sine: [{arm: 10 deg, slide: 0.05}, 0]\n  cosine: [0, 0.01]\n" + FIRM
    )
    time = np.linspace(0, 4, 9)
    expected = (
        math.radians(30) + math.radians(10) * np.sin(math.pi * time) + 0.01 * np.cos(2 * math.pi * time)
    )
    np.testing.assert_allclose(trajectory.at(time).q[:, 0], expected, rtol=1e-14)
    np.testing.assert_allclose(trajectory.at(time).dq[0], [math.pi * math.radians(10), math.pi * 0.05])


def test_a_ramp_lets_sinusoids_begin_and_end_at_rest():
    trajectory = load(LASTING + SINUSOIDS + "  sine: [0.1]\n  ramp: 0.5\n" + FIRM)
    ends = trajectory.at(np.array([0.0, 4.0]))
    np.testing.assert_array_equal(ends.q, [[math.radians(30), 0.1]] * 2)
    for derivative in (ends.dq, ends.ddq, ends.d3q, ends.d4q):
        assert not derivative.any()


def test_a_stiffness_swings_within_a_ramp():
    swing = SWINGING + "  sine: [{arm: 300, slide: 0}, [0, 2000]]\n  ramp: 1\n"
    trajectory = load(LASTING + VIA + swing)
    commanded = trajectory.at(np.array([0.0, 1.0, 1.5, 2.5, 4.0])).commanded
    half = math.sqrt(0.5)
    arm, slide = commanded["stiffness"].T
    np.testing.assert_allclose(arm, [900, 1200, 900 + 300 * half, 900 - 300 * half, 900], rtol=1e-14)
    np.testing.assert_allclose(slide, [8000, 8000, 6000, 10000, 8000], rtol=1e-14)
    for name in ("dstiffness", "ddstiffness"):
        assert not commanded[name][[0, -1]].any()


def test_small_and_fast_swings_of_the_stiffness_are_plausible():
    """Amplitudes are no stiffness, and their frequency is not that of the motion."""
    rest = LASTING + "position: {type: polynomial, degree: 7, start: 0, end: [1, 0.1]}\n"
    swing = SWINGING.replace("0.25", "200") + "  sine: [{arm: 0.01, slide: 1}, 0]\n"
    assert not load(rest + swing).warnings
    [warning] = load(rest + swing.replace("900,", "9,")).warnings
    assert "stiffness.offset.arm" in warning


def test_only_joints_with_a_stiffness_swing():
    robot = load_robot(ROOT / "robots" / "mixed_3r.yaml")
    swing = "stiffness: {type: sinusoids, frequency: 1, offset: 900, sine: [{elbow: 50}], cosine: [20]}\n"
    Path("move.yaml").write_text(LASTING + STANDING + swing)
    stiffness = load_trajectory("move.yaml", robot).at(np.array([0.25])).commanded["stiffness"][0]
    np.testing.assert_allclose(stiffness[np.isfinite(stiffness)], [950])
    assert np.isnan(stiffness).sum() == 2


def test_a_sequence_goes_on_where_it_was():
    trajectory = load(HEAD + SEQUENCE + GO + DWELL + ON + FIRM)
    assert (trajectory.duration, trajectory.samples) == (pytest.approx(3.1), 3101)
    at = trajectory.at(np.array([0, 1.5, 1.8, 2.2, trajectory.duration]))
    np.testing.assert_allclose(at.q, [[0, 0.1], [1, 0.2], [1, 0.2], [1, 0.2], [0, 0]], atol=1e-14)
    np.testing.assert_array_equal(trajectory.position.breakpoints, [0, 1.5, 2.2, trajectory.duration])


def test_a_dwell_at_the_beginning_stands_where_the_next_part_starts():
    trajectory = load(HEAD + SEQUENCE + DWELL + GO + DWELL + FIRM)
    np.testing.assert_array_equal(trajectory.at(np.array([0.0, 0.5])).q, [[0, 0.1]] * 2)


def test_via_points_and_sinusoids_are_parts_as_well():
    parts = "  - {type: via, degree: 9, points: [[1, 0.2], 0, [0.5, 0]], times: [0, 0.5, 1.25]}\n"
    parts += "  - {type: sinusoids, duration: 2, frequency: 1, offset: [0.5, 0], sine: [0.1], ramp: 0.5}\n"
    trajectory = load(HEAD + SEQUENCE + GO + parts + FIRM)
    assert trajectory.duration == 4.75
    np.testing.assert_allclose(trajectory.at(np.array([2.0])).q, 0, atol=1e-15)
    assert list(trajectory.position.jumps(5)) == []


def test_a_given_duration_may_differ_by_rounding_from_that_of_the_parts():
    assert 1.5 + 0.7 + 0.7 + 0.9 != 3.8
    assert load(HEAD + "duration: 3.8\n" + SEQUENCE + GO + DWELL + DWELL + ON + FIRM).duration == 3.8


def test_stiffness_and_wrench_step_independently_of_the_motion():
    push = PUSH + "  times: [0.5]\n  transition: 0.25\n"
    trajectory = load(LASTING + VIA + STEPS + "  times: [1, 3]\n  transition: 1\n" + push)
    at = trajectory.at(np.array([0.0, 1.5, 2.5, 4.0]))
    np.testing.assert_array_equal(
        at.commanded["stiffness"], [[9000, 9000], [4950, 8500], [900, 8000], [9500, 9500]]
    )
    np.testing.assert_array_equal(at.wrench.wrench, [[0] * 6, *[[1, 2, 3, 4, 5, 6]] * 3])


def test_joints_without_stiffness_have_none():
    robot = load_robot(ROOT / "robots" / "mixed_3r.yaml")
    for points in ("[850, {elbow: 1000}, [null, null, 900]]", "[{elbow: 850}, 1000, 900]"):
        Path("move.yaml").write_text(
            LASTING + STANDING + f"stiffness: {{type: via, degree: 5, times: [0, 1, 4], points: {points}}}\n"
        )
        middle = load_trajectory("move.yaml", robot).at(np.array([1.0])).commanded["stiffness"][0]
        np.testing.assert_array_equal(middle, [np.nan, np.nan, 1000])


@pytest.mark.parametrize(
    "text",
    [
        "type: via\n  degree: 3\n  points: [0, 0.5, 0.2]\n  times: [0, 1, 2]\n",
        "type: sequence\n  parts:\n"
        "  - {type: polynomial, duration: 1, degree: 5, start: 0, end: 1}\n  - {type: dwell, duration: 1}\n",
    ],
)
def test_rigid_robots_need_not_be_that_smooth(text):
    part = "    actuator: {type: rigid, motor: {inertia: 2}}\n"
    link = "    link: {mass: 2, com: [0.1, 0, 0], inertia: {xx: 0.1, yy: 0.2, zz: 0.2}}\n"
    joint = f"  - name: a\n    type: revolute\n    dh: {{a: 0.2, alpha: 90 deg}}\n{link}{part}"
    Path("rig.yaml").write_text(f"format: vsacli-robot/1\nname: rig\njoints:\n{joint}")
    Path("move.yaml").write_text(f"{HEAD}position:\n  {text}")
    robot = load_robot("rig.yaml")
    assert inverse_dynamics(robot, load_trajectory("move.yaml", robot)).report.verdict == "ok"
    Path("move.yaml").write_text(f"{HEAD}position:\n  {text}".replace("degree: 5", "degree: 3"))
    if "sequence" in text:
        with pytest.raises(InputError, match=r"ddq jumps .* twice continuously .* take degree 5 or more"):
            load_trajectory("move.yaml", robot)


@pytest.mark.parametrize("name", ["via", "excitation", "pick_and_place"])
def test_the_result_of_a_step_does_not_depend_on_the_others(name):
    robot = load_robot(ROOT / "robots" / "vsa_3r.yaml")
    trajectory = load_trajectory(ROOT / "trajectories" / f"vsa_3r_{name}.yaml", robot)
    whole = trajectory.block(0, trajectory.samples).variables()
    for start in range(0, trajectory.samples, 997):
        alone = trajectory.block(start, start + 1).variables()
        for variable, values in alone.items():
            np.testing.assert_array_equal(values, whole[variable][start : start + 1])


def test_the_recorded_motion_sets_the_duration_of_the_others():
    time = np.linspace(1, 3, 21)
    rows = "\n".join(f"{t},{0.1 * t},{0.02 * t}" for t in time.tolist())
    Path("motion.csv").write_text(f"time,arm.q,slide.q\n{rows}\n")
    position = "position: {type: csv, file: motion.csv}\n"
    trajectory = load(HEAD + position + STEPS + "  times: [0.5, 1.2]\n  transition: 0.5\n")
    np.testing.assert_array_equal(trajectory.at(np.array([2.1])).commanded["stiffness"], [[900, 8000]])
    late = STEPS + "  times: [0.5, 1.8]\n  transition: 0.5\n"
    expected = "move.yaml: stiffness.times: the last change ends at 2.3 s, the trajectory at 2 s"
    assert problems(HEAD + position + late) == [expected]
    assert problems(HEAD + position + SOFTENING + "  times: [0, 1, 4]\n") == [
        "move.yaml: stiffness: lasts 4 s, but the trajectory 2 s"
    ]


@pytest.mark.slow
def test_polynomials_and_dwells_do_without_scipy():
    """Its parts take longer to import than such a trajectory to compute; it imports each at first use."""
    Path("move.yaml").write_text(
        HEAD + SEQUENCE + GO + DWELL + STEPS + "  times: [0, 1]\n  transition: 0.5\n"
    )
    code = (
        "import sys; from vsacli import load_robot, load_trajectory\n"
        f"robot = load_robot({str(ROOT / 'robots' / 'rp_2.yaml')!r})\n"
        "load_trajectory('move.yaml', robot).block(0, 10)\n"
        "assert not {'scipy.interpolate', 'scipy.linalg', 'scipy.special'} & {*sys.modules}\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
