"""`vsacli sensitivity`: what it says of the paper's arm, of tolerances, and of what it cannot use."""

from __future__ import annotations

import json
import math

import h5py
import numpy as np
import pytest
from samples.command_line import REPOSITORY, REST_TO_REST, ROBOT, rest_to_rest

from vsacli import InputError, load_robot, load_trajectory, motor_torques, sensitivity
from vsacli.actuators.reach import margin
from vsacli.results.charts.ranking import Ranking
from vsacli.results.plots import ranking_figure
from vsacli.robot.parameters import parameters
from vsacli.studies.sensitivities import SensitivityRun


@pytest.fixture(scope="module")
def arm():
    return load_robot(ROBOT)


@pytest.fixture(scope="module")
def motion(arm, tmp_path_factory):
    return load_trajectory(rest_to_rest(tmp_path_factory.mktemp("motion") / "coarse.yaml"), arm)


def run(robot, motion):
    block = motor_torques(robot, motion.block(0, motion.samples))
    return block, margin(block.stiffness, block.stiffness_min, block.stiffness_max)


def test_the_ranking_is_what_changes_do(arm, motion):
    found = sensitivity(arm, motion)
    order = [each.path for each in found.parameters if each.most][:3]
    assert order == [f"joints.{name}.actuator.spring.k" for name in ("shoulder", "base", "elbow")]
    block, gap = run(arm, motion)
    for each in found.parameters[:12]:
        joint, effect = each.most
        index = arm.joint_names.index(joint)
        # A thousandth of the step, both ways: what is quadratic in it cancels, and cubic terms are 1e-6.
        more, less = (
            run(arm.replace(each.path, each.value + sign * each.step / 1000), motion) for sign in (1, -1)
        )
        changes = np.abs(more[0].tau_motor - less[0].tau_motor)[:, index] * 500
        assert effect.torque == pytest.approx(np.nanmax(changes), rel=1e-5)
        assert effect.share == pytest.approx(
            np.nanmax(changes) / np.nanmax(np.abs(block.tau_motor[:, index])), rel=1e-5
        )
        step = gap[:, index].argmin()
        assert effect.margin == pytest.approx((more[1] - less[1])[step, index] * 500, rel=1e-4, abs=1e-9)
        power = [np.maximum(each[0].motor_power, 0).sum(axis=-1)[:, index] for each in (more, less)]
        spent = (
            np.diff(block.time) * (power[0] - power[1] + np.roll(power[0] - power[1], -1))[:-1] / 2
        ).sum() * 500
        # Where a motor begins or ends to spend, the sums differ by the square of the small step.
        assert effect.spent == pytest.approx(spent, rel=1e-3, abs=1e-5)


def test_published_figures_of_the_papers_arm(vsacli):
    lines = vsacli("sensitivity", ROBOT, REST_TO_REST).out.splitlines()
    rows = {line.split()[0]: line.split() for line in lines if line}
    assert rows["joints.shoulder.actuator.spring.k"][3:6] == ["shoulder", "2.3", "2.49"]
    assert rows["joints.shoulder.actuator.spring.k_c"][3:5] == ["shoulder", "0.44"]
    assert rows["joints.elbow.link.mass"][3:5] == ["shoulder", "0.18"]


@pytest.mark.exhaustive
@pytest.mark.slow
def test_drawn_robots_agree_with_the_first_order(arm):
    """With 1000 draws a deviation is known to 2 %; the rest is what first order leaves out."""
    page = (REPOSITORY / "docs/sensitivity.md").read_text(encoding="utf-8")
    found = sensitivity(arm, load_trajectory(REST_TO_REST, arm), tolerances="2%", runs=1000)
    drawn = found.monte_carlo
    assert drawn.refused == 0
    for joint, band in found.band.items():
        if band.margin > 0.05:
            assert drawn.torque[joint] == pytest.approx(band.torque, rel=0.1)
        torques = f"| +- {band.torque:.2f} N m | +- {drawn.torque[joint]:.2f} N m"
        lost = f"| {100 * band.lost:.2g} % | {100 * drawn.lost[joint]:.2g} % |"
        assert f"| {joint} | {100 * band.margin:.2f} % {torques} {lost}" in page


def test_a_deviation_takes_two_robots_with_torques():
    robot = load_robot(REPOSITORY / "robots/planar_2r.yaml")
    trajectory = load_trajectory(REPOSITORY / "trajectories/planar_2r.yaml", robot)
    found = sensitivity(robot, trajectory, tolerances="20%", runs=2, seed=4)
    assert found.monte_carlo.lost["shoulder"] == 0.5
    assert np.isnan(found.monte_carlo.torque["shoulder"])
    header, *_ = rows = found.as_text().tables[0]
    shoulder = dict(zip(header, rows[1], strict=True))
    assert (shoulder["drawn +-\nN m"], shoulder["infeasible\n% of draws"]) == ("-", "50")


def test_the_chance_that_a_margin_is_lost(arm, motion, tmp_path):
    (tmp_path / "t.yaml").write_text("joints.shoulder.actuator.spring.k: {normal: 4 %}\n")
    found = sensitivity(arm, motion, tolerances=str(tmp_path / "t.yaml"))
    band = found.band["shoulder"]
    assert band.lost == pytest.approx(math.erfc(band.margin / band.margin_deviation / math.sqrt(2)) / 2)
    (changed,) = [each for each in found.parameters if each.tolerance]
    assert changed.tolerance == pytest.approx(0.04 * 400)
    assert band.margin_deviation == pytest.approx(4 * abs(changed.joints["shoulder"].margin), rel=1e-3)
    assert found.band["elbow"].torque == 0


def test_uniform_tolerances_and_units(arm, motion, tmp_path):
    text = "joints.*.link.mass: {uniform: 3 %}\njoints.base.dh.alpha: {normal: 1 deg}\n"
    (tmp_path / "t.yaml").write_text(text)
    found = {
        each.path: each.tolerance
        for each in sensitivity(arm, motion, tolerances=str(tmp_path / "t.yaml")).parameters
    }
    assert found["joints.elbow.link.mass"] == pytest.approx(0.03 * 5.0894 / math.sqrt(3))
    assert found["joints.base.dh.alpha"] == pytest.approx(math.radians(1))
    assert found["joints.base.link.com.0"] == 0


def test_limits_are_no_parameters(arm):
    assert not [each for each in parameters(arm) if "limits" in str(each) or "max_" in str(each)]


def test_json_has_every_number(vsacli, tmp_path):
    rest_to_rest(tmp_path / "coarse.yaml")
    report = json.loads(
        vsacli("sensitivity", ROBOT, "coarse.yaml", "--json", "--parameters", "joints.*.actuator.*").out
    )
    assert report["format"] == "vsacli-sensitivity/2"
    assert {each["path"].split(".")[2] for each in report["parameters"]} == {"actuator"}
    assert len(report["parameters"]) == 12
    assert set(report["parameters"][0]["joints"]["shoulder"]) == {
        "torque",
        "share",
        "time",
        "motor",
        "margin",
        "spent",
    }


BAD = {
    "no parameter of the robot matches 'joints.*.max'": ["--parameters", "joints.*.max"],
    "t.yaml: no such file": ["--tolerances", "t.yaml"],
    "'-3%': expected a share from 0 % to 100 %, e.g. 2% or 0.02": ["--tolerances", "-3%"],
    "'1e300%': expected a share from 0 % to 100 %, e.g. 2% or 0.02": ["--tolerances", "1e300%"],
    "'300%': expected a share from 0 % to 100 %, e.g. 2% or 0.02": ["--tolerances", "300%"],
    "none of 2 drawn robots is valid; choose smaller": ["--tolerances", "wide.yaml", "--monte-carlo", "2"],
    "'x%': expected a share from 0 % to 100 %, e.g. 2% or 0.02": ["--tolerances", "x%"],
    "'5' has no unit; write 5% for all parameters, or name a YAML file": ["--tolerances", "5"],
    "coarse.yaml: is a trajectory, but --tolerances must be a tolerances file (YAML, e.g. joints": [
        "--tolerances",
        "coarse.yaml",
    ],
    "give --tolerances": ["--monte-carlo", "10"],
    "bad.yaml:1: joints.*.link.mass: expected a distribution": ["--tolerances", "bad.yaml"],
    "bad.yaml:2: no parameter of the robot matches": ["--tolerances", "bad.yaml"],
}


@pytest.mark.parametrize(
    ("pattern", "hint"),
    [
        ("joints.*.masss", "did you mean 'joints.*.link.mass'?"),
        ("k", "did you mean 'joints.*.actuator.spring.k'?"),
        ("joints.elbw.link.mass", "did you mean 'joints.elbow.link.mass'?"),
        ("joints.*.inert", "did you mean 'joints.*.actuator.motor.inertia'?"),
        (
            "name",
            "valid: gravity.*, base.*, tool.*, joints.*.dh.*, joints.*.link.*, joints.*.damping, "
            "joints.*.actuator.*",
        ),
    ],
)
def test_a_pattern_that_matches_nothing(pattern, hint):
    with pytest.raises(InputError) as caught:
        parameters(load_robot(ROBOT), [pattern])
    assert str(caught.value) == f"no parameter of the robot matches {pattern!r}; {hint}"


@pytest.mark.parametrize("sentence", BAD)
def test_what_cannot_be_used_is_said(vsacli, tmp_path, sentence):
    rest_to_rest(tmp_path / "coarse.yaml")
    (tmp_path / "bad.yaml").write_text("joints.*.link.mass: 3 %\njoints.foot.link.mass: {normal: 1 %}\n")
    (tmp_path / "wide.yaml").write_text("joints.*.link.mass: {normal: 1e9}\n")
    done = vsacli("sensitivity", ROBOT, "coarse.yaml", *BAD[sentence])
    assert (done.code, done.out) == (2, "")
    assert sentence in done.err


def test_the_file_has_the_derivatives_over_time(vsacli, tmp_path, arm):
    motion = load_trajectory(rest_to_rest(tmp_path / "coarse.yaml"), arm)
    done = vsacli(
        "sensitivity", ROBOT, "coarse.yaml", "-o", "s.h5", "--parameters", "joints.elbow.*", "--json"
    )
    assert done.code == 0
    (part,) = SensitivityRun(arm, motion, ["joints.elbow.*"])
    with h5py.File(tmp_path / "s.h5") as file:
        assert file.attrs["format"] == "vsacli-sensitivity/2"
        assert file.attrs["verdict"] == json.loads(done.out)["verdict"] == "ok"
        paths = file["parameter"].asstr()[...].tolist()
        values = dict(zip(paths, file["parameter_value"][...].tolist(), strict=True))
        assert values["joints.elbow.link.mass"] == 5.0894
        assert file["parameter_unit"].asstr()[paths.index("joints.elbow.link.mass")] == "kg"
        np.testing.assert_array_equal(file["tau_motor"][...], part.block.tau_motor)
        for name in SensitivityRun.slopes:
            stored = file[f"{name}_slope"]
            np.testing.assert_array_equal(stored[...], part.over_time(name))
            dims = [stored.dims[axis].keys()[0] for axis in range(stored.ndim)]
            assert dims == ["time", "parameter", "joint", "motor"][: stored.ndim]


@pytest.mark.slow
def test_figures_show_ranking_and_bands(vsacli, tmp_path):
    rest_to_rest(tmp_path / "coarse.yaml")
    assert vsacli("sensitivity", ROBOT, "coarse.yaml", "--tolerances", "2%", "--plot", "figures").code == 0
    assert {path.name for path in (tmp_path / "figures").iterdir()} == {
        "vsa_3r-coarse-ranking.png",
        "vsa_3r-coarse-band.png",
    }
    assert vsacli("sensitivity", ROBOT, "coarse.yaml", "--plot", "figures").code == 4
    assert vsacli("sensitivity", ROBOT, "coarse.yaml", "--plot", "others").code == 0
    assert [path.name for path in (tmp_path / "others").iterdir()] == ["vsa_3r-coarse-ranking.png"]


@pytest.mark.slow
def test_plot_draws_the_ranking_of_a_file(vsacli, tmp_path):
    """The same figure as `sensitivity --plot`; the bands need curves that the file does not have."""
    rest_to_rest(tmp_path / "coarse.yaml")
    made = vsacli(
        "sensitivity", ROBOT, "coarse.yaml", "--tolerances", "2%", "-o", "s.h5", "--plot", "figures"
    )
    assert made.code == 0
    done = vsacli("plot", "s.h5", "-o", "again")
    assert done.code == 0
    assert "no figure of the tolerance bands: `vsacli sensitivity --plot` draws it" in done.err
    (figure,) = (tmp_path / "again").iterdir()
    assert figure.name == "s-ranking.png"
    assert figure.read_bytes() == (tmp_path / "figures" / "vsa_3r-coarse-ranking.png").read_bytes()
    (tmp_path / "copy.h5").write_bytes((tmp_path / "s.h5").read_bytes())
    for options, part in (
        (["s.h5"], "s.h5 is given twice"),
        (["copy.h5"], "one at a time"),
        (["--format", "html"], "for results, simulations and studies"),
        (["--joints", "elbow"], "--joints cannot be used with sensitivity files"),
    ):
        refused = vsacli("plot", "s.h5", *options, "-o", "other")
        assert refused.code == 2
        assert part in " ".join(refused.err.split())


def test_figures_say_what_they_show_in_words(arm, motion):
    found = sensitivity(arm, motion)
    ranking = Ranking.of(json.loads(json.dumps(found.as_json())), arm.joint_names)
    assert ranking.title == f"sensitivity of {found.robot}, {found.trajectory}: 15 of 72 parameters"
    assert ranking.bars[0].label == "1 % of spring stiffness k, shoulder"
    assert [bar.share for bar in ranking.bars] == [each.share for each in found.top]
    changes = {bar.label.partition(" of ")[0] for bar in ranking.bars}
    assert changes == {each.words for each in found.top}
    figure = ranking_figure(ranking)
    assert [text.get_text() for text in figure.axes[0].texts][:3] == [" shoulder", " base", " elbow"]


def test_without_a_feasible_step_there_is_no_torque_to_be_off(vsacli, tmp_path):
    rest_to_rest(tmp_path / "coarse.yaml")
    done = vsacli("sensitivity", ROBOT, "coarse.yaml", "--tolerances", "5%", "--set", "stiffness.start=10",
                  "--set", "stiffness.end=20")  # fmt: skip
    assert "nan" not in done.out
    [base] = [line for line in done.out.splitlines() if line.startswith("base  ")]
    assert base.split()[1:4] == ["-", "-", "-"]
    assert base.split()[-1] == "100"


def test_steps_that_cannot_be_done_do_not_count(vsacli, tmp_path):
    rest_to_rest(tmp_path / "soft.yaml", 790)
    done = vsacli("sensitivity", ROBOT, "soft.yaml")
    assert done.code == 3
    first, second = done.out.splitlines()[:2]
    assert first.startswith("INFEASIBLE  vsa-3r, ")
    report = json.loads(vsacli("sensitivity", ROBOT, "soft.yaml", "--json").out)
    left_out, samples = report["left_out"], report["samples"]
    assert 0 < left_out < samples
    assert (
        second == f"{left_out} of {samples} samples are infeasible and left out; check-feasibility says why"
    )
    assert "nan" not in done.out


def test_implausible_values_are_reported(vsacli, tmp_path):
    rest_to_rest(tmp_path / "coarse.yaml")
    done = vsacli("sensitivity", ROBOT, "coarse.yaml", "--set", "joints.elbow.link.com=[0,0,150]")
    warning = "joints.elbow.link.com.2 (z) = 150 m is "
    assert f"\nwarning: {warning}" in done.out
