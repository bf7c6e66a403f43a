"""Types of options: numbers, whole numbers, lists of numbers, shares, and choices of words.

The types of click speak of floats and ranges of integers. These say what was found, and what the option
expects, with its unit and an example.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import click
from click.types import FloatParamType, StringParamType


class Number(FloatParamType):
    """A finite number.

    Args:
        expected: what the option expects, with its unit and an example; shown after every refusal.
        least: minimum.
        most: maximum.
        positive: whether zero is refused, too.
    """

    name = "number"

    def __init__(
        self, expected: str, *, least: float = -math.inf, most: float = math.inf, positive: bool = False
    ) -> None:
        self.expected, self.positive = expected, positive
        self.least, self.most = 0.0 if positive else least, most

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """See `click.ParamType.convert`."""
        if not isinstance(value, str):
            return value
        try:
            number = self.read(value)
        except ValueError:
            self.fail(f"{value!r} is not a {self.name}; expected {self.expected}", param, ctx)
        if reason := self._range_requirement(number):
            self.fail(f"must be {reason}, not {value}; expected {self.expected}", param, ctx)
        return number

    def read(self, text: str) -> float:
        """Return the number that a text stands for.

        Raises:
            ValueError: the text is none.
        """
        return float(text)

    def _range_requirement(self, number: float) -> str:
        if isinstance(number, float) and not math.isfinite(number):
            return "finite"
        if self.positive and number <= 0:
            return "positive"
        if number < self.least:
            return f"at least {self.least:g}"
        return f"at most {self.most:g}" if number > self.most else ""


class Whole(Number):
    """A whole number."""

    name = "whole number"

    def read(self, text: str) -> int:
        """See `Number.read`."""
        return int(text)


class Share(Number):
    """A share from 0 % to 100 %: `2 %`, `2%` and `0.02` are the same number."""

    name = "share"

    def __init__(self) -> None:
        super().__init__("a share from 0 % to 100 %, e.g. 2% or 0.02")

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """See `click.ParamType.convert`."""
        if not isinstance(value, str):
            return value
        try:
            share = self.read(value.strip())
        except ValueError:
            share = math.nan
        if not 0 <= share <= 1:
            self.fail(f"{value!r}: expected {self.expected}", param, ctx)
        return share

    def read(self, text: str) -> float:
        """See `Number.read`."""
        return float(text[:-1]) / 100 if text.endswith("%") else float(text)


class Numbers(StringParamType):
    """Finite numbers separated by commas.

    Args:
        expected: as of `Number`.
        counts: how many numbers there may be; any number of them if empty.
        positive: whether all must be above zero.
    """

    name = "numbers"

    def __init__(self, expected: str, counts: Iterable[int] = (), *, positive: bool = False) -> None:
        self.expected, self.counts = expected, tuple(counts)
        self._number_type = Number(expected, positive=positive)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """See `click.ParamType.convert`."""
        if not isinstance(value, str):
            return value
        numbers = tuple(self._number_type.convert(word.strip(), param, ctx) for word in value.split(","))
        if self.counts and len(numbers) not in self.counts:
            self.fail(f"expected {self.expected}, found {len(numbers)}", param, ctx)
        return numbers


class Words(click.Choice[str]):
    """A choice of words, which names the present name of a renamed word, or the one that was meant.

    Args:
        words: words to choose from.
        synonyms: words of other commands or programs, each with the one that has this meaning here.
    """

    def __init__(self, words: Iterable[str], synonyms: Mapping[str, str] | None = None) -> None:
        super().__init__(tuple(words))
        self.synonyms = synonyms or {}

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """See `click.Choice.convert`."""
        if value not in self.choices:
            self.fail(self._refusal_text(value), param, ctx)
        return super().convert(value, param, ctx)

    def _refusal_text(self, value: str) -> str:
        """Return why a word is refused."""
        from vsacli.base.did_you_mean import nearest  # loaded for error messages only
        from vsacli.base.renamed import successor

        if new := successor(value, self.choices):
            return f"{value!r} is now {new!r}"
        suggestion = self.synonyms.get(value) or nearest(value, self.choices)
        hint = f"; did you mean {suggestion!r}?" if suggestion else ""
        return f"{value!r} is not one of {', '.join(map(repr, self.choices))}{hint}"


RATE = Number("samples per second, e.g. 1000", positive=True)
TIME = Number("a time in seconds, e.g. 2.5")
SEED = Whole("a seed, e.g. 0", least=0)
SHARE = Share()
SENSOR_NOISE = Numbers(
    "one value for positions (rad) or two, for positions and motor torques (rad,N m), e.g. 2e-5,0.5", [1, 2]
)
