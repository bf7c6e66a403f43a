"""Elastic joints with springs of any law: the deflection, its derivatives, and where there is none."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from samples.driven_arm import ARM, LINK, assert_follows, motion_of, robot_of
from samples.full_model import Drive, springs_of
from samples.law_energies import SAMPLES
from samples.marks import needs_compiler, slow_but
from samples.springs import SPRINGS
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq

from vsacli import Antagonistic, Elastic, Flag, InputError, Motor, inverse_dynamics, laws
from vsacli.actuators.transmission import Command, JointVariables

MOTOR = Motor(inertia=0.2, damping=0.1)
NONE = (np.nan, np.nan)
HEAVY = dataclasses.replace(LINK, gravity=60.0)
"""So that a tendon is pulled all the way."""


def elastic(law: laws.SpringLaw) -> Elastic:
    return Elastic(motor=MOTOR, spring=law)


def drive_of(name: str) -> Drive:
    energy = SAMPLES[name].energy
    return Drive(0.2, [0.1], springs_of(lambda q, theta: energy(theta - q), 1))


def asked(tau_e: list[float], **rates: float) -> Command:
    """A command of torques, (samples,), whose derivatives are the same at all; nothing else moves."""
    arrays = {name: np.full(len(tau_e), rates.get(name, 0.0)) for name in Command.names(())}
    return Command.of({**arrays, "tau_e": np.array(tau_e)})


def transmit(law: laws.SpringLaw, tau_e: list[float], **rates: float) -> JointVariables:
    return elastic(law).transmit(asked(tau_e, **rates), 0.01, None)


@pytest.mark.parametrize("name", slow_but(["cubic", "quadratic", "table"], SAMPLES))
def test_the_full_model_follows(name: str) -> None:
    law, arm = SAMPLES[name].law, LINK if name not in ("exponential", "quadratic") else HEAVY
    result = assert_follows(arm, [elastic(law)], [drive_of(name)], [NONE])
    assert np.ptp(result.stiffness) > 0.1 * result.stiffness.max()
    # the spline through 1000 samples a second, relative to the peak; what is seen is 1e-8
    stiffness = make_interp_spline(result.time, result.stiffness[:, 0], k=7)
    for order, found in ((1, result.dstiffness), (2, result.ddstiffness)):
        np.testing.assert_allclose(
            found[:, 0], stiffness(result.time, order), rtol=0, atol=1e-6 * np.abs(found).max()
        )
    assert np.isnan([result.stiffness_min, result.stiffness_max, result.det_A]).all()


@pytest.mark.slow
def test_an_arm_of_springs_of_several_laws_follows() -> None:
    linear = Elastic(motor=MOTOR, stiffness=300)
    of_linear = Drive(0.2, [0.1], springs_of(lambda q, theta: 150 * (theta - q) ** 2, 1))
    actuators = [elastic(SAMPLES["sinh"].law), linear, elastic(SAMPLES["table"].law)]
    assert_follows(ARM, actuators, [drive_of("sinh"), of_linear, drive_of("table")], [NONE] * 3)


@pytest.mark.parametrize("law", SPRINGS)
@pytest.mark.parametrize("side", [0, 1])
def test_the_deflection_is_the_root_that_bracketing_finds(law: str, side: int) -> None:
    spring, curve = SPRINGS[law][side]
    low, high = np.clip(spring.domain, -0.6, 0.6)
    torque = curve.torque(np.linspace(low, high, 41)[1:-1])
    found = transmit(spring, torque.tolist())
    for load, deflection in zip(torque, found.phi[0], strict=True):
        root = brentq(lambda x, load=load: float(curve.torque(np.array(x))) - load, low, high, xtol=1e-15)
        assert deflection == pytest.approx(root, rel=1e-11, abs=1e-12)  # where there is no stiffness at rest


def test_a_linear_law_is_the_same_as_its_stiffness() -> None:
    command = asked([-3.0, 0.0, 7.0], dtau_e=2.0, ddtau_e=-5.0, ddq=1.5)
    linear = Elastic(motor=MOTOR, stiffness=40).transmit(command, 0.01, None)
    law = elastic(laws.Polynomial(c1=40)).transmit(command, 0.01, None)
    assert law.by_name().keys() == linear.by_name().keys()
    for name, values in law.by_name().items():
        np.testing.assert_allclose(values, getattr(linear, name), rtol=1e-15)


def test_a_tendon_does_not_push() -> None:
    found = transmit(laws.Exponential(c=4, a=6), [-1.0, -1e-12, 0.0, 3.0], dtau_e=1.0)
    slack = Flag.INFEASIBLE | Flag.SLACK
    assert found.flags.tolist() == [slack, slack, 0, 0]
    np.testing.assert_allclose(found.stiffness, [np.nan, np.nan, 24, 42])
    for name in ("stiffness", "dstiffness", "ddstiffness", "elastic_energy"):
        assert np.isnan(getattr(found, name)[:2]).all()
    for name in ("phi", "dphi", "ddtheta", "tau_transmission"):
        assert np.isnan(getattr(found, name)[0, :2]).all()
        assert np.isfinite(getattr(found, name)[0, 2:]).all()


def test_a_tendon_without_stiffness_at_rest_is_singular_there() -> None:
    found = transmit(laws.Quadratic(k=100), [0.0, 4.0], dtau_e=1.0)
    assert found.flags.tolist() == [Flag.SINGULAR, 0]
    assert (found.phi[0, 0], found.tau_transmission[0, 0], found.stiffness[0]) == (0, 0, 0)
    for values in (found.dphi[0], found.ddtheta[0], found.dstiffness, found.ddstiffness):
        assert np.isnan(values[0])
        assert np.isfinite(values[1])


@pytest.mark.parametrize("law", [laws.FourBar(k=30, ratio=1.4), SAMPLES["table"].law])
def test_beyond_the_end_of_its_law_a_spring_carries_nothing(law: laws.SpringLaw) -> None:
    low, high = law.torque_range
    # what exceeds the end by less than a billionth, as rounding does, is at the end
    found = transmit(law, [1.001 * low, low, high, high * (1 + 1e-10), 1.001 * high])
    assert found.flags.tolist() == [Flag.INFEASIBLE, 0, 0, 0, Flag.INFEASIBLE]
    np.testing.assert_allclose(found.phi[0, 1:4], [*law.domain, law.domain[1]], rtol=1e-9)


def test_a_law_or_a_stiffness_but_not_both() -> None:
    with pytest.raises(InputError, match=r"missing key 'stiffness' .* or 'spring'"):
        Elastic(motor=MOTOR)
    with pytest.raises(InputError, match="stiffness: the law of `spring` says already how stiff"):
        Elastic(motor=MOTOR, stiffness=3, spring=laws.Cubic(k=1, k_c=1))


@pytest.mark.slow
@needs_compiler
def test_the_compiled_engine_agrees() -> None:
    hardening = [SAMPLES["sinh"].law, SAMPLES["polynomial"].law, SAMPLES["quadratic"].law]
    robot, motion = robot_of(ARM, [elastic(law) for law in hardening]), motion_of([NONE] * 3)
    numpy, compiled = (inverse_dynamics(robot, motion, engine=name) for name in ("numpy", "c"))
    np.testing.assert_array_equal(compiled.flags, numpy.flags)
    assert (numpy.flags & Flag.SLACK).any()
    for name in ("stiffness", "dstiffness", "ddstiffness", "phi", "ddtheta", "tau_motor", "elastic_energy"):
        one, other = getattr(numpy, name), getattr(compiled, name)
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-12 * np.nanmax(np.abs(one)))


@pytest.mark.slow
def test_one_spring_beside_pairs() -> None:
    pair = Antagonistic(motor=(MOTOR, MOTOR), spring=(laws.Cubic(k=60, k_c=900),) * 2)
    energy = SAMPLES["cubic"].energy
    of_pair = Drive(
        np.diag([0.2, 0.2]), [0.1, 0.1], springs_of(lambda q, *theta: sum(energy(x - q) for x in theta), 2)
    )
    one = elastic(SAMPLES["cubic"].law)
    drives = [drive_of("cubic"), of_pair, drive_of("cubic")]
    assert_follows(ARM, [one, pair, one], drives, [NONE, (150, 200), NONE])
