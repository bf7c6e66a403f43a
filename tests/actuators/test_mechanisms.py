"""Mechanisms of serial actuators: state, solution and corridor of each against its potential alone."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.mechanism_scan import Level, along, scanned_corridor
from samples.marks import slow_but
from samples.mechanisms import DEVICES, Device

from vsacli import mechanisms
from vsacli.actuators.reach import classify_stiffness

DRAWS = 10_000


SCANNED = [name for name in DEVICES if not name.startswith("potential")]
"""Devices whose branch the scan can follow; that of a potential begins wherever its file says."""


@pytest.fixture(params=slow_but(mechanisms.MECHANISMS.keys() & SCANNED, SCANNED))
def device(request: pytest.FixtureRequest) -> Device:
    return DEVICES[request.param]


@pytest.fixture(params=slow_but(mechanisms.MECHANISMS, DEVICES))
def any_device(request: pytest.FixtureRequest) -> Device:
    return DEVICES[request.param]


def test_every_mechanism_has_a_device_of_its_name() -> None:
    kinds = {name: mechanisms.MECHANISMS.name_of(type(device.mechanism)) for name, device in DEVICES.items()}
    assert {name: kinds[name] for name in mechanisms.MECHANISMS} == {
        name: name for name in mechanisms.MECHANISMS
    }
    assert all(name.startswith(kind) for name, kind in kinds.items())


def states(device: Device, samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """phi, theta_2 and q of states on the branch with positive stiffness."""
    rng = np.random.default_rng(7)
    phi, s = (rng.uniform(*ends, samples) for ends in (device.deflections, device.settings))
    q = rng.uniform(-2, 2, samples)
    on_branch = device.on_branch(phi, s) & (device.springs(q, q + phi, s).stiffness > 0)
    return phi[on_branch], s[on_branch], q[on_branch]


def peak(values: np.ndarray) -> float:
    return float(np.abs(values).max())


@pytest.mark.cases(4)
def test_the_state_is_that_of_the_potential(any_device: Device) -> None:
    """Torques, stiffness and their rates along any motion, and the motion back from them."""
    phi, s, q = states(any_device, 1000)
    rng = np.random.default_rng(8)
    motion = np.stack([(at, *rng.uniform(-5, 5, (2, len(at)))) for at in (q, q + phi, s)])
    (tau_e, dtau_e, ddtau_e), (sigma, dsigma, ddsigma), *motors = along(any_device.potential, motion)
    (_, dq, ddq), (_, dtheta_1, ddtheta_1), (_, ds, dds) = motion
    state = any_device.mechanism.state(phi, s, q)
    rates = dtheta_1 - dq, ds, dq
    found = {
        "tau_e": (state.tau_e, tau_e),
        "stiffness": (state.stiffness, sigma),
        "tau_transmission": (state.tau_transmission, np.array([motor[0] for motor in motors])),
        "torque_rate": (state.torque_rate(rates), dtau_e),
        "stiffness_rate": (state.stiffness_rate(rates), dsigma),
        "transmission_rates": (state.transmission_rates(rates), np.array([motor[1] for motor in motors])),
    }
    for name, (ours, theirs) in found.items():
        # theta_1 - q rounds to 1e-16 of q, and both texts to a few more
        np.testing.assert_allclose(ours, theirs, rtol=1e-11, atol=1e-12 * peak(theirs), err_msg=name)
    determinant = state.determinant
    regular = np.abs(determinant) > 1e-3 * peak(determinant)
    back = state.rates(dtau_e, dsigma, dq)
    accelerations = state.motor_accelerations(rates, ddq, ddtau_e, ddsigma)
    for ours, theirs in (
        (back[0], dtheta_1 - dq),
        (back[1], ds),
        (accelerations[0], ddtheta_1),
        (accelerations[1], dds),
    ):
        # where det A is a thousandth of its peak, rounding is a thousand times as large
        np.testing.assert_allclose(ours[regular], theirs[regular], rtol=0, atol=1e-8 * peak(theirs))


def test_the_energy_is_the_potential(any_device: Device) -> None:
    phi, s, q = states(any_device, 50)
    energy = [float(any_device.potential(*at)) for at in zip(q, q + phi, s, strict=True)]
    np.testing.assert_allclose(any_device.mechanism.state(phi, s, q).energy, energy, rtol=1e-11)


def test_there_and_back(device: Device) -> None:
    phi, s, q = states(device, DRAWS)
    springs = device.springs(q, q + phi, s)
    tau_e, sigma = -springs.link, springs.stiffness
    found = device.mechanism.solve(tau_e, sigma, q)
    assert not classify_stiffness(sigma, found).infeasible.any()
    again = device.springs(q, q + found.phi_1, found.phi_2)
    np.testing.assert_allclose(-again.link, tau_e, rtol=1e-11, atol=1e-12 * peak(tau_e))
    np.testing.assert_allclose(again.stiffness, sigma, rtol=1e-11)
    # next to a turning point of the stiffness the states differ by the root of rounding
    determinant = device.mechanism.state(phi, s, q).determinant
    clear = np.abs(determinant) > 1e-2 * peak(determinant)
    np.testing.assert_allclose(found.phi_1[clear], phi[clear], rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.phi_2[clear], s[clear], rtol=1e-9)


@pytest.mark.cases(4)
def test_the_corridor_is_that_of_a_scan_and_what_lies_outside_is_flagged(device: Device) -> None:
    phi, s, q = states(device, 40)
    largest, scanned = peak(device.springs(q, q + phi, s).link), device.scanned or device.deflections
    rng = np.random.default_rng(9)
    for share, at in zip((0, 1e-9, 0.03, -0.2, 0.4, -0.7, 0.9, -1.3), q, strict=False):
        tau_e = share * largest
        settings = device.scanned_settings or device.mechanism.setting_range
        level = Level(device.springs, tau_e, scanned, settings, at)
        expected = scanned_corridor(level, device.anchor, falls=device.falls)
        upper = np.inf if device.scanned_settings else expected.upper
        top = 2 * np.nan_to_num(expected.upper, nan=1000.0)
        stiffness = rng.uniform(-0.1 * top, top, DRAWS // 10)
        found = device.mechanism.solve(np.full_like(stiffness, tau_e), stiffness, np.full_like(stiffness, at))
        # both solve for the ends to rounding; where the torque has its maximum the stiffness is its root
        np.testing.assert_allclose(found.lower, expected.lower, rtol=1e-9, atol=1e-9 * top)
        np.testing.assert_allclose(found.upper, upper, rtol=1e-9)
        assert bool(found.lower_critical[0]) == expected.lower_turns or expected.lower == 0  # never reached
        assert bool(found.upper_critical[0]) == expected.upper_turns
        inside = (stiffness > 0) & (stiffness >= expected.lower) & (stiffness <= upper)
        np.testing.assert_array_equal(classify_stiffness(stiffness, found).infeasible, ~inside)


def test_next_to_the_ends_of_the_corridor_it_carries_what_is_asked(device: Device) -> None:
    phi, s, q = states(device, 200)
    tau_e = -device.springs(q, q + phi, s).link
    ends = device.mechanism.solve(tau_e, np.ones_like(tau_e), q)
    for end, inwards in ((ends.lower, 1), (ends.upper, -1)):
        for margin in (1e-2, 1e-4, 1e-6, 1e-8):
            asked = end * (1 + inwards * margin)
            there = (asked > 1e-3 * peak(ends.upper)) & (ends.lower <= asked) & (asked <= ends.upper)
            stiffness, load, at = asked[there], tau_e[there], q[there]
            found = device.mechanism.solve(load, stiffness, at)
            again = device.springs(at, at + found.phi_1, found.phi_2)
            np.testing.assert_allclose(-again.link, load, rtol=1e-10, atol=1e-12 * peak(tau_e))
            np.testing.assert_allclose(again.stiffness, stiffness, rtol=1e-10)


def test_it_rests_without_load(device: Device) -> None:
    unloaded = device.mechanism.solve(np.zeros(1), np.ones(1), np.zeros(1))
    lower, upper = float(unloaded.lower[0]), min(float(unloaded.upper[0]), 1e6)
    stiffness = lower + np.linspace(0.001, 0.999, 50) * (upper - lower)
    for tau_e in (0.0, -0.0, 1e-300, -1e-300):
        found = device.mechanism.solve(np.full(50, tau_e), stiffness, np.zeros(50))
        # where a profile rests is fitted, to 1e-14
        np.testing.assert_allclose(found.phi_1, device.rest, rtol=0, atol=1e-14)
        again = device.springs(np.zeros(50), found.phi_1, found.phi_2)
        np.testing.assert_allclose(again.stiffness, stiffness, rtol=1e-11)


def test_what_no_setting_carries_is_infeasible(device: Device) -> None:
    phi, s, q = states(device, 200)
    beyond = 1e3 * peak(device.springs(q, q + phi, s).link)
    tau_e, stiffness = np.array([np.nan, np.inf, 0.0, beyond, -beyond]), np.full(5, 500.0)
    stiffness[2] = np.nan
    infeasible = classify_stiffness(
        stiffness, device.mechanism.solve(tau_e, stiffness, np.zeros(5))
    ).infeasible
    assert infeasible.tolist() == [True] * 3 + [not device.endless] * 2


def test_the_sides_of_symmetric_springs_change_with_the_sign_of_the_torque(device: Device) -> None:
    phi, s, q = states(device, 500)
    springs = device.springs(q, q + phi, s)
    found, turned = (device.mechanism.solve(sign * -springs.link, springs.stiffness, q) for sign in (1, -1))
    if device.symmetric:
        np.testing.assert_allclose(found.phi_1, -turned.phi_1, rtol=1e-15)  # the last bit
        np.testing.assert_allclose(found.phi_2, turned.phi_2, rtol=1e-15)
