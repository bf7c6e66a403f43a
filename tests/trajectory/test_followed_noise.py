"""Noise that a filter made smooth is found in fits that follow it, and nowhere else."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml
from oracles.one_joint import motor_torque
from samples.noisy_records import MOTIONS
from samples.random_recordings import draw
from samples.recorded_torques import judge
from scipy.interpolate import make_interp_spline
from scipy.signal import butter, sosfiltfilt

from vsacli.trajectory.fits import fit_samples
from vsacli.trajectory.fits.spectrum import followed_noise, motion_band

ONCE_WRONG = (10, 58, 60, 78, 118, 130, 132, 208, 216, 346, 362, 392, 657)
"""Recordings that passed for right: torques were wrong by up to 90 %, or by 10 to 60,000 deviations. The last
moves so fast that only the finest resolution follows; in the others a steep filter left noise."""


def share_of(time, row, bandwidth=None, degree=7, order=4):
    spline = make_interp_spline(time, row[:, None], k=degree)
    inside = time[50], time[-50]
    return followed_noise(spline, inside, time[1], order, bandwidth)


def filtered(seed, time, cutoff, size):
    noise = sosfiltfilt(
        butter(6, 2 * cutoff * time[1], output="sos"), np.random.default_rng(seed).standard_normal(len(time))
    )
    return size * noise


def two_sines(time):
    return 0.5 * np.sin(2 * np.pi * 0.4 * time) + 0.1 * np.sin(2 * np.pi * 1.3 * time + 1)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("size", [3e-5, 3e-4])
def test_the_share_is_that_of_the_noise(seed, size):
    time = np.arange(5001) / 500
    motion, noise = two_sines(time), filtered(seed, time, 10, size)
    whole, alone = (
        make_interp_spline(time, row, k=7)(time[100:-100], nu=4) for row in (motion + noise, noise)
    )
    found = share_of(time, motion + noise)
    # some hundred lines make up the noise: their medians are off by some 10 %
    assert found.share == pytest.approx(np.std(alone) / np.std(whole), rel=0.3)
    assert 1.2 < found.above < 7  # between the motion and the cut-off
    assert found.above < found.peak < 12


@pytest.mark.parametrize("rate", [250, 1000])
@pytest.mark.parametrize("name", [name for name in MOTIONS if name != "random"])  # which is noise itself
@pytest.mark.parametrize("seed", range(3))
def test_motion_is_no_noise(name, seed, rate):
    time = np.arange(10 * rate + 1) / rate
    # rounding of the samples' last digit is noise, too, the more the higher the rate
    assert share_of(time, MOTIONS[name](time, seed)[0]).share < 0.05


def test_the_band_of_the_motion_ends_where_the_noise_begins():
    time = np.arange(5001) / 500
    row = two_sines(time) + filtered(0, time, 10, 3e-4)
    spline, inside = make_interp_spline(time, row[:, None], k=7), (time[50], time[-50])
    noise = followed_noise(spline, inside, time[1], 4)
    # the faster sine has nearly all of the derivative; a line is 0.1 Hz wide, with a Hann window two
    assert motion_band(spline, inside, time[1], 4, noise.above + 0.3) == pytest.approx(1.3, abs=0.25)
    assert motion_band(spline, inside, time[1], 4) > 5
    resting = make_interp_spline(time, 0 * row[:, None], k=7)
    assert np.isnan(motion_band(resting, inside, time[1], 4))


def test_below_a_stated_bandwidth_there_is_motion():
    time = np.arange(5001) / 500
    row = two_sines(time) + filtered(0, time, 10, 3e-4)
    assert share_of(time, row, bandwidth=30).share == 0 < share_of(time, row).share


@pytest.mark.parametrize("seed", range(4))
def test_a_recorded_stiffness_is_judged_alike(seed):
    """At 1 % noise and 10 Hz it was interpolated, and its second derivative wrong by a factor of hundred."""
    time = np.arange(1001) / 250
    place = time / time[-1]
    truth = 850 + 425 * place**3 * (10 - 15 * place + 6 * place**2)
    row = truth + filtered(seed, time, 10, 10)
    fit = fit_samples(time, row[None], 5, 2, None)
    part, inside = fit.parts[0], slice(125, -125)
    second = 425 * (60 * place - 180 * place**2 + 120 * place**3) / time[-1] ** 2
    error = np.sqrt(np.mean((part.spline(time, nu=2)[:, 0] - second)[inside] ** 2))
    assert part.smoothing is not None
    stated = part.smoothing.relative * np.sqrt(np.mean(part.spline(time, nu=2)[inside] ** 2))
    assert error < 3 * stated or not part.smoothing.resolved


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("seed", ONCE_WRONG)
def test_recordings_that_were_wrong_are_right_or_in_doubt(seed):
    found = judge(draw(seed))
    if found.verdict == "ok":
        assert found.torque.size < 0.1
        assert found.torque.size < 10 * found.torque.stated


ARM = """\
format: vsacli-robot/1
name: arm
gravity: [0, 0, -9.81]
joints:
  - name: elbow
    type: revolute
    dh: {a: 0.3, alpha: 0, d: 0, theta: 0}
    link: {mass: 5.0894, com: [-0.15, 0, 0], inertia: {xx: 0.0104, yy: 0.0434, zz: 0.0434}}
    damping: 1e-5
    actuator: {type: elastic, motor: {inertia: 1, damping: 1e-4}, stiffness: 100}
"""


@pytest.mark.slow
@pytest.mark.usefixtures("own_folder")
def test_what_the_warning_advises_gives_the_torque(vsacli):
    """d4q was 60 % noise; with the bandwidth that the warning names the torque is right to 10 %."""
    recording = draw(58)
    time = recording.time
    samples = "".join(f"{t:.17g},{q:.17g}\n" for t, q in zip(time, recording.position.recorded, strict=True))
    Path("log.csv").write_text("time,elbow.q\n" + samples)
    Path("arm.yaml").write_text(ARM)
    done = vsacli("invdyn", "arm.yaml", "log.csv", "-o", "log.h5")
    assert done.code == 3
    [warning] = [line for line in done.out.splitlines() if "noise that a filter made smooth" in line]
    bandwidth = float(warning.split("or set bandwidth: ")[1].split(";")[0])
    Path("limited.yaml").write_text(
        yaml.safe_dump(
            {
                "format": "vsacli-trajectory/1",
                "name": "limited",
                "position": {"type": "csv", "file": "log.csv", "bandwidth": bandwidth},
            }
        )
    )
    assert vsacli("invdyn", "arm.yaml", "limited.yaml", "-o", "limited.h5").code == 0
    with h5py.File("limited.h5") as file:
        found = file["tau_motor"][:, 0, 0]
    arm = recording.arm._replace(motor_inertia=1.0, k=100.0, k_c=0.0, horizontal=True)
    expected = motor_torque(arm, recording.truth[0], None).ravel()
    inside = slice(len(time) // 8, -(len(time) // 8))
    error = (found - expected)[inside]
    assert np.sqrt(np.mean(error**2)) < 0.1 * np.sqrt(np.mean(expected[inside] ** 2))
