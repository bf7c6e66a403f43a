"""What varies over a study, with the values it takes: numbers, or whatever else a file could hold."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any, NamedTuple

import numpy as np

from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.base.units import ANY_SI_UNIT
from vsacli.documents import tree
from vsacli.documents.expression import ExpressionError
from vsacli.documents.number import evaluate
from vsacli.documents.record_numbers import Entry, NumberPath
from vsacli.documents.record_numbers import Number as NumberAt
from vsacli.studies.sensitivities.tolerances import Tolerance, distribution
from vsacli.studies.sweeps.ways import Drawn, Linked, Listed, Ranged, Spaced, Varied

MOST_VALUES = 1_000_000
"""Of one path: more than any study has runs."""


class Held(NamedTuple):
    """A number of one of the files: the path as users write it, also with indices, its unit and its value."""

    path: str
    indexed: str
    unit: str
    value: float


def held(numbers: Sequence[NumberAt], joint_types: Mapping[str, str]) -> list[Held]:
    """Numbers of a file as they are looked up by paths.

    Args:
        numbers: as `documents.plausibility.numbers` has them.
        joint_types: type of each joint by name, on which units depend.
    """
    return [
        Held(
            _dotted(each.path),
            _dotted(each.path, indexed=True),
            each.quantity.unit(_type(each, joint_types)),
            each.value,
        )
        for each in numbers
    ]


def _dotted(path: NumberPath, *, indexed: bool = False) -> str:
    return ".".join(str(step.number) if indexed and isinstance(step, Entry) else str(step) for step in path)


def _type(number: NumberAt, joint_types: Mapping[str, str]) -> str:
    names = (step.name for step in number.path if isinstance(step, Entry))
    return next((joint_types[name] for name in names if name in joint_types), "revolute")


class Dimension(NamedTuple):
    """What one path leads to, over a study.

    Attributes:
        path: to a number, or to several that take the same value, or to anything else.
        unit: SI unit of the number; empty if it is none, or not known.
        values: those that it takes, each what the file could hold; empty if it is drawn.
        centre: about which it is drawn.
        tolerance: by which it is drawn; None if its values are listed.
        linked: path of the dimension that it is a multiple of, if it is of one.
        factor: this multiple.
        numeric: whether all its values are numbers.
    """

    path: str
    unit: str
    values: tuple[Any, ...] = ()
    centre: float = 0.0
    tolerance: Tolerance | None = None
    linked: str = ""
    factor: float = 1.0
    numeric: bool = True

    def drawn(self, share: float) -> Any:
        """The value that so large a share of all is below; of listed ones each has an equal share."""
        if self.tolerance is not None:
            return self.centre + self.tolerance.below(share)
        return self.values[int(share * len(self.values))]

    def number(self, value: Any) -> float | None:
        """A value as a number in SI units; None if it is none."""
        try:
            return (
                float(evaluate(str(value), self.unit or str(ANY_SI_UNIT)))
                if isinstance(value, str | int | float)
                else None
            )
        except ExpressionError:
            return None


def dimensions_of(
    varied: Varied, numbers: Sequence[Held], before: Sequence[Dimension]
) -> Iterator[Dimension]:
    """What a path of the study file varies: a dimension, or of a distribution one for each number that fits.

    Args:
        varied: the entry of the file.
        numbers: of robot and trajectories.
        before: dimensions of the entries before it.

    Raises:
        InputError: the way of varying does not fit what is there.
    """
    fitting = [each for each in numbers if _fits(each, varied.path)]
    unit = fitting[0].unit if fitting else ""
    match varied.way:
        case Listed(values=values):
            listed = Dimension(varied.path, unit, values)
            yield listed._replace(numeric=None not in map(listed.number, values))
        case Spaced() as spaced:
            yield Dimension(varied.path, unit, _spaced(spaced, unit))
        case Ranged(least=least, largest=largest):
            low, high = (_number(text, unit) for text in (least, largest))
            if not low < high:
                raise InputError.one(f"expected uniform: [least, largest], found {least} and {largest}")
            size = (high - low) / 2
            yield Dimension(varied.path, unit, (), low + size, Tolerance("uniform", size))
        case Drawn(node=node):
            yield from _distributed(varied.path, node, fitting, numbers)
        case Linked(path=path, factor=factor):
            origin = next((each for each in before if each.path == path and not each.linked), None)
            if origin is None:
                hint = did_you_mean(path, [each.path for each in before if not each.linked])
                raise InputError.one(f"linked: no path above it that varies by itself is {path!r}{hint}")
            yield Dimension(
                varied.path, unit, linked=path, factor=_number(factor, "1"), numeric=origin.numeric
            )


def _fits(number: Held, path: str) -> bool:
    """Whether a number is what a path leads to, or stands in it."""
    return any(fnmatchcase(each, pattern) for each in number[:2] for pattern in (path, f"{path}.*"))


def _distributed(
    path: str, node: tree.Node, fitting: Sequence[Held], numbers: Sequence[Held]
) -> Iterator[Dimension]:
    if not fitting:
        raise InputError.one(
            f"no number of robot or trajectory fits{did_you_mean(path, [each.path for each in numbers])}"
        )
    for each in dict.fromkeys(fitting):
        if any(other.path == each.path and other.value != each.value for other in fitting):
            raise InputError.one(f"{each.path} differs between trajectories; list its values, or a range")
        tolerance = distribution(node, each.value, each.unit)
        if tolerance.size == 0:
            raise InputError.one(
                f"{each.path} is zero, of which a share is nothing; give {each.unit} instead"
            )
        yield Dimension(each.path, each.unit, (), each.value, tolerance)


def _spaced(spaced: Spaced, unit: str) -> tuple[float, ...]:
    first, last, count = _number(spaced.first, unit), _number(spaced.last, unit), _number(spaced.steps, "1")
    if not (count.is_integer() and 1 <= count <= MOST_VALUES):
        raise InputError.one(
            f"{spaced.shape}: expected a count from 1 to {MOST_VALUES:,}, found {spaced.steps}"
        )
    if spaced.shape == "linspace":
        return tuple(np.linspace(first, last, int(count)).tolist())
    if not first * last > 0:
        raise InputError.one(
            f"logspace: expected two numbers of one sign, found {spaced.first} and {spaced.last}"
        )
    return tuple(np.geomspace(first, last, int(count)).tolist())


def _number(text: str, unit: str) -> float:
    try:
        number = float(evaluate(text, unit or str(ANY_SI_UNIT)))
    except ExpressionError as error:
        raise InputError.one(
            f"expected a number{f' in {unit}' if unit else ''}, found {text!r}: {error}"
        ) from None
    return number
