"""Keys of reports that changed before 0.1: `info --field` of an old one fails, and names the new one."""

from __future__ import annotations

import pytest


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("joints.elbow.steps.infeasible", "joints.elbow.samples.infeasible"),
        ("joints.elbow.margin.reachable", "joints.elbow.margin.attainable"),
        ("joints.elbow.start.torque_step", "joints.elbow.start.torque_discontinuity"),
    ],
)
def test_an_old_key_is_refused_with_its_successor(vsacli, feasible_result, old, new):
    refused = vsacli("info", feasible_result, "--field", f"report.{old}")
    changed = next(key for key in new.split(".") if key not in old.split("."))
    assert (refused.code, refused.out) == (2, "")
    assert f"it is now '{changed}'" in refused.err
    assert vsacli("info", feasible_result, "--field", f"report.{new}").code == 0
