"""A sum of sinusoids."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from vsacli.base import units
from vsacli.base.errors import FieldProblem
from vsacli.documents.fields import NON_NEGATIVE, POSITIVE, Items, PerJoint, number, value
from vsacli.trajectory.curves.sinusoids import Sinusoids
from vsacli.trajectory.declared.declaration import Formula, Use
from vsacli.trajectory.times import MAX_STEPS

MAX_HARMONICS = 100
"""More are taken for a mistake: identification uses about five."""


class SumOfSinusoids(Formula):
    """offset + sum over k = 1, 2, ... of sine_k sin(k w t) + cosine_k cos(k w t) with w = 2 pi frequency.

    The periodic excitation of identification experiments (Swevers et al., IEEE Transactions on Robotics and
    Automation, 1997); t counts from the start. Without `ramp` it begins and ends in motion.
    """

    frequency: float
    offset: tuple[float, ...]
    sine: tuple[tuple[float, ...], ...]
    cosine: tuple[tuple[float, ...], ...]
    ramp: float

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """The declared fields by name."""
        amplitudes = Items(PerJoint(use.signal.quantities[0]))
        sine = "amplitudes of sin(k w t), one entry for each k from 1 on"
        ramp = (
            "how long the sum rises from zero at the start, and falls to zero at the end, so that the robot"
            " begins and ends at rest at the offset"
        )
        return {
            "frequency": number(units.RATE, "frequency of the lowest harmonic, k = 1", check=POSITIVE),
            "offset": use.one("about which the joint moves"),
            "sine": value(amplitudes, sine, default=()),
            "cosine": value(amplitudes, "amplitudes of cos(k w t), likewise", default=()),
            "ramp": number(units.TIME, ramp, check=NON_NEGATIVE, default=0.0),
        }

    def _problems(self) -> Iterator[FieldProblem]:
        if not (self.sine or self.cosine):
            yield FieldProblem((), "missing key 'sine' or 'cosine' (amplitudes)")
        for name in ("sine", "cosine"):
            count = len(getattr(self, name))
            if count > MAX_HARMONICS:
                yield FieldProblem((name,), f"at most {MAX_HARMONICS} harmonics are possible, not {count}")

    def over(self, span: tuple[float, float]) -> Sinusoids:
        """The profile from the first to the last time of a span, in s."""
        duration = span[1] - span[0]
        return Sinusoids(
            signal=self.signal,
            span=span,
            cycles=self.frequency * duration,
            offset=self.offset,
            sine=self.sine,
            cosine=self.cosine,
            ramp=self.ramp / duration,
        )

    def problems_over(self, duration: float) -> Iterator[FieldProblem]:
        """What keeps it from lasting so long, in s."""
        if 2 * self.ramp > duration:
            message = f"must take at most half of the {duration:g} s, not {self.ramp:g} s"
            yield FieldProblem(("ramp",), message)
        elif not self.frequency * duration <= MAX_STEPS:
            cycles = f"{self.frequency * duration:.4g} periods in {duration:g} s"
            yield FieldProblem(("frequency",), f"gives {cycles}; at most {MAX_STEPS:.0e} are possible")
        else:
            yield from super().problems_over(duration)
