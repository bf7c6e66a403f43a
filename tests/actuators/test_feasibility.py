"""Corridor, margins, flags and limits of single steps, and what a run reports of them."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from samples.drives import (
    ALIKE,
    Stopped,
    command,
    joint_with,
    lower_by_branch,
    motion,
    springs,
    with_branch,
)
from samples.robots import vsa_3r

from vsacli import Antagonistic, Flag, InputError, Joint, Limits, Motor, inverse_dynamics, laws, mechanisms
from vsacli.actuators.reach import margin, reach_flags
from vsacli.actuators.transmission import JointVariables
from vsacli.analysis.run import Run
from vsacli.base.flags import LIMITS, MIN_MARGIN
from vsacli.dynamics.drive import drive

MOTOR_VARIABLES = ("phi", "dphi", "theta", "dtheta", "ddtheta", "tau_transmission", "tau_motor", "det_A")
LOST_AT_A_FOLD = ("dphi", "dtheta", "ddtheta", "tau_motor")


def flags_of(joint: Joint, **given: np.ndarray | float) -> list[Flag]:
    return [Flag(int(bits)) for bits in drive(joint, command(**given)).flags]


def corridor(
    lower: float, upper: float, *, critical: bool = True, slack: bool = False
) -> mechanisms.PairSolution:
    """A corridor both ends of which are critical points, or neither is."""
    ends = np.array([lower]), np.array([upper]), np.array([critical]), np.array([critical])
    return mechanisms.PairSolution(*ends, np.array([slack]), np.zeros(1), np.zeros(1))


def reach(stiffness: float, solution: mechanisms.PairSolution) -> Flag:
    return Flag(int(reach_flags(np.array([stiffness]), solution)[0]))


# Margins


def test_margin_is_relative_to_the_stiffness_and_to_the_nearer_end():
    stiffness = np.array([1000.0, 1000, 1000, 1000])
    lower, upper = np.array([900.0, 700, 1100, math.nan]), np.array([math.inf, 1200, 2000, math.nan])
    np.testing.assert_array_equal(margin(stiffness, lower, upper), [0.1, 0.2, -0.1, math.nan])


@pytest.mark.parametrize(
    ("gap", "critical", "expected"),
    [
        (-1e-3, True, Flag.INFEASIBLE),
        (-1.01e-9, True, Flag.INFEASIBLE),
        (-0.99e-9, True, Flag.SINGULAR),
        (0, True, Flag.SINGULAR),
        (0.99e-9, True, Flag.SINGULAR),
        (1.01e-9, True, Flag.NEAR_SINGULAR),
        (0.00999, True, Flag.NEAR_SINGULAR),
        (0.01001, True, Flag(0)),
        (-1.01e-9, False, Flag.INFEASIBLE),
        (-0.99e-9, False, Flag(0)),
        (0, False, Flag(0)),
        (0.005, False, Flag(0)),
    ],
)
@pytest.mark.parametrize("at_upper", [False, True], ids=["lower end", "upper end"])
def test_flags_follow_the_margin(gap: float, critical: bool, expected: Flag, at_upper: bool):
    end = 1000 * (1 + gap if at_upper else 1 - gap)
    solution = corridor(*((100, end) if at_upper else (end, math.inf)), critical=critical)
    assert reach(1000.0, solution) == expected


def test_only_the_nearer_end_counts_as_singular():
    solution = corridor(995, 1004)._replace(upper_critical=np.array([False]))
    assert reach(1000.0, solution) == Flag(0)
    assert reach(999.0, solution) == Flag.NEAR_SINGULAR


def test_torque_that_cannot_be_carried_is_infeasible():
    assert reach(1000.0, corridor(math.nan, math.nan)) == Flag.INFEASIBLE


def test_slack_is_named_below_the_corridor_only():
    for stiffness, expected in [
        (900, Flag.INFEASIBLE | Flag.SLACK),
        (1000.5, Flag(0)),
        (2001, Flag.INFEASIBLE),
    ]:
        assert reach(stiffness, corridor(1000, 2000, critical=False, slack=True)) == expected


def test_threshold_of_near_singular_steps_can_be_chosen():
    solution = corridor(900, math.inf)
    for threshold, expected in [(MIN_MARGIN, Flag(0)), (0.11, Flag.NEAR_SINGULAR)]:
        assert Flag(int(reach_flags(np.array([1000.0]), solution, threshold)[0])) == expected


@pytest.mark.parametrize("threshold", [0, 1e-9, 1, math.nan, -0.1])
def test_threshold_must_be_a_margin(threshold: float):
    with pytest.raises(InputError, match="minimum margin must lie between 1e-09 and 1"):
        Run(vsa_3r(), motion(), min_margin=threshold)


# What is NaN


def values_of(driven: JointVariables, name: str) -> np.ndarray:
    """(samples, ...) of a variable of the motors."""
    return np.moveaxis(getattr(driven, name), -1, 0)


def test_infeasible_step_has_no_motor_variables():
    driven = drive(joint_with(), command(tau_e=np.array([10.0, 40.0, 10.0]), stiffness=806.0))
    assert [Flag(int(bits)) for bits in driven.flags] == [
        Flag.NEAR_SINGULAR,
        Flag.INFEASIBLE,
        Flag.NEAR_SINGULAR,
    ]
    for name in MOTOR_VARIABLES:
        values = values_of(driven, name)
        assert np.all(np.isnan(values[1])), name
        assert np.all(np.isfinite(values[[0, 2]])), name
    assert np.all(np.isfinite(driven.stiffness_min))
    assert np.all(driven.stiffness_max == math.inf)


@pytest.mark.parametrize("tau_e", [0.0, 40.0, 400.0])
def test_singular_step_keeps_what_needs_no_inverse(tau_e: float):
    lower = drive(joint_with(), command(tau_e=tau_e)).stiffness_min
    driven = drive(joint_with(), command(tau_e=tau_e, stiffness=lower, dtau_e=5.0))
    assert Flag(int(driven.flags[0])) == Flag.SINGULAR
    for name in MOTOR_VARIABLES:
        lost = name in LOST_AT_A_FOLD
        assert np.all(np.isnan(getattr(driven, name)) == lost), name
    # The springs carry the load: rounding of the spread's square root, 1e-8, squared.
    assert driven.tau_transmission.sum() == pytest.approx(tau_e, abs=1e-12 * (1 + tau_e))


def test_other_joints_are_untouched_by_an_infeasible_one():
    robot = vsa_3r()
    asked = (850.0, 850.0, 801.0)
    result, whole = (inverse_dynamics(robot, motion(stiffness=each)) for each in (asked, (850.0,) * 3))
    infeasible = (result.flags[:, 2] & Flag.INFEASIBLE) != 0
    assert infeasible.any()
    for name in MOTOR_VARIABLES:
        values, expected = getattr(result, name), getattr(whole, name)
        np.testing.assert_array_equal(values[:, :2], expected[:, :2])
        assert np.all(np.isnan(values[infeasible, 2]))
    for name in ("tau_e", "dtau_e", "ddtau_e"):
        np.testing.assert_array_equal(getattr(result, name), getattr(whole, name))


def test_end_of_a_laws_domain_is_no_singularity():
    actuator = springs(Stopped(k=400, k_c=2000), Stopped(k=400, k_c=2000))
    upper = drive(joint_with(actuator), command(tau_e=10.0)).stiffness_max
    tau_e = np.array([10.0, 10.0, 10.0, 61.0])
    driven = drive(
        joint_with(actuator), command(tau_e=tau_e, stiffness=upper * np.array([0.999, 1, 1.001, 1]))
    )
    assert [int(bits) for bits in driven.flags] == [0, 0, Flag.INFEASIBLE, Flag.INFEASIBLE]
    # One spring is at its stop, the other carries the rest.
    np.testing.assert_allclose(driven.tau_transmission[:, 1], [30, -20], rtol=1e-14)
    assert np.all(np.isfinite(driven.tau_motor[:, :2]))
    assert np.isnan([driven.stiffness_min[3], driven.stiffness_max[3]]).all()


# Limits


def test_each_limit_has_its_bit():
    limits = Limits(position=(-1, 2), velocity=(-3, 3), stiffness=(810, 2000))
    joint = joint_with(limits=limits)
    for variable, inside, outside, bit in [
        ("q", (-1, 2), (-1.001, 2.001), Flag.POSITION_LIMIT),
        ("dq", (-3, 3), (-3.001, 3.001), Flag.VELOCITY_LIMIT),
        ("stiffness", (810, 2000), (809.9, 2000.1), Flag.STIFFNESS_LIMIT),
    ]:
        assert not any(flag & LIMITS for flag in flags_of(joint, **{variable: np.array(inside)}))
        assert [flag & LIMITS for flag in flags_of(joint, **{variable: np.array(outside)})] == [bit, bit]


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize(
    ("variable", "limit", "bit"),
    [
        ("phi", "max_deflection", Flag.DEFLECTION_LIMIT),
        ("dtheta", "max_velocity", Flag.MOTOR_VELOCITY_LIMIT),
        ("tau_motor", "max_torque", Flag.MOTOR_TORQUE_LIMIT),
    ],
)
def test_limits_of_a_side_are_its_own(side: int, variable: str, limit: str, bit: Flag):
    asked = {"tau_e": 8.0, "stiffness": 900.0, "dq": 0.5, "dtau_e": 20.0}
    reached = abs(
        float(getattr(drive(joint_with(springs(ALIKE, ALIKE)), command(**asked)), variable)[side, 0])
    )
    for factor, expected in [(1.0, Flag(0)), (1 + 1e-6, Flag(0)), (1 - 1e-6, bit)]:
        motors, sides = [Motor(inertia=3, damping=0.1)] * 2, [ALIKE] * 2
        parts = sides if limit == "max_deflection" else motors
        parts[side] = dataclasses.replace(parts[side], **{limit: factor * reached})
        actuator = Antagonistic(motor=(motors[0], motors[1]), spring=(sides[0], sides[1]))
        assert flags_of(joint_with(actuator), **asked) == [expected]


def test_running_along_a_limit_is_within_it():
    limits = Limits(velocity=(-0.3, 0.3))
    rounded = 0.3 * (1 + np.array([-1e-15, 0, 1e-15, 0.9e-9, 1.1e-9]))
    flags = flags_of(joint_with(limits=limits), dq=rounded)
    assert flags == [Flag(0)] * 4 + [Flag.VELOCITY_LIMIT]


def test_limits_do_not_flag_what_does_not_exist():
    actuator = springs(*[laws.Cubic(k=400, k_c=2000, max_deflection=1e-6)] * 2)
    assert flags_of(joint_with(actuator), stiffness=700.0) == [Flag.INFEASIBLE]


def test_limits_do_not_move_the_corridor():
    limited = springs(*[laws.Cubic(k=400, k_c=2000, max_deflection=1e-3)] * 2)
    for name in ("phi", "tau_motor", "stiffness_min", "stiffness_max"):
        free, held = (drive(joint_with(each), command(tau_e=20.0)) for each in (None, limited))
        if name != "tau_motor":
            np.testing.assert_array_equal(getattr(free, name), getattr(held, name))
    assert Flag(int(held.flags[0])) == Flag.DEFLECTION_LIMIT
    assert np.all(np.isfinite(held.tau_motor))


def test_the_deflection_limit_of_a_tendon_holds_on_both_sides():
    actuator = springs(*[laws.Quadratic(k=1000, max_deflection=0.1)] * 2)
    found = drive(joint_with(actuator), command(stiffness=1000.0))  # 2 k |phi| on either side
    np.testing.assert_allclose(found.phi[:, 0], [0.25, -0.25], rtol=1e-12)
    checks = [check.motor for check in actuator.limits if check.flag is Flag.DEFLECTION_LIMIT]
    held = [check for check in actuator.limits if np.isfinite(check.range).all()]
    assert checks == [1, 2]
    assert [check.flags({"phi": found.phi}).tolist() for check in held] == [[Flag.DEFLECTION_LIMIT]] * 2


# The other branch


def test_other_branch_may_reach_less_stiffness_under_heavy_load():
    """Beyond the load at which the inner piece splits off, the two branches end at different folds."""
    unlike = springs(ALIKE, laws.Cubic(k=440, k_c=2000))
    tau_e = np.array([100.0, 400.0])
    lower = lower_by_branch(joint_with(unlike), tau_e)
    # Below that load both end at the only fold; a root finder each.
    assert lower["positive"][0] == pytest.approx(lower["negative"][0], rel=1e-14)
    low, high = sorted(lower, key=lambda branch: lower[branch][1])
    between = np.array([0.99 * lower[low][0], (lower[low][1] + lower[high][1]) / 2])
    for branch, expected in [(high, [False, True]), (low, [False, False])]:
        actuator = with_branch(joint_with(unlike), branch).actuator
        assert actuator.other_branch(tau_e, between, tau_e).tolist() == expected


def test_other_branch_does_no_better_where_sides_are_alike():
    alike = springs(ALIKE, ALIKE)
    assert not alike.other_branch(np.array([100.0]), np.array([810.0]), np.array([0.0])).any()
