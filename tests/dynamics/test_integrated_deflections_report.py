"""What a report says of integrated deflections: how far they drift, and whether that matters."""

from __future__ import annotations

import numpy as np
import pytest
from samples.deflections import (
    ARM,
    COARSE,
    drifts,
    integrated,
    motion,
)
from samples.shipped import shipped_run

from vsacli import inverse_dynamics


def test_loose_integration_drifts_and_says_so():
    loose = integrated(ARM, motion(), tolerance=1e-3)
    largest = max(drifts(loose))
    # Each step may err by 1e-3 of 0.1 rad.
    assert 1e-7 < largest < 1e-3
    base, _ = loose.report.drifts
    when = float(np.abs(loose.phi - inverse_dynamics(ARM, motion()).phi)[:, 0].max(axis=1).argmax()) / 100
    assert base.time == pytest.approx(when)
    assert f"integration drift: base {base.largest:.1e} rad at {base.time:.3f} s, shoulder" in str(
        loose.report
    )


def test_drift_beyond_its_bound_fails_the_self_check():
    loose = integrated(ARM, motion(), tolerance=1e-3)
    assert loose.report.self_check.spring_residual > 1e-6
    assert loose.report.self_check.ladder < 1e-8
    assert loose.report.verdict == "self_check_failed"
    finding = str(loose.report).splitlines()[1]
    assert finding.startswith("do not use these torques: the self-check failed")
    assert finding.endswith(" of springs (bound 1e-06)")


def test_report_as_json():
    report = integrated(ARM, motion(), COARSE).report
    entry = report.as_json()["deflections"]
    assert entry["method"] == "ode"
    assert [joint["joint"] for joint in entry["joints"]] == ["base", "shoulder"]
    for joint, drift in zip(entry["joints"], report.drifts, strict=True):
        assert (joint["drift"], joint["time"]) == (drift.largest, drift.time)
        assert (joint["unit"], joint["stopped"]) == ("rad", None)


def test_drift_of_a_sliding_joint_is_in_meters():
    robot, trajectory = shipped_run("rp_2", "rp_2")
    assert [drift.unit for drift in integrated(robot, trajectory, COARSE).report.drifts] == ["rad", "m"]


def test_report_of_the_root_names_its_method():
    report = inverse_dynamics(ARM, motion()).report
    assert report.as_json()["deflections"] == {"method": "root"}
    assert "drift" not in str(report)
