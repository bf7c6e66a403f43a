"""Types of options that several commands share: shares, and choices whose words have changed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import click
from click.types import FloatParamType


class ShareType(FloatParamType):
    """A share: `2 %`, `2%` and `0.02` are the same number."""

    name = "share"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """See `click.ParamType.convert`."""
        if isinstance(value, float):
            return value
        number = value.strip()
        try:
            return float(number[:-1]) / 100 if number.endswith("%") else float(number)
        except ValueError:
            self.fail(f"expected a share such as 3% or 0.03, not {value!r}", param, ctx)


class Words(click.Choice[str]):
    """A choice of words that refuses a renamed one with its present name."""

    def __init__(self, words: Iterable[str]) -> None:
        super().__init__(tuple(words))

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """See `click.Choice.convert`."""
        if value in self.choices:
            return super().convert(value, param, ctx)
        from vsacli.base.renamed import successor  # loaded for error messages only

        if new := successor(value, self.choices):
            self.fail(f"{value!r} is now {new!r}.", param, ctx)
        return super().convert(value, param, ctx)


SHARE = ShareType()
