"""Records of a healthy sensor: motions, how they are sampled, and noise that a laboratory has."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

Motion = Callable[[np.ndarray], np.ndarray]

RATES = (100.0, 250.0, 1000.0, 4000.0)
DURATION = 10.0


def sines(rng: np.random.Generator) -> Motion:
    frequency, phase = rng.uniform(0.1, 3, 4), rng.uniform(0, 2 * np.pi, 4)
    size = rng.uniform(0.05, 0.5, 4)
    return lambda t: np.sin(2 * np.pi * frequency * t[:, None] + phase) @ size


def rest_to_rest(rng: np.random.Generator) -> Motion:
    """Polynomials of degree 5 to 9 from rest to rest, with pauses."""
    ends = np.cumsum(rng.uniform(0.3, 2, 20))
    levels, degree = rng.uniform(-2, 2, 11), int(rng.choice([5, 7, 9]))

    def rise(s: np.ndarray) -> np.ndarray:
        power = np.polynomial.Polynomial([0, 1]) ** ((degree - 1) // 2)
        bell = (power * (1 - np.polynomial.Polynomial([0, 1])) ** ((degree - 1) // 2)).integ()
        return np.asarray(bell(np.clip(s, 0, 1)) / bell(1))

    def motion(t: np.ndarray) -> np.ndarray:
        q = np.full_like(t, levels[0])
        for start, end, before, after in zip(ends[::2], ends[1::2], levels, levels[1:], strict=False):
            q += (after - before) * rise((t - start) / (end - start))
        return q

    return motion


def sweep(rng: np.random.Generator) -> Motion:
    low, high, size = rng.uniform(0.05, 0.5), rng.uniform(1, 6), rng.uniform(0.1, 1)
    return lambda t: size * np.sin(2 * np.pi * (low * t + (high - low) * t**2 / (2 * DURATION)))


def velocity_steps(rng: np.random.Generator) -> Motion:
    """Ramps and pauses with corners that are rounded over 50 to 200 ms."""
    times, speeds = np.sort(rng.uniform(0, DURATION, 8)), rng.uniform(-1, 1, 9) * rng.integers(0, 2, 9)
    width = rng.uniform(0.05, 0.2)

    def rounded(t: np.ndarray) -> np.ndarray:
        """The integral of a speed that rises from 0 to 1 within the width, without jerk at the ends."""
        s = np.clip(t / width, 0, 1)
        return np.asarray(width * (2.5 * s**4 - 3 * s**5 + s**6) + np.maximum(t - width, 0))

    def motion(t: np.ndarray) -> np.ndarray:
        q = speeds[0] * t
        for start, before, after in zip(times, speeds, speeds[1:], strict=False):
            q = q + (after - before) * rounded(t - start)
        return q

    return motion


MOTIONS = {
    "sines": sines,
    "rest to rest": rest_to_rest,
    "sweep": sweep,
    "velocity steps": velocity_steps,
}


def encoder(bits: int) -> Callable[[np.random.Generator, np.ndarray], np.ndarray]:
    step = 2 * np.pi / 2**bits
    return lambda _rng, q: np.round(q / step) * step


def flickering(rng: np.random.Generator, q: np.ndarray) -> np.ndarray:
    """An encoder whose last bit is not sure."""
    return encoder(14)(rng, q + rng.normal(0, 4e-4, len(q)))


def white(size: float) -> Callable[[np.random.Generator, np.ndarray], np.ndarray]:
    return lambda rng, q: q + rng.normal(0, size, len(q))


def printed(digits: int) -> Callable[[np.random.Generator, np.ndarray], np.ndarray]:
    return lambda _rng, q: np.round(q, digits)


def filtered(rng: np.random.Generator, q: np.ndarray) -> np.ndarray:
    """A 12-bit encoder, low-passed forwards and backwards."""
    from scipy.signal import butter, sosfiltfilt

    return np.asarray(sosfiltfilt(butter(2, 0.2, output="sos"), encoder(12)(rng, q)))


def first_order(rng: np.random.Generator, q: np.ndarray) -> np.ndarray:
    from scipy.signal import lfilter

    return np.asarray(q + lfilter([1e-4], [1, -0.9], rng.normal(size=len(q))))


def hum(rng: np.random.Generator, q: np.ndarray) -> np.ndarray:
    return q + 1e-4 * np.sin(0.31 * np.arange(len(q))) + rng.normal(0, 1e-5, len(q))


SENSORS = {
    "exact": printed(15),
    "six digits": printed(6),
    "12 bits": encoder(12),
    "17 bits": encoder(17),
    "flickering": flickering,
    "white 1e-4": white(1e-4),
    "white 1e-5": white(1e-5),
    "12 bits, filtered": filtered,
    "first order": first_order,
    "hum": hum,
}


def clean_records(seeds: range) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """What it is, its stamps, and a column of positions."""
    for seed in seeds:
        for m, (motion_name, motion) in enumerate(MOTIONS.items()):
            for s, (sensor_name, sensor) in enumerate(SENSORS.items()):
                rng = np.random.default_rng([seed, m, s])
                rate = RATES[(seed + m + s) % len(RATES)]
                time = np.arange(int(DURATION * rate) + 1) / rate
                yield (
                    f"{motion_name}, {sensor_name}, {rate:g} Hz, seed {seed}",
                    time,
                    sensor(rng, motion(rng)(time)),
                )
