"""Joints of a URDF that stand still: at zero, where they are held, or where they follow another one to."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from oracles.urdf_pinocchio import UrdfOracle
from samples.urdf import joint, link, robot, write

from vsacli import InputError, import_urdf, link_torques

LIMIT = '<limit lower="-3" upper="3" velocity="1" effort="1"/>'
LEFT = LIMIT.replace('"-3" upper="3"', '"0.01" upper="0.05"')
FOLLOWS_LEFT = '<mimic joint="left" multiplier="-2" offset="0.3"/>' + LIMIT.replace("3", "1")
FOLLOWS_RIGHT = '<mimic joint="right" multiplier="0.5" offset="0.2"/>'
TREE = robot(
    *(link(name) for name in ("world", "torso", "arm", "hand", "pad", "thumb", "tip", "box")),
    joint("lean", "world", "torso", "R", rpy="1 0 0", rest=LIMIT),
    joint("shoulder", "torso", "arm", "R", rpy="0.7 0 0", rest=LIMIT),
    joint("wrist", "arm", "hand", "R", rpy="0 1 0", rest=LIMIT),
    joint("left", "hand", "pad", "P", rpy="0 0.4 1", rest=LEFT),
    joint("right", "hand", "thumb", "R", rpy="0.5 0 0", rest=FOLLOWS_LEFT),
    joint("bend", "thumb", "tip", "C", rpy="0 0.3 0", rest=FOLLOWS_RIGHT),
    joint("drawer", "world", "box", "P", rest=LIMIT),
)
"""Two links of the hand stand by a chain of <mimic>: right = 0.3 - 2 left, bend = 0.2 + right/2."""

ROUNDING = 1e-13
"""Relative, of torques; no angle of the file is near a right one, which import would make exact."""


@pytest.fixture
def urdf(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda text: write(tmp_path / "arm.urdf", text).name


def positions(conversion):
    return {held.urdf.name: held.position for held in conversion.tree.held}


@pytest.mark.parametrize(
    ("hold", "expected"),
    [
        ({}, {"left": 0, "right": 0.3, "bend": 0.35}),
        ({"left": 0.04}, {"left": 0.04, "right": 0.22, "bend": 0.31}),
        ({"left": "0.02 + 0.02"}, {"left": 0.04, "right": 0.22, "bend": 0.31}),
    ],
)
def test_joints_that_follow_others_stand_where_those_take_them(urdf, hold, expected):
    conversion = import_urdf(urdf(TREE), base="torso", tip="hand", hold=hold)
    assert positions(conversion) == pytest.approx({"lean": 0, **expected}, rel=1e-15)


@pytest.mark.parametrize("hold", [{}, {"left": 0.04}, {"lean": "-30 deg", "left": 0.02}])
def test_torques_with_held_joints(urdf, hold):
    path = urdf(TREE)
    conversion = import_urdf(path, base="torso", tip="hand", hold=hold)
    held = {"lean": math.radians(-30), "left": 0.02} if "lean" in hold else hold
    q, dq, ddq = np.random.default_rng(1).uniform(-2, 2, (3, 5, 2))
    found = link_torques(conversion.robot, q, dq, ddq, 0 * q, 0 * q)[0]
    oracle, chain = UrdfOracle(path), ["shoulder", "wrist"]
    expected = np.array([oracle.torques(chain, *row, held) for row in zip(q, dq, ddq, strict=True)])
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())


def test_what_does_not_stand_at_zero_is_told(urdf):
    conversion = import_urdf(urdf(TREE), base="torso", tip="hand", hold={"lean": "-30 deg"})
    right, bend = "right at 0.3 rad (follows left)", "bend at 0.35 rad (follows left)"
    assert [note for note in conversion.notes() if note.startswith("held")] == [
        "held below the base: lean at -0.523599 rad",
        "held at zero outside the chain, their links lumped: left",
        f"held outside the chain, their links lumped: {right}, {bend}",
    ]
    assert conversion.robot.description.endswith("to link hand, lean at -0.523599 rad")


@pytest.mark.parametrize(
    ("hold", "warnings"),
    [
        ({}, ["left at 0 m is outside its limits, 0.01 to 0.05 m; hold it elsewhere by --hold left=0.01"]),
        ({"left": 0.01}, []),
        ({"left": 0.05}, []),
        (
            {"left": -1},
            [
                "left at -1 m is outside its limits, 0.01 to 0.05 m; hold it elsewhere by --hold left=0.01",
                "right at 2.3 rad (follows left) is outside its limits, -1 to 1 rad; "
                "hold it elsewhere by --hold left=VALUE",
            ],
        ),
    ],
)
def test_a_joint_outside_its_limits_is_warned_of(urdf, hold, warnings):
    conversion = import_urdf(urdf(TREE), base="torso", tip="hand", hold=hold)
    assert [warning for warning in conversion.warnings() if "placeholder" not in warning] == warnings


def test_a_joint_whose_leader_is_missing_stands_as_if_that_stood_at_zero(urdf):
    path = urdf(TREE.replace('mimic joint="left"', 'mimic joint="gone"'))
    conversion = import_urdf(path, base="torso", tip="hand", hold={"left": 0.01})
    assert positions(conversion) == {"lean": 0, "left": 0.01, "right": 0.3, "bend": 0.35}
    assert next(conversion.warnings()) == (
        "right at 0.3 rad: there is no joint 'gone', which it should follow (<mimic>); "
        "if it stands elsewhere, say so by --hold right=VALUE"
    )
    held = import_urdf(path, base="torso", tip="hand", hold={"left": 0.01, "right": -0.2})
    assert positions(held) == {"lean": 0, "left": 0.01, "right": -0.2, "bend": 0.1}
    assert not any("gone" in warning for warning in held.warnings())


@pytest.mark.parametrize(
    ("hold", "reason"),
    [
        ({"lft": 0}, "there is no joint 'lft' outside the chain; did you mean 'left'?"),
        ({"wrist": 0}, "'wrist' belongs to the chain, where it moves"),
        ({"bend": 0}, "'bend' follows 'left' (<mimic>); hold that one"),
        ({"drawer": 0}, "'drawer' is neither outside the chain nor below its base, so that it has no effect"),
        ({"left": "1 deg"}, "'1 deg' is an angle; expected a number in m"),
        ({"left": "a"}, "expected a number in m, found 'a'"),
        ({"left": math.nan}, "expected a number in m, found 'nan'; only finite numbers can be used"),
        ({"left": True}, "expected a number in m, found 'True'"),
    ],
)
def test_what_cannot_be_held(urdf, hold, reason):
    ((name, value),) = hold.items()
    with pytest.raises(InputError, match=f"^arm.urdf: --hold {name}={value}: {re.escape(reason)}"):
        import_urdf(urdf(TREE), base="torso", tip="hand", hold=hold)


@pytest.mark.parametrize(
    ("changes", "options", "problem"),
    [
        (
            [('joint="left"', 'joint="bend"')],
            {},
            r"14: joint 'right' follows itself: the <mimic> of joints form a circle\n"
            r"arm.urdf:15: joint 'bend' follows itself",
        ),
        ([('joint="right"', 'joint="bend"')], {}, "15: joint 'bend' follows itself"),
        (
            [('joint="left"', 'joint="wrist"')],
            {},
            r"14: joint 'right' outside the chain follows 'wrist' on it .*\n"
            r"arm.urdf:15: joint 'bend' outside the chain follows 'wrist' on it .*; hold it by --hold bend=0",
        ),
        (
            [(f' rpy="1 0 0"/><axis xyz="0 0 1"/>{LIMIT}', ' rpy="1 0 0"/><mimic joint="wrist"/>')],
            {},
            "10: joint 'lean' below the base follows 'wrist' on it .*; hold it by --hold lean=0",
        ),
        (
            [('multiplier="-2"', 'multiplier="-1e9"'), ('multiplier="0.5"', 'multiplier="1e9"')],
            {"left": 1},
            "15: joint 'bend': following 'left' it stands at -1e.18 rad, more than can be computed with",
        ),
        ([('multiplier="-2"', 'multiplier="x"')], {}, "14: multiplier: expected a number"),
    ],
)
def test_joints_that_cannot_follow(urdf, changes, options, problem):
    text = TREE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    with pytest.raises(InputError, match=f"^arm.urdf:{problem}"):
        import_urdf(urdf(text), base="torso", tip="hand", hold=options)


FOLLOWER = (
    link("cylinder", ""),
    joint("slide", "arm", "cylinder", "C", rest='<mimic joint="wrist"/><dynamics damping="2"/>'),
    link("rod", ""),
    joint("push", "cylinder", "rod", "P", rest='<mimic joint="slide" multiplier="3"/>'),
)
"""A branch of two joints without mass, both of which follow the wrist."""


def branched(*parts: str) -> str:
    return TREE.replace("</robot>", "\n".join([*parts, "</robot>"]))


def test_a_branch_without_mass_that_follows_the_chain_changes_nothing(urdf):
    plain = import_urdf(urdf(TREE), base="torso", tip="hand")
    conversion = import_urdf(urdf(branched(*FOLLOWER)), base="torso", tip="hand")
    assert conversion.robot == plain.robot
    assert set(conversion.notes()) - set(plain.notes()) == {
        "outside the chain, following it without mass, so without torque: slide (follows wrist), "
        "push (follows slide)",
        "damping left out: slide",
    }


@pytest.mark.parametrize("number", [0, 2])
def test_a_branch_with_mass_that_follows_the_chain_can_be_held(urdf, number):
    """The advice of the message works, and is the same as the file without <mimic>."""
    heavy = [*FOLLOWER[:number], link("cylinder" if number == 0 else "rod"), *FOLLOWER[number + 1 :]]
    path = urdf(branched(*heavy))
    with pytest.raises(InputError) as caught:
        import_urdf(path, base="torso", tip="hand")
    hold = dict(re.findall(r"hold it by --hold (\w+)=(0), which neglects its motion", str(caught.value)))
    conversion = import_urdf(path, base="torso", tip="hand", hold=hold)
    neglected = "it follows wrist (<mimic>), and its motion with that joint is neglected"
    assert f"slide at 0 rad: {neglected}" in list(conversion.warnings())
    free = branched(*heavy).replace('<mimic joint="wrist"/>', "")
    assert conversion.robot == import_urdf(urdf(free), base="torso", tip="hand").robot


def test_a_joint_below_the_base_that_follows_the_chain_can_be_held(urdf):
    turned = ' rpy="1 0 0"/><axis xyz="0 0 1"/>'
    text = TREE.replace(f"{turned}{LIMIT}", f'{turned}<mimic joint="wrist"/>')
    held = import_urdf(urdf(text), base="torso", tip="hand", hold={"lean": "30 deg"})
    free = import_urdf(urdf(TREE), base="torso", tip="hand", hold={"lean": "30 deg"})
    assert held.robot == free.robot
    assert "lean at 0.523599 rad: it follows wrist" in next(held.warnings())
