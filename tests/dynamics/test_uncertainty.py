"""Propagation of uncertainty to first order, against noise that is drawn."""

import dataclasses

import numpy as np
import pytest
from samples.blurred import Blurred, random_covariances
from samples.plants import elastic, rigid, with_actuators
from samples.robots import random_robot, vsa_3r

from vsacli import Motion, Trajectory, Wrench, motor_torques
from vsacli.base.signals import POSITION, STIFFNESS, WRENCH
from vsacli.base.variables import UNCERTAIN, VARIABLES
from vsacli.base.wrench import WRENCH_NAMES
from vsacli.dynamics import uncertainty
from vsacli.dynamics.uncertainty import MARGIN, Uncertainty
from vsacli.trajectory.curves import ConstantProfile
from vsacli.trajectory.curves.sinusoids import Sinusoids
from vsacli.trajectory.profile import WrenchProfile
from vsacli.trajectory.times import UniformTimes

SPAN = (0.0, 2.0)
SIZES = 1e-5 * np.array([1.0, 10.0, 100.0, 1e3, 1e4])
"""Of the deviations of q to d4q, rad/s^k: what noise of 1e-5 rad leaves of a motion of 10 rad/s."""

DRAWS = 20_000
TIMES = np.array([0.31, 0.97, 1.6])

COMPUTED = ("tau_e", "dtau_e", "ddtau_e", "phi", "theta", "dtheta", "tau_motor")


def mixed():
    """Revolute and prismatic joints; an antagonistic, an elastic and a rigid one."""
    return with_actuators(random_robot("RPR", 3), {1: elastic(), 2: rigid()})


def blurred(joints, *, stiffness=1500.0, uncertain=None, exerted=False):
    """A motion of sines, a stiffness and perhaps a wrench, all uncertain."""
    amplitudes = tuple(0.3 - 0.05 * index for index in range(joints))
    sines = Sinusoids(
        signal=POSITION,
        span=SPAN,
        cycles=2.0,
        offset=(0.3,) * joints,
        sine=(amplitudes,),
        cosine=((0.0,) * joints,),
    )
    firm = ConstantProfile(signal=STIFFNESS, span=SPAN, value=(stiffness,) * joints)
    push = ConstantProfile(signal=WRENCH, span=SPAN, value=(5.0, -3.0, 8.0, 0.5, 1.0, -0.7))
    covariances = random_covariances(1, joints, SIZES) if uncertain is None else uncertain
    return Trajectory(
        UniformTimes(SPAN[1], 1000.0),
        Blurred(sines, covariances),
        {"stiffness": Blurred(firm, random_covariances(2, joints, np.array([0.5, 2.0, 30.0])))},
        wrench=WrenchProfile(Blurred(push, random_covariances(3, 6, np.array([0.01, 0.1, 1.0]))))
        if exerted
        else None,
        name="blurred",
    )


def drawn(robot, trajectory, time):
    """Standard deviations of what follows from a motion at one instant with drawn errors, by name."""
    rng = np.random.default_rng(0)
    arrays = {}
    for signal, estimate in trajectory.estimates.items():
        values = estimate.at(np.array([time]))[:, :, 0]
        roots = np.linalg.cholesky(estimate.covariances + 1e-30 * np.eye(signal.orders))
        errors = np.einsum("cmk,nck->mnc", roots, rng.standard_normal((DRAWS, *roots.shape[:2])))
        arrays |= dict(zip(signal.names, values[:, None] + errors, strict=True))
    wrench = None
    if trajectory.wrench is not None:
        wrench = Wrench(*(arrays[name] for name in WRENCH_NAMES), frame=trajectory.wrench.frame)
    block = motor_torques(robot, Motion.of(np.full(DRAWS, time), arrays, wrench))
    assert not block.flags.any()
    return {name: np.std(getattr(block, name), axis=0) for name in COMPUTED}


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "exerted"), [(vsa_3r(), False), (mixed(), False), (mixed(), True)], ids=["3r", "mixed", "push"]
)
def test_deviations_are_those_of_drawn_errors(robot, exerted):
    trajectory = blurred(3, exerted=exerted)
    found = Uncertainty(robot, trajectory).at(TIMES)
    for place, time in enumerate(TIMES):
        for name, expected in drawn(robot, trajectory, time).items():
            stated = found[name][place]
            assert (np.isnan(stated) == np.isnan(expected)).all()
            # 20,000 draws leave 0.5 % of a deviation; four such errors, and what is not linear
            np.testing.assert_allclose(stated, expected, rtol=0.025, atol=0, err_msg=f"{name} at {time}")


def test_the_deviations_of_one_joint_are_those_that_all_joints_have():
    robot = with_actuators(random_robot("RPRRRPR", 3), {1: elastic(), 2: rigid()})
    trajectory = blurred(len(robot.joints), exerted=True)
    motion, estimates = trajectory.at(TIMES), trajectory.estimates
    covariances = {signal: each.covariance(TIMES) for signal, each in estimates.items()}
    of_all = uncertainty.propagate_deviations(robot, motion, estimates, covariances)
    for index in range(len(robot.joints)):
        found = uncertainty.deviations_of_joint(robot, index, motion, estimates, covariances)
        assert set(of_all.deviations) - set(found.deviations) == {MARGIN, *WRENCH_NAMES}
        for name, array in found.deviations.items():
            expected = of_all.deviations[name][:, index].T
            # sums of fewer terms in another order
            np.testing.assert_allclose(array, expected, rtol=1e-11, err_msg=f"{name} of joint {index}")
            assert (found.unstated[name] == of_all.unstated[name][index]).all()


def test_what_is_given_has_no_deviation_and_counts_as_exact():
    alone = np.zeros((3, 5, 5))
    alone[1, 0, 0] = 1e-8  # of the second joint's position; all else is given
    trajectory = blurred(3, uncertain=alone)
    trajectory = Trajectory(
        trajectory.times,
        trajectory.position,
        {"stiffness": trajectory.commanded["stiffness"].exact},
        name="q",
    )
    found = Uncertainty(vsa_3r(), trajectory).at(TIMES)
    np.testing.assert_allclose(found["q"], [[0, 1e-4, 0]] * 3, rtol=1e-12)
    assert not found["d4q"].any()
    assert "stiffness" not in found
    assert (found["tau_e"][:, 1:] > 0).all()


@pytest.mark.slow
def test_nothing_is_said_of_what_depends_on_a_component_that_is_not_determined():
    trajectory = blurred(3)
    unknown = trajectory.commanded["stiffness"].covariances.copy()
    unknown[2] = np.nan
    soft = dataclasses.replace(trajectory.commanded["stiffness"], covariances=unknown)
    found = Uncertainty(
        vsa_3r(), Trajectory(trajectory.times, trajectory.position, {"stiffness": soft}, name="soft")
    ).at(TIMES)
    for name in ("tau_motor", "theta", MARGIN, "stiffness"):
        assert np.isnan(found[name][:, 2]).all()
        assert np.isfinite(found[name][:, :2]).all()
    assert np.isfinite(found["tau_e"]).all()

    shaky = random_covariances(1, 3, SIZES)
    shaky[2] = np.nan
    found = Uncertainty(vsa_3r(), blurred(3, uncertain=shaky)).at(TIMES)
    assert np.isnan(found["tau_e"]).all()  # the last joint moves all others
    assert np.isnan(found["tau_motor"]).all()
    assert np.isnan(found["q"][:, 2]).all()
    assert np.isfinite(found["q"][:, :2]).all()


@pytest.mark.slow
def test_near_the_end_of_the_corridor_the_side_counts_that_exists():
    # 800 N m/rad are the least that the base can have, and its stiffness has a deviation of about 0.5
    found = Uncertainty(vsa_3r(), blurred(3, stiffness=850.2)).at(np.linspace(*SPAN, 200))
    beyond = Uncertainty(vsa_3r(), blurred(3, stiffness=700.0)).at(TIMES)
    assert np.isfinite(found["tau_motor"]).all(axis=0).any()
    assert np.isnan(beyond["tau_motor"]).all()
    assert np.isfinite(beyond[MARGIN]).all()
    assert np.isfinite(beyond["tau_e"]).all()


def test_between_the_times_at_which_they_are_computed_deviations_are_linear(monkeypatch):
    time = np.linspace(*SPAN, 777)
    found = Uncertainty(vsa_3r(), blurred(3)).at(time)
    monkeypatch.setattr(uncertainty, "FEWEST_PROBES", 200)
    coarse = Uncertainty(vsa_3r(), blurred(3)).at(time)
    for name in COMPUTED:
        # a hundred times a period of a motion leave (2 pi/100)^2/8 = 5e-4 of what changes with its square
        size = np.sqrt(np.mean(found[name] ** 2, axis=0))
        assert (np.abs(coarse[name] - found[name]) < 5e-3 * size).all(), name


@pytest.mark.slow
def test_every_variable_that_may_have_a_deviation_gets_one():
    found = Uncertainty(vsa_3r(), blurred(3, exerted=True)).at(TIMES)
    assert set(found) == {*(name for name in UNCERTAIN if vsa_3r().has_variable(VARIABLES[name])), MARGIN}
    assert all(array.shape[0] == len(TIMES) for array in found.values())
