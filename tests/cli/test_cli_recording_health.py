"""What a recording lacks is said by every command that reads it: file, line, column, time, fix."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from samples.command_line import ROBOT

from vsacli import load_robot, load_trajectory

TIME = np.arange(1001) / 500
JOINTS = ("base", "shoulder", "elbow")


def positions(seed=0):
    noise = np.random.default_rng(seed).normal(0, 1e-5, (len(TIME), len(JOINTS)))
    return 0.3 * np.sin(np.outer(TIME, [2.0, 2.5, 3.0])) + noise


@pytest.fixture
def recorded(tmp_path):
    def write(q, time=TIME, name="motion.csv", unit="", time_unit=""):
        header = [f"time{time_unit}", *(f"{joint}.q{unit}" for joint in JOINTS)]
        header += [f"{joint}.stiffness" for joint in JOINTS]
        table = np.column_stack((time, q, np.full_like(q, 1000.0)))
        np.savetxt(tmp_path / name, table, fmt="%.17g", delimiter=",", header=",".join(header), comments="")
        return name

    return write


@pytest.mark.slow
def test_a_clean_recording_is_not_doubted(vsacli, recorded):
    report = json.loads(vsacli("invdyn", ROBOT, recorded(positions()), "--json").out)
    assert [text for text in report["warnings"] if "motion.csv" in text] == []


@pytest.mark.slow
def test_outliers_stand_in_the_report_with_line_column_and_time(vsacli, recorded):
    q = positions()
    q[600, 1] += 6.2e-4
    q[700, 1] -= 0.02
    file = recorded(q)
    for command in ("invdyn", "check-feasibility", "info"):
        arguments = (file, "--robot", ROBOT) if command == "info" else (ROBOT, file)
        out = vsacli(command, *arguments).out
        assert (
            f"{file}:602: shoulder.q is off 2 times, first at t = 1.200 s, by up to 0.02 rad (at t = 1.400 s)"
            in out
        )


@pytest.mark.slow
def test_faults_come_before_what_follows_from_them(vsacli, recorded):
    q = positions()
    q[700:760, 1] = q[700, 1]
    verdict, fault, *others = vsacli("check-feasibility", ROBOT, recorded(q)).out.splitlines()
    assert verdict.startswith("UNRELIABLE")
    assert fault.startswith("warning: motion.csv:702: shoulder.q is frozen at t = 1.400 s")
    assert "below the minimum" in others[0]
    assert not any("if the arm did move like this" in line for line in others)


@pytest.mark.slow
def test_a_false_sample_is_left_out_of_what_is_computed(vsacli, recorded):
    q = positions()
    q[700, 1] -= 0.1
    outcome = vsacli("check-feasibility", ROBOT, recorded(q))
    assert outcome.code == 0
    assert "warning: motion.csv:702: shoulder.q is off at t = 1.400 s" in outcome.out
    assert "left out" in outcome.out


@pytest.mark.slow
def test_an_infeasible_recording_is_about_its_stiffness_or_the_springs(vsacli, recorded, tmp_path):
    file = recorded(positions())
    advice = (
        "if the arm did move like this, the recorded stiffness or the springs of the robot file are wrong"
    )
    softer = (tmp_path / file).read_text().replace(",1000", ",600")
    (tmp_path / "soft.csv").write_text(softer)
    (tmp_path / "chosen.yaml").write_text(
        "format: vsacli-trajectory/1\nname: chosen\n"
        "position: {type: csv, file: motion.csv, ignore: rest}\n"
        "stiffness: {type: constant, value: 600}\n"
    )
    recorded_soft, chosen = (
        vsacli("check-feasibility", ROBOT, name).out for name in ("soft.csv", "chosen.yaml")
    )
    assert recorded_soft.startswith("INFEASIBLE")
    assert chosen.startswith("INFEASIBLE")
    assert f"{advice}: run vsacli identify first" in recorded_soft
    assert advice not in chosen
    assert advice not in vsacli("check-feasibility", ROBOT, file).out


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("start", [0.0, 1.7e9])
def test_gap_frozen_sensor_and_stamps_since_1970(vsacli, recorded, start):
    q, kept = positions(), (TIME < 1) | (TIME >= 1.2)
    q[300:340, 2] = q[300, 2]
    report = json.loads(vsacli("invdyn", ROBOT, recorded(q[kept], start + TIME[kept]), "--json").out)
    assert report["self_check"]["passed"]
    health = [text for text in report["warnings"] if "motion.csv" in text]
    assert health[0].startswith(
        f"motion.csv:502: time has a gap of 202 ms from t = {start + 0.998:.3f} s on;"
    )
    assert health[1].startswith(f"motion.csv:302: elbow.q is frozen at t = {start + 0.6:.3f} s, for 78 ms,")
    assert len(health) == 2


@pytest.mark.slow
def test_wrapped_angles_are_unwrapped_on_demand(vsacli, recorded, tmp_path):
    q = positions()
    turned = q + np.array([1.0, 3.1, 0.0])
    wrapped = (turned + np.pi) % (2 * np.pi) - np.pi
    recorded(wrapped)
    said = vsacli("check-feasibility", ROBOT, "motion.csv").out
    assert "shoulder.q jumps by 2 pi 2 times, first at t = " in said
    assert "Set unwrap: true under position in a trajectory file" in said

    (tmp_path / "unwrapped.yaml").write_text(
        "format: vsacli-trajectory/1\nname: unwrapped\n"
        "position: {type: csv, file: motion.csv, unwrap: true}\n"
        "stiffness: {type: csv, file: motion.csv}\n"
    )
    recorded(turned, name="turned.csv")
    unwrapped = json.loads(vsacli("invdyn", ROBOT, "unwrapped.yaml", "--json").out)
    assert "motion.csv: 2 jumps by 2 pi taken out of shoulder.q" in unwrapped["notes"]
    assert not any("jumps by 2 pi" in text for text in unwrapped["warnings"])
    expected = json.loads(vsacli("invdyn", ROBOT, "turned.csv", "--json").out)
    peaks = [[joint["peak"]["tau_e"] for joint in report["joints"]] for report in (unwrapped, expected)]
    np.testing.assert_allclose(*peaks, rtol=1e-9)


@pytest.mark.slow
def test_degrees_and_milliseconds_without_unit_are_doubted(vsacli, recorded):
    q = np.degrees(positions())
    said = vsacli("check-feasibility", ROBOT, recorded(q, 1000 * TIME)).out
    assert "motion.csv: time looks like ms: rows are 2 s apart" in said
    assert (
        "motion.csv: base.q goes to 17.19 rad, 2.74 turns; are these degrees? Write [deg] after its name"
        in said
    )
    said = vsacli("check-feasibility", ROBOT, recorded(q, 1000 * TIME, unit="[deg]", time_unit="[ms]")).out
    assert "motion.csv" not in said


@pytest.mark.slow
def test_jittering_stamps_recommend_a_rate_also_where_torques_are_exported(vsacli, recorded):
    late = TIME + np.random.default_rng(1).uniform(0, 1e-3, len(TIME))
    done = vsacli("invdyn", ROBOT, recorded(positions(), late), "-o", "late.h5")
    assert "motion.csv: time jitters: steps of about 2 ms change by" in done.out
    assert "set rate: 500 in a trajectory file" in done.out
    refused = vsacli("export", "late.h5", "--rate", "250")
    assert refused.code == 2
    assert "run invdyn with --set rate=250, then export without --rate" in refused.err


def test_computed_samples_are_used_as_they_are(vsacli, tmp_path):
    """A fourth derivative that falls to 0 within a step at the end is off a smooth curve, and yet true."""
    left, fall = TIME[-1] - TIME, 2e-4
    rest = np.exp(-left / fall)
    rows = {
        name: (-left) ** integrals / math.factorial(integrals) - fall**integrals * rest
        for integrals, name in enumerate(("d4q", "d3q", "ddq", "dq", "q"))
    }
    header = ["time", *(f"{joint}.{name}" for name in rows for joint in JOINTS)]
    table = np.column_stack((TIME, *(row for row in rows.values() for _ in JOINTS)))
    np.savetxt(tmp_path / "swift.csv", table, "%.17g", ",", header=",".join(header), comments="")
    doubted = {}
    for fit in ("", ", fit: interpolate"):
        (tmp_path / "swift.yaml").write_text(
            "format: vsacli-trajectory/1\nname: swift\nstiffness: {type: constant, value: 1000}\n"
            f"position: {{type: csv, file: swift.csv{fit}}}\n"
        )
        doubted[fit] = vsacli("validate", ROBOT, "swift.yaml").out.count("d4q is off")
    assert doubted == {"": len(JOINTS), ", fit: interpolate": 0}
    used = load_trajectory("swift.yaml", load_robot(ROBOT)).block(0, len(TIME))
    assert (used.d4q == rows["d4q"][:, None]).all()
