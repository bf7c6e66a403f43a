"""Random recordings that are hard to smooth: coarse steps, swinging pendulums, filters that ring.

A seed determines everything. Even seeds are the design half, odd seeds the unseen half, as in
`samples.random_recordings`. The families take turns:

- rounded: positions in steps of 1e-4 to 2e-2 rad, as cheap encoders and text files have them;
- pendulum: a driven pendulum that swings far or turns over, in such steps or with white noise;
- controller: 30 s of moves and pauses at 94 to 125 Hz with little noise, as robots log their own motion;
- ringing: a steep filter that was run forwards and backwards over the finite log.

The truth is the motion without noise, after the filter, but without its transients, which are errors.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import make_lsq_spline
from scipy.signal import butter, cheby1, cheby2, ellip, sosfiltfilt, sosfreqz

from samples.random_recordings import fourier_series
from samples.recorded_torques import MOTOR, lifting
from vsacli import Elastic, Motion, Motor, Rigid, Robot, Trajectory, inverse_dynamics, motor_torques

FAMILIES = ("rounded", "pendulum", "controller", "ringing")

STEPS = (1e-4, 2e-2)
"""Range of rounding steps, rad."""

RATES = (50, 80, 100, 125, 200, 250, 400, 500)
"""Hz."""

LEFT_OUT = 0.1
"""Share of the recording at each end in which the oracle is not judged."""


class HardRecording(NamedTuple):
    """One joint, recorded.

    Attributes:
        seed: that it was drawn with.
        family: of `FAMILIES`.
        facts: how it was made, in words.
        time: stamps, (samples,), s.
        values: as recorded, (samples,), rad.
        truth: position and four derivatives, (5, samples).
        robot: with one joint.
    """

    seed: int
    family: str
    facts: str
    time: NDArray[np.float64]
    values: NDArray[np.float64]
    truth: NDArray[np.float64]
    robot: Robot


class Judgment(NamedTuple):
    """What a run says of a recording, and how right it is, away from the unreliable ends.

    Attributes:
        seed: of the recording.
        family: of the recording.
        facts: how it was made.
        verdict: of the run.
        error: of tau_motor, root mean square, relative.
        stated: deviation of tau_motor, likewise; NaN if none is stated.
        bound: by which tau_motor may be wrong, as the report says.
        attainable: error of the best least-squares spline.
    """

    seed: int
    family: str
    facts: str
    verdict: str
    error: float
    stated: float
    bound: float
    attainable: float

    @property
    def wrong(self) -> bool:
        """Whether it is said to be right and is not."""
        return self.verdict == "ok" and not self.error <= 0.1

    @property
    def beyond(self) -> bool:
        """Whether it is off by more than ten stated deviations."""
        return self.error > 10 * self.stated


def draw_hard(seed: int) -> HardRecording:
    """Draw a recording."""
    rng = np.random.default_rng([seed, 42])
    family = FAMILIES[seed // 2 % len(FAMILIES)]
    rate, duration = float(rng.choice(RATES)), float(rng.uniform(6, 20))
    if family == "controller":
        rate, duration = float(rng.choice([94, 100, 125])), float(rng.uniform(20, 35))
    elif family == "ringing":
        rate = float(rng.choice([200, 250, 500, 1000]))
    time = np.arange(round(rate * duration) + 1) / rate
    facts, truth, values = _recorded(rng, family, time, rate)
    name, robot = _robot(rng)
    return HardRecording(
        seed, family, f"{facts}, {rate:g} Hz, {time[-1]:.3g} s, {name}", time, values, truth, robot
    )


_Drawn = tuple[str, NDArray[np.float64], NDArray[np.float64]]
"""Facts, truth with four derivatives, and recorded values."""


def _recorded(rng: np.random.Generator, family: str, time: NDArray[np.float64], rate: float) -> _Drawn:
    if family == "pendulum":
        facts, truth = pendulum_motion(rng, time)
        if rng.integers(2):
            level = _logarithmic(rng, 1e-5, 1e-3)
            return f"{facts}, white {level:.1e} rad", truth, truth[0] + level * rng.standard_normal(len(time))
        step = _logarithmic(rng, *STEPS)
        return f"{facts}, steps of {step:.1e} rad", truth, step * np.round(truth[0] / step)
    facts, series = _motion(rng, family, len(time), rate)
    exact = np.fft.irfft(series, 2 * (len(time) - 1))[: len(time)]
    if family == "ringing":
        noise, gain, values = _filtered(rng, exact, rate)
        return f"{facts}, {noise}", _derivatives(gain * series, rate), values
    truth = _derivatives(series, rate)
    if family == "controller":
        level = _logarithmic(rng, 3e-5, 3e-4)
        values = np.round(exact + level * rng.standard_normal(len(exact)), 6)
        return f"{facts}, white {level:.1e} rad", truth, values
    step = _logarithmic(rng, *STEPS)
    return f"{facts}, steps of {step:.1e} rad", truth, step * np.round(exact / step)


def _motion(
    rng: np.random.Generator, family: str, samples: int, rate: float
) -> tuple[str, NDArray[np.complex128]]:
    """Return a motion as the Fourier series of a period of which the recording is the first half."""
    shapes = {
        "rounded": ("slow sines", "faster sines", "rest to rest, pauses", "random", "velocity steps"),
        "controller": ("rest to rest, pauses", "velocity steps", "minimum jerk", "slow sines"),
        "ringing": ("slow sines", "faster sines", "random"),
    }[family]
    shape = str(rng.choice(shapes))
    highest, period = rng.uniform(0.5, 2.0 if family == "ringing" else 3.0), 2 * (samples - 1)
    series = fourier_series(rng, shape, period, rate, highest)
    values = np.fft.irfft(series, period)
    series *= min(rng.uniform(0.3, 3) / np.ptp(values), 8 / np.abs(np.diff(values)).max() / rate)
    return f"{shape} below {highest:.2g} Hz", series


def _derivatives(series: NDArray[np.complex128], rate: float) -> NDArray[np.float64]:
    period = 2 * (len(series) - 1)
    turn = 2j * np.pi * np.fft.rfftfreq(period, 1 / rate)
    return np.array([np.fft.irfft(turn**order * series, period)[: len(series)] for order in range(5)])


def pendulum_motion(rng: np.random.Generator, time: NDArray[np.float64]) -> tuple[str, NDArray[np.float64]]:
    """Return a driven pendulum q'' = -w^2 sin q - c q' + a cos(v t), with derivatives by its equation."""
    w, c, v = rng.uniform(3, 8), rng.uniform(0, 0.3), rng.uniform(1, 6)
    a, start = rng.uniform(0, 0.8) * w**2, (rng.uniform(-3, 3), rng.uniform(-5, 5))

    def acceleration(t: float, state: NDArray[np.float64]) -> list[float]:
        return [state[1], -(w**2) * np.sin(state[0]) - c * state[1] + a * np.cos(v * t)]

    q, dq = solve_ivp(acceleration, (0, time[-1]), start, "DOP853", time, rtol=1e-11, atol=1e-12).y
    sine, cosine = w**2 * np.sin(q), w**2 * np.cos(q)
    ddq = -sine - c * dq + a * np.cos(v * time)
    d3q = -cosine * dq - c * ddq - a * v * np.sin(v * time)
    d4q = sine * dq**2 - cosine * ddq - c * d3q - a * v**2 * np.cos(v * time)
    return f"pendulum of {w:.2g} rad/s driven at {v:.2g} rad/s", np.array([q, dq, ddq, d3q, d4q])


def _filtered(
    rng: np.random.Generator, exact: NDArray[np.float64], rate: float
) -> tuple[str, NDArray[np.float64], NDArray[np.float64]]:
    """Return facts, the filter's gain at the frequencies of the motion's series, and filtered samples."""
    level, order, cutoff = _logarithmic(rng, 1e-4, 2e-3), int(rng.integers(4, 9)), rng.uniform(4, 10)
    kind = str(rng.choice(["Butterworth", "Chebyshev I", "Chebyshev II", "elliptic"]))
    sections = {
        "Butterworth": lambda: butter(order, cutoff, fs=rate, output="sos"),
        "Chebyshev I": lambda: cheby1(order, 0.5, cutoff, fs=rate, output="sos"),
        "Chebyshev II": lambda: cheby2(order, 40, 1.3 * cutoff, fs=rate, output="sos"),
        "elliptic": lambda: ellip(order, 0.5, 40, cutoff, fs=rate, output="sos"),
    }[kind]()
    gain = np.abs(sosfreqz(sections, np.linspace(0, np.pi, len(exact)))[1]) ** 2
    facts = f"white {level:.1e} rad, {kind} {order} at {cutoff:.2g} Hz"
    return facts, gain, sosfiltfilt(sections, exact + level * rng.standard_normal(len(exact)))


def _robot(rng: np.random.Generator) -> tuple[str, Robot]:
    motor = Motor(inertia=_logarithmic(rng, 0.05, 2), damping=1e-4)
    stiffness, horizontal = _logarithmic(rng, 5, 3000), bool(rng.integers(2))
    if rng.integers(3) == 0:
        return "rigid", lifting(Rigid(motor=MOTOR), horizontal=horizontal)
    return f"spring of {stiffness:.3g} N m/rad", lifting(
        Elastic(motor=motor, stiffness=stiffness), horizontal=horizontal
    )


def _logarithmic(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def torques(recording: HardRecording, rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return tau_motor, (samples,), for a position and four derivatives, (5, samples)."""
    names = ("q", "dq", "ddq", "d3q", "d4q", "stiffness", "dstiffness", "ddstiffness")
    unused = np.full((3, rows.shape[1]), np.nan)
    arrays = dict(zip(names, np.concatenate([rows, unused])[:, :, None], strict=True))
    return np.asarray(motor_torques(recording.robot, Motion.of(recording.time, arrays)).tau_motor[:, 0, 0])


def judge_hard(recording: HardRecording) -> Judgment:
    """Compute motor torques along a recording, and compare them with the truth."""
    trajectory = Trajectory.from_samples(recording.time, recording.values[:, None])
    result = inverse_dynamics(recording.robot, trajectory)
    time, true = recording.time, torques(recording, recording.truth)
    fits = [each.fit.unreliable for each in trajectory.estimates.values()]
    start, end = np.minimum(np.max(fits, axis=0), time[-1] / 4)
    inside = (time >= start) & (time <= time[-1] - end)
    found, deviation = (getattr(result, name)[:, 0, 0] for name in ("tau_motor", "tau_motor_std"))
    report = result.report
    bound = report.joints[0].uncertainty.variables["tau_motor"].bound
    error, stated = (_relative(rows, true, inside) for rows in (found - true, deviation))
    return Judgment(
        recording.seed,
        recording.family,
        recording.facts,
        report.verdict,
        error,
        stated,
        bound,
        attainable_error(recording),
    )


def _relative(rows: NDArray[np.float64], true: NDArray[np.float64], inside: NDArray[np.bool_]) -> float:
    return float(np.sqrt(np.mean(rows[inside] ** 2) / np.mean(true[inside] ** 2)))


def attainable_error(recording: HardRecording) -> float:
    """Return the error of tau_motor by the least-squares spline whose knots are chosen by the truth."""
    time, true = recording.time, torques(recording, recording.truth)
    ends = round(LEFT_OUT * len(time))
    inside = np.zeros(len(time), dtype=bool)
    inside[ends:-ends] = True
    best = np.inf
    for spans in np.unique(np.geomspace(6, len(time) / 2.5, 30).astype(int)):
        knots = np.concatenate([[0] * 7, np.linspace(0, time[-1], spans + 1), [time[-1]] * 7])
        spline = make_lsq_spline(time, recording.values, knots, k=7)
        rows = np.array([spline(time, nu=order) for order in range(5)])
        best = min(best, _relative(torques(recording, rows) - true, true, inside))
    return best
