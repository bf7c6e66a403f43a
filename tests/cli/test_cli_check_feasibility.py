"""`vsacli check-feasibility`: the report without the file."""

from __future__ import annotations

import json

import pytest
from samples.command_line import ROBOT, contents, installed


def test_installed_command_says_yes(tmp_path, motion):
    done = installed("check-feasibility", ROBOT, motion, folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[0].endswith(" OK")
    assert contents(tmp_path).keys() == {"move.yaml"}


@pytest.mark.parametrize("options", [[], ["--json"], ["--stop-on-infeasible"]], ids=" ".join)
def test_report_and_exit_code_are_those_of_invdyn(vsacli, too_soft, options):
    checked = vsacli("check-feasibility", ROBOT, too_soft, *options)
    computed = vsacli("invdyn", ROBOT, too_soft, *options)
    assert (checked.code, checked.out) == (3, computed.out)
    assert checked.err == ""


def test_nothing_is_written(vsacli, tmp_path, too_soft):
    vsacli("check-feasibility", ROBOT, too_soft)
    assert contents(tmp_path).keys() == {"soft.yaml"}


def test_json_holds_the_verdict(vsacli, too_soft):
    report = json.loads(vsacli("check-feasibility", ROBOT, too_soft, "--json").out)
    assert (report["verdict"], report["samples"], report["complete"]) == ("infeasible", 401, True)


def test_verbose_describes_the_inputs_and_what_computes(vsacli, motion):
    inputs, engine = vsacli("check-feasibility", ROBOT, motion, "--verbose").err.splitlines()
    assert inputs == "vsa-3r: 3 joints; rest-to-rest: 401 steps over 4 s"
    assert engine == "NumPy computes: 401 samples are few"
