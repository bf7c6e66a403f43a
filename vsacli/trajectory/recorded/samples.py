"""Recorded samples of a signal, and their profile: given columns, and a fit for missing derivatives.

Even sample times are recovered from stamps rounded to decimals, or to floating-point seconds since 1970.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.progress import Progress, unseen
from vsacli.base.signals import Signal
from vsacli.trajectory.fits import AS_IT_ASKS_FOR, Fit, FitChoice, fit_samples, mismatches
from vsacli.trajectory.fits.fit import unresolved, vibrations
from vsacli.trajectory.fits.fit_text import describe, fit_notes, fit_sentences, undetermined_derivatives
from vsacli.trajectory.recorded import hermite
from vsacli.trajectory.recorded.thresholds import ENOUGH_ROWS
from vsacli.trajectory.times import stretch

MOST_DECIMALS = 9

EVEN = 1e-6
"""Deviation from even stamps, in sampling intervals, that affects no derivative."""

LOST = 1.5
"""Interval, in median ones, above which rows are missing."""

DIGITS = 17
"""Digits that distinguish any two floating-point numbers."""

COARSEST = 0.5
"""Coarsest resolution, in sampling intervals, with which stamps show whether samples are even."""


def elapsed_times(stamps: FloatArray) -> FloatArray:
    """Return times from the first stamp on, (samples,), s, made even if their resolution allows it.

    Rounded stamps of even samples act like noise of the motion, even periodic noise, which no fit could
    distinguish from a vibration. Rows may be missing.
    """
    elapsed = stamps - stamps[:1]
    if len(stamps) < ENOUGH_ROWS or not np.all(np.diff(stamps) > 0):
        return elapsed
    even_times, step = _evenly_spaced(elapsed), float(elapsed[-1]) / (len(stamps) - 1)
    deviation = float(np.abs(even_times - elapsed).max())
    if deviation <= EVEN * step:
        return elapsed
    resolution, rounding = (
        stamp_resolution(stamps),
        _float_spacing(stamps),
    )  # half of each from a stamp, half from both ends
    if deviation <= rounding or (deviation <= resolution + rounding and resolution <= COARSEST * step):
        return even_times
    return elapsed


def _evenly_spaced(elapsed: FloatArray) -> FloatArray:
    """Return the nearest multiples of an interval that divides the last time into an integer number."""
    steps = np.diff(elapsed)
    interval = float(np.mean(steps[steps < LOST * np.median(steps)]))
    interval_counts = np.round(elapsed / (elapsed[-1] / np.round(elapsed[-1] / interval)))
    return np.asarray(elapsed[-1] * interval_counts / interval_counts[-1])


def stamp_resolution(stamps: FloatArray) -> float:
    """Return the resolution of stamps, s: their last decimal, or the spacing of floating-point numbers."""
    sampled_stamps = stamps[:: max(1, len(stamps) // 1000)]
    rounding = _float_spacing(stamps)
    for decimals in range(MOST_DECIMALS + 1):
        if np.abs(sampled_stamps - np.round(sampled_stamps, decimals)).max() <= 2 * rounding:
            return max(10.0**-decimals, rounding)
    return rounding


def _float_spacing(stamps: FloatArray) -> float:
    """Return the spacing of floating-point numbers at the stamps, s."""
    return float(np.spacing(np.abs(stamps).max()))


def even_rate(stamps: FloatArray) -> float | None:
    """Return the sample rate, 1/s, of even stamps, (samples,), s, without missing rows; None for others.

    Of all rates that are possible with the rounding of the stamps it has the fewest digits.
    """
    steps = len(stamps) - 1
    elapsed = elapsed_times(stamps)
    if steps < 1 or np.abs(np.diff(elapsed) * steps / elapsed[-1] - 1).max() > 2 * EVEN:
        return None
    even_times = elapsed[-1] * np.arange(steps + 1) / steps
    max_deviation = float(np.abs(stamps - stamps[0] - even_times).max()) + _float_spacing(stamps)
    rate, relative_tolerance = (
        steps / float(elapsed[-1]),
        2 * max_deviation / float(elapsed[-1]),
    )  # both ends may be off
    rounded_rates = (float(f"{rate:.{digits}g}") for digits in range(1, DIGITS))
    return next((each for each in rounded_rates if abs(each - rate) <= relative_tolerance * rate), rate)


def rounding_notes(stamps: FloatArray) -> tuple[str, ...]:
    """Return a note if rounded stamps were replaced by even ones."""
    elapsed = elapsed_times(stamps)
    max_deviation = float(np.abs(elapsed - (stamps - stamps[:1])).max(initial=0.0))
    if max_deviation == 0:
        return ()
    return (
        f"stamps are up to {max_deviation:.2g} s from even, which is their rounding, and are taken for even",
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class SignalSamples:
    """A signal at recorded times; `time_problems` and `sample_problems` check whether it can be used.

    Attributes:
        signal: described signal.
        time: times from the first sample on, (samples,), s: stamps since 1970 are too coarse for splines.
        values: values, (components, samples); all NaN for a component without an optional signal.
        derivatives: given values of each derivative, (components, samples); None if not given.
        labels: names of the components in sentences.
        start: stamp of the first sample, s.
    """

    signal: Signal
    time: FloatArray = field(repr=False)
    values: FloatArray = field(repr=False)
    derivatives: tuple[FloatArray | None, ...] = field(repr=False)
    labels: tuple[str, ...]
    start: float = 0.0

    @classmethod
    def recorded(
        cls,
        signal: Signal,
        stamps: FloatArray,
        values: FloatArray,
        derivatives: tuple[FloatArray | None, ...],
        labels: tuple[str, ...],
    ) -> SignalSamples:
        """Return samples from stamps, (samples,), s, counted from any instant."""
        start = float(stamps[0]) if len(stamps) else 0.0
        return cls(
            signal=signal,
            time=elapsed_times(stamps),
            values=values,
            derivatives=derivatives,
            labels=labels,
            start=start,
        )

    @property
    def has_values(self) -> BoolArray:
        """Mask of components with values, (components,)."""
        absent: BoolArray = np.all(np.isnan(self.values), axis=1)
        return ~absent if self.signal.optional else np.ones_like(absent)

    @property
    def complete(self) -> bool:
        """Whether all derivatives are given."""
        return all(derivative is not None for derivative in self.derivatives)

    @cached_property
    def rows(self) -> FloatArray:
        """Value and all derivatives, (orders, components, samples), if all are given."""
        return np.stack(
            [self.values, *(derivative for derivative in self.derivatives if derivative is not None)]
        )

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the derivatives that are not given."""
        pairs = zip(self.signal.names[1:], self.derivatives, strict=True)
        return tuple(name for name, derivative in pairs if derivative is None)

    @property
    def columns(self) -> dict[str, FloatArray]:
        """Values and given derivatives by name, (components, samples)."""
        pairs = zip(self.signal.names, (self.values, *self.derivatives), strict=True)
        return {name: rows for name, rows in pairs if rows is not None}

    def with_columns(self, columns: Mapping[str, FloatArray]) -> SignalSamples:
        """Return the samples with other numbers in the same columns, see `columns`."""
        value, *names = self.signal.names
        return replace(self, values=columns[value], derivatives=tuple(map(columns.get, names)))

    def warnings(self, fit: Fit, *, resampled: bool) -> Iterator[str]:
        """Yield sentences on estimated values at the samples, and on given derivatives that disagree."""
        value, *names = self.signal.names
        fitted = names if resampled else self.missing
        yield from fit_sentences(value, fitted, self.labels, self.time, fit)
        if fitted:
            yield from (
                sentence for sentence, _ in undetermined_derivatives(value, fitted[-1], self.labels, fit)
            )
        if not resampled:
            yield from mismatches(
                self.signal.names, self.labels, self.time, self.derivatives, fit, start=self.start
            )

    def stretched(self, factor: float) -> SignalSamples:
        """Return the samples further apart by a factor, with given derivatives scaled accordingly."""
        derivatives = tuple(
            None if derivative is None else derivative / factor**order
            for order, derivative in enumerate(self.derivatives, start=1)
        )
        return replace(self, time=stretch(self.time, 0.0, factor), derivatives=derivatives)


@dataclass(frozen=True, eq=False, kw_only=True)
class SampledProfile:
    """The profile of a recorded signal.

    At recorded times its derivatives are the given ones, or else those of a fit. Its values are the samples
    if all derivatives are given, or if the fit goes through the samples, else those of the fit. Between
    recorded times it is the Hermite spline if all derivatives are given and consistent, else the fit.

    Attributes:
        record: recorded samples.
        fit: fit of the values.
        choice: choice of the fit by the user.
        resampled: whether samples are at other times than the recorded ones; only the fit is used then.
        warnings: sentences on estimated values, and on given derivatives that do not follow from the values.
    """

    record: SignalSamples
    fit: Fit
    choice: FitChoice = AS_IT_ASKS_FOR
    resampled: bool = False
    warnings: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        record: SignalSamples,
        choice: FitChoice = AS_IT_ASKS_FOR,
        *,
        resampled: bool = False,
        progress: Progress = unseen,
    ) -> SampledProfile:
        """Fit samples that have no problems.

        Args:
            record: recorded samples.
            choice: choice of the fit; see `fit_samples`.
            resampled: whether samples are at other times than the recorded ones.
            progress: function that opens a progress bar over the samples of all components.
        """
        signal = record.signal
        with np.errstate(
            over="ignore", invalid="ignore"
        ):  # extreme values, e.g. 1e100 in 1e-30 s, may overflow
            fit = fit_samples(
                record.time,
                record.values,
                signal.spline_degree,
                signal.orders - 1,
                choice.method,
                noise=choice.deviations,
                bandwidth=choice.bandwidth,
                progress=progress,
            )
            warnings = tuple(record.warnings(fit, resampled=resampled))
        return cls(record=record, fit=fit, choice=choice, resampled=resampled, warnings=warnings)

    @property
    def signal(self) -> Signal:
        """Described signal."""
        return self.record.signal

    @property
    def components(self) -> int:
        """Number of components: one per joint, or six of a wrench."""
        return len(self.record.values)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the interpretation of noise, and on given derivatives that are not used."""
        record = self.record
        notes_of_fit = (
            tuple(fit_notes(record.signal.names[0], record.labels, self.fit)) if self.fitted else ()
        )
        unused = [name for name in record.signal.names[1:] if name not in record.missing]
        if not self.resampled or not unused:
            return notes_of_fit
        verb = "plays" if len(unused) == 1 else "play"
        return (*notes_of_fit, f"the given {', '.join(unused)} {verb} no part, since the steps are resampled")

    @property
    def fitted(self) -> bool:
        """Whether any value at the samples comes from the fit."""
        return self.resampled or not self.record.complete

    @property
    def estimate(self) -> SampledProfile | None:
        """This profile if any value at the samples comes from the fit, else None."""
        return self if self.fitted else None

    def summary(self) -> dict[str, Any]:
        """Return the properties of the fit as JSON values; see `describe`."""
        return describe(self.record.signal.names[0], self.record.labels, self.fit)

    @property
    def breakpoints(self) -> FloatArray:
        """Ascending times between which `at` is analytic; the first and last are its span."""
        if self._through_all:
            return self.record.time
        return self.fit.breakpoints if self.fit.parts else self.record.time[[0, -1]]

    @property
    def known_between(self) -> bool:
        """Whether `at` agrees with the samples: all derivatives come from the fit, or are consistent."""
        without_derivatives = all(derivative is None for derivative in self.record.derivatives)
        return self.resampled or without_derivatives or self._through_all

    @cached_property
    def _through_all(self) -> bool:
        """Whether all derivatives are given and consistent, so that they determine values between samples."""
        record = self.record
        return (
            not self.resampled
            and record.complete
            and hermite.derivatives_are_consistent(record.time, record.rows)
        )

    def samples(self, start: int, stop: int, time: FloatArray, /) -> FloatArray:
        """Return value and derivatives at samples start..stop-1: given ones, and the fit for others."""
        record = self.record
        if self.resampled:
            return self.at(time)
        if record.complete:
            rows = np.empty((record.signal.orders, self.components, len(time)))
            exact = np.ones(self.components, dtype=bool)
        else:
            rows = self.at(record.time[start:stop])
            exact = self.fit.exact
        rows[0, exact] = record.values[exact, start:stop]
        for row, derivative in zip(rows[1:], record.derivatives, strict=True):
            if derivative is not None:
                row[:] = derivative[:, start:stop]
        return rows

    def at(self, time: FloatArray) -> FloatArray:
        """Return value and derivatives at any times of the span, shape (orders, components, samples)."""
        if self._through_all:
            return hermite.interpolate_hermite(self.record.time, self.record.rows, time)
        return self.fit.at(time, self.record.signal.orders)

    def advice_without_derivative(self) -> dict[str, str]:
        """Return what to do by each warning on the highest derivative, for a robot that does not use it."""
        missing = self.signal.names[1:] if self.resampled else self.record.missing
        return dict(undetermined_derivatives(self.signal.names[0], missing[-1], self.record.labels, self.fit))

    @property
    def estimated(self) -> tuple[str, ...]:
        """Result variables of value and derivatives that come from the fit at the samples."""
        signal, record = self.signal, self.record
        value, *derivatives = zip(signal.variables, signal.names, strict=True)
        fitted = (each for each, name in derivatives if self.resampled or name in record.missing)
        return value[0], *fitted

    def covariance(self, time: FloatArray) -> FloatArray:
        """Return covariances of value and derivatives at times, (components, orders, orders, samples).

        It is zero for given derivatives, and NaN for components of unknown uncertainty, e.g. if the spline
        follows a vibration that may be noise. For components that are not `stated` it is only a bound.
        """
        covariances = self.fit.covariance(time)
        for members, covariance in unresolved(self.fit, self.signal.orders):
            covariances[members] = covariance[..., None]
        for member, covariance in vibrations(self.fit, self.signal.orders):
            covariances[member] += covariance[..., None]
        exact = [name not in self.estimated for name in self.signal.variables]
        covariances[:, exact] = 0
        covariances[:, :, exact] = 0
        return covariances

    @cached_property
    def stated(self) -> BoolArray:
        """Mask of components with a reliable standard deviation, (components,)."""
        stated = np.ones(self.components, dtype=bool)
        for part in self.fit.parts:
            smoothing = part.smoothing
            stated[part.members] = smoothing is None or (smoothing.resolved and not smoothing.lines.others)
        return stated

    def stretched(self, factor: float) -> SampledProfile:
        """Return the profile slowed down by a factor; its warnings still refer to the recording."""
        return replace(
            self,
            record=self.record.stretched(factor),
            fit=self.fit.stretched(factor),
            choice=self.choice.stretched(factor),
        )
