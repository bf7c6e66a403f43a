"""Commands along a path from powers of the speed, against the recursion along the motion over time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from samples.command_line import REPOSITORY, ROBOT

from vsacli import Damper, Friction, Motion, Wrench, link_torques, load_robot
from vsacli.base.signals import DAMPING, POSITION
from vsacli.base.wrench import WRENCH_NAMES
from vsacli.compute.duals import seeds, tangents_of, value_of
from vsacli.studies.search.path_commands import PathCommands, Speeds

TIMES = np.linspace(0.0, 1.0, 7)
DIFFERENCE = 1e-6


def arm(name):
    """A robot whose joints have viscous and dry friction, and dampers between the links."""
    robot = load_robot(REPOSITORY / "robots" / name)
    joints = [
        replace(
            joint,
            damping=0.3 + index,
            friction=Friction(coulomb=(0.7, 0.7), offset=0.1, width=0.2),
            damper=Damper(location="link", range=(0, 10)),
        )
        for index, joint in enumerate(robot.joints)
    ]
    return replace(robot, joints=tuple(joints))


def derivatives(polynomial, at, orders):
    """Values of a polynomial and its derivatives, (orders, instants)."""
    return np.stack([polynomial.deriv(order)(at) if order else polynomial(at) for order in range(orders)])


def signals(names, components, draw, of_time, at):
    """Random signals along a path by name, by s and by time: arrays (instants, components)."""
    functions = [Polynomial(draw.uniform(-1, 1, 4)) for _ in range(components)]
    by_s = np.stack([derivatives(each, of_time(at), len(names)) for each in functions], axis=-1)
    by_time = np.stack([derivatives(each(of_time), at, len(names)) for each in functions], axis=-1)
    return dict(zip(names, by_s, strict=True)), dict(zip(names, by_time, strict=True))


@pytest.mark.parametrize("frame", [None, "base", "end_effector"])
@pytest.mark.parametrize("name", [ROBOT.name, "rp_2.yaml", "lwr_7r_vsa.yaml"])
def test_link_torques_are_those_of_the_motion_over_time(name, frame):
    """The path q(s(t)) of random polynomials is differentiated as one polynomial of t.

    Bound: the five evaluations of the recursion are subtracted from one another, and times up to v^4 = 40.
    """
    robot, draw = arm(name), np.random.default_rng(28)
    of_time = Polynomial(draw.uniform(0.2, 0.8, 4))
    joints = len(robot.joints)
    q, dq = signals(POSITION.names, joints, draw, of_time, TIMES)
    damping, ddamping = signals(DAMPING.names, joints, draw, of_time, TIMES)
    exerted, dexerted = signals(WRENCH_NAMES, 6, draw, of_time, TIMES)
    wrenches = [frame and Wrench(**each, frame=frame) for each in (exerted, dexerted)]
    along = PathCommands(robot, Motion.of(of_time(TIMES), {**q, **damping}, wrenches[0]))
    commands = along.at(Speeds(*derivatives(of_time, TIMES, 5)[1:]))

    expected = link_torques(robot, **dq, wrench=wrenches[1], **ddamping)
    for order, torque in enumerate(("tau_e", "dtau_e", "ddtau_e")):
        found = np.stack([getattr(command, torque) for command in commands], axis=1)
        assert np.abs(found - expected[order]).max() <= 1e-12 * np.abs(expected[order]).max()


def test_derivatives_by_the_speeds_are_those_of_differences():
    robot, draw = arm(ROBOT.name), np.random.default_rng(29)
    of_time = Polynomial(draw.uniform(0.2, 0.8, 4))
    q, _ = signals(POSITION.names, 3, draw, of_time, TIMES)
    damping, _ = signals(DAMPING.names, 3, draw, of_time, TIMES)
    along = PathCommands(robot, Motion.of(of_time(TIMES), {**q, **damping}))
    speeds = derivatives(of_time, TIMES, 5)[1:]
    carried = along.at(Speeds(*seeds(list(speeds))))
    for direction in range(4):
        step = DIFFERENCE * np.eye(4)[direction][:, None]
        after, before = (along.at(Speeds(*(speeds + sign * step))) for sign in (1, -1))
        for joint, command in enumerate(carried):
            for name in ("dq", "ddq", "tau_e", "dtau_e", "ddtau_e"):
                slope = (getattr(after[joint], name) - getattr(before[joint], name)) / (2 * DIFFERENCE)
                dual = getattr(command, name)
                scale = 1 + np.abs(slope).max()
                assert np.allclose(tangents_of(dual).get(direction, 0.0), slope, atol=1e-7 * scale)
                assert np.array_equal(value_of(dual), getattr(along.at(Speeds(*speeds))[joint], name))
