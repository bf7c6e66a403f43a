"""`convention: modified` in a robot file: frames are moved, rows are not relabeled."""

from __future__ import annotations

import json
import math

import numpy as np
import pinocchio as pin
import pytest
from oracles.kinematics import tool_pose
from oracles.modified_dh import ModifiedChain, ModifiedJoint
from samples.robots import ODD_GRAVITY, random_robot

from vsacli import InputError, Robot, link_torques, load_robot
from vsacli.dynamics.elastic_torques import link_constants

PANDA = [
    (0, "0", 0.333),
    (0, "-pi/2", 0),
    (0, "pi/2", 0.316),
    (0.0825, "pi/2", 0),
    (-0.0825, "-pi/2", 0.384),
    (0, "pi/2", 0),
    (0.088, "pi/2", 0),
]
"""a_{i-1}, alpha_{i-1}, d_i of the Panda in the modified convention, as its maker publishes them."""


def text_of(robot: Robot, convention: str = "modified") -> str:
    """A robot file with the numbers of a robot, read by another convention."""
    joints = [
        {
            "name": joint.name,
            "type": joint.type,
            "dh": vars(joint.dh),
            "link": {**vars(joint.link), "inertia": vars(joint.link.inertia)},
            "actuator": {"type": "rigid", "motor": {"inertia": 1}},
        }
        for joint in robot.joints
    ]
    base, tool = (json.dumps(vars(pose)) for pose in (robot.base, robot.tool))
    return (
        f"format: vsacli-robot/1\nname: modified\nconvention: {convention}\n"
        f"gravity: {json.dumps(robot.gravity)}\nbase: {base}\ntool: {tool}\njoints: {json.dumps(joints)}\n"
    )


def panda_text() -> str:
    link = "link: {mass: 2, com: [0.01, 0.02, 0.03], inertia: {xx: 0.03, yy: 0.02, zz: 0.01}}"
    drive = "actuator: {type: rigid, motor: {inertia: 1}}"
    rows = [
        f"  - {{name: j{number}, type: revolute, dh: {{a: {a}, alpha: {alpha}, d: {d}}}, {link}, {drive}}}"
        for number, (a, alpha, d) in enumerate(PANDA)
    ]
    tool = "tool: {xyz: [0, 0, 0.107]}"
    return "\n".join(
        ["format: vsacli-robot/1", "name: panda", "convention: modified", tool, "joints:", *rows]
    )


@pytest.fixture
def load(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def load_text(text: str) -> Robot:
        (tmp_path / "arm.yaml").write_text(text)
        return load_robot("arm.yaml")

    return load_text


def placed(robot: Robot) -> Robot:
    """The robot on a tilted base and with a tilted tool."""
    base = {"xyz": (0.3, -0.2, 0.5), "rpy": (0.4, -1.1, 2.0)}
    tool = {"xyz": (0.1, 0.2, -0.3), "rpy": (-0.7, 0.3, 1.2)}
    kind = type(robot.base)
    return Robot(
        name=robot.name, gravity=robot.gravity, joints=robot.joints, base=kind(**base), tool=kind(**tool)
    )


def modified_chain(robot: Robot) -> ModifiedChain:
    """The oracle, built from numbers that are meant in the modified convention."""
    base, tool = (
        pin.SE3(pin.rpy.rpyToMatrix(*pose.rpy), np.array(pose.xyz)) for pose in (robot.base, robot.tool)
    )
    joints = [
        ModifiedJoint(
            joint.type == "revolute",
            **vars(joint.dh),
            mass=joint.link.mass,
            com=np.array(joint.link.com),
            inertia=joint.link.inertia.tensor,
        )
        for joint in robot.joints
    ]
    return ModifiedChain(joints, np.array(robot.gravity), base, tool)


@pytest.mark.parametrize("types", ["R", "P", "RRP", "PRPR", "RRRRRRR"])
@pytest.mark.parametrize("seed", range(3))
def test_kinematics_and_torques_are_those_of_the_modified_rows(load, types, seed):
    written = placed(random_robot(types, seed))
    robot, oracle = load(text_of(written)), modified_chain(written)
    rng = np.random.default_rng(seed)
    q, dq, ddq = rng.uniform(-3, 3, (3, 20, len(types)))
    for position in q:
        # Products of 4x4 matrices with entries of a few meters.
        np.testing.assert_allclose(tool_pose(robot, position).real, oracle.tool_pose(position), atol=1e-13)
    found = link_torques(robot, q, dq, ddq, 0 * q, 0 * q)[0]
    expected = oracle.torques(q, dq, ddq)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())  # rounding


def test_relabeled_rows_would_be_another_robot(load):
    written = random_robot("RRP", 1)
    q = np.array([0.3, -0.4, 0.5])
    modified, standard = load(text_of(written)), load(text_of(written, "standard"))
    assert np.abs(tool_pose(modified, q) - tool_pose(standard, q)).max() > 0.1


def test_standard_is_the_default(load):
    written = text_of(random_robot("RRP", 1), "standard")
    assert load(written) == load(written.replace("convention: standard\n", ""))


def test_the_published_panda(load):
    robot = load(panda_text())
    # The flange stands 0.333 + 0.316 + 0.384 - 0.107 m above the base and 0.088 m before it.
    expected = np.array([0.088, 0, 0.333 + 0.316 + 0.384 - 0.107])
    np.testing.assert_allclose(tool_pose(robot, np.zeros(7)).real[:3, 3], expected, atol=1e-15)
    assert [joint.dh.a for joint in robot.joints] == [0, 0, 0.0825, -0.0825, 0, 0.088, 0]


def test_right_angles_stay_exact(load):
    robot = load(panda_text())
    twists = [(link.cos_alpha, link.sin_alpha) for link in map(link_constants, robot.joints)]
    assert all(type(value) is int for twist in twists for value in twist)
    assert robot.joints[0].link.com == (0.01, -0.03, 0.02)
    assert vars(robot.joints[0].link.inertia) == {
        "xx": 0.03,
        "yy": 0.01,
        "zz": 0.02,
        "xy": 0,
        "xz": 0,
        "yz": 0,
    }
    assert (robot.base.xyz, robot.base.rpy) == ((0, 0, 0), (0, 0, 0))


def test_the_first_row_belongs_to_the_base(load):
    first = "dh: {a: 0, alpha: 0, d: 0.333}"
    robot = load(panda_text().replace(first, "dh: {a: 0.2, alpha: pi/2, d: 0.333}"))
    assert robot.base.xyz == (0.2, 0, 0)
    assert robot.base.rpy == (math.pi / 2, 0, 0)


def test_physics_is_judged_on_the_numbers_of_the_file(load):
    with pytest.raises(
        InputError, match=r"^arm.yaml:6: inertia: the tensor has the negative eigenvalue -0\.03"
    ):
        load(panda_text().replace("xx: 0.03", "xx: -0.03", 1))


def test_an_unknown_convention(load):
    with pytest.raises(
        InputError, match=r"^arm.yaml:3: convention: unknown word 'modifed'; did you mean 'mod"
    ):
        load(panda_text().replace("modified", "modifed"))


def test_sums_that_are_too_large(load):
    edited = panda_text().replace("xyz: [0, 0, 0.107]}", "xyz: [0, 0, 0.107]}\nbase: {xyz: [1e30, 0, 0]}")
    with pytest.raises(InputError, match=r"^arm.yaml: its modified rows have no standard ones: Pose: xyz"):
        load(edited.replace("a: 0, alpha: 0, d: 0.333", "a: 1e30, alpha: 0, d: 0.333"))


def test_gravity_is_given_in_the_base_frame(load):
    written = placed(random_robot("RR", 2))
    assert load(text_of(written)).gravity == ODD_GRAVITY
