"""Attainable stiffness at rest within the limits of motors and springs, against closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from samples.command_line import REPOSITORY, edited

from vsacli import Antagonistic, DenavitHartenberg, Inertia, Joint, Limits, Link, Motor, laws
from vsacli.robot.attainable import attainable_stiffnesses

DIGITS = 1e-5
"""Relative; the search of an end stops at 6e-6 of a step that is at most 58 % of the stiffness."""


def joint_of(
    motors: tuple[Motor, Motor], springs: tuple[laws.SpringLaw, laws.SpringLaw], **limits: Any
) -> Joint:
    return Joint(
        name="elbow",
        type="revolute",
        dh=DenavitHartenberg(a=0.3, alpha=0),
        link=Link(mass=1, com=(-0.15, 0, 0), inertia=Inertia(xx=1e-3, yy=1e-2, zz=1e-2)),
        actuator=Antagonistic(motor=motors, spring=springs),
        limits=Limits(**limits),
    )


def tendons(largest: float = math.inf, deflection: float = math.inf, **limits: Any) -> Joint:
    """Two tendons of c (exp(a phi) - 1), c = 1.5 N m, a = 6/rad: stiffness a (c + tau)."""
    spring = laws.Exponential(c=1.5, a=6, max_deflection=deflection)
    return joint_of((Motor(inertia=0.1, max_torque=largest),) * 2, (spring,) * 2, **limits)


def test_tendons_up_to_the_torque_of_their_motors() -> None:
    """At rest 2 a (c + 15); under a load of 1 N m the other tendon pulls with 14 N m."""
    attainable = attainable_stiffnesses(tendons(largest=15), 1.0, 0.0)
    assert attainable["unloaded"].range == pytest.approx((18, 198), rel=DIGITS)
    assert attainable["loaded"].range == pytest.approx((24, 6 * 16.5 + 6 * 15.5), rel=DIGITS)
    assert attainable["unloaded"].bounds == attainable["loaded"].bounds == ("springs", "max_torque")


def test_tendons_up_to_their_deflection() -> None:
    """Of two limits the tighter one bounds: the tendon's torque at 0.3 rad is 7.57 N m."""
    pull = 1.5 * (math.exp(1.8) - 1)
    attainable = attainable_stiffnesses(tendons(largest=15, deflection=0.3), 1.0, 0.0)
    assert attainable["unloaded"].range == pytest.approx((18, 12 * (1.5 + pull)), rel=DIGITS)
    assert attainable["loaded"].range[1] == pytest.approx(12 * (1.5 + pull) - 6, rel=DIGITS)
    assert attainable["loaded"].bounds == ("springs", "max_deflection")


def test_limits_of_the_joint_and_none_at_all() -> None:
    limited = attainable_stiffnesses(tendons(largest=15, stiffness=(20, 100)), 1.0, 0.0)
    assert limited["unloaded"] == ((20, 100), ("limits.stiffness", "limits.stiffness"))
    assert limited["loaded"] == ((pytest.approx(24), 100), ("springs", "limits.stiffness"))
    assert attainable_stiffnesses(tendons(), 1.0, 0.0)["unloaded"] == ((18, math.inf), ("springs", None))


def test_a_load_that_the_motors_cannot_hold() -> None:
    attainable = attainable_stiffnesses(tendons(largest=15), 16.0, 0.0)
    assert attainable["loaded"].bounds == ("max_torque", "max_torque")
    assert np.isnan(attainable["loaded"].range).all()
    assert attainable["unloaded"].range[1] == pytest.approx(198, rel=DIGITS)


def stiffest(springs: tuple[laws.Cubic, laws.Cubic], largest: tuple[float, float], load: float) -> float:
    """The largest stiffness at which both motors hold a load, tau_1 + tau_2; one of them is at its end."""
    candidates = []
    for torque in (largest[0], load + largest[1]):
        sides = (torque, load - torque)
        if all(abs(side) <= most * (1 + 1e-12) for side, most in zip(sides, largest, strict=True)):
            roots = [
                np.roots([spring.k_c, 0, spring.k, -side])
                for spring, side in zip(springs, sides, strict=True)
            ]
            phi = [float(root[np.abs(root.imag) < 1e-9].real[0]) for root in roots]
            candidates.append(
                sum(spring.k + 3 * spring.k_c * angle**2 for spring, angle in zip(springs, phi, strict=True))
            )
    return max(candidates)


@pytest.mark.parametrize("seed", range(6))
def test_unequal_cubic_springs_and_motors(seed: int) -> None:
    rng = np.random.default_rng(seed)
    springs = tuple(laws.Cubic(k=rng.uniform(50, 500), k_c=rng.uniform(200, 4000)) for _ in range(2))
    largest = tuple(rng.uniform(20, 200, 2).tolist())
    load = rng.uniform(0.05, 0.6) * min(largest)
    motors = tuple(Motor(inertia=0.1, max_torque=torque) for torque in largest)
    attainable = attainable_stiffnesses(joint_of(motors, springs), load, 0.0)
    expected = min(stiffest(springs, largest, sign * load) for sign in (1, -1))
    assert attainable["unloaded"].range[1] == pytest.approx(stiffest(springs, largest, 0), rel=DIGITS)
    assert attainable["loaded"].range[1] == pytest.approx(expected, rel=DIGITS)
    assert attainable["loaded"].bounds == ("springs", "max_torque")


def test_description_of_a_robot(vsacli: Any) -> None:
    """How stiff a joint can get is asked first; `from 18` does not say it where a motor ends it."""
    arm = REPOSITORY / "robots" / "tendon_1r.yaml"
    shown = vsacli("info", arm).out
    assert "18 to 198 N m/rad   springs, max_torque" in shown
    assert "stiffness: attainable at rest, without load and with the static load in either direction" in shown
    assert vsacli("info", arm, "--field", "joints.elbow.attainable_stiffness.unloaded").out == (
        '{"range": [18.0, 198.0], "bounds": ["springs", "max_torque"]}\n'
    )


def test_an_end_that_nothing_bounds(vsacli: Any, tmp_path: Any) -> None:
    arm = edited(
        REPOSITORY / "robots" / "tendon_1r.yaml", tmp_path / "arm.yaml", (", max_deflection: 0.5", "")
    )
    free = edited(arm, tmp_path / "free.yaml", (", max_torque: 15", ""))
    assert "from 18 N m/rad   springs, none" in vsacli("info", free).out
    path = "joints.elbow.attainable_stiffness.unloaded"
    assert (
        vsacli("info", free, "--field", path).out == '{"range": [18.0, null], "bounds": ["springs", null]}\n'
    )
