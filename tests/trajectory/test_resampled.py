"""Images that resampling leaves, and hum that grows and fades, are no vibration."""

import numpy as np
import pytest
from samples.noisy_records import MOTIONS
from scipy.interpolate import interp1d

from vsacli.trajectory.fits import fit_samples

TIME = np.arange(10001) / 1000


def fitted(row, truth):
    """The part of a fit, and the error of its fourth derivative inside, relative."""
    [part] = fit_samples(TIME, row[None], 7, 4, None).parts
    inside = slice(1000, -1000)
    found = part.spline(TIME, nu=4)[inside, 0]
    return part, np.sqrt(np.mean((found - truth[inside]) ** 2) / np.mean(truth[inside] ** 2))


@pytest.mark.cases(3)
@pytest.mark.slow
@pytest.mark.parametrize("kind", ["linear", "cubic"])
@pytest.mark.parametrize("name", ["sines", "sweep to 4 Hz"])
@pytest.mark.parametrize("rate", [50, 100, 200])
def test_images_of_the_motion_are_left_out(name, kind, rate):
    """They were followed as a vibration, and the derivative was wrong by up to 190 %."""
    coarse = np.arange(10 * rate + 1) / rate
    row = interp1d(coarse, MOTIONS[name](coarse, 0)[0], kind=kind)(TIME)
    part, error = fitted(row, MOTIONS[name](TIME, 0)[1])
    assert part.smoothing is not None
    assert part.smoothing.lines.others == ()
    if part.smoothing.determined:
        assert error < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("swing", [0.5, 2, 5])
def test_side_bands_of_hum_are_hum(swing):
    truth = MOTIONS["sines"](TIME, 0)
    hum = 1e-3 * (1 + 0.5 * np.sin(2 * np.pi * swing * TIME)) * np.sin(2 * np.pi * 50 * TIME)
    row = truth[0] + hum + 1e-6 * np.random.default_rng(0).standard_normal(len(TIME))
    part, error = fitted(row, truth[1])
    assert part.smoothing is not None
    assert part.smoothing.lines.others == ()
    assert error < 0.02


@pytest.mark.slow
def test_a_pair_of_vibrations_stays_one():
    truth = MOTIONS["sines"](TIME, 0)[0]
    row = truth + 3e-4 * (np.sin(2 * np.pi * 23 * TIME) + np.sin(2 * np.pi * 27 * TIME))
    part, _ = fitted(row + 1e-6 * np.random.default_rng(0).standard_normal(len(TIME)), truth)
    assert part.smoothing is not None
    assert part.smoothing.lines.others == pytest.approx((23, 27), abs=0.1)
