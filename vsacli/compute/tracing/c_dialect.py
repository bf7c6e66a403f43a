"""How values and operations are written in C; one class for single samples, one for vectors of them."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from vsacli.compute.tracing.symbol import Kind


class Dialect(ABC):
    """A way of writing.

    Attributes:
        types: C type of each kind of value.
        table_type: that of the constants in a table.
    """

    def __init__(self, types: Mapping[Kind, str], table_type: str) -> None:
        self.types = types
        self.table_type = table_type

    @abstractmethod
    def real(self, number: float) -> str:
        """A constant."""

    @abstractmethod
    def integer(self, number: int) -> str:
        """A constant field of bits or index."""

    @abstractmethod
    def truth(self, value: bool) -> str:
        """A constant truth value."""

    @abstractmethod
    def logical(self, operator: str, operands: Sequence[str]) -> str:
        """`and`, `or`, `not` of truth values."""

    @abstractmethod
    def where(self, kind: Kind, truth: str, a: str, b: str) -> str:
        """One of two values of a kind."""

    @abstractmethod
    def masked(self, truth: str, mask: str) -> str:
        """The mask where true, else 0."""

    @abstractmethod
    def function(self, kind: Kind, name: str, operands: Sequence[str]) -> str:
        """A call that gives a value of a kind.

        The name is one of math.h; or `maximum`, `minimum`, which NaN passes through; or `take`, `search` in a
        table.
        """

    @abstractmethod
    def any(self, truth: str) -> str:
        """Whether a truth value holds for any sample, as a condition of C."""

    @abstractmethod
    def replaced(self, kind: Kind, truth: str, new: str, old: str) -> str:
        """The new value, for samples for which a truth value holds, in a place where it does for one."""

    def constant(self, value: float | int | bool, kind: Kind) -> str:
        """A constant of a kind."""
        if kind is Kind.TRUTH:
            return self.truth(bool(value))
        return self.real(float(value)) if kind is Kind.REAL else self.integer(int(value))


def digits(number: float) -> str:
    """A constant with all its digits; those that are not finite by their names of math.h."""
    if math.isnan(number):
        return "NAN"
    if math.isinf(number):
        return "INFINITY" if number > 0 else "(-INFINITY)"
    return f"({number!r})" if number < 0 else repr(number)
