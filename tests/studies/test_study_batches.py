"""Rows of a study, most of which are computed together, against the runs of the public functions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples.marks import needs_compiler
from samples.studies import DRAWN, column, study

from vsacli import Report, inverse_dynamics, load_robot, load_trajectory, run_study
from vsacli.studies.sweeps.study import Study, load_study

MIXED = """
method: random
samples: 14
seed: 2
vary:
  joints.*.link.mass: {normal: 5 %}
  joints.shoulder.actuator.spring.0.k: [395, 405]
  joints.elbow.actuator.motor.inertia: {uniform: 20 %}
  joints.base.actuator.motor.max_torque: [90, 300]
  stiffness.end: [700, 1275]
"""
"""Numbers that are rows, others with a batch for each value, and motions too soft for some of the springs."""


def report_of(read: Study, run: int) -> Report:
    point = read.point(run)
    robot = load_robot(read.source.path.replace("study.yaml", "arm.yaml"), point.changes.robot)
    path = read.trajectories[point.trajectory]
    return inverse_dynamics(robot, load_trajectory(path, robot, point.changes.trajectory)).report


@pytest.mark.parametrize("engine", ["numpy", pytest.param("c", marks=needs_compiler)])
def test_rows_are_those_of_single_runs(tmp_path: Path, engine: str) -> None:
    path, table = study(tmp_path, MIXED), tmp_path / "table.h5"
    run_study(path, table, processes=1, engine=engine).close()
    read, verdicts = load_study(path), column(table, "verdict")
    assert len(read.varied_parameters) == 5  # three masses, an inertia and a limit
    assert len(set(verdicts)) > 1
    for run in range(read.runs):
        report = report_of(read, run)
        assert verdicts[run] == report.verdict
        for number, joint in enumerate(report.joints):
            for name in ("margin", "margin_time", "peak_tau_e"):
                # Margins are differences of stiffnesses, and known to their rounding.
                expected = pytest.approx(getattr(joint, name), rel=1e-12, abs=1e-12, nan_ok=True)
                assert column(table, name)[run, number] == expected
            feasible = not (joint.samples["infeasible"] or joint.samples["singular"])
            spent = joint.energy.spent if feasible else np.nan
            assert column(table, "energy_spent")[run, number] == pytest.approx(spent, rel=1e-12, nan_ok=True)


def test_a_run_that_fails_in_a_batch_costs_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its row names the values with which it failed."""
    path = study(tmp_path, DRAWN)
    third = str(load_study(path).point(2).values["joints.base.actuator.spring.k"])
    whole = tmp_path / "whole.h5"
    run_study(path, whole, processes=1).close()

    def broken(variants, *arguments, **keywords):
        if any(str(robot.joints[0].actuator.spring[0].k) == third for robot in variants.robots):
            raise ZeroDivisionError("by chance")
        return Batch(variants, *arguments, **keywords)

    from vsacli.studies.sweeps.rows import Batch

    monkeypatch.setattr("vsacli.studies.sweeps.rows.Batch", broken)
    run_study(path, tmp_path / "broken.h5", processes=1).close()
    errors = column(tmp_path / "broken.h5", "error")
    assert [bool(error) for error in errors] == [False, False, True, False, False, False]
    assert "ZeroDivisionError: by chance" in errors[2]
    assert f"joints.base.actuator.spring.k={third}" in errors[2]
    others = [0, 1, 3, 4, 5]
    assert np.array_equal(column(tmp_path / "broken.h5", "margin")[others], column(whole, "margin")[others])


def test_runs_are_a_batch_even_if_the_first_one_cannot_be_built(tmp_path: Path) -> None:
    text = "method: random\nsamples: 6\nseed: {}\nvary: {{joints.base.link.mass: {{normal: 100 %}}}}\n"
    drawn = (load_study(study(tmp_path, text.format(seed))) for seed in range(20))
    read = next(each for each in drawn if each.point(0).values["joints.base.link.mass"] < 0)
    assert [str(number) for number in read.varied_parameters] == ["joints.base.link.mass"]
