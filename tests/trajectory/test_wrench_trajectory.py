"""A wrench in trajectories and through the pipeline."""

from __future__ import annotations

import numpy as np
import pytest
from samples.moves import move
from samples.robots import vsa_3r
from samples.wrenches import held

from vsacli import InputError, Trajectory, inverse_dynamics, link_torques
from vsacli.base.signals import WRENCH
from vsacli.base.wrench import WRENCH_FRAMES, WRENCH_NAMES
from vsacli.trajectory.curves import ConstantProfile, RestToRest
from vsacli.trajectory.profile import WrenchProfile

frames = pytest.mark.parametrize("frame", WRENCH_FRAMES)

SPAN = (0.0, 2.0)


def trajectory(wrench: WrenchProfile | None) -> Trajectory:
    """The 3R arm reaches out and stiffens within 2 s."""
    ends = (0, 0, 0), (1.5, 0.7, -1)
    return move(2.0, 100.0, ends, stiffness=((850,) * 3, (1275,) * 3), wrench=wrench, name="reach")


def pushed(frame: str, profile_type: type[RestToRest] = RestToRest) -> Trajectory:
    """A push that grows, changes direction and stays within what the springs carry."""
    profile = profile_type(
        signal=WRENCH, span=SPAN, degree=3, start=(0, 4, -8, 0.5, 0, 1), end=(9, -3, 6, 0, -1.5, 2)
    )
    return trajectory(WrenchProfile(profile, frame))


@frames
def test_the_self_check_holds_under_a_wrench(frame: str) -> None:
    result = inverse_dynamics(held(vsa_3r()), pushed(frame))
    assert result.report.verdict == "ok"
    assert result.report.self_check.passed


class WrongRate(RestToRest):
    def at(self, time):
        return super().at(time) * [[[1.0]], [[1.01]], [[1.0]]]


def test_the_self_check_fails_if_the_wrench_is_not_what_its_rate_says() -> None:
    assert not inverse_dynamics(vsa_3r(), pushed("base", WrongRate)).report.self_check.passed


@frames
def test_a_trajectory_passes_its_wrench_on(frame: str) -> None:
    result = inverse_dynamics(vsa_3r(), pushed(frame))
    motion = pushed(frame).block(0, 201)
    assert motion.wrench is not None
    assert motion.wrench.frame == frame
    torques = link_torques(vsa_3r(), motion.q, motion.dq, motion.ddq, motion.d3q, motion.d4q, motion.wrench)
    np.testing.assert_array_equal((result.tau_e, result.dtau_e, result.ddtau_e), torques)
    np.testing.assert_array_equal(result.wrench, motion.wrench.wrench)
    assert result.wrench[[0, -1]].tolist() == [[0, 4, -8, 0.5, 0, 1], [9, -3, 6, 0, -1.5, 2]]


def test_without_a_wrench_the_result_has_none() -> None:
    result = inverse_dynamics(vsa_3r(), trajectory(None))
    assert (result.wrench, result.dwrench, result.ddwrench) == (None, None, None)


@frames
def test_a_run_that_ends_early_keeps_the_wrench_so_far(frame: str) -> None:
    heavy = ConstantProfile(signal=WRENCH, span=SPAN, value=(0, 0, -900, 0, 0, 0))
    result = inverse_dynamics(vsa_3r(), trajectory(WrenchProfile(heavy, frame)), stop_on_infeasible=True)
    assert not result.report.complete
    assert result.wrench.shape == (len(result.time), 6)


def test_a_stretched_trajectory_stretches_its_wrench() -> None:
    once, twice = pushed("base").at(np.array([0.6])), pushed("base").stretched(2).at(np.array([1.2]))
    for order, name in enumerate(WRENCH_NAMES):
        rate, slower = getattr(once.wrench, name), getattr(twice.wrench, name)
        np.testing.assert_allclose(slower * 2**order, rate, rtol=1e-14)  # some 10 eps
    assert twice.wrench.frame == "base"


def test_a_wrench_has_six_components_over_the_span_of_the_steps() -> None:
    with pytest.raises(InputError, match=r"the wrench has 3 components, not 6 \(fx, fy, fz, mx, my, mz\)"):
        WrenchProfile(ConstantProfile(signal=WRENCH, span=SPAN, value=(1, 2, 3)))
    with pytest.raises(InputError, match=r"the wrench spans 0 to 3 s, the steps 0 to 2 s"):
        trajectory(WrenchProfile(ConstantProfile(signal=WRENCH, span=(0, 3), value=(0,) * 6)))
    with pytest.raises(InputError, match=r"unknown frame 'tool' of the wrench; valid: end_effector, base"):
        WrenchProfile(ConstantProfile(signal=WRENCH, span=SPAN, value=(0,) * 6), "tool")


def sampled(**arrays: object) -> Trajectory:
    time = np.linspace(0, 1, 11)
    motion = {"q": np.outer(time, [1, 2, 3]), "stiffness": np.full((11, 3), 900.0)}
    return Trajectory.from_samples(time, **motion, **arrays)


def test_derivatives_that_are_given_are_used_and_others_are_those_of_a_spline() -> None:
    time = np.linspace(0, 1, 11)[:, None]
    cubic = time**3 * np.arange(1, 7)
    rates = np.full((11, 6), 7.0)
    motion = sampled(wrench=cubic, dwrench=rates, wrench_frame="base").block(0, 11)
    np.testing.assert_array_equal(motion.wrench.wrench, cubic)
    np.testing.assert_array_equal(motion.wrench.dwrench, rates)
    # a cubic spline is the cubic; its second derivative has rounding of eps / step^2 = 2e-14, times about 6
    np.testing.assert_allclose(motion.wrench.ddwrench, 6 * time * np.arange(1, 7), atol=1e-11)
    assert motion.wrench.frame == "base"


def test_samples_have_the_frame_of_the_end_effector_and_say_what_was_fitted() -> None:
    trajectory = sampled(wrench=np.ones((11, 6)))
    assert trajectory.block(0, 1).wrench.frame == "end_effector"
    assert any("dwrench, ddwrench come from a C4 spline through wrench" in w for w in trajectory.warnings)


@pytest.mark.parametrize(
    ("arrays", "problem"),
    [
        ({"wrench": np.ones((11, 3))}, r"wrench has the shape \(11, 3\), expected \(11, 6\)"),
        ({"wrench": np.ones((10, 6))}, r"wrench has the shape \(10, 6\), expected \(11, 6\)"),
        ({"wrench": np.ones((11, 6)), "dwrench": np.ones(11)}, r"dwrench has the shape \(11,\), expected"),
        ({"wrench": np.full((11, 6), np.nan)}, r"wrench\[0, 0\] must be finite, not nan"),
        (
            {"wrench": np.ones((11, 6)), "wrench_frame": "world"},
            r"unknown frame 'world' of the wrench; valid:",
        ),
        ({"dwrench": np.ones((11, 6))}, r"derivatives of a wrench are given, but not the wrench"),
    ],
)
def test_samples_that_are_no_wrench_are_refused(arrays: dict[str, object], problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        sampled(**arrays)
