"""Links from records with noise: within their errors as often as these say, and torques as they were."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.marks import slow_but
from samples.robots import random_link
from samples.shipped import shipped_robot

from vsacli import (
    Identification,
    InputError,
    Result,
    Robot,
    Tool,
    Trajectory,
    identify,
    inverse_dynamics,
    load_robot,
    load_trajectory,
)
from vsacli.studies.identification import fitted_text
from vsacli.studies.identification.conditioning import ConditionedRecording, conditioned
from vsacli.studies.identification.consistent_links import doubts_of, found_links
from vsacli.studies.identification.fitted_system import Solution, fit_system
from vsacli.studies.identification.identification_report import OK, numbers_of
from vsacli.studies.identification.link_equations import link_system
from vsacli.studies.identification.motor_equations import GROUPS, motor_systems
from vsacli.studies.identification.regressor import parameters_of

SEEDS = 20
POSITION_NOISE, TORQUE_NOISE = 2e-5, 0.5  # rad or m, N m or N

FRICTION = {"coulomb": 0.4, "width": 0.05}
OF_LINKS = {"joints.*.damping": 0.2, "joints.*.friction": FRICTION}
OF_MOTORS = {"joints.*.actuator.motor": {"inertia": 2.5, "damping": 0.5, "friction": FRICTION}}
DIFFERENT = [{"type": "cubic", "k": 420, "k_c": 1800}, {"type": "cubic", "k": 380, "k_c": 2200}]

SINES = "offset: 0, sine: [[0.4, 0.3, -0.3], [-0.2, 0.2, 0.2], [0.1, -0.1, 0.15]]"
STIFFNESS = "offset: 1400, sine: [[0, 0, 100], [200, 0, 0], [0, 200, 150]]"

CASES: Mapping[str, tuple[str, Mapping[str, Any], str, str]] = {
    "3R": ("vsa_3r", OF_LINKS | OF_MOTORS, SINES, STIFFNESS),
    "different springs": (
        "vsa_3r",
        OF_LINKS | OF_MOTORS | {"joints.*.actuator.spring": DIFFERENT},
        SINES,
        STIFFNESS,
    ),
    "RP": (
        "rp_2",
        OF_LINKS | {"joints.slide.damping": 5, "joints.slide.friction": {"coulomb": 4, "width": 0.01}},
        "offset: [0, 0.15], sine: [[0.5, 0.05], [0.2, -0.05], [-0.2, 0.02]]",
        "offset: [1400, 14000], sine: [[0, 1000], [200, 0], [100, 2000]]",
    ),
    "serial": (
        "awas_1r",
        OF_LINKS | {"joints.elbow.link.mass": 8},
        "offset: 0, sine: [[0.6], [0.3], [-0.2]]",
        "offset: 400, sine: [[100], [0], [100]]",
    ),
}
"""Robot, what is changed of it, and its motion: position and stiffness."""


def motion_of(case: str, folder: Path) -> tuple[Robot, Trajectory]:
    name, changes, position, stiffness = CASES[case]
    robot, motion = shipped_robot(name).replace(changes), folder / "motion.yaml"
    motion.write_text(
        "format: vsacli-trajectory/1\nname: excitation\nduration: 15\nrate: 100\n"
        f"position: {{type: sinusoids, frequency: 0.2, {position}}}\n"
        f"stiffness: {{type: sinusoids, frequency: 0.2, {stiffness}}}\n"
    )
    return robot, load_trajectory(motion, robot)


def measured(run: Result, seed: int) -> ConditionedRecording:
    """What sensors would have read of a run, conditioned."""
    random = np.random.default_rng(seed)
    q, theta = (each + POSITION_NOISE * random.normal(size=each.shape) for each in (run.q, run.theta))
    torque = run.tau_motor + TORQUE_NOISE * random.normal(size=run.tau_motor.shape)
    return conditioned(run.time, q, theta, torque, bandwidth=2.0)


def solved(robot: Robot, signals: ConditionedRecording) -> list[Solution]:
    """Motors, and last the links."""
    joints = range(len(robot.joints))
    motors = [fit_system(each, [signals]) for each in motor_systems(robot, joints, GROUPS, [signals])]
    return [*motors, fit_system(link_system(robot, GROUPS, motors), [signals])]


def errors_of_base(links: Solution) -> np.ndarray:
    """Of base parameters, in standard errors."""
    count = sum(map(bool, links.system.sums))
    return ((links.fit.values - links.system.before[list(links.free)]) / links.fit.standard_errors)[:count]


def fitted(robot: Robot, found: list[Solution]) -> Robot:
    """The robot with all that was told."""
    numbers = (number for each in found for number in numbers_of(each))
    told = {each.path: each.value for each in numbers if each.identifiable and not each.sum}
    bodies = found_links(robot, found[-1])
    assert bodies.within
    robot = robot.replace(told)
    joints = map(lambda joint, link: dataclasses.replace(joint, link=link), robot.joints, bodies.links)
    return dataclasses.replace(robot, joints=tuple(joints))


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("case", CASES)
def test_base_parameters_are_off_by_about_their_standard_errors(case: str, tmp_path: Path) -> None:
    """Of one record; the statistics of many are below."""
    robot, trajectory = motion_of(case, tmp_path)
    off = errors_of_base(solved(robot, measured(inverse_dynamics(robot, trajectory), seed=0))[-1])
    assert np.all(np.abs(off) < 4)
    assert np.std(off) > 0.4


@pytest.mark.exhaustive
@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_base_parameters_are_within_two_standard_errors(case: str, tmp_path: Path) -> None:
    """19 of 20, were errors known exactly; of so few draws, whose numbers go together, 0.88 to 1."""
    robot, trajectory = motion_of(case, tmp_path)
    run = inverse_dynamics(robot, trajectory)
    off = [errors_of_base(solved(robot, measured(run, seed))[-1]) for seed in range(SEEDS)]
    share = np.mean(np.abs(off) < 2)
    assert 0.88 <= share <= 1.0
    assert np.std(off) > 0.6, "errors that are too large cover all"


@pytest.mark.slow
@pytest.mark.parametrize("case", slow_but(("RP",), CASES))
def test_torques_by_what_was_found_are_those_that_were(case: str, tmp_path: Path) -> None:
    """Of the same motion, by the links as bodies, without the noise: within 1 % of their root mean square."""
    robot, trajectory = motion_of(case, tmp_path)
    run = inverse_dynamics(robot, trajectory)
    start = robot.replace({"joints.*.link.mass": 2.0, "joints.*.damping": 0.1})
    found = solved(start, measured(run, seed=0))
    torques = inverse_dynamics(fitted(start, found), trajectory).tau_motor
    error = np.sqrt(np.nanmean((torques - run.tau_motor) ** 2, axis=0)).max(axis=-1)
    assert np.all(error < 0.01 * np.sqrt(np.nanmean(run.tau_motor**2, axis=0)).max(axis=-1))


def test_a_robot_file_with_the_links_found_reads_back_as_these(tmp_path: Path) -> None:
    """In the frames that the file names: modified rows have other ones than the robot that is read."""
    random = np.random.default_rng(1)
    for name in ("panda_7r", "rp_2"):
        robot = shipped_robot(name)
        joints = (dataclasses.replace(each, link=random_link(random)) for each in robot.joints)
        other = dataclasses.replace(robot, joints=tuple(joints))
        found = Identification(name, OK, records=(), systems=(), notes=(), fitted=other)
        file = tmp_path / "fitted.yaml"
        file.write_text(fitted_text(robot, found, tmp_path))
        again = load_robot(file)
        for read, expected in zip(again.joints, other.joints, strict=True):
            found_, wanted = parameters_of(read.link), parameters_of(expected.link)
            assert found_ == pytest.approx(wanted, rel=1e-5, abs=1e-6)  # seven digits


def written(robot: Robot, run: Result, joints: Sequence[str], folder: Path, **further: np.ndarray) -> Path:
    """A record of some joints as a file, with further columns."""
    columns = {"time": run.time}
    for name in joints:
        at = robot.joint_names.index(name)
        columns[f"{name}.q"] = run.q[:, at]
        for motor in range(2):
            columns[f"{name}.theta_{motor + 1}"] = run.theta[:, at, motor]
            columns[f"{name}.tau_motor_{motor + 1}"] = run.tau_motor[:, at, motor]
    columns |= further
    file = folder / "record.csv"
    table = np.column_stack(tuple(columns.values()))
    np.savetxt(file, table, delimiter=",", header=",".join(columns), comments="")
    return file


@pytest.mark.slow
def test_links_are_left_out_with_a_reason(tmp_path: Path) -> None:
    robot, trajectory = motion_of("RP", tmp_path)
    run = inverse_dynamics(robot, trajectory)
    unknown = identify(robot, written(robot, run, ["slide"], tmp_path))
    assert [system.title for system in unknown.systems] == ["slide"]
    assert "links are not identified, since the positions of arm were not recorded" in unknown.notes
    assert unknown.fitted.joints[0].link == robot.joints[0].link
    file = written(robot, run, robot.joint_names, tmp_path, fx=0 * run.time)
    pushed = identify(robot, file)
    assert [system.title for system in pushed.systems] == ["arm", "slide"]
    sentence = "links are not identified, since a wrench acts on the end effector"
    assert pushed.notes == (f"{file}: {sentence}",)
    with pytest.raises(InputError, match=sentence):
        identify(robot, file, ["links"])
    handed = dataclasses.replace(
        robot, tools=(Tool(name="hand", joint="slide"), Tool(name="grip", joint="arm"))
    )
    for column, tool in (("hand.fx", "hand"), ("fx", "a tool")):
        file = written(robot, run, robot.joint_names, tmp_path, **{column: 0 * run.time})
        (note,) = identify(handed, file).notes
        assert note == f"{file}: links are not identified, since a wrench acts on {tool}"


def test_forces_that_no_body_exerts_are_told(tmp_path: Path) -> None:
    """A slide that is drawn along wherever it accelerates has a negative mass, many errors below zero."""
    robot, trajectory = motion_of("RP", tmp_path)
    *_, links = solved(robot, measured(inverse_dynamics(robot, trajectory), seed=0))
    place = links.system.names.index("slide.m")
    lighter = links.fit.solution.copy()
    lighter[place] = -0.5
    bodies = found_links(robot, links._replace(fit=links.fit._replace(solution=lighter)))
    assert not bodies.within
    (sentence,) = doubts_of(bodies)
    assert "no bodies near the links of the file have the base parameters found" in sentence
