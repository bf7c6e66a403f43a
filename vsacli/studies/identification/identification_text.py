"""Values of an identification (parameters, residuals, use of recordings), and their tables and sentences."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol, TypeVar

from vsacli.base.json_records import Published, named
from vsacli.base.tables import cell
from vsacli.base.texts import counted
from vsacli.base.units import in_header
from vsacli.robot.parameters import JOINTS

CHANGED = 3.0
"""Difference from the file, in standard errors, that is a change. Of a hundred unchanged parameters, five
exceed two standard errors by chance, and less than one exceeds three."""


@dataclass(frozen=True)
class Number(Published):
    """The result for one parameter of a robot.

    Attributes:
        path: path of the parameter in the robot, or name of a base parameter.
        unit: unit of all values.
        before: value in the robot file.
        value: identified value, or the previous one.
        standard_error: standard error of the value; NaN if unidentifiable.
        note: reason why it is unidentifiable, or at a bound; otherwise empty.
        sum: terms of a base parameter, which the file does not have; otherwise empty.
    """

    path: str
    unit: str
    before: float
    value: float
    standard_error: float
    note: str = ""
    sum: str = ""

    shape: ClassVar = {
        **named("path", "unit", "before", "value", "standard_error", "off", "changed"),
        "note?": "note",
        "sum?": "sum",
    }

    @property
    def identifiable(self) -> bool:
        """Whether the parameter was identified."""
        return math.isfinite(self.standard_error)

    @property
    def off(self) -> float:
        """Difference from the file in standard errors; NaN if unidentifiable."""
        difference = self.value - self.before
        if not (difference and self.identifiable):
            return 0.0 * self.standard_error
        return difference / self.standard_error

    @property
    def changed(self) -> bool:
        """Whether the value differs from the file by more than `CHANGED` standard errors."""
        return self.identifiable and abs(self.value - self.before) > CHANGED * self.standard_error


FAR = 3.0
"""Factor between an identified value and the file beyond which it is far. Parameters from data sheets and CAD
are better; those of another robot are not."""


def far_from_file(numbers: Iterable[Number]) -> list[str]:
    """Return a sentence if most identified parameters are far from the file, otherwise nothing."""
    known = [each for each in numbers if each.identifiable and each.before and not each.sum]
    far = [each for each in known if each.changed and not 1 / FAR < each.value / each.before < FAR]
    if 2 * len(far) <= len(known):
        return []
    differ = "differs" if len(far) == 1 else "differ"
    return [
        f"{len(far)} of {counted(len(known), 'parameter')} {differ} from the file by more than a factor of "
        f"{FAR:g}: is it the recording of another robot? If not, repeat with the robot file that -o writes"
    ]


@dataclass(frozen=True)
class Residual(Published):
    """The residual of the equations of a motor or a link, as root mean squares after the filter.

    Attributes:
        group: name of the motor or link.
        unit: unit of all values.
        torque: measured torque.
        residual: measured minus predicted torque.
        noise: noise of the residual, expected from the noise of torque and positions; NaN if unknown.
        held_out: residual on held-out samples; NaN if nothing was held out.
    """

    group: str
    unit: str
    torque: float
    residual: float
    noise: float
    held_out: float


@dataclass(frozen=True)
class TorqueDeviation(Published):
    """The uncertainty of a motor's torque that is computed with the fitted robot.

    Standard deviations follow from the covariance of the parameters found.

    Attributes:
        motor: name of the motor.
        unit: unit of all values.
        torque: largest torque along the recordings.
        deviation: largest standard deviation along the recordings.
        elsewhere: largest standard deviation with positions, velocities, accelerations and stiffness that
            were recorded at different times.
    """

    motor: str
    unit: str
    torque: float
    deviation: float
    elsewhere: float


@dataclass(frozen=True)
class SystemReport(Published):
    """The results for the parameters of a joint's motors and springs, or of the links.

    Attributes:
        title: name of the joint, or "links".
        numbers: results for all unknown parameters.
        condition: condition number of the columns of the equations.
        combinations: identifiable combinations of indistinguishable parameters, as sentences.
        residuals: residuals of each motor or link.
        converged: whether the fit converged.
    """

    title: str
    numbers: tuple[Number, ...]
    condition: float
    combinations: tuple[str, ...]
    residuals: tuple[Residual, ...]
    converged: bool = True


@dataclass(frozen=True)
class RecordReport(Published):
    """Properties of a recording and its use.

    Attributes:
        path: path of the file.
        duration: duration of the used part, s.
        rate: sample rate, Hz.
        bandwidth: bandwidth of the filter, Hz.
        delay: delay of torques behind positions, s; NaN if unidentifiable.
        delay_error: standard error of the delay, s.
        corrected: whether the delay was removed.
        doubts: likely faults, as sentences.
        unused: columns that were not required.
    """

    path: str
    duration: float
    rate: float
    bandwidth: float
    delay: float
    delay_error: float
    corrected: bool
    doubts: tuple[str, ...]
    unused: tuple[str, ...]


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
