"""The smallest accepted number of a grid, where acceptance need not be monotone."""

from __future__ import annotations

from typing import Protocol


class Candidates(Protocol):
    """Whole numbers that stand for changes of growing size, judged on a few watched steps or on all."""

    def stride(self, number: int) -> int:
        """How far a scan goes from a refused number, at least 1."""

    def accepts(self, number: int) -> bool:
        """Whether the change is accepted at the watched steps."""

    def confirms(self, number: int) -> bool:
        """Whether it is accepted at all steps; some of those that refuse it are watched from now on."""


def smallest_confirmed(candidates: Candidates, start: int, stop: int) -> int | None:
    """The smallest number from `start` to `stop` that scan, bisection and confirmation find; None if none."""
    number: int | None = start if start <= stop else None
    while number is not None:
        number = _smallest_accepted(candidates, number, stop)
        if number is not None and candidates.confirms(number):
            break
    return number


def _smallest_accepted(candidates: Candidates, start: int, stop: int) -> int | None:
    """Go up in strides to the first accepted number, then bisect down to the last refused one.

    Numbers between strides that are accepted while their neighbours are not may be missed.
    """
    refused, number = start - 1, start
    while not candidates.accepts(number):
        if number == stop:
            return None
        refused, number = number, min(number + candidates.stride(number), stop)
    while number - refused > 1:
        middle = (number + refused) // 2
        if candidates.accepts(middle):
            number = middle
        else:
            refused = middle
    return number
