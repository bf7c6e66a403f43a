"""Refusal of single precision for robots whose generated code would fail its own test in it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.errors import InputError
from vsacli.base.flags import Flag
from vsacli.control.codegen.interface import Array, Function
from vsacli.control.codegen.self_test import TOLERANCE, Comparison, Reference
from vsacli.robot.model import Robot

SHARE = 0.5
"""Part of the self-test's tolerance beyond which single precision is refused: the library of a controller may
round functions otherwise than this machine, and bundled robots take a 400th of the tolerance."""


class _Difference(NamedTuple):
    """A result that single precision changes.

    Attributes:
        size: difference relative to the largest value of the array; infinite if flags differ or a value is
            missing in one precision.
        function: name of the function.
        array: the array.
        place: indices of the result in it; the joint comes first.
        single: value in single precision.
        double: value in double precision.
    """

    size: float
    function: str
    array: Array
    place: tuple[int, ...]
    single: float
    double: float


def check_single_precision(robot: Robot, functions: Sequence[Function], reference: Reference) -> None:
    """Refuse a robot whose functions in single precision miss the values of the self-test.

    Raises:
        InputError: naming the joint and the result that are furthest off.
    """
    worst = max(_differences(functions, reference), key=lambda each: each.size, default=None)
    allowed = SHARE * TOLERANCE["float"]
    if worst is None or worst.size <= allowed:
        return
    raise InputError.one(
        f"{robot.name} cannot be computed in single precision: at joint {robot.joint_names[worst.place[0]]}, "
        f"{_described(worst)}; generate the code with --precision double"
    )


def _differences(functions: Sequence[Function], reference: Reference) -> Iterator[_Difference]:
    """The largest difference in each array."""
    for function in functions:
        single, double = reference.single_results(function), reference.results(function)
        for array in function.result.arrays:
            values = single[array.name], double[array.name]
            sizes = _sizes(*values, reference.comparison(function, array.name))
            at = np.unravel_index(sizes.argmax(), sizes.shape)
            _, *index = map(int, at)
            yield _Difference(
                float(sizes[at]), function.name, array, tuple(index), *(float(each[at]) for each in values)
            )


def _sizes(single: FloatArray, double: FloatArray, comparison: Comparison) -> FloatArray:
    """Differences as the self-test sees them, relative to the scale."""
    found, expected = (np.minimum(each, comparison.bound) for each in (single, double))
    same = (found == expected) | (np.isnan(found) & np.isnan(expected))
    with np.errstate(all="ignore"):
        sizes = np.abs(found - expected) / comparison.scale
    return np.where(same, 0.0, np.where(np.isnan(sizes), np.inf, sizes))


def _described(difference: _Difference) -> str:
    name = f"{difference.array.name} of {difference.function}"
    if difference.array.bits:
        return f"{name} are {_flags(difference.single)}, in double precision {_flags(difference.double)}"
    values = f"{name} is {difference.single:.4g}, in double precision {difference.double:.4g}"
    if np.isinf(difference.size):
        return values
    size, allowed = (f"{100 * each:.2g} %" for each in (difference.size, SHARE * TOLERANCE["float"]))
    return f"{values}, off by {size} of its largest value, where {allowed} may be lost"


def _flags(bits: float) -> str:
    return " and ".join(flag.label for flag in Flag if flag & int(bits)) or "none"
