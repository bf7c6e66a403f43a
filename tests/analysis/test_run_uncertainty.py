"""What a run says of recorded signals: deviations, limits that may be kept, what is not determined."""

import dataclasses
import json
import math
import re

import numpy as np
import pytest
from samples.blurred import Blurred
from samples.robots import vsa_3r

from vsacli import Flag, Limits, Report, Trajectory, inverse_dynamics
from vsacli.actuators.reach import LimitCheck
from vsacli.analysis.joint_report import JointUncertainty, Spread
from vsacli.analysis.report import VERDICTS
from vsacli.analysis.run import Run
from vsacli.analysis.run_uncertainty import judged_variables
from vsacli.analysis.trouble_text import uncertainty_lines
from vsacli.base.flags import LIMITS, has_flag
from vsacli.base.signals import POSITION, STIFFNESS
from vsacli.base.variables import deviation
from vsacli.trajectory.curves import ConstantProfile
from vsacli.trajectory.curves.sinusoids import Sinusoids
from vsacli.trajectory.times import UniformTimes

SPAN = (0.0, 2.0)
AMPLITUDE = 0.3


def swinging(deviations, *, stiffness=1500.0, unreliable=(0.0, 0.0), known=True, rate=500.0):
    """Three joints that swing by `AMPLITUDE`; deviations of q to d4q, each joint's alike."""
    sines = Sinusoids(
        signal=POSITION,
        span=SPAN,
        cycles=2.0,
        offset=(0.0,) * 3,
        sine=((AMPLITUDE,) * 3,),
        cosine=((0.0,) * 3,),
    )
    covariances = np.repeat(np.diag(np.square(deviations, dtype=float))[None], 3, axis=0)
    if not known:
        covariances[2] = np.nan
    firm = ConstantProfile(signal=STIFFNESS, span=SPAN, value=(stiffness,) * 3)
    position = Blurred(sines, covariances, unreliable=unreliable)
    return Trajectory(UniformTimes(SPAN[1], rate), position, {"stiffness": firm}, name="swing")


def limited(**limits):
    """The 3R arm, whose base has limits, each of the size of a quantity."""
    base, *others = vsa_3r().joints
    ranges = Limits(**{name: (-size, size) for name, size in limits.items()})
    return dataclasses.replace(vsa_3r(), joints=(dataclasses.replace(base, limits=ranges), *others))


STEADY = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
SHAKY = (1e-5, 1e-4, 1e-3, 1e-2, 1e5)


def test_deviations_are_variables_of_the_result():
    result = inverse_dynamics(vsa_3r(), swinging(STEADY))
    np.testing.assert_allclose(result.d4q_std, 0.1, rtol=1e-12)
    assert result.tau_motor_std.shape == result.tau_motor.shape
    assert (result.tau_motor_std > 0).all()
    assert result.stiffness_std is None
    assert result.report.verdict == "ok"
    exact = swinging(STEADY)
    exact = Trajectory(exact.times, exact.position.exact, exact.commanded, name="swing")
    plain = inverse_dynamics(vsa_3r(), exact)
    assert not any(name.endswith("_std") for name in plain.arrays())
    assert all("uncertainty" not in joint for joint in plain.report.as_json()["joints"])
    for name, array in plain.arrays().items():
        np.testing.assert_array_equal(array, getattr(result, name))


@pytest.mark.slow
def test_results_do_not_depend_on_the_size_of_blocks():
    whole, parts = (
        Run(limited(position=0.2999), swinging(STEADY), block_samples=samples) for samples in (2000, 77)
    )
    arrays = [[block.arrays() for block in run] for run in (whole, parts)]
    for name, array in arrays[0][0].items():
        np.testing.assert_array_equal(array, np.concatenate([block[name] for block in arrays[1]]))
    expected, found = (run.report().as_json()["joints"] for run in (whole, parts))
    for one, other in zip(expected, found, strict=True):
        assert one["uncertainty"]["limits"] == other["uncertainty"]["limits"]
        for name, spread in one["uncertainty"]["variables"].items():
            assert other["uncertainty"]["variables"][name] == pytest.approx(spread)


@pytest.mark.parametrize(
    ("limit", "deviation", "exceeded"),
    [
        (0.2998, 1.1e-4, False),  # 2e-4 beyond, 2.2e-4 allowed
        (0.2998, 0.9e-4, True),
        (0.2990, 0.1, False),  # 1e-3 beyond; 1 % of the range of 0.598 is allowed
        (0.2930, 0.1, True),  # 7e-3 beyond, 5.86e-3 allowed
        (0.3001, 0.1, False),
    ],
)
def test_limits_of_recorded_motions_count_beyond_two_deviations_but_one_percent(limit, deviation, exceeded):
    result = inverse_dynamics(limited(position=limit), swinging((deviation, *STEADY[1:])))
    joint = result.report.joints[0]
    assert bool(joint.samples["over_limit"]) == exceeded
    assert has_flag(result.flags[:, 0], LIMITS).any() == exceeded
    within = joint.uncertainty.limits
    assert ("position_limit" in within) == (limit < AMPLITUDE)
    if not exceeded and within:
        line = next(line for line in str(result.report).splitlines() if "does not count" in line)
        assert line.startswith("base: position is ")
        assert f"its limit of {limit:g} rad" in line.replace("-", "")


def test_what_lies_beyond_the_allowance_stays_flagged_and_what_does_not_is_named():
    result = inverse_dynamics(limited(position=0.2998), swinging((9e-5, *STEADY[1:])))
    flagged = has_flag(result.flags[:, 0], Flag.POSITION_LIMIT)
    beyond = np.abs(result.q[:, 0]) - 0.2998
    np.testing.assert_array_equal(flagged, beyond > 1.8e-4 + 0.2998e-9)
    named = result.report.joints[0].uncertainty.limits["position_limit"]
    assert abs(named.value) - 0.2998 == pytest.approx(beyond[beyond <= 1.8e-4].max())


def test_a_peak_between_samples_that_keep_their_limit_within_the_uncertainty_counts():
    """Samples are 1e-4 beyond the limit, of which 2e-4 are allowed, and the four peaks 0.04."""
    sample = AMPLITUDE * math.sin(math.pi / 3)
    result = inverse_dynamics(limited(position=sample - 1e-4), swinging((1e-4, *STEADY[1:]), rate=6.0))
    joint = result.report.joints[0]
    assert abs(joint.worst["position_limit"].value) == pytest.approx(AMPLITUDE)
    assert result.report.verdict == "over_limit"
    assert has_flag(result.flags[:, 0], Flag.POSITION_LIMIT).sum() == joint.samples["over_limit"] == 4


def test_the_allowance_of_a_one_sided_limit_is_a_share_of_the_bound():
    check = LimitCheck(Flag.STIFFNESS_LIMIT, "stiffness", None, (-math.inf, 2000.0))
    allowed = check.allowance({"stiffness_std": np.array([1.0, 1e3, np.nan])})
    np.testing.assert_array_equal(allowed, [2.0, 20.0, 0.0])
    assert check.allowance({}) == 0


def test_torques_that_are_not_determined_make_a_run_unreliable():
    report = inverse_dynamics(vsa_3r(), swinging(SHAKY)).report
    assert report.verdict == "unreliable"
    text = str(report).splitlines()
    assert text[0] == "UNRELIABLE  vsa-3r, swing: 1001 samples, 2 s; 3 of 3 joints unreliable"
    assert any(
        line.startswith("elbow: tau_motor is not determined by the recording: its error may reach ")
        and line.endswith(" N m; 10 % is allowed")
        for line in text
    )
    spread = report.joints[0].uncertainty.variables["tau_motor"]
    assert spread.share > 0.1
    assert Report.from_json(json.loads(json.dumps(report.as_json()))) == report


@pytest.mark.slow
def test_it_is_what_was_asked_for_that_must_be_determined():
    def verdict(*asked):
        run = Run(vsa_3r(), swinging(SHAKY), asked=asked)
        assert sum(len(block.time) for block in run) == 1001
        return run.report().verdict

    assert verdict("tau_motor") == "unreliable"
    assert verdict("ddtheta") == "unreliable"  # has no deviation of its own
    assert verdict("d4q_std") == "unreliable"
    assert verdict("q", "tau_e") == "ok"
    assert verdict("flags", "stiffness") == "ok"
    assert judged_variables(["flags"], limited(velocity=2.0)) == ("dq", "tau_e")
    assert judged_variables(["motor_energy", "q", "time"], vsa_3r()) == ("q", "tau_motor")


def test_a_component_that_is_not_determined_makes_unreliable_what_depends_on_it():
    report = inverse_dynamics(vsa_3r(), swinging(STEADY, known=False)).report
    assert report.verdict == "unreliable"
    assert str(report).count("is not determined by the recording, since a signal") == 3
    assert report.as_json()["joints"][0]["uncertainty"]["variables"]["tau_motor"]["rms"] is None
    run = Run(vsa_3r(), swinging(STEADY, known=False), asked=["q"])
    assert list(run)
    assert [bool(joint.uncertainty.undetermined) for joint in run.report().joints] == [False, False, True]


@pytest.mark.parametrize(("deviations", "verdict"), [(STEADY, "ok"), (SHAKY, "unreliable")])
def test_a_bound_decides_without_being_stated(deviations, verdict):
    trajectory = swinging(deviations)
    position = dataclasses.replace(trajectory.position, known=False)
    result = inverse_dynamics(
        limited(position=0.2999), Trajectory(trajectory.times, position, trajectory.commanded, name="bound")
    )
    assert result.report.verdict == ("over_limit" if verdict == "ok" else verdict)
    assert np.isnan(result.tau_motor_std).all()
    assert np.isnan(result.q_std).all()
    spread = result.report.joints[0].uncertainty.variables["tau_motor"]
    assert math.isnan(spread.rms)
    assert math.isnan(spread.share)
    stated = inverse_dynamics(vsa_3r(), trajectory).report.joints[0].uncertainty.variables["tau_motor"]
    assert spread.bound == stated.bound == 2 * stated.share
    assert "+- unknown, wrong by at most " in str(result.report)
    assert result.report.joints[0].uncertainty.limits == {}  # no deviation to allow for


@pytest.mark.slow
def test_the_unreliable_ends_of_a_record_do_not_count():
    @dataclasses.dataclass(frozen=True)
    class Frayed(Blurred):
        def covariance(self, time):
            found = super().covariance(time)
            found[..., (time < 0.2) | (time > 1.9)] *= 1e14
            return found

    steady = swinging(STEADY).position
    position = Frayed(steady.exact, steady.covariances, unreliable=(0.21, 0.11))
    ends = Trajectory(UniformTimes(SPAN[1], 500.0), position, swinging(STEADY).commanded, name="frayed")
    assert inverse_dynamics(vsa_3r(), ends).report.verdict == "ok"
    assert "unreliable end" not in str(inverse_dynamics(vsa_3r(), ends).report)
    shorter = dataclasses.replace(position, unreliable=(0.19, 0.11))
    cut = Trajectory(ends.times, shorter, ends.commanded, name="frayed")
    assert inverse_dynamics(vsa_3r(), cut).report.verdict == "unreliable"
    # where they overlap, the half in the middle counts
    few = dataclasses.replace(position, unreliable=(1.5, 1.5))
    half = Trajectory(ends.times, few, ends.commanded, name="frayed")
    assert inverse_dynamics(vsa_3r(), half).report.verdict == "ok"


@pytest.mark.parametrize(("ratio", "said"), [(1.09, False), (1.11, True)])
def test_a_peak_at_an_end_is_reported_if_it_is_more_than_a_tenth_larger(ratio, said):
    joint = inverse_dynamics(vsa_3r(), swinging(STEADY)).report.joints[0]
    peak = ratio * joint.uncertainty.variables["tau_motor"].peak
    sentences = list(uncertainty_lines([dataclasses.replace(joint, peak_tau_motor=(peak, peak / 2))]))
    assert any("is at an unreliable end of the recording" in sentence for sentence in sentences) == said


def test_undetermined_derivatives_that_hardly_matter_are_put_into_proportion():
    report = inverse_dynamics(vsa_3r(), swinging(STEADY)).report
    doubted = dataclasses.replace(report, warnings=("d4q of base is not determined by the record to 10 %",))
    assert "depend little on it" not in str(report)
    assert re.search(r"motor torques depend little on it: their error may reach [\d.e-]+ % of", str(doubted))
    shaky = dataclasses.replace(inverse_dynamics(vsa_3r(), swinging(SHAKY)).report, warnings=doubted.warnings)
    assert "depend little on it" not in str(shaky)


@pytest.mark.slow
def test_infeasible_steps_within_the_uncertainty_are_counted_and_stay_infeasible():
    soft = swinging((1e-4, 1e-3, 1.0, 0.1, 1.0), stiffness=802.0)
    result = inverse_dynamics(vsa_3r(), soft)
    base = result.report.joints[0]
    within, all_of_them = base.uncertainty.samples["infeasible"], base.samples["infeasible"]
    assert 0 < within < all_of_them
    assert f"base: {within} of {all_of_them} samples that are infeasible may not be" in str(result.report)
    surer = inverse_dynamics(vsa_3r(), swinging(STEADY, stiffness=802.0)).report.joints[0]
    assert surer.samples["infeasible"] == all_of_them
    assert surer.uncertainty.samples["infeasible"] < within


def test_unreliable_is_worse_than_infeasible():
    assert VERDICTS.index("infeasible") < VERDICTS.index("unreliable") < VERDICTS.index("self_check_failed")
    both = inverse_dynamics(vsa_3r(), swinging(SHAKY, stiffness=802.0)).report
    assert both.joints[0].samples["infeasible"]
    assert both.verdict == "unreliable"


def test_a_spread_that_is_not_a_number_determines_nothing():
    assert not Spread("tau_motor", math.nan, math.nan, math.nan, math.nan, 9.0, "N m").determined
    assert Spread("tau_motor", 0.0, 0.0, 0.0, 0.0, 9.0, "N m").determined
    assert JointUncertainty().undetermined == ()
    assert deviation("d4q") == "d4q_std"
