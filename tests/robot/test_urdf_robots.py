"""Every chain, and the whole, of the robots in `example-robot-data`, against Pinocchio's own reading."""

from __future__ import annotations

import dataclasses
import importlib.metadata
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from oracles.kinematics import tool_pose
from oracles.urdf_pinocchio import UrdfOracle
from samples.urdf_chains import ARMS, REFUSED, WHOLE_REFUSED, WITHOUT_ARMS
from samples.urdf_deviations import deviations

from vsacli import InputError, import_urdf, inverse_dynamics, link_torques, load_trajectory
from vsacli.files.templates import trajectory_template
from vsacli.robot.plausibility import robot_rules_with_findings
from vsacli.robot.urdf import Conversion
from vsacli.robot.urdf.link_tree import MOVING, Urdf, joints_below
from vsacli.robot.urdf.reader import read_urdf

try:
    PACKAGE = importlib.metadata.files("example-robot-data") or []
except importlib.metadata.PackageNotFoundError:
    pytest.skip("could not import 'example-robot-data'", allow_module_level=True)
FILES = [Path(str(file.locate())) for file in PACKAGE if file.suffix == ".urdf"]

HORIZONTAL = ("TwoDofs.urdf", "iris.urdf")
"""Files whose joints all have vertical axes: a planar arm, and four rotors."""

ALONG_ALL_AXES = "is along the axes of all joints, so that it loads none of them"

pytestmark = pytest.mark.slow

BY_NAME = {file.name: file for file in FILES}

BOUND = 1e-10
"""m, and relative torque. Ten angles of a chain that the file rounds by 1e-11 rad, which import makes right
angles again; without such angles, agreement is to 1e-13."""

SAMPLES = 5

CHAINS = [arm[:3] for arm in ARMS]


@cache
def oracle(path: Path) -> UrdfOracle:
    return UrdfOracle(path)


def check(path: Path, conversion: Conversion, held: Mapping[str, float] | None = None) -> None:
    """Compare tips and torques at random states with those of Pinocchio."""
    held = held or {}
    chain, robot = conversion.tree, conversion.robot
    joints = [joint.urdf.name for joint in chain.joints]
    q, dq, ddq = np.random.default_rng(len(joints)).uniform(-2, 2, (3, SAMPLES, len(joints)))
    for position in q:
        found = tool_pose(robot, position).real
        expected = oracle(path).tip_pose(joints, chain.base, chain.tips[0].link, position, held)
        np.testing.assert_allclose(found, expected, rtol=0, atol=BOUND)
    found = link_torques(robot, q, dq, ddq, 0 * q, 0 * q)[0] - dq * [joint.damping for joint in robot.joints]
    expected = np.array([oracle(path).torques(joints, *row, held) for row in zip(q, dq, ddq, strict=True)])
    np.testing.assert_allclose(found, expected, rtol=0, atol=BOUND * np.abs(expected).max())
    assert conversion.residual.position < BOUND
    # The rules on plausible numbers find nothing, even if the placeholders are taken for real.
    real = dataclasses.replace(robot, placeholder=False)
    for subtree in real.checked_subtrees:
        assert robot_rules_with_findings(real.checked, subtree, ()) == frozenset()
    unloaded = any(ALONG_ALL_AXES in warning for warning in real.warnings)
    assert not unloaded or path.name in HORIZONTAL


def ends(urdf: Urdf) -> Iterator[str]:
    """A leaf for each different chain of moving joints from the root."""
    joints = list(joints_below(urdf.root, urdf.joints.values()))
    parents = {joint.parent for joint in joints}
    seen: set[tuple[str, ...]] = set()
    for leaf in (joint.child for joint in joints if joint.child not in parents):
        moving = tuple(joint.name for joint in urdf.joints_above(leaf) if not joint.is_fixed)
        if moving and moving not in seen:
            seen.add(moving)
            yield leaf


def refusals(path: Path) -> Iterator[str]:
    """Check every chain from the root; yields why one is refused."""
    try:
        tips = list(ends(read_urdf(path)))
    except InputError as error:
        yield str(error)
        return
    for tip in tips or [None]:
        try:
            check(path, import_urdf(path, tip=tip))
        except InputError as error:
            yield str(error)


@pytest.mark.cases(14)
@pytest.mark.parametrize(("name", "base", "tip", "letters"), ARMS)
def test_an_arm(name, base, tip, letters):
    conversion = import_urdf(BY_NAME[name], base, tip)
    assert "".join("R" if joint.is_revolute else "P" for joint in conversion.robot.joints) == letters
    check(BY_NAME[name], conversion)


@pytest.mark.cases(14)
@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parts[-3]}-{path.stem}")
def test_every_chain_from_the_root_is_exact_or_refused_for_a_listed_reason(path):
    reasons = {reason for name, reason in REFUSED if name == path.name}
    found = list(refusals(path))
    assert [refusal for refusal in found if not any(reason in refusal for reason in reasons)] == []
    assert {reason for reason in reasons if any(reason in refusal for refusal in found)} == reasons


def held_anywhere(conversion: Conversion) -> dict[str, float]:
    """A random position, within the limits if there are any, of each joint that can be held."""
    rng = np.random.default_rng(3)
    leaders = {held.leader for held in conversion.tree.held if held.urdf.type in MOVING}
    limits = {held.urdf.name: held.urdf.limit.position or (-2.0, 2.0) for held in conversion.tree.held}
    return {name: float(rng.uniform(*limits.get(name, (-2.0, 2.0)))) for name in sorted(leaders)}


@pytest.mark.cases(14)
@pytest.mark.parametrize(("name", "base", "tip"), CHAINS)
def test_an_arm_whose_side_branches_are_held_anywhere(name, base, tip):
    held = held_anywhere(import_urdf(BY_NAME[name], base, tip))
    check(BY_NAME[name], import_urdf(BY_NAME[name], base, tip, hold=held), held)


@pytest.mark.cases(4)
@pytest.mark.parametrize(("name", "base", "tip"), CHAINS)
def test_an_arm_can_execute_its_new_trajectory(name, base, tip, tmp_path):
    """Its placeholders carry it, in the report's words: nothing is infeasible, singular or over a limit."""
    robot = import_urdf(BY_NAME[name], base, tip).robot
    path = tmp_path / "move.yaml"
    path.write_text(trajectory_template(robot).replace("rate: 1000", "rate: 50  "))
    assert inverse_dynamics(robot, load_trajectory(path, robot)).report.verdict == "ok"


def whole_robot(path: Path) -> tuple[Conversion | None, dict[str, float], str]:
    """All of a robot, with joints held as the message of a refusal advises, and this message."""
    try:
        return import_urdf(path), {}, ""
    except InputError as error:
        held = dict.fromkeys(re.findall(r"or both by --hold (\S+)=0", str(error)), 0.0)
        return (import_urdf(path, hold=held) if held else None), held, str(error)


@pytest.mark.cases(14)
@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parts[-3]}-{path.stem}")
def test_every_whole_robot_is_exact_or_refused_for_a_listed_reason(path):
    conversion, held, refusal = whole_robot(path)
    reason = dict(WHOLE_REFUSED).get(path.name, "")
    assert (reason in refusal, bool(reason)) == (True, bool(refusal))
    if conversion is not None:
        assert max(deviations(conversion, oracle(path), 100, held)) < BOUND
        assert max(conversion.residual) < BOUND
        tips = len(conversion.tree.tips)
        assert (conversion.tree.shape, len(conversion.robot.tools)) == (
            ("chain", 0) if tips == 1 else ("tree", tips)
        )


def test_every_file_is_listed():
    assert len(FILES) > 50
    listed = {arm[0] for arm in ARMS} | {name for name, _ in REFUSED} | set(WITHOUT_ARMS)
    assert {file.name for file in FILES} == listed
