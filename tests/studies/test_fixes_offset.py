"""The smallest constant change of a joint's stiffness."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from samples.fixes import (
    BASE,
    CUBIC,
    K_C,
    SHOULDER,
    K,
    accepted,
    changed,
    lowest_stiffness,
    pendulum,
    rest_to_rest,
)
from samples.marks import slow
from samples.robots import vsa_3r

from vsacli import Elastic, Limits, Motor, Trajectory, fixes, inverse_dynamics, laws
from vsacli.studies.search.acceptance import Acceptance, ImpossibleError
from vsacli.studies.search.cutting_planes import smallest_offset
from vsacli.studies.search.fix_report import NotPossible, StiffnessOffset
from vsacli.studies.search.loads import joint_loads

MARGIN = 0.01
GIVEN = ("dq", "ddq", "d3q", "d4q", "dstiffness", "ddstiffness")
UNIT = 0.01
"""Spacing of the grid for a stiffness of 100 to 1000 N m/rad."""


def offsets(robot, trajectory):
    found = fixes(robot, trajectory, MARGIN).stiffness_offset
    assert isinstance(found, StiffnessOffset)
    return {offset.joint: offset.value for offset in found.offsets}


def reason(robot, trajectory):
    found = fixes(robot, trajectory, MARGIN).stiffness_offset
    assert isinstance(found, NotPossible)
    (only,) = found.reasons
    return only


def peak_load(robot, trajectory):
    return np.abs(inverse_dynamics(robot, trajectory).tau_e).max(axis=0)


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize(("duration", "stiffness"), [(4.0, 790.0), (0.5, 850.0), (0.3, 850.0)])
def test_offset_reaches_the_closed_bound(duration, stiffness):
    robot, trajectory = vsa_3r(), rest_to_rest(duration, stiffness, rate=800 / duration)
    needed = lowest_stiffness(peak_load(robot, trajectory)) / (1 - MARGIN) - stiffness
    found = np.array(list(offsets(robot, trajectory).values()))
    np.testing.assert_array_less(-1e-9, found - np.maximum(needed, 0))  # rounding of the two bounds
    np.testing.assert_array_less(found - np.maximum(needed, 0), UNIT + 1e-9)
    assert (found > 0).tolist() == (needed > 0).tolist()


@pytest.mark.slow
def test_only_the_joint_in_trouble_is_changed():
    found = offsets(vsa_3r(), rest_to_rest(4.0, (850.0, 820.0, 850.0)))
    assert found["shoulder"] > 0
    assert found["base"] == found["elbow"] == 0


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("stiffness", "limits", "expected"),
    [(950.0, (0.0, 900.0), -50.0), (850.0, (871.25, 2000.0), 21.25), (850.0, (900.0, 900.0), 50.0)],
)
def test_stiffness_limit_is_met_exactly(stiffness, limits, expected):
    robot = changed(SHOULDER, limits=Limits(stiffness=limits))
    assert offsets(robot, rest_to_rest(4.0, (850.0, stiffness, 850.0)))["shoulder"] == expected


@pytest.mark.slow
def test_deflection_limit_lowers_the_stiffness_to_its_closed_bound():
    limit = 0.1
    robot = changed(0, robot=pendulum(), spring=(dataclasses.replace(CUBIC, max_deflection=limit),) * 2)
    still = rest_to_rest(1.0, 950.0, start=(0.0,), end=(0.0,))
    # phi_1 is at its limit and carries tau_1; the other spring carries the rest of the load of 24.525 N m.
    rest = 5.0 * 9.81 * 0.5 - (K * limit + K_C * limit**3)
    (phi_2,) = [root.real for root in np.roots([K_C, 0, K, -rest]) if abs(root.imag) < 1e-12]
    ceiling = 2 * K + 3 * K_C * (limit**2 + phi_2**2)
    assert offsets(robot, still)["swing"] == pytest.approx(ceiling - 950.0, abs=UNIT)


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("motor", "duration"),
    [({"max_torque": 60.0}, 1.0), ({"max_torque": 20.0}, 4.0), ({"max_torque": 180.0}, 0.55)],
)
def test_motor_limit_takes_the_way_that_is_shorter(motor, duration):
    robot, trajectory = changed(BASE, motor=motor), rest_to_rest(duration)
    found = offsets(robot, trajectory)["base"]

    def with_offset(value):
        return accepted(robot, rest_to_rest(duration, (850.0 + value, 900.0, 900.0)), MARGIN)

    assert found != 0
    assert with_offset(found)
    assert not with_offset(found - math.copysign(UNIT, found))
    nearer = np.linspace(-abs(found), abs(found), 101)[1:-1]
    assert not any(with_offset(value) for value in nearer.tolist())


@pytest.mark.slow
def test_steps_between_the_watched_ones_count():
    """Motor torque peaks with a given ddstiffness, at one of 3001 steps, not all of which are watched."""
    motion = rest_to_rest(4.0, rate=750).block(0, 3001)
    columns = {name: motion.of_joints[name].copy() for name in GIVEN}
    columns["ddstiffness"][1501, BASE] = 40_000.0
    trajectory = Trajectory.from_samples(motion.time, motion.q, motion.commanded["stiffness"], **columns)
    robot = changed(BASE, motor={"max_torque": 100.0})
    found = offsets(robot, trajectory)["base"]
    stiffer = Trajectory.from_samples(
        motion.time, motion.q, motion.commanded["stiffness"] + np.array([found, 0, 0]), **columns
    )
    assert accepted(robot, stiffer, MARGIN)
    assert not accepted(robot, trajectory, MARGIN)


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize(
    "spring",
    [
        (CUBIC, dataclasses.replace(CUBIC, k=380.0, k_c=2500.0)),
        (laws.Sinh(k=80, a=5), laws.Sinh(k=70, a=5.5)),
        (laws.Exponential(c=80, a=5), laws.Exponential(c=80, a=5)),
    ],
    ids=["cubics", "sinh", "tendons"],
)
def test_other_springs(spring):
    robot = changed(SHOULDER, spring=spring)
    found = offsets(robot, rest_to_rest(0.4))
    # a thousandth of the margin, 1e-5 of 1121 N m/rad, may be for what lies between the steps
    for step, expected in ((0.0, True), (-UNIT - 0.02, False)):
        values = 850.0 + found["base"], 850.0 + found["shoulder"] + step, 850.0
        assert accepted(robot, rest_to_rest(0.4, values), MARGIN) is expected


@pytest.mark.slow
def test_prismatic_joint_has_its_unit():
    found = fixes(pendulum(letter="P"), rest_to_rest(1.0, 800.0, start=(0.0,), end=(0.3,)))
    assert found.stiffness_offset.sentence.startswith("raise the stiffness of lift by ")
    assert found.stiffness_offset.sentence.endswith(" N/m")


@pytest.mark.slow
def test_raised_and_lowered_joints_in_one_sentence():
    robot = changed(SHOULDER, limits=Limits(stiffness=(0.0, 900.0)))
    found = fixes(robot, rest_to_rest(4.0, (800.0, 950.0, 800.0)))
    assert found.stiffness_offset.sentence == (
        "raise the stiffness of base by 8.1 N m/rad, elbow by 9.16 N m/rad "
        "and lower the stiffness of shoulder by 50 N m/rad"
    )


@pytest.mark.slow
def test_corridor_and_stiffness_limit_exclude_each_other():
    robot = changed(SHOULDER, limits=Limits(stiffness=(0.0, 820.0)))
    assert reason(robot, rest_to_rest(4.0, (850.0, 790.0, 850.0))) == (
        "shoulder: stiffness is 790 N m/rad at t = 0.000 s, even at rest, below the 827.8 N m/rad needed for "
        "a margin of 1 % (minimum 819.4): no slower motion and no constant stiffness helps, since with "
        "827.8 N m/rad, the least it may have, stiffness is 827.7 N m/rad at t = 0.000 s, above its limit "
        "of 820 N m/rad"
    )


@pytest.mark.parametrize(
    ("asked", "change", "what", "limit"),
    [
        (900.0, {"limits": Limits(stiffness=(0.0, 820.0))}, "stiffness is 900 N m/rad", "820 N m/rad"),
        slow(830.0, {"motor": {"max_torque": 2.0}}, "joint-side torque of motor 1 is 28.", "2 N m"),
        (
            900.0,
            {"spring": (dataclasses.replace(CUBIC, max_deflection=0.02),) * 2},
            "deflection of spring 1 is 0.1",
            "0.02 rad",
        ),
    ],
    ids=["stiffness", "torque", "deflection"],
)
def test_the_limit_in_the_way_is_named(asked, change, what, limit):
    """It is the first that a stiffness which the load allows exceeds, with its value and time."""
    found = reason(changed(SHOULDER, **change), rest_to_rest(4.0, (850.0, asked, 850.0)))
    at_rest, softest = found.split(": no slower motion and no constant stiffness helps, since with ")
    assert at_rest.startswith(f"shoulder: {what}")
    assert at_rest.endswith(f", even at rest, above its limit of {limit}")
    # 819.4 N m/rad at rest, of which the margin is 1 %
    assert softest.startswith("827.8 N m/rad, the least it may have, ")
    assert " at t = " in softest
    assert softest.endswith(f" s, above its limit of {limit}")


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        (
            Limits(position=(-1.0, 1.0)),
            "base: position is 1.571 rad at t = 1.000 s, above its limit of 1 rad: "
            "timing and stiffness have no effect on that: change the path or the limit",
        ),
        (
            Limits(velocity=(-9.0, 3.0)),
            "the velocity of base is 3.436 rad/s at t = 0.500 s, above its limit of 3 rad/s; "
            "the stiffness has no effect on that: change the motion or the limit",
        ),
    ],
    ids=["position", "velocity"],
)
def test_limits_of_the_motion_are_none_of_the_stiffness(limits, expected):
    robot = changed(BASE, limits=limits)
    assert reason(robot, rest_to_rest(1.0)) == expected


@pytest.mark.slow
def test_motor_velocity_that_no_stiffness_brings_down():
    robot = changed(BASE, motor={"max_velocity": 1.0})
    assert reason(robot, rest_to_rest(1.0)).startswith(
        "none keeps every limit of base; as it is, the joint-side velocity of motor 1 of base is 3.297 rad/s"
    )


@dataclasses.dataclass(frozen=True)
class ShortCubic(laws.Cubic):
    """The spring of Table I, known up to 0.2 rad only."""

    @property
    def domain(self):
        return (-0.2, 0.2)

    @property
    def torque_range(self):
        return (-96.0, 96.0)  # K 0.2 + Kc 0.2^3

    def closed_pair(self, other):  # noqa: ARG002
        return None


@pytest.mark.slow
def test_upper_end_of_the_corridor_has_its_margin_too():
    robot = dataclasses.replace(pendulum(ShortCubic(k=K, k_c=K_C)), gravity=(0.0, 0.0, 0.0))
    still = rest_to_rest(1.0, 1300.0, start=(0.0,), end=(0.0,))
    highest = 2 * (K + 3 * K_C * 0.2**2)  # both springs at the end of their domain
    found = offsets(robot, still)["swing"]
    assert found == pytest.approx(highest / (1 + MARGIN) - 1300.0, abs=0.1)  # the grid beyond 1000 N m/rad
    assert accepted(robot, rest_to_rest(1.0, 1300.0 + found, start=(0.0,), end=(0.0,)), MARGIN)


def test_elastic_actuator_has_no_stiffness_to_choose():
    joint = vsa_3r().joints[BASE]
    elastic = dataclasses.replace(joint, actuator=Elastic(motor=Motor(inertia=1.0), stiffness=850.0))
    (load,) = joint_loads(vsa_3r(), rest_to_rest(1.0, rate=10), [BASE])
    with pytest.raises(ImpossibleError, match=r"^the actuator of base has no stiffness to choose$"):
        smallest_offset(Acceptance(vsa_3r(), MARGIN), elastic, load)
