"""`vsacli export --rate` at rates that take no whole number of stored samples."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from samples.command_line import REPOSITORY

TASK = """\
format: vsacli-trajectory/1
name: quick
duration: 0.963
rate: 500
position: {type: polynomial, degree: 7, start: 0, end: [90 deg, 45 deg, -60 deg]}
stiffness: {type: constant, value: 1200}
"""
ROBOT = REPOSITORY / "robots" / "vsa_3r.yaml"


def columns(path):
    header, *rows = csv.reader(path.read_text().splitlines())
    return header, np.array(rows, dtype=float)


def exported(vsacli, folder, task, rate):
    (folder / "quick.yaml").write_text(task)
    result, table = folder / f"{rate}.h5", folder / f"{rate}.csv"
    assert vsacli("invdyn", ROBOT, folder / "quick.yaml", "-o", result).code == 0
    done = vsacli("export", result, "--rate", rate, "-o", table)
    assert done.code == 0, done.err
    return columns(table)


@pytest.mark.parametrize("rate", [1000, 300])
def test_a_declared_trajectory_is_computed_at_the_rate(tmp_path, vsacli, rate):
    """0.963 s hold 481.5 periods of 500 Hz, so that the steps are no multiples of 2 ms."""
    header, rows = exported(vsacli, tmp_path, TASK, rate)
    whole, expected = exported(vsacli, tmp_path, TASK.replace("rate: 500", "rate: 3000"), 3000)
    assert header == whole
    np.testing.assert_allclose(rows[:, 0], np.arange(len(rows)) / rate, rtol=1e-14)
    assert rows[-1, 0] == pytest.approx(int(0.963 * rate + 1e-9) / rate)
    # the same function of time at times that are rounded differently
    np.testing.assert_allclose(rows, expected[:: 3000 // rate][: len(rows)], rtol=1e-10, atol=1e-9)


@pytest.mark.slow
def test_a_motion_known_at_its_samples_alone_is_not(tmp_path, vsacli):
    (tmp_path / "quick.yaml").write_text(TASK.replace("0.963", "0.96"))
    result, table = tmp_path / "r.h5", tmp_path / "moved.csv"
    assert vsacli("invdyn", ROBOT, tmp_path / "quick.yaml", "-o", result).code == 0
    assert vsacli("export", result, "--variables", "q,dq,stiffness", "-o", table).code == 0
    again = tmp_path / "again.h5"
    vsacli("invdyn", ROBOT, table, "-o", again)
    done = vsacli("export", again, "--rate", 300)
    assert done.code == 2
    assert "--rate: the stored rate of 500 Hz is not a multiple of 300 Hz; use 250 or 500 Hz" in done.err


def recorded(folder):
    """One second of three sines at some 200 Hz, whose stamps jitter by a tenth of a millisecond."""
    time = np.arange(200) / 200 + np.random.default_rng(0).normal(0, 1e-4, 200)
    sine = 0.2 * np.sin(2 * np.pi * time)
    table = folder / "log.csv"
    values = np.stack((time, sine, sine, sine, *[np.full(200, 1200.0)] * 3), axis=1)
    names = [f"{name}{number}" for name in ("q", "stiffness") for number in (1, 2, 3)]
    np.savetxt(table, values, delimiter=",", header=",".join(["time", *names]), comments="", fmt="%.6f")
    return table


@pytest.mark.slow
@pytest.mark.slow
def test_fractions_of_the_rate_at_which_a_recording_was_resampled(tmp_path, vsacli):
    """No whole number of periods of 200 Hz lasts as long as the recording: the rate is 199.99 Hz."""
    result, part, whole = (tmp_path / name for name in ("r.h5", "part.csv", "whole.csv"))
    vsacli("invdyn", ROBOT, recorded(tmp_path), "--rate", 200, "-o", result)
    assert vsacli("export", result, "--rate", 50, "-o", part).code == 0
    assert vsacli("export", result, "-o", whole).code == 0
    np.testing.assert_array_equal(columns(part)[1], columns(whole)[1][::4])
    done = vsacli("export", result, "--rate", 70)
    assert "use 50 or 100 Hz, or run invdyn with --set rate=70, then export without --rate" in done.err


@pytest.mark.slow
@pytest.mark.slow
def test_the_way_to_another_rate_is_named_and_works(tmp_path, vsacli):
    result, table = tmp_path / "r.h5", tmp_path / "torques.csv"
    vsacli("invdyn", ROBOT, recorded(tmp_path), "-o", result)
    done = vsacli("export", result, "--rate", 70)
    assert done.code == 2
    assert "not equally spaced" in done.err
    assert "; run invdyn with --set rate=70, then export without --rate" in done.err
    vsacli("invdyn", ROBOT, recorded(tmp_path), "--set", "rate=70", "-o", result, "--overwrite")
    assert vsacli("export", result, "-o", table).code == 0
    steps = np.diff(columns(table)[1][:, 0])
    assert steps == pytest.approx(np.full(len(steps), 1 / 70), rel=1 / 2 / 70)  # a whole number of them
