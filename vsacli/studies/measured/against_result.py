"""A recording beside the result it was meant to be: when it begins, and how far apart both are."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.documents.columns_file import load_columns
from vsacli.results.store.reader import StoredResult
from vsacli.results.store.simulation import open_stored
from vsacli.studies.measured.agreement import Agreement, straight_line
from vsacli.studies.measured.alignment import FEWEST_SAMPLES, Alignment, Pairing, align, lag_of
from vsacli.studies.measured.comparison_report import SHOWN_LAG, Comparison
from vsacli.studies.measured.measured_columns import Measured, Recording, known_columns, read_recording
from vsacli.studies.measured.slips import slips

POSITIONS = ("q", "theta")
"""By these a recording is aligned if it has any: torques depend on the model, positions were commanded."""

FEWEST_STEPS = 4
"""Steps of a result through which a cubic spline goes."""

OTHER_UNIT = 100
"""How many times longer or shorter than the result a recording is whose times may be in another unit."""

LAG_SHARE = 0.05
"""Share of the duration within which a lag is looked for."""

SAME_LAG = 0.2
"""Relative distance of lags up to which they are one, which the clock may have."""


def compare(
    result: str | Path | StoredResult,
    recording: str | Path,
    begins_at: float | None = None,
    columns: str | Path | None = None,
) -> Comparison:
    """Compare a recording with a result: error figures of each signal, aligned in time.

    Args:
        result: a result or simulation, or the path of its file.
        recording: a CSV file with a column `time` and columns named as `vsacli export` names them, at times
            of its own; a unit in brackets may follow a name. Cells may be empty where a column has no sample.
        begins_at: when the result begins, s from the first row of the recording; looked for if None.
        columns: a file that says what columns of the recording with other names stand for.

    Raises:
        InputError: the recording has no column of the result or a wrong unit, its times do not ascend, it
            cannot be aligned, or does not overlap with the result.
        StorageError: a file cannot be read.
    """
    if begins_at is not None and not math.isfinite(begins_at):
        raise InputError.one(
            f"when the result begins must be a finite number of seconds, not {begins_at:g}", recording
        )
    if not isinstance(result, StoredResult):
        with open_stored(result) as stored:
            return compare(stored, recording, begins_at, columns)
    variables = [result.declared[name] for name in result.variables]
    places = known_columns(result, variables)
    recorded = read_recording(recording, places, "the result", load_columns(columns))
    computed = [_interpolated(result, signal) for signal in recorded.signals]
    duration = float(result.time[-1] - result.time[0])
    pairings = [
        Pairing(function, duration, *_sampled(recorded, signal))
        for function, signal in zip(computed, recorded.signals, strict=True)
    ]
    alignment = _aligned(recorded, pairings, recording) if begins_at is None else Alignment(begins_at, 1.0)
    covered = _covered(recorded.time - alignment.begins_at, duration, recording)
    signals = tuple(
        _agreement(signal, pairing, alignment.begins_at, result)
        for signal, pairing in zip(recorded.signals, pairings, strict=True)
    )
    notes = (
        *_alignment_notes(alignment),
        *_common_lag(signals, alignment.begins_at),
        *slips(signals, _gear_ratios(recorded, result)),
        *_left_out(recorded),
    )
    return Comparison(
        result=str(result.path),
        recording=str(recording),
        begins_at=alignment.begins_at,
        found=begins_at is None,
        duration=duration,
        compared=covered,
        signals=signals,
        notes=notes,
        sources=(recorded.table.source,),
    )


def _sampled(recorded: Recording, signal: Measured) -> tuple[FloatArray, FloatArray]:
    """Times and values of a signal, without the rows in which it has none."""
    there = np.isfinite(signal.values)
    if np.count_nonzero(there) < FEWEST_SAMPLES and not there.all():
        message = f"column {signal.column!r} has {np.count_nonzero(there)} numbers; leave it out"
        raise InputError.one(message, recorded.table.source.path)
    return recorded.time[there], signal.values[there]


def _interpolated(result: StoredResult, signal: Measured) -> Callable[[FloatArray], FloatArray]:
    """What was computed of a signal as a function of the time from the beginning of the result.

    NaN beyond the result and next to steps that have no value.
    """
    from scipy.interpolate import make_interp_spline

    place, time = signal.place, result.time - result.time[0]
    values = result.read(place.variable)[:, place.joint]
    values = np.asarray(values if place.motor is None else values[:, place.motor - 1], dtype=float)
    known = np.isfinite(values)
    if known.sum() < FEWEST_STEPS:
        return lambda times: np.full(np.shape(times), np.nan)
    spline = make_interp_spline(time[known], values[known], k=3)
    gaps = np.where(known, 0.0, np.nan)

    def at(times: FloatArray) -> FloatArray:
        return np.asarray(spline(times) + np.interp(times, time, gaps, left=np.nan, right=np.nan))

    return at


def _aligned(recorded: Recording, pairings: Sequence[Pairing], path: str | Path) -> Alignment:
    positions = [
        pairing
        for signal, pairing in zip(recorded.signals, pairings, strict=True)
        if signal.place.variable.startswith(POSITIONS)
    ]
    alignment = align(positions) if positions else None
    alignment = alignment or align(pairings)
    if alignment is None:
        raise InputError.one(
            "is like the computed signals at no shift in time; is it the recording of this motion? "
            f"{_other_unit(pairings[0])}--begins-at says when in the recording the result begins",
            path,
        )
    return alignment


def _other_unit(pairing: Pairing) -> str:
    """That times may be in another unit than seconds, if the recording lasts so much longer or shorter."""
    lasts = float(pairing.time[-1])
    if 1 / OTHER_UNIT < lasts / pairing.duration < OTHER_UNIT:
        return ""
    lengths = f"It lasts {lasts:.4g} s and the result {pairing.duration:.4g} s"
    return f"{lengths}: if times are in another unit, write it in the header, e.g. time[ms]; "


def _covered(time: FloatArray, duration: float, path: str | Path) -> float:
    """How much of the result the recording covers, s."""
    covered = min(float(time[-1]), duration) - max(float(time[0]), 0.0)
    rows = np.count_nonzero((time >= 0) & (time <= duration))
    if rows < FEWEST_SAMPLES:
        raise InputError.one(
            f"lies from {time[0]:.4g} to {time[-1]:.4g} s of the result, which takes {duration:.4g} s: "
            f"{rows} of its rows are within, {FEWEST_SAMPLES} are needed; change --begins-at",
            path,
        )
    return covered


def _agreement(signal: Measured, pairing: Pairing, begins_at: float, result: StoredResult) -> Agreement:
    time = pairing.time - begins_at
    computed = pairing.computed(time)
    there = np.isfinite(computed)
    time, computed, measured = time[there], computed[there], pairing.measured[there]
    error = measured - computed
    place = signal.place
    worst = int(np.argmax(np.abs(error))) if error.size else None
    offset, gain, correlation = straight_line(computed, measured) if error.size else (math.nan,) * 3
    scale = math.sqrt(np.mean(computed**2)) if error.size else math.nan
    rms = math.sqrt(np.mean(error**2)) if error.size else math.nan
    lag = lag_of(pairing, begins_at, LAG_SHARE * pairing.duration) if math.isfinite(gain) else math.nan
    return Agreement(
        column=signal.column,
        variable=place.variable,
        joint=result.joint_names[place.joint],
        motor=place.motor,
        unit=result.declared[place.variable].quantity.unit(result.joint_types[place.joint]),
        samples=int(error.size),
        rms=rms,
        share=rms / scale if scale > 0 else math.nan,
        worst=math.nan if worst is None else float(error[worst]),
        worst_time=math.nan if worst is None else float(time[worst]),
        offset=offset,
        gain=gain,
        correlation=correlation,
        lag=lag,
        time=time,
        computed=computed,
        measured=measured,
    )


def _alignment_notes(alignment: Alignment) -> Iterator[str]:
    if alignment.others:
        listed = ", ".join(f"{other:.3f} s" for other in alignment.others[:3])
        yield f"beginning at {listed} it would agree as well, as periodic motions do; --begins-at chooses"


def _common_lag(signals: Sequence[Agreement], begins_at: float) -> Iterator[str]:
    """Where all that is no position lags alike: a joint that does not follow its command misleads."""
    lags = [signal.lag for signal in signals if not signal.variable.startswith(POSITIONS)]
    middle = float(np.median(lags)) if lags else math.nan
    if abs(middle) >= SHOWN_LAG and max(abs(lag - middle) for lag in lags) <= SAME_LAG * abs(middle):
        yield (
            f"all signals but positions lag by {1e3 * middle:+.1f} ms; if the joints did not follow their "
            f"commands, --begins-at {begins_at + middle:.4f} may be right"
        )


def _gear_ratios(recorded: Recording, result: StoredResult) -> list[float]:
    """Of the motor that each signal is of; NaN if it is of none."""
    places = [signal.place for signal in recorded.signals]
    return [
        math.nan if place.motor is None else float(result.gear_ratio[place.joint, place.motor - 1])
        for place in places
    ]


def _left_out(recorded: Recording) -> Iterator[str]:
    if recorded.others:
        yield f"not compared, as the result has none of that name: {', '.join(recorded.others)}"
