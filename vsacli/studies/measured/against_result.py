"""Comparison of a recording with a result: alignment in time, error figures of each signal, and warnings.

A linear fit and a time offset are found for almost any two smooth motions, so that a recording of another
robot or of another motion is compared without an error. The warnings say so at the top of the report.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import compress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FLAG_TYPE, FloatArray
from vsacli.base.errors import InputError
from vsacli.base.flags import Flag, has_flag
from vsacli.base.simulation_variables import COMMANDS, measured
from vsacli.base.texts import counted, listed
from vsacli.base.variables import Variable
from vsacli.documents.columns_file import load_columns
from vsacli.results.store.reader import StoredResult, open_stored
from vsacli.studies.measured.agreement import SHOWN_LAG, Agreement, Comparison, with_error
from vsacli.studies.measured.alignment import Alignment, align, lags_agree, mean_of_effects
from vsacli.studies.measured.likely_causes import (
    FEWEST_OFF,
    NOTABLE,
    SURE,
    WILD,
    exchanged_places,
    likely_causes,
    mistaken,
    wrong_model,
)
from vsacli.studies.measured.line_fit import LineFit, fit_line, root_mean_square, still_signal
from vsacli.studies.measured.measured_columns import (
    MAX_LISTED_JOINTS,
    MeasuredSignal,
    Recording,
    nearest_turn,
    preferred,
    read_recording,
    stand_ins,
)
from vsacli.studies.measured.pairing import FEWEST_SAMPLES, Computed, Pairing, interpolated
from vsacli.trajectory.recorded.header_words import COMMANDED, role_of

POSITIONS = ("q", "theta")
"""Variables preferred for the alignment: errors of the model change the first not, the others hardly."""

OTHER_UNIT = 100
"""Ratio of the durations of recording and result above which the times may be in another unit."""

TORQUES = ("tau", "current")
"""Beginnings of the variables that sensors of torque show, late or not."""


def compare(
    result: str | Path | StoredResult,
    recording: str | Path,
    time_offset: float | None = None,
    columns: str | Path | None = None,
) -> Comparison:
    """Compare a recording with a result: error figures of each signal, aligned in time.

    Args:
        result: a result or simulation, or the path of its file.
        recording: CSV file with a column `time` and columns named as by `vsacli export`, at its own times; a
            unit in brackets may follow a name. Cells may be empty where a column has no sample.
        time_offset: time in the recording at which the result begins, s since the first row; found from the
            signals if None.
        columns: file that maps other column names.

    Raises:
        InputError: the recording has no column of the result or a wrong unit, its times do not ascend, it
            cannot be aligned, or does not overlap with the result.
        StorageError: a file cannot be read.
    """
    if time_offset is not None and not math.isfinite(time_offset):
        raise InputError.one(f"the time offset must be finite, not {time_offset:g} s")
    if not isinstance(result, StoredResult):
        with open_stored(result) as stored:
            return compare(stored, recording, time_offset, columns)
    column_names = list(stand_ins(_variables(result)))
    mapping = load_columns(columns)
    full_recording = read_recording(recording, result, column_names, result.robot_name, mapping)
    direct_recording, replaced_columns = _most_direct_signals(full_recording)
    computed = _interpolate_signals(result, direct_recording.signals)
    duration = float(result.time[-1] - result.time[0])
    pairings = [
        Pairing(function, duration, *_signal_samples(direct_recording, signal))
        for function, signal in zip(computed, direct_recording.signals, strict=True)
    ]
    alignment = (
        _align_recording(direct_recording, pairings, recording)
        if time_offset is None
        else Alignment(time_offset)
    )
    overlap = _overlap(direct_recording.time, alignment.time_offset, duration, recording)
    if mapping.unwrap:
        pairings = _nearest_turns(direct_recording, pairings, alignment.time_offset)
    signals = _agreements(result, direct_recording, pairings, alignment)
    ratios = _gear_ratios(direct_recording, result)
    notes = (
        *_without_torques(direct_recording, column_names),
        *_alignment_notes(alignment),
        *_common_lag_notes(signals, alignment.time_offset),
        *likely_causes(signals, ratios),
        *wrong_model(signals, ratios),
        *_columns_left_out(direct_recording, replaced_columns),
    )
    return Comparison(
        result=str(result.path),
        recording=str(recording),
        time_offset=alignment.time_offset,
        time_offset_error=alignment.error,
        found=time_offset is None,
        duration=duration,
        compared=overlap.duration,
        signals=signals,
        warnings=tuple(comparison_warnings(result, full_recording.stranger, signals, ratios, overlap)),
        notes=notes,
        sources=(direct_recording.table.source,),
    )


def _variables(result: StoredResult) -> dict[str, Variable]:
    """Return the variables by plain name; for a simulation the simulated ones instead of the commands."""
    variables: dict[str, Variable] = {}
    for name in result.variables:
        plain_name = name.removesuffix(measured(""))
        if name not in COMMANDS.values():
            variables[plain_name] = result.declared[plain_name if plain_name in result.variables else name]
    return variables


def _most_direct_signals(recorded: Recording) -> tuple[Recording, list[str]]:
    """Return the recording with the most direct column of each signal, and the names of the others."""
    preferred_columns = {signal.column for signal in preferred(recorded.signals).values()}
    direct_signals = tuple(signal for signal in recorded.signals if signal.column in preferred_columns)
    replaced_columns = [
        signal.column for signal in recorded.signals if signal.column not in preferred_columns
    ]
    return recorded._replace(signals=direct_signals), replaced_columns


def _signal_samples(recorded: Recording, signal: MeasuredSignal) -> tuple[FloatArray, FloatArray]:
    """Return times and values of a signal, without rows in which it has none."""
    is_finite = np.isfinite(signal.values)
    if np.count_nonzero(is_finite) < FEWEST_SAMPLES and not is_finite.all():
        number_count = counted(int(np.count_nonzero(is_finite)), "number")
        message = f"column {signal.column!r} has {number_count} of at least {FEWEST_SAMPLES}; leave it out"
        raise InputError.one(message, recorded.table.source.path)
    return recorded.time[is_finite], signal.values[is_finite]


def _interpolate_signals(result: StoredResult, signals: Sequence[MeasuredSignal]) -> list[Computed]:
    """Return each computed signal as a function of the time since the start of the result."""
    computed_signals, time = [], result.time - result.time[0]
    names = {signal.place.variable for signal in signals}
    stored = {name: np.asarray(result.read(name), dtype=float) for name in names}
    max_magnitudes = {
        name: float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
        for name, values in stored.items()
    }
    for variable, joint, motor in (signal.place.target for signal in signals):
        values = stored[variable][:, joint]
        computed_signals.append(
            interpolated(time, values if motor is None else values[:, motor - 1], max_magnitudes[variable])
        )
    return computed_signals


def _align_recording(recorded: Recording, pairings: Sequence[Pairing], path: str | Path) -> Alignment:
    groups = [_exchange_group(signal) for signal in recorded.signals]
    variables = [signal.place.variable for signal in recorded.signals]
    is_position = [variable.startswith(POSITIONS) for variable in variables]
    commanded = [variable.startswith(POSITIONS[0]) for variable in variables]
    positions = align(
        *(list(compress(pairings, is_position)), list(compress(groups, is_position))),
        list(compress(commanded, is_position)),
    )
    alignment = positions or align(pairings, groups, commanded)
    if alignment is None:
        raise InputError.one(
            "matches the result at no time offset; is it the recording of this motion, and does anything "
            f"move? {_time_unit_hint(pairings[0])}If the offset is known, give --time-offset",
            path,
        )
    return alignment


def _exchange_group(signal: MeasuredSignal) -> tuple[str, str]:
    """Return the key of a group of columns that may have been exchanged with each other."""
    return signal.place.variable, signal.place.unit


def _time_unit_hint(pairing: Pairing) -> str:
    """Return a hint that times may not be in seconds, if the durations differ much; otherwise ""."""
    recording_duration = float(pairing.time[-1])
    if 1 / OTHER_UNIT < recording_duration / pairing.duration < OTHER_UNIT:
        return ""
    sentence = f"It lasts {recording_duration:.4g} s and the result {pairing.duration:.4g} s"
    return f"{sentence}: if times are in another unit, write it in the header, e.g. time[ms]. "


def _nearest_turns(recorded: Recording, pairings: Sequence[Pairing], time_offset: float) -> list[Pairing]:
    """Return pairings with unwrapped angles in the turn of the computed ones."""
    return [
        pairing._replace(measured=nearest_turn(pairing.measured, pairing.overlap(time_offset)[0]))
        if (signal.place.unit, signal.place.gear) == ("rad", 1)
        else pairing
        for signal, pairing in zip(recorded.signals, pairings, strict=True)
    ]


def _overlap(times: FloatArray, time_offset: float, duration: float, path: str | Path) -> Overlap:
    """Return the part of the result that the recording covers.

    Raises:
        InputError: too few rows overlap.
    """
    time = times - time_offset
    row_count = int(np.count_nonzero((time >= 0) & (time <= duration)))
    if row_count < FEWEST_SAMPLES:
        row_text = f"{row_count or 'no'} {'row overlaps' if row_count < 2 else 'rows overlap'}"
        raise InputError.one(
            f"with a time offset of {time_offset:.4g} s, {row_text} the result ({duration:.4g} s): "
            f"the recording spans {time[0]:.4g} to {time[-1]:.4g} s of it; at least {FEWEST_SAMPLES} rows "
            "must overlap",
            path,
        )
    return Overlap(min(float(time[-1]), duration) - max(float(time[0]), 0.0), row_count, duration)


def _agreements(
    result: StoredResult, recorded: Recording, pairings: Sequence[Pairing], alignment: Alignment
) -> tuple[Agreement, ...]:
    """Return the agreement of every column with the result."""
    groups = [_exchange_group(signal) for signal in recorded.signals]
    followed_indices = exchanged_places(pairings, groups, alignment.time_offset)
    followed_columns = [
        None if followed_index == index else recorded.signals[followed_index].column
        for index, followed_index in enumerate(followed_indices)
    ]
    return tuple(
        _signal_agreement(result, signal, pairing, alignment, follows)
        for signal, pairing, follows in zip(recorded.signals, pairings, followed_columns, strict=True)
    )


def _signal_agreement(
    result: StoredResult, signal: MeasuredSignal, pairing: Pairing, alignment: Alignment, follows: str | None
) -> Agreement:
    computed, in_overlap = pairing.overlap(alignment.time_offset)
    time, computed = (pairing.time - alignment.time_offset)[in_overlap], computed[in_overlap]
    values = pairing.measured[in_overlap]
    error, place = values - computed, signal.place
    worst_index = int(np.argmax(np.abs(error))) if error.size else None
    rms, scale = root_mean_square(error), root_mean_square(computed)
    fit = LineFit() if follows else fit_line(pairing, alignment.time_offset)
    still_kind = still_signal(pairing, alignment.time_offset, fit) if error.size and not follows else None
    line = LineFit() if still_kind else fit
    left_out = int(np.count_nonzero(in_overlap) - np.count_nonzero(fit.used)) if fit.used.size else 0
    usual_rms = root_mean_square(error[fit.used[in_overlap]]) if left_out else 0.0
    outlier_threshold = max(WILD * usual_rms, NOTABLE * float(np.ptp(computed))) if left_out else 0.0
    return Agreement(
        column=signal.column,
        variable=place.variable,
        joint=result.joint_names[place.joint],
        motor=place.motor,
        unit=result.declared[place.variable].quantity.unit(result.joint_types[place.joint]),
        samples=int(error.size),
        rms=rms,
        share=rms / scale if scale > 0 else math.nan,
        worst=math.nan if worst_index is None else float(error[worst_index]),
        worst_time=math.nan if worst_index is None else float(time[worst_index]),
        offset=line.offset,
        gain=line.gain,
        correlation=line.correlation,
        lag=line.lag,
        time=time,
        computed=computed,
        measured=values,
        offset_error=line.offset_error,
        gain_error=line.gain_error,
        lag_error=math.hypot(line.lag_error, np.nan_to_num(alignment.error)),
        follows=follows,
        still=still_kind,
        left_out=left_out if left_out and np.abs(error).max() > outlier_threshold else 0,
    )


def _without_torques(recorded: Recording, wanted: Sequence[tuple[str, int, Variable]]) -> Iterator[str]:
    """Yield a note if columns were left out, torques among them perhaps, and no torque is compared."""
    left = listed((*recorded.table.ignored, *recorded.table.unknown_columns), MAX_LISTED_JOINTS)
    variables = [name for name, *_ in wanted], [signal.place.variable for signal in recorded.signals]
    computed, compared = (any(each.startswith(TORQUES) for each in names) for names in variables)
    if left and computed and not compared:
        yield f"no torque was compared; if any of {left} is one, map it with --columns"


def _alignment_notes(alignment: Alignment) -> Iterator[str]:
    if alignment.others:
        other_offsets = " and ".join(f"{other:.4g} s" for other in alignment.others[:3])
        fit = "fits" if len(alignment.others) == 1 else "fit"
        yield (
            f"a time offset of {other_offsets} {fit} as well, as in periodic motions; choose with "
            "--time-offset"
        )


def _common_lag_notes(signals: Sequence[Agreement], time_offset: float) -> Iterator[str]:
    """Yield a note if torques agree on a lag behind the positions on which the time offset rests."""
    late = [each for each in signals if each.variable.startswith(TORQUES) and math.isfinite(each.lag)]
    if len(late) < FEWEST_OFF:
        return
    lags, errors = (np.array([getattr(each, name) for each in late]) for name in ("lag", "lag_error"))
    lag, error = mean_of_effects(lags, errors)
    if lags_agree(lags, errors) and abs(lag) >= SHOWN_LAG and abs(lag) > SURE * error:
        yield (
            f"torques agree on a lag of {with_error(1e3 * lag, 1e3 * error, 'ms', '+.1f')} behind positions: "
            "their sensors are late (vsacli identify ROBOT RECORDING removes such a delay), the model is "
            "wrong, or joints did not follow their commands, and then --time-offset "
            f"{time_offset + lag:.4f} is right"
        )


def _gear_ratios(recorded: Recording, result: StoredResult) -> list[float]:
    """Return the gear ratio of the motor of each signal; NaN for other signals."""
    places = [signal.place for signal in recorded.signals]
    return [
        math.nan if place.motor is None else float(result.gear_ratio[place.joint, place.motor - 1])
        for place in places
    ]


def _columns_left_out(recorded: Recording, replaced_columns: Sequence[str]) -> Iterator[str]:
    commanded = [column for column in recorded.table.unknown_columns if role_of(column)[0] == COMMANDED]
    unknown = [column for column in recorded.table.unknown_columns if column not in commanded]
    if replaced_columns:
        yield f"not compared, as other columns say what the robot did: {', '.join(replaced_columns)}"
    if commanded:
        yield f"not compared, as these are commands, not what the robot did: {', '.join(commanded)}"
    if unknown:
        yield f"not compared, as the result has none of that name: {', '.join(unknown)}"


LARGE_ERROR = 0.5
"""Rms error relative to the rms computed value above which a signal does not fit. Feedback-controlled robots
with a poor friction model stay below it in positions, so that fewer than half of their signals exceed it."""

SHORT_OVERLAP = 0.1
"""Share of the duration of the result below which the overlap is short."""

INVALID = Flag.INFEASIBLE | Flag.SINGULAR | Flag.NOT_FINITE
"""Flags of samples without motor torques."""

WITHOUT_TORQUES = ("infeasible", "singular")
"""Verdicts on results that have such samples."""


class Overlap(NamedTuple):
    """The common part of a recording and a result.

    Attributes:
        duration: duration, s.
        rows: number of rows of the recording.
        whole: duration of the result, s.
    """

    duration: float
    rows: int
    whole: float


def comparison_warnings(
    result: StoredResult,
    stranger: str,
    signals: Sequence[Agreement],
    gear_ratios: Sequence[float],
    overlap: Overlap,
) -> Iterator[str]:
    """Yield the warnings of a comparison, the most serious first.

    Args:
        result: compared result.
        stranger: sentence on joints of the recording that the result does not have; otherwise empty.
        signals: agreement of each column.
        gear_ratios: gear ratio of the motor of each signal; NaN without a motor, or if unknown.
        overlap: common part of recording and result.
    """
    if stranger:
        yield stranger
    yield from _poor_fit_warnings(signals, gear_ratios)
    if overlap.duration < SHORT_OVERLAP * overlap.whole:
        rows = counted(overlap.rows, "row")
        yield f"only {overlap.duration:.3g} s ({rows}) of {overlap.whole:.4g} s overlap"
    if result.verdict in WITHOUT_TORQUES:
        yield (
            f"{result.path} is {result.verdict}{_missing_torques_text(result)}; its motors are not "
            "compared there"
        )


def _poor_fit_warnings(signals: Sequence[Agreement], gear_ratios: Sequence[float]) -> Iterator[str]:
    """Yield a warning if most signals differ much from the result, without a likely mistake as the cause."""
    finite_signals = [
        (signal, ratio)
        for signal, ratio in zip(signals, gear_ratios, strict=True)
        if math.isfinite(signal.share) and signal.still != "computed"
    ]
    differing = [
        signal
        for signal, ratio in finite_signals
        if signal.share > LARGE_ERROR and not mistaken(signal, ratio)
    ]
    if 2 * len(differing) <= len(finite_signals):
        return
    worst = max(differing, key=lambda signal: signal.share)
    columns = (
        f"{len(differing)} of {counted(len(finite_signals), 'column')} "
        f"{'differs' if len(differing) == 1 else 'differ'}"
    )
    yield (
        f"the recording does not fit the result: {columns} by more than {100 * LARGE_ERROR:g} % "
        f"({worst.column} by {100 * worst.share:.4g} %); is it the recording of another robot or motion?"
    )


def _missing_torques_text(result: StoredResult) -> str:
    """Return at how many samples motor torques are missing, if the result has flags; otherwise ""."""
    if "flags" not in result.variables:
        return ""
    flags = np.asarray(result.read("flags"), dtype=FLAG_TYPE)
    is_missing = np.any(has_flag(flags, INVALID), axis=1)
    return f" at {np.count_nonzero(is_missing)} of {counted(len(is_missing), 'sample')}"
