"""`vsacli check-feasibility`: the report without the file."""

from __future__ import annotations

import json

import numpy as np
import pytest
from samples.command_line import ROBOT, contents, installed

from vsacli import Flag, open_result


@pytest.mark.slow
def test_installed_command_says_yes(tmp_path, motion):
    done = installed("check-feasibility", ROBOT, motion, folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("OK  vsa-3r, rest-to-rest: ")
    assert contents(tmp_path).keys() == {"move.yaml"}


@pytest.mark.parametrize("options", [[], ["--json"], ["--stop-on-infeasible"]], ids=" ".join)
def test_report_and_exit_code_are_those_of_invdyn(vsacli, too_soft, options):
    checked = vsacli("check-feasibility", ROBOT, too_soft, *options)
    computed = vsacli("invdyn", ROBOT, too_soft, *options)
    assert (checked.code, checked.out) == (3, computed.out)
    assert checked.err == ""


@pytest.mark.parametrize("command", ["invdyn", "check-feasibility"])
def test_a_report_says_how_to_list_fixes_of_the_same_task(vsacli, motion, command):
    wrong = "stiffness.end=[790, 1275, 1275]"
    out = vsacli(command, ROBOT, motion, "--set", wrong).out
    assert out.count("\nto list fixes: ") == 1
    assert f"\nto list fixes: vsacli check-feasibility {ROBOT} {motion} --set '{wrong}' --fixes\n\n" in out
    more = [
        part
        for change in (wrong, "rate=50", "duration=4", "stiffness.start=850")
        for part in ("--set", change)
    ]
    out = vsacli(command, ROBOT, motion, *more, *(["--overwrite"] if command == "invdyn" else [])).out
    others = "to list fixes, with the same --set options"
    assert f"\n{others}: vsacli check-feasibility {ROBOT} {motion} --fixes\n" in out


@pytest.mark.parametrize("command", ["invdyn", "check-feasibility"])
def test_a_feasible_task_needs_no_fixes(vsacli, motion, command):
    assert "list fixes" not in vsacli(command, ROBOT, motion).out


def test_nothing_is_written(vsacli, tmp_path, too_soft):
    vsacli("check-feasibility", ROBOT, too_soft)
    assert contents(tmp_path).keys() == {"soft.yaml"}


def test_json_holds_the_verdict(vsacli, too_soft):
    report = json.loads(vsacli("check-feasibility", ROBOT, too_soft, "--json").out)
    assert (report["verdict"], report["samples"], report["complete"]) == ("infeasible", 401, True)


def test_verbose_describes_the_inputs_and_what_computes(vsacli, motion):
    inputs, engine = vsacli("check-feasibility", ROBOT, motion, "--verbose").err.splitlines()
    assert inputs == "vsa-3r: 3 joints; rest-to-rest: 401 samples over 4 s"
    assert engine == "NumPy computes: 401 samples are few"


COARSE = """\
format: vsacli-trajectory/1
name: coarse
duration: 4
rate: 4
position:
  type: sinusoids
  frequency: 1
  offset: [0, 30 deg, 0]
  sine: [[0, 9 deg, 0]]
  cosine: [[0, 9 deg, 0]]
stiffness: {type: constant, value: 830}
"""


@pytest.mark.slow
def test_what_lies_between_the_steps_counts(vsacli, tmp_path):
    """The shoulder sways, and its load is largest between two steps."""
    (tmp_path / "coarse.yaml").write_text(COARSE)
    task, path = (ROBOT, "coarse.yaml"), tmp_path / "run.h5"
    done = vsacli("invdyn", *task, "-o", path, "--json")
    report = json.loads(done.out)
    assert (done.code, report["verdict"]) == (3, "infeasible")
    shoulder = report["joints"][1]
    assert shoulder["between"]["margin"] == shoulder["worst"]["infeasible"]
    with open_result(path) as result:
        infeasible = result.flags[:, 1] & Flag.INFEASIBLE != 0
        assert result.report.as_json() == report
        assert np.isfinite(result.tau_motor).all(), "every step by itself can be done"
    assert shoulder["samples"]["infeasible"] == np.count_nonzero(infeasible) > 0
    assert "at this load; increase it" in (text := vsacli("check-feasibility", *task).out)
    assert ", between two samples, is below the minimum" in text
    stopped = json.loads(vsacli("check-feasibility", *task, "--json", "--stop-on-infeasible").out)
    assert stopped["samples"] == int(infeasible.argmax()) + 1
    assert stopped["verdict"] == "infeasible"
