"""Base classes of profiles in closed form, and of the declarations of signals in trajectory files.

A type of declaration, such as a polynomial or a recording, becomes a record class for each of its uses, i.e.
for a signal and for robots with or without springs. The simplest profile is a constant. A new type needs a
class like those in this folder, and a row in `TYPES`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, make_dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeAlias

import numpy as np

from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem, InputError
from vsacli.base.lazy import LazyRegistry
from vsacli.base.signals import POSITION, WRENCH, Signal
from vsacli.base.wrench import WRENCH_AXES, WRENCH_FRAMES
from vsacli.documents.fields import (
    POSITIVE,
    Check,
    Items,
    NumberList,
    OneOf,
    PerJoint,
    boolean,
    choice,
    number,
    text,
    value,
)
from vsacli.documents.record_checks import DeclaredRecord
from vsacli.trajectory.profile import Profile
from vsacli.trajectory.times import stretch

if TYPE_CHECKING:
    from vsacli.documents.column_mapping import ColumnMapping
    from vsacli.documents.columns_file import ColumnSource
    from vsacli.trajectory.fits import FitChoice


MIN_DURATION, MAX_DURATION = 1e-30, 1e30
"""Range of durations, s, whose fourth powers neither overflow nor underflow."""

DEGREES = range(3, 16, 2)
"""Degrees of rest-to-rest polynomials."""

VIA_DEGREES = range(3, 10, 2)
"""Degrees of splines through points; higher degrees lose too many digits."""


@dataclass(frozen=True, kw_only=True)
class ClosedForm(Profile):
    """A profile in closed form, analytic between its breakpoints; its span is in s."""

    signal: Signal
    span: tuple[float, float]

    def __post_init__(self) -> None:
        first, last = self.span
        if not MIN_DURATION <= last - first <= MAX_DURATION:
            allowed = f"a positive time ({MIN_DURATION:g} to {MAX_DURATION:g} s)"
            raise InputError.one(f"a profile must last {allowed}, not from {first:g} to {last:g} s")

    @property
    def breakpoints(self) -> FloatArray:
        """Ends of the span."""
        return np.array(self.span)

    def stretched(self, factor: float) -> Self:
        """Return the profile slowed down by a factor."""
        first, last = self.span
        return replace(self, span=(first, stretch(last, first, factor)))

    @abstractmethod
    def rescaled(self, factors: Sequence[float], constants: Sequence[float]) -> Self:
        """Return the profile with each component multiplied by a factor, and then a constant added."""


def rescale(
    values: Sequence[float], factors: Sequence[float], constants: Sequence[float]
) -> tuple[float, ...]:
    """Return the value of each component multiplied by a factor, and then a constant added."""
    changes = zip(values, factors, constants, strict=True)
    return tuple(factor * value + constant for value, factor, constant in changes)


@dataclass(frozen=True, kw_only=True)
class ConstantProfile(ClosedForm):
    """A constant `value`, one number per component."""

    value: tuple[float, ...]

    @property
    def components(self) -> int:
        """Number of components: one per joint, or six of a wrench."""
        return len(self.value)

    def at(self, time: FloatArray) -> FloatArray:
        """See `Profile.at`."""
        derivatives = np.zeros((self.signal.orders, self.components, len(time)))
        derivatives[0] = np.array(self.value)[:, None]
        return derivatives

    def rescaled(self, factors: Sequence[float], constants: Sequence[float]) -> Self:
        """See `ClosedForm.rescaled`."""
        return replace(self, value=rescale(self.value, factors, constants))


SAME_TIME = 1e-9
"""Relative difference up to which times are equal: rounding in a file."""

Values: TypeAlias = tuple[float | None, ...]
"""A number for each joint or axis; None for joints that the signal does not command."""


@dataclass(frozen=True)
class Use:
    """The use of a type of declaration.

    Attributes:
        signal: declared signal.
        rigid: whether all joints are rigid, so that torques do not depend on jerk and snap.
        by_tool: whether it is declared for each of several tools, under the tool's name.
    """

    signal: Signal
    rigid: bool = False
    by_tool: bool = False

    @property
    def smoothness(self) -> int:
        """Number of continuous derivatives that the signal must have."""
        return 2 if self.rigid else self.signal.orders - 1

    def one(self, role: str, **options: Any) -> Any:
        """Return the field of a value; `role` is e.g. "at the start"."""
        return self._field(self._kind, f"{self.signal.key} {role}", **options)

    def several(self, role: str) -> Any:
        """Return the field of a list of values; `role` is e.g. " to pass"."""
        plural = self.signal.key + ("es" if self.signal.key.endswith(("s", "ch")) else "s")
        return self._field(Items(self._kind), plural + role)

    def size(self, doc: str) -> Any:
        """Return the optional field of a positive value in the unit of the signal."""
        return value(self._kind, doc, check=POSITIVE, default=None)

    def frame(self) -> dict[str, Any]:
        """Return the fields of a wrench's frame, and of its tool if there are several; else empty."""
        if self.signal is not WRENCH:
            return {}
        doc = f"frame in whose axes `{' '.join(WRENCH_AXES)}` are given"
        tool = {"name": text("name of the tool", identifier=True)} if self.by_tool else {}
        return {**tool, "frame": choice(WRENCH_FRAMES, doc)}

    def degree(self, degrees: range) -> Check:
        """Return the check of a degree: smooth enough for a motion that begins and ends at rest."""
        vanishing_text = "its rate"
        if self.signal is POSITION:
            vanishing_text = "velocity" if self.rigid else "derivatives up to the third"
        return odd(degrees, 2 * self.smoothness - 1, f"{vanishing_text} must vanish at both ends")

    @property
    def _kind(self) -> PerJoint | NumberList:
        unit = self.signal.quantities[0]
        if self.signal.components is not None:
            return NumberList(self.signal.components, unit)
        return PerJoint(unit, self.signal.key)

    def _field(self, kind: Any, doc: str, **options: Any) -> Any:
        return value(kind, doc, check=POSITIVE if self.signal.positive else None, **options)


def odd(degrees: range, lowest: int, reason: str) -> Check:
    """Return the check of a degree: odd, and at least the lowest that is smooth enough."""
    allowed = range(max(lowest, degrees.start), degrees.stop, degrees.step)
    requirement = f"odd, from {allowed[0]} to {allowed[-1]} ({reason})"
    return Check(lambda degree: degree in allowed, requirement, {"enum": list(allowed)})


class Declaration(DeclaredRecord, ABC):
    """A type of declaration in a trajectory file, with its fields for each use.

    Attributes:
        use: use of the record classes that `record` returns.
        frame: frame along whose axes a wrench is given; only for wrenches.
        name: name of the tool on which it acts; only for wrenches by tool.
    """

    use: ClassVar[Use]
    frame: str
    name: str

    @classmethod
    @abstractmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """Return the declared fields by name."""

    @classmethod
    def meaning(cls, _use: Use) -> str:
        """Return the meaning for users."""
        return cls.__doc__ or ""

    @classmethod
    def record(cls, use: Use) -> type[Self]:
        """Return the record class for a use."""
        record_class: type[Self] = _declare_record(cls, use)
        return record_class


@cache
def _declare_record(cls: type[Declaration], use: Use) -> Any:
    fields = [(name, Any, field) for name, field in cls.fields(use).items()]
    prefix = "Rigid" if use.rigid else "Tool" if use.by_tool else ""
    name = f"{prefix}{use.signal.key.capitalize()}{cls.__name__}"
    namespace = {"__doc__": cls.meaning(use), "use": use, **({"keyed_by": "name"} if use.by_tool else {})}
    return make_dataclass(name, fields, bases=(cls,), namespace=namespace, frozen=True)


class Recorded(Declaration):
    """Samples from a CSV table, whose times are those of the trajectory."""

    file: str
    fit: str | None
    noise: Values | None
    bandwidth: float | None
    columns: Mapping[str, ColumnSource] | None
    ignore: str | tuple[str | int, ...] | None
    skip_rows: tuple[int, ...] | None

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """Return the declared fields by name."""
        from vsacli.documents.columns_file import columns_field, ignore_field, skip_rows_field
        from vsacli.trajectory.fits import METHODS

        doc = (
            "spline for derivatives that are not given: interpolation of the samples, least squares "
            "for noisy ones, or smoothing for noise of any color; by default the noise decides"
        )
        file = text("path of the CSV file, relative to the trajectory file")
        bandwidth = "bandwidth of the motion in Hz; by default estimated from the recording"
        fields = {
            **use.frame(),
            "file": file,
            "fit": choice(METHODS, doc, default=None),
            "noise": use.size(
                "standard deviation of the noise of a sample; by default estimated from the recording"
            ),
            "bandwidth": number(units.RATE, bandwidth, check=POSITIVE, default=None),
            "columns": columns_field(),
            "ignore": ignore_field(),
            "skip_rows": skip_rows_field(),
        }
        if use.signal is POSITION:
            fields["unwrap"] = boolean(
                "remove jumps by 2 pi from the angles of revolute joints", default=False
            )
        return fields

    def _problems(self) -> Iterator[FieldProblem]:
        from vsacli.trajectory.fits import SMOOTH

        if self.bandwidth is not None and self.fit not in (None, SMOOTH):
            message = f"only smoothing splines have one; leave it out, or fit: {self.fit}"
            yield FieldProblem(("bandwidth",), message)

    @property
    def fit_choice(self) -> FitChoice:
        """Choice of the spline."""
        from vsacli.trajectory.fits import FitChoice

        return FitChoice(self.fit, self.noise, self.bandwidth)

    @property
    def mapping(self) -> ColumnMapping:
        """Mapping of the columns of the file."""
        from vsacli.documents.column_mapping import ColumnMapping

        return ColumnMapping(self.columns or {}, self.ignore or (), skip_rows=self.skip_rows or ())

    @classmethod
    def meaning(cls, use: Use) -> str:
        """Return the meaning for users."""
        meaning = f"Samples from a CSV table with the columns {', '.join(WRENCH_AXES)}."
        return meaning if use.signal is WRENCH else super().meaning(use)


class Formula(Declaration):
    """The declaration of a signal in closed form."""

    @property
    def signal(self) -> Signal:
        """Declared signal."""
        return self.use.signal

    @property
    def lasts(self) -> float | None:
        """Duration that follows from the declaration, s; None if it may have any."""
        return None

    @abstractmethod
    def profile_over(self, span: tuple[float, float]) -> ClosedForm:
        """Return the profile over a span, s."""

    def problems_over(self, duration: float) -> Iterator[FieldProblem]:
        """Yield the problems that prevent a profile of this duration, s."""
        if self.lasts is not None and not same_time(self.lasts, duration):
            yield FieldProblem((), f"lasts {self.lasts:.10g} s, but the trajectory {duration:.10g} s")
            return
        try:
            self.profile_over((0.0, duration)).at(np.zeros(1))
        except InputError as error:
            yield FieldProblem((), str(error))

    def warnings_over(self, _span: tuple[float, float], _joints: Mapping[str, str], /) -> Iterator[str]:
        """Yield warnings about the profile over a span, as clauses.

        Args:
            _span: first and last time, s.
            _joints: joint types by joint name.
        """
        return iter(())

    def notes_over(self, _span: tuple[float, float], /) -> Iterator[str]:
        """Yield notes on values that were derived for a span, s, as clauses."""
        return iter(())


def same_time(one: float, other: float) -> bool:
    """Return whether two times are equal up to rounding."""
    return math.isclose(one, other, rel_tol=SAME_TIME)


def nan_for_none(values: Values) -> tuple[float, ...]:
    """Return values with NaN in place of None."""
    return tuple(math.nan if value is None else value for value in values)


_JOINTS = ("position", "commanded")
_ALL_USES = (*_JOINTS, "wrench")

TYPES = {
    "polynomial": ("vsacli.trajectory.curves.polynomial:Polynomial", _ALL_USES),
    "via": ("vsacli.trajectory.curves.via_points:Via", _JOINTS),
    "sinusoids": ("vsacli.trajectory.curves.sinusoids:SumOfSinusoids", _JOINTS),
    "sequence": ("vsacli.trajectory.curves.sequence:Sequence", ("position",)),
    "steps": ("vsacli.trajectory.curves.steps:Steps", ("commanded", "wrench")),
    "constant": ("vsacli.trajectory.curves.polynomial:Hold", _ALL_USES),
    "csv": ("vsacli.trajectory.curves.closed_form:Recorded", _ALL_USES),
}
"""Types of declarations, each with module and class, and its uses: position, commanded signals, wrench."""


class _Types(LazyRegistry):
    """The record classes of the types that are possible for a use."""

    def __init__(self, use: Use) -> None:
        use_name = {POSITION: "position", WRENCH: "wrench"}.get(use.signal, "commanded")
        super().__init__({name: home for name, (home, serves) in TYPES.items() if use_name in serves})
        self._use = use

    def __getitem__(self, name: str) -> Any:
        return super().__getitem__(name).record(self._use)


def declared_as(use: Use) -> OneOf:
    """Return the possible declarations of a signal."""
    return OneOf(_Types(use))


__all__ = ["TYPES", "Declaration", "Formula", "Recorded", "Use", "declared_as"]
