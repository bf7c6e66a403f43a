"""A sum of sinusoids."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from vsacli.base import units
from vsacli.base.errors import FieldProblem
from vsacli.base.signals import POSITION
from vsacli.documents.fields import NON_NEGATIVE, POSITIVE, Items, PerJoint, number, value
from vsacli.trajectory.curves.sinusoids import Sinusoids
from vsacli.trajectory.declared.declaration import Formula, Use, Values, numbers
from vsacli.trajectory.times import MAX_STEPS

MAX_HARMONICS = 100
"""More are taken for a mistake: identification uses about five."""

LEAST_SHARE = 1e-12
"""Share of the offset that a signal which must be positive may fall to; less is zero but for rounding."""


class SumOfSinusoids(Formula):
    """offset + sum over k = 1, 2, ... of sine_k sin(k w t) + cosine_k cos(k w t) with w = 2 pi frequency.

    The periodic excitation of identification experiments (Swevers et al., IEEE Transactions on Robotics and
    Automation, 1997); t counts from the start. Without `ramp` it begins and ends in motion.
    """

    frequency: float
    offset: Values
    sine: tuple[Values, ...]
    cosine: tuple[Values, ...]
    ramp: float

    @classmethod
    def fields(cls, use: Use) -> dict[str, Any]:
        """The declared fields by name."""
        amplitudes = Items(PerJoint(use.signal.quantities[0], use.signal.key))
        subject = "robot" if use.signal is POSITION else use.signal.key
        about = "the joint moves" if use.signal is POSITION else "it swings"
        sine = "amplitudes of sin(k w t), one entry for each k from 1 on"
        ramp = (
            "how long the sum rises from zero at the start, and falls to zero at the end, so that the"
            f" {subject} begins and ends at rest at the offset"
        )
        return {
            "frequency": number(units.RATE, "frequency of the lowest harmonic, k = 1", check=POSITIVE),
            "offset": use.one(f"about which {about}"),
            "sine": value(amplitudes, sine, default=()),
            "cosine": value(amplitudes, "amplitudes of cos(k w t), likewise", default=()),
            "ramp": number(units.TIME, ramp, check=NON_NEGATIVE, default=0.0),
        }

    @classmethod
    def meaning(cls, use: Use) -> str:
        """What it does, for users."""
        if use.signal is POSITION:
            return super().meaning(use)
        positive = ", and must stay positive" if use.signal.positive else ""
        return f"A sum of sinusoids as above{positive}. Without `ramp` it changes from the first instant on."

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
            offset=numbers(self.offset),
            sine=tuple(map(numbers, self.sine)),
            cosine=tuple(map(numbers, self.cosine)),
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
            problems = list(super().problems_over(duration))
            yield from problems or self._not_positive(duration)

    def _not_positive(self, duration: float) -> Iterator[FieldProblem]:
        """Where a signal that must stay positive does not."""
        if not self.signal.positive:
            return
        lowest, when = self.over((0.0, duration)).lowest()
        offset = np.array(self.offset, dtype=np.float64)
        for joint in np.flatnonzero(lowest <= LEAST_SHARE * offset).tolist():
            fall = f"the sum falls to {lowest[joint]:.4g} after {when[joint]:.3f} s"
            enough = f"take one above {offset[joint] - lowest[joint]:.6g}, or smaller amplitudes"
            yield FieldProblem(("offset",), f"{fall}, but must stay positive; {enough}", joint)
