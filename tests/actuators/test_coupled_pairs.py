"""Pairs with a spring between their motors: all of the pair as it was, but for what the motors feel."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from samples.driven_arm import ARM, LINK, assert_follows, motion_of, robot_of
from samples.full_model import Drive, springs_of
from samples.law_energies import SAMPLES
from samples.marks import needs_compiler, slow_but

from vsacli import Antagonistic, InputError, Motor, inverse_dynamics, laws

MOTOR = Motor(inertia=0.2, damping=0.1)
RANGE = (290.0, 340.0)
"""Stiffness of two cubic springs of 60 N m/rad at both ends of a motion, N m/rad."""

COUPLINGS = ("cubic", "polynomial", "sinh")


def pair(coupling: laws.SpringLaw | None, branch: str = "positive") -> Antagonistic:
    return Antagonistic(
        motor=(MOTOR, MOTOR), spring=(SAMPLES["cubic"].law,) * 2, coupling=coupling, branch=branch
    )


def drive_of(coupling: str | None) -> Drive:
    of_side = SAMPLES["cubic"].energy
    between = SAMPLES[coupling].energy if coupling else lambda _: 0
    return Drive(
        np.diag([0.2, 0.2]),
        [0.1, 0.1],
        springs_of(lambda q, one, two: of_side(one - q) + of_side(two - q) + between(one - two), 2),
    )


@pytest.mark.parametrize("coupling", slow_but(["sinh"], COUPLINGS))
def test_the_full_model_follows(coupling: str) -> None:
    law, drive = SAMPLES[coupling].law, drive_of(coupling)
    coupled = assert_follows(LINK, [pair(law)], [drive], [RANGE])
    alone = inverse_dynamics(robot_of(LINK, [pair(None)]), motion_of([RANGE]))
    changed = {"tau_transmission", "tau_motor", "elastic_energy", "motor_power", "motor_energy"}
    for name, values in coupled.arrays().items():
        if name not in changed:
            np.testing.assert_array_equal(values, getattr(alone, name), err_msg=name)
    added = coupled.tau_transmission - alone.tau_transmission
    # what is taken away again is off by the rounding of what it was added to
    rounding = 4 * np.spacing(np.abs(coupled.tau_transmission).max())
    np.testing.assert_allclose(added.sum(axis=-1), 0, atol=rounding)
    apart = coupled.theta[..., 0] - coupled.theta[..., 1]
    np.testing.assert_allclose(added[..., 0], law.torque(apart), rtol=1e-13, atol=rounding)


@pytest.mark.slow
def test_arms_with_and_without_couplings_follow() -> None:
    names = ("sinh", None, "cubic")
    actuators = [pair(SAMPLES[name].law if name else None, "negative") for name in names]
    assert_follows(ARM, actuators, [drive_of(name) for name in names], [RANGE] * 3)


def test_the_work_of_the_motors_is_what_all_springs_and_the_rest_take() -> None:
    """From rest to rest without damping or gravity, it is all in the springs."""
    law = SAMPLES["sinh"].law
    motor = Motor(inertia=0.2)
    actuator = Antagonistic(motor=(motor, motor), spring=(laws.Cubic(k=60, k_c=900),) * 2, coupling=law)
    arm = dataclasses.replace(LINK, damping=[0.0], gravity=0.0)
    result = inverse_dynamics(robot_of(arm, [actuator]), motion_of([RANGE]))
    work = result.motor_energy[-1].sum()
    # integrated step by step by cubics, h = 0.5 ms
    assert work == pytest.approx(np.ptp(result.elastic_energy[[0, -1], 0]), rel=1e-9)
    [joint] = result.report.joints
    assert np.isnan([joint.energy.co_contraction, joint.energy.load, joint.energy.co_contraction_share]).all()
    assert "co-contraction" not in str(result.report)


@pytest.mark.slow
@needs_compiler
def test_the_compiled_engine_agrees() -> None:
    robot, motion = robot_of(ARM, [pair(SAMPLES[name].law) for name in COUPLINGS]), motion_of([RANGE] * 3)
    numpy, compiled = (inverse_dynamics(robot, motion, engine=name) for name in ("numpy", "c"))
    np.testing.assert_array_equal(compiled.flags, numpy.flags)
    for name in ("tau_transmission", "tau_motor", "elastic_energy", "motor_energy"):
        one, other = getattr(numpy, name), getattr(compiled, name)
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-12 * np.abs(one).max())


@pytest.mark.parametrize(
    ("coupling", "message"),
    [
        (
            laws.Exponential(c=1, a=2),
            "coupling: holds from 0 to inf only, but the motors may be any distance",
        ),
        (SAMPLES["table"].law, "coupling: holds from -0.6 to 0.6 only, but the motors may be any distance"),
        (
            laws.Polynomial(c1=2, max_deflection=1),
            "coupling.max_deflection: is not known of a spring between",
        ),
    ],
)
def test_a_coupling_has_no_end(coupling: laws.SpringLaw, message: str) -> None:
    with pytest.raises(InputError, match=message):
        pair(coupling)
