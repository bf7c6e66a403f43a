"""Ranges of gear ratios in closed form against a dense scan, for demands and motors of any kind."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsacli.studies.sizing import CatalogMotor
from vsacli.studies.sizing.catalog import Shaft
from vsacli.studies.sizing.demand import MotorDemand
from vsacli.studies.sizing.ratios import ratios_within, shares

SCAN = np.geomspace(1e-4, 1e7, 1500)
AT_END = 1e-6
"""Relative distance from an end of a range within which rounding decides."""


def demand_of(
    velocity: np.ndarray, acceleration: np.ndarray, load: np.ndarray, weight: np.ndarray
) -> MotorDemand:
    """Of a motor at a revolute joint, at steps of one motion, each (samples,)."""
    moved = velocity, acceleration, load, load
    steps = np.arange(len(load))
    return MotorDemand("joint", "revolute", 1, ("motion",), 0 * steps, 1.0 * steps, weight, *moved)


def random_demand(rng: np.random.Generator) -> MotorDemand:
    """Few steps with nothing in common; of some nothing moves, or nothing is carried, or there are pauses."""
    samples = int(rng.integers(1, 30))
    velocity, acceleration, load = (
        rng.normal(size=samples) * 10 ** rng.uniform(-2, most) for most in (1.0, 2.0, 2.0)
    )
    kind = rng.integers(4)
    velocity *= (kind != 0) * (1.0 if kind != 2 else rng.random(samples) < 0.5)
    acceleration *= kind != 0
    load *= kind != 1
    return demand_of(velocity, acceleration, load, rng.uniform(0, 1, samples))


def random_shaft(rng: np.random.Generator) -> Shaft:
    """With friction of two sizes and an offset, that the motor can overcome; with any of the limits."""
    torque, unbounded = 10 ** rng.uniform(-1, 2), (math.inf,)
    backward, forward = torque * rng.uniform(0, 0.9, 2) * rng.choice([0, 1])
    return Shaft(
        inertia=10 ** rng.uniform(-6, -2),
        damping=rng.choice([0.0, 10 ** rng.uniform(-6, -3)]),
        backward=backward,
        forward=forward,
        offset=rng.choice([0, 1]) * torque * rng.uniform(-0.05, 0.05),
        max_torque=torque * rng.uniform(1, 3),
        continuous_torque=rng.choice([*unbounded, torque]),
        max_velocity=rng.choice([*unbounded, 10 ** rng.uniform(1, 3)]),
        max_voltage=rng.choice([*unbounded, 10 ** rng.uniform(0.5, 2)]),
        torque_constant=10 ** rng.uniform(-2, 0),
        resistance=10 ** rng.uniform(-2, 1),
        efficiency=rng.choice([1.0, rng.uniform(0.3, 1)]),
    )


@pytest.mark.slow
@settings(max_examples=40, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1))
def test_ranges_are_where_no_limit_is_exceeded(seed: int) -> None:
    rng = np.random.default_rng(seed)
    demand, shaft = random_demand(rng), random_shaft(rng)
    if shaft.stall_torque <= max(shaft.backward, shaft.forward) + abs(shaft.offset):
        return  # a motor that its own friction stops is no motor
    found = ratios_within(demand, Shaft.of([shaft]))
    low, high = found.low[0], found.high[0]
    alike = Shaft(*(np.full_like(SCAN, constant) for constant in shaft))
    kept = (shares(demand, alike, SCAN) <= 1).all(axis=1)
    apart = np.all([np.abs(SCAN / end - 1) > AT_END for end in (low, high) if 0 < end < math.inf], axis=0)
    inside = (low <= SCAN) & (high >= SCAN)
    np.testing.assert_array_equal(kept[apart], inside[apart])


def test_where_load_and_rotor_cancel_nothing_is_asked_of_the_motor() -> None:
    """J n a + load/n vanishes at n^2 = -load/(J a), about which the mean square is lost in rounding."""
    demand = demand_of(np.zeros(1), np.full(1, 2.0), np.full(1, -3.0), np.ones(1))
    motor = CatalogMotor(name="m", inertia=1e-3, continuous_torque=0.01)
    found = ratios_within(demand, Shaft.of([motor.shaft]))
    # the roots of 0.002 n^2 -+ 0.01 n - 3
    ends = [(sign * 0.01 + math.sqrt(1e-4 + 0.024)) / 0.004 for sign in (-1, 1)]
    np.testing.assert_allclose([found.low[0], found.high[0]], ends, rtol=1e-9)  # bisection to all digits
