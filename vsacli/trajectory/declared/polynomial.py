"""From one value to another by a polynomial, or the same value all the time."""

from __future__ import annotations

from typing import Any

from vsacli.base.signals import POSITION, WRENCH
from vsacli.base.wrench import WRENCH_AXES
from vsacli.documents.fields import integer
from vsacli.trajectory.curves import DEGREES, Constant, RestToRest
from vsacli.trajectory.declared.declaration import Formula, Use, Values, numbers

AXES = f", `[{', '.join(WRENCH_AXES)}]`"


class Polynomial(Formula):
    """From one value to another, at rest before and after."""

    degree: int
    start: Values
    end: Values

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """The declared fields by name."""
        degree = "degree of the polynomial"
        if use.signal is not POSITION:
            degree += f", odd, {DEGREES[0]} to {DEGREES[-1]}"
        elif not use.rigid:
            degree += "; from 3 on if all joints are rigid"
        return {
            **use.frame(),
            "degree": integer(degree, check=use.degree(DEGREES)),
            "start": use.one("at the start" + (AXES if use.signal is WRENCH else "")),
            "end": use.one("at the end"),
        }

    @classmethod
    def meaning(cls, use: Use) -> str:
        """What it does, for users."""
        if use.rigid:
            same = "The same for a robot whose joints are all rigid"
            return f"{same}: its torques do not depend on jerk and snap."
        way = "Rest to rest" if use.signal is POSITION else f"From one {use.signal.key} to another"
        return f"{way}: all derivatives up to (degree-1)/2 vanish at both ends."

    def over(self, span: tuple[float, float]) -> RestToRest:
        """The profile from the first to the last time of a span, in s."""
        start, end = numbers(self.start), numbers(self.end)
        return RestToRest(signal=self.signal, span=span, degree=self.degree, start=start, end=end)


class Hold(Formula):
    """The same value all the time."""

    value: Values

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """The declared fields by name."""
        return {**use.frame(), "value": use.one("all the time" + (AXES if use.signal is WRENCH else ""))}

    @classmethod
    def meaning(cls, use: Use) -> str:
        """What it does, for users."""
        if use.signal is POSITION:
            return "The robot stands still."
        return f"The same {use.signal.key} all the time."

    def over(self, span: tuple[float, float]) -> Constant:
        """The profile from the first to the last time of a span, in s."""
        return Constant(signal=self.signal, span=span, value=numbers(self.value))
