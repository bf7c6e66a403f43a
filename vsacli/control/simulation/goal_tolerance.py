"""How far from the command a simulated robot may end."""

from __future__ import annotations

import math
from dataclasses import dataclass

from vsacli.base.errors import InputError

_GRAMMAR = "expected a number in rad (m) such as 0.01, or a share of each joint's range such as 2%, not {!r}"


@dataclass(frozen=True)
class GoalTolerance:
    """Largest error of a joint's position at the end of a run that counts as having arrived.

    Attributes:
        share: of the range over which the joint is commanded, from 0 to 1.
        absolute: what is allowed beside it, so that a joint that is to hold still may err, too, rad (m).

    Raises:
        InputError: one is negative or not finite, both are zero, or the share exceeds 1.
    """

    share: float = 0.01
    absolute: float = 1e-3

    def __post_init__(self) -> None:
        if not (0 <= self.share <= 1 and 0 <= self.absolute < math.inf and self.share + self.absolute > 0):
            raise InputError.one(
                "the tolerance must be positive and finite, as a share at most 100 %: "
                f"not {100 * self.share:g} % + {self.absolute:g} rad (m)"
            )

    @classmethod
    def from_text(cls, written: str) -> GoalTolerance:
        """As typed: `2%` of each joint's range beside the usual absolute part, or `0.01`, in rad (m), alone.

        Raises:
            InputError: it is neither, or out of range.
        """
        text = written.strip()
        try:
            number = float(text.removesuffix("%"))
        except ValueError:
            raise InputError.one(f"--tolerance: {_GRAMMAR.format(written)}") from None
        return cls(share=number / 100) if text.endswith("%") else cls(0.0, number)

    def of(self, commanded_range: float) -> float:
        """Of a joint commanded over a range, rad (m)."""
        return self.share * commanded_range + self.absolute
