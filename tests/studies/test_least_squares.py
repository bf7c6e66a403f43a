"""Least squares on synthetic problems whose answers are known."""

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from vsacli import InputError
from vsacli.studies.identification.estimation import Equations, LeastSquaresFit, gauss_newton, least_squares

TRUTH = np.array([3.0, -1.0, 0.5, 20.0])
DRAWS = 200
Noise = Callable[[np.random.Generator, int], np.ndarray]


def columns(samples: int) -> np.ndarray:
    """Of the kinds that motors and links have: slow waves, faster ones, a constant, all of different size."""
    time = np.linspace(0, 1, samples)
    waves = [np.sin(2 * np.pi * 5 * time), np.cos(2 * np.pi * 7 * time + 1), np.sin(2 * np.pi * 31 * time)]
    return np.stack([*waves, 1e-3 + 0 * time], axis=1) * [1.0, 10.0, 0.1, 1.0]


def record(measured: np.ndarray, slopes: np.ndarray, present: np.ndarray, group: str = "link") -> Equations:
    rows = len(measured)
    return Equations(measured, slopes @ present, slopes, np.array([group] * rows), np.arange(rows))


def white(random: np.random.Generator, samples: int) -> np.ndarray:
    return random.normal(size=samples)


def red(random: np.random.Generator, samples: int) -> np.ndarray:
    """First order, correlated over some ten samples."""
    from scipy.signal import lfilter

    return np.asarray(lfilter([1], [1, -0.8], random.normal(size=samples + 200))[200:])


def blue(random: np.random.Generator, samples: int) -> np.ndarray:
    """Differences of white noise, as of a derivative."""
    return np.diff(random.normal(size=samples + 1))


def derivative(random: np.random.Generator, samples: int) -> np.ndarray:
    """Noise of a torque, and as much of an acceleration."""
    of_acceleration = low_passed(random, samples)
    return white(random, samples) + of_acceleration / np.std(of_acceleration)


def low_passed(random: np.random.Generator, samples: int) -> np.ndarray:
    """The second derivative of white noise behind a low-pass, decimated to about twice its bandwidth."""
    from scipy.signal import butter, sosfiltfilt

    noise = random.normal(size=4 * samples + 400)
    smooth = sosfiltfilt(butter(4, 0.2, output="sos"), noise)
    return np.asarray(30 * np.diff(smooth, 2)[200 : 200 + 4 * samples : 4])


@cache
def fits(noise: Noise, samples: int = 600) -> list[LeastSquaresFit]:
    random, slopes, present = np.random.default_rng(7), columns(samples), np.zeros(4)
    measured = [slopes @ TRUTH + 0.3 * noise(random, samples) for _ in range(DRAWS)]
    return [least_squares([record(each, slopes, present)], present) for each in measured]


def test_exact_equations_give_back_their_numbers() -> None:
    slopes = columns(50)
    fit = least_squares([record(slopes @ TRUTH, slopes, np.ones(4))], np.ones(4))
    assert fit.values == pytest.approx(TRUTH, rel=1e-11)  # condition of the columns is below 10
    assert not fit.inseparable
    assert fit.unexcited.size == 0


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("noise", [white, red, derivative])
def test_two_standard_errors_cover_the_truth(noise: Noise) -> None:
    """95.4 % if errors were known exactly; of 200 draws the share of one unknown strays by 1.5 %."""
    found = fits(noise)
    off = np.array([(fit.values - TRUTH) / fit.standard_errors for fit in found])
    covered = np.mean(np.abs(off) < 2, axis=0)
    assert np.all(covered > 0.90)
    assert np.all(covered < 0.99)
    assert np.all(np.abs(np.mean(off, axis=0)) < 4 / math.sqrt(DRAWS))


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("noise", [blue, low_passed])
def test_derivatives_of_noise_alone_leave_errors_at_most_somewhat_too_large(noise: Noise) -> None:
    """They have nothing at frequency zero but what neighboring frequencies let in."""
    found = fits(noise)
    off = np.array([(fit.values - TRUTH) / fit.standard_errors for fit in found])
    assert np.all(np.mean(np.abs(off) < 2, axis=0) > 0.90)
    assert np.all(np.std(off, axis=0) > 0.2)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [red, derivative, blue])
def test_errors_by_white_residuals_would_not(noise: Noise) -> None:
    """The noise of the cases above is colored enough to tell: the usual errors are off."""
    slopes, found = columns(600), fits(noise)
    spread = np.std([fit.values for fit in found], axis=0)
    rms = np.mean([fit.residual_rms["link"] for fit in found])
    usual = rms * np.sqrt(np.diagonal(np.linalg.inv(slopes.T @ slopes)))
    ratio = spread[0] / usual[0]
    assert ratio > 2 or ratio < 0.8


def test_noise_that_groups_have_in_common_counts() -> None:
    """Two groups that repeat the same rows with the same noise tell no more than one."""
    random, slopes = np.random.default_rng(1), columns(400)
    measured = slopes @ TRUTH + 0.3 * white(random, 400)
    once = least_squares([record(measured, slopes, np.zeros(4))], np.zeros(4))
    first, second = (record(measured, slopes, np.zeros(4), group) for group in ("one", "two"))
    both = Equations(*(np.concatenate(pair) for pair in zip(first[:5], second[:5], strict=True)))
    twice = least_squares([both], np.zeros(4))
    assert twice.values == pytest.approx(once.values)
    assert twice.standard_errors == pytest.approx(once.standard_errors, rel=0.02)  # leverage is half as large


def test_groups_count_by_their_noise() -> None:
    """Beside the optimal weights: errors are those of the quiet group, however loud the other is."""
    random, slopes = np.random.default_rng(2), columns(400)
    quiet = record(slopes @ TRUTH + 1e-3 * white(random, 400), slopes, np.zeros(4), "quiet")
    loud = record(slopes @ TRUTH + 10 * white(random, 400), slopes, np.zeros(4), "loud")
    alone, fit = (least_squares(records, np.zeros(4)) for records in ([quiet], [quiet, loud]))
    assert fit.values == pytest.approx(alone.values, abs=1e-3 * np.max(alone.standard_errors))
    assert fit.residual_rms == pytest.approx({"quiet": 1e-3, "loud": 10}, rel=0.1)  # 3.5 % by chance


def test_records_are_not_correlated_with_each_other() -> None:
    """Two records of the same motion, each with noise of its own: errors go with the root of their number."""
    random, slopes = np.random.default_rng(3), columns(400)
    records = [record(slopes @ TRUTH + 0.3 * white(random, 400), slopes, np.zeros(4)) for _ in range(4)]
    one, four = (least_squares(some, np.zeros(4)) for some in (records[:1], records))
    assert four.standard_errors == pytest.approx(one.standard_errors / 2, rel=0.3)  # estimated from 400 rows


def test_one_combination_that_cannot_be_told_apart() -> None:
    random, slopes = np.random.default_rng(4), columns(400)
    slopes[:, 3] = 0.25 * slopes[:, 0] - 0.01 * slopes[:, 1]
    present = np.array([2.0, -2.0, 0.0, 4.0])
    fit = least_squares([record(slopes @ TRUTH + 0.01 * white(random, 400), slopes, present)], present)
    assert np.isnan(fit.standard_errors[[0, 1, 3]]).all()
    assert np.array_equal(fit.values[[0, 1, 3]], present[[0, 1, 3]])
    assert abs(fit.values[2] - TRUTH[2]) < 4 * fit.standard_errors[2]
    words = {each.words(["k", "d", "b", "k_c"]): each for each in fit.inseparable}
    assert set(words) == {"k + 0.25 k_c", "d - 0.01 k_c"}
    for each, expected in (("k + 0.25 k_c", 8.0), ("d - 0.01 k_c", -1.2)):
        assert abs(words[each].value - expected) < 4 * words[each].standard_error
        assert words[each].standard_error < 0.01
    assert slopes @ fit.solution == pytest.approx(slopes @ TRUTH, abs=0.01)


def test_several_combinations_and_an_unknown_of_no_effect() -> None:
    random = np.random.default_rng(5)
    independent = random.normal(size=(300, 2))
    mixing = np.array([[1.0, 0, 2, 0, 0], [0, 1, 0, -3, 0]])
    slopes, truth = independent @ mixing, np.array([1.0, 2, 3, 4, 5])
    fit = least_squares([record(slopes @ truth, slopes, np.zeros(5))], np.zeros(5))
    assert list(fit.unexcited) == [4]
    assert np.isnan(fit.standard_errors).all()
    for each in fit.inseparable:
        told = np.zeros(5)
        for at, factor in each.terms:
            told[at] = factor
        assert each.value == pytest.approx(told @ truth, abs=1e-9)
        assert np.linalg.matrix_rank(np.vstack((mixing, told)), tol=1e-9) == 2, "a combination that rows tell"
    assert len(fit.inseparable) == 2


def test_numbers_that_were_found_before_add_their_uncertainty() -> None:
    """What is measured is a gain of known error times a signal: all unknowns are off by the same share."""
    slopes = columns(400)
    measured = slopes @ TRUTH
    given = record(measured, slopes, np.zeros(4))._replace(errors=0.01 * measured[:, None])
    fit = least_squares([given], np.zeros(4))
    assert fit.standard_errors == pytest.approx(0.01 * np.abs(TRUTH), rel=1e-6)


def noisy_columns(random: np.random.Generator, true: np.ndarray, noise: float) -> Equations:
    """Equations whose columns are known by a measurement, with a second draw of its noise."""
    first, second = noise * random.normal(size=(2, *true.shape))
    measured, present = true @ TRUTH + 0.1 * white(random, len(true)), np.zeros(4)
    found = record(measured, true + first, present)
    return found._replace(noise=lambda: (0 * measured, second))


@pytest.mark.slow
def test_noise_in_the_columns_counts_as_an_error() -> None:
    """It makes unknowns too small, by more than the residuals alone would say."""
    true = columns(600) / np.linalg.norm(columns(600), axis=0)
    random, present = np.random.default_rng(10), np.zeros(4)
    records = [noisy_columns(random, true, 0.15 / np.sqrt(600)) for _ in range(60)]
    found = [least_squares([each], present) for each in records]
    blind = [least_squares([each._replace(noise=None)], present) for each in records]
    off, blindly = (
        np.abs([(fit.values - TRUTH) / fit.standard_errors for fit in some]) for some in (found, blind)
    )
    assert np.mean(blindly[:, 3] < 2) < 0.9
    assert np.all(np.mean(off < 2, axis=0) > 0.9)


def test_what_noise_in_the_columns_hides_cannot_be_told() -> None:
    """Two columns differ by less than they are known to: least squares tells both, and both wrong."""
    true = columns(600) / np.linalg.norm(columns(600), axis=0)
    true[:, 3] = true[:, 0] + 0.02 * true[:, 3]
    equations = noisy_columns(np.random.default_rng(11), true, 0.05 / np.sqrt(600))
    blind, fit = (least_squares([each], np.zeros(4)) for each in (equations._replace(noise=None), equations))
    assert not blind.inseparable
    assert abs(blind.values[3] - TRUTH[3]) > 4 * blind.standard_errors[3]
    (told,) = fit.inseparable
    assert {at for at, _ in told.terms} == {0, 3}
    assert told.value == pytest.approx(TRUTH[0] + TRUTH[3], rel=0.02)


def test_too_few_equations_are_refused() -> None:
    slopes = columns(4)
    with pytest.raises(InputError, match="4 equations do not tell 4 unknowns; record for longer"):
        least_squares([record(slopes @ TRUTH, slopes, np.zeros(4))], np.zeros(4))


def sinh_spring(phi: np.ndarray, k: float, c: float) -> np.ndarray:
    return np.asarray(k / c * np.sinh(c * phi))


def sinh_equations(measured: np.ndarray, phi: np.ndarray, unknowns: np.ndarray) -> list[Equations]:
    k, c = unknowns
    if k <= 0 or c <= 0:
        return [Equations(measured, np.full_like(phi, np.nan), np.ones((len(phi), 2)), *labels(phi))]
    by_c = -k / c**2 * np.sinh(c * phi) + k / c * phi * np.cosh(c * phi)
    slopes = np.stack([np.sinh(c * phi) / c, by_c], axis=1)
    return [Equations(measured, sinh_spring(phi, k, c), slopes, *labels(phi))]


def labels(phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.array(["motor"] * len(phi)), np.arange(len(phi))


@pytest.mark.parametrize("start", [(300.0, 5.0), (900.0, 2.0), (20.0, 14.0)])
def test_gauss_newton_finds_springs_that_are_not_linear(start: tuple[float, float]) -> None:
    phi = 0.4 * np.sin(np.linspace(0, 20, 500))
    random = np.random.default_rng(6)
    truth = np.array([400.0, 7.0])
    measured = sinh_spring(phi, *truth) + 0.5 * white(random, 500)
    fit = gauss_newton(lambda unknowns: sinh_equations(measured, phi, unknowns), np.array(start))
    assert fit.converged
    assert np.all(np.abs(fit.values - truth) < 3 * fit.standard_errors)
    assert fit.standard_errors[0] < 4


def test_gauss_newton_says_when_it_does_not_arrive() -> None:
    """arctan(u) = 2 has no solution: there is always a step that gains a little, further out."""

    def equations(unknowns: np.ndarray) -> list[Equations]:
        (u,), rows = unknowns, np.ones(20)
        random = np.random.default_rng(8).normal(size=20)
        measured = 2 + 1e-3 * random
        return [Equations(measured, rows * math.atan(u), rows[:, None] / (1 + u * u), *labels(rows))]

    fit = gauss_newton(equations, np.array([0.0]))
    assert not fit.converged
