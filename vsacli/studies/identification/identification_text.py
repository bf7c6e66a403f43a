"""Tables and sentences of an identification report."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Protocol, TypeVar

from vsacli.base.tables import cell
from vsacli.base.texts import counted
from vsacli.base.units import in_header
from vsacli.robot.parameters import JOINTS
from vsacli.studies.identification.identified_values import (
    CHANGED,
    Number,
    RecordReport,
    SystemReport,
    TorqueDeviation,
)

T = TypeVar("T", bound="Named")

LARGEST_SHOWN = 1e3
"""Deviation in standard errors above which only this bound is printed."""

TENS = 10
"""Deviation in standard errors below which it is printed with a decimal."""

MOST_DIGITS = 6
"""Largest number of digits of a value in the report, for errors near rounding, as of recordings without
noise."""

INDISTINCT, NO_EFFECT, NOT_PHYSICAL, AT_BOUND = (
    "not distinguished",
    "no effect",
    "not physical",
    "at its bound",
)
"""Notes on parameters: only a sum with others is identifiable; no torque depends on it; the value found is
impossible, such as a negative inertia; or it is at the end of its range."""

ACTUATOR = "actuator."
"""Part of a path that is omitted after the name of the joint: nothing else has springs and motors."""


def rounded_by_error(value: float, error: float, digits: float = MOST_DIGITS) -> str:
    """Return a value rounded to two digits of its standard error, with at most so many digits in all."""
    if not (math.isfinite(error) and error > 0):
        return f"{value:.6g}"
    most = math.inf if math.isinf(digits) else _most_decimals(int(digits), value, error)
    return _with_decimals(value, int(min(_decimals(error), most)))


def _decimals(error: float) -> int:
    """Return the decimals of a value that its standard error supports."""
    return 1 - math.floor(math.log10(error))


def _most_decimals(digits: int, *values: float) -> int:
    """Return the decimals with which the largest of some values has so many digits."""
    return digits - 1 - math.floor(math.log10(max(map(abs, values))))


def _with_decimals(value: float, decimals: int, sign: str = "") -> str:
    rounded = round(value, decimals) or 0.0  # no negative zero
    return f"{rounded:{sign if rounded else ''}.{max(decimals, 0)}f}"


def agreement_counts(numbers: Sequence[Number]) -> str:
    """Return how many parameters agree with the file, differ from it, or are unidentifiable."""
    identifiable = sum(each.identifiable for each in numbers)
    changed = sum(each.changed for each in numbers)
    by_words = {
        "agrees" if identifiable - changed == 1 else "agree": identifiable - changed,
        f"{'differs' if changed == 1 else 'differ'} by more than {CHANGED:g} standard errors": changed,
        "unidentifiable": len(numbers) - identifiable,
    }
    listed = ", ".join(f"{number} {words}" for words, number in by_words.items() if number)
    return f"{counted(len(numbers), 'parameter')}: {listed}"


def joint_of_path(path: str, joints: Sequence[str]) -> str:
    """Return the name of the joint of a parameter or base parameter; empty if it has none."""
    beginning = path.removeprefix(f"{JOINTS}.")
    return max((joint for joint in joints if beginning.startswith(f"{joint}.")), key=len, default="")


class Named(Protocol):
    """A parameter with its path."""

    @property
    def path(self) -> str:
        """Path in the robot, or name of a base parameter."""


def parameters_by_joint(
    numbers: Sequence[T], joints: Sequence[str]
) -> Iterator[tuple[str, list[str], list[T]]]:
    """Yield joints, names for a table and parameters; those of no joint last, with an empty name.

    The names are paths without the beginning that they share, indented below the name of the joint.
    """
    for joint in (*joints, ""):
        own = [each for each in numbers if joint_of_path(each.path, joints) == joint]
        if not own:
            continue
        if not joint:
            yield joint, [each.path for each in own], own
            continue
        paths = [each.path.removeprefix(f"{JOINTS}.").removeprefix(f"{joint}.") for each in own]
        short = [path.removeprefix(ACTUATOR) for path in paths]
        yield joint, [f"  {path}" for path in (short if len(set(short)) == len(own) else paths)], own


def parameter_rows(numbers: Sequence[Number], joints: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the table of parameters by joint: largest deviation first, unidentifiable ones last."""
    rows: list[tuple[str, ...]] = [("parameter", "unit", "file", "found", "+-", "deviation\nstd error")]
    ordered = sorted(
        numbers, key=lambda each: (not each.identifiable, -abs(each.off) if each.identifiable else 0.0)
    )
    for joint, names, of_joint in parameters_by_joint(ordered, joints):
        rows += [(joint, *[""] * (len(rows[0]) - 1))] if joint else []
        rows += [
            (name, each.unit, *_value_texts(each), _deviation_from_file(each))
            for name, each in zip(names, of_joint, strict=True)
        ]
    return rows


def _value_texts(number: Number) -> tuple[str, str, str]:
    """Return value in the file, value found and its error, all to two digits of the error."""
    before, value, error = number.before, number.value, number.standard_error
    if not number.identifiable or error <= 0:
        return f"{before:.4g}", "-" if value == before else f"{value:.4g}", "-"
    exact = _decimals(error)
    decimals = min(exact, _most_decimals(MOST_DIGITS, before, value, error))
    shown = _with_decimals(before, decimals)
    return (
        shown if float(shown) else f"{before:.2g}",
        _with_decimals(value, decimals),
        _with_decimals(error, exact) if exact == decimals else f"{error:.1e}",
    )


def _deviation_from_file(number: Number) -> str:
    if not number.identifiable:
        return "-"
    size = abs(number.off)
    if size > LARGEST_SHOWN:
        return f"> {LARGEST_SHOWN:g}"
    return _with_decimals(number.off, int(size < TENS), sign="+")


def residual_rows(systems: Sequence[SystemReport]) -> list[tuple[str, ...]]:
    """Return a table of the residuals of each motor or link, the header first."""
    units = in_header(each.unit for system in systems for each in system.residuals)
    header = ("rms, filtered", *(f"{name}\n{units}" for name in ("torque", "residual", "noise", "held out")))
    rows: list[tuple[str, ...]] = [(*header, "condition")]
    for system in systems:
        condition = f"{system.condition:.3g}"
        rows += [
            (each.group, *map(cell, (each.torque, each.residual, each.noise, each.held_out)), condition)
            for each in system.residuals
        ]
    return rows


def deviation_rows(deviations: Sequence[TorqueDeviation]) -> list[tuple[str, ...]]:
    """Return a table of the torques of the fitted robot, the header first."""
    units = in_header(each.unit for each in deviations)
    header = ("fitted robot", *(f"{words}\n{units}" for words in ("torque", "+-", "+- elsewhere")))
    rows = ((each.motor, cell(each.torque), each.deviation, each.elsewhere) for each in deviations)
    return [
        header,
        *((name, torque, *(f"{error:.2g}" for error in errors)) for name, torque, *errors in rows),
    ]


def findings(
    systems: Sequence[SystemReport], recordings: Sequence[RecordReport], notes: Sequence[str]
) -> Iterator[str]:
    """Yield the findings: faulty recordings, causes of residuals, then unidentifiable parameters."""
    numbers = [number for system in systems for number in system.numbers]
    yield from (f"{recording.path}: {doubt}" for recording in recordings for doubt in recording.doubts)
    yield from notes
    for system in systems:
        yield from (f"{system.title}: {sentence}" for sentence in system.combinations)
    for note in (NO_EFFECT, NOT_PHYSICAL, AT_BOUND):
        paths = [each.path for each in numbers if each.note == note]
        if paths:
            yield f"{note}: {', '.join(paths)}"
    if not all(each.identifiable for each in numbers):
        yield (
            "unidentifiable parameters keep the values of the file, unless their sum differs; to plan a "
            "motion that identifies more: vsacli identify --plan"
        )


def sum_definitions(numbers: Sequence[Number], *, verbose: bool) -> Iterator[str]:
    """Yield the definitions of sums if verbose, otherwise how to see them, and which terms are written."""
    sums = [f"{each.path} is {each.sum}" for each in numbers if each.sum not in ("", each.path)]
    yield from sums if verbose else ()
    if sums:
        listed = "" if verbose else "; with -v its terms are listed"
        yield f"* sum of several parameters{listed}; -o writes terms near the file's"


def use_line(record: RecordReport) -> str:
    """Return which part of a recording was used, and how late its torques are."""
    used = f"{record.duration:.4g} s at {record.rate:.4g} Hz, filtered to {record.bandwidth:.3g} Hz"
    line = f"{record.path}: {used}"
    if not math.isfinite(record.delay):
        return f"{line}; delay of torques unidentifiable"
    late = f"{1e3 * record.delay:+.2g} +- {1e3 * record.delay_error:.1g} ms behind positions"
    return f"{line}; torques are {late}{' (removed)' if record.corrected else ''}"
