"""Signals as they were measured and as they were computed, for figures and pages."""

from __future__ import annotations

from typing import NamedTuple

from vsacli.base.arrays import FloatArray


class MeasuredCurve(NamedTuple):
    """A signal as it was measured and computed.

    Attributes:
        name: of the signal.
        unit: of its values.
        rms: root mean square of measured minus computed.
        time: (samples,), s.
        computed, measured: (samples,).
    """

    name: str
    unit: str
    rms: float
    time: FloatArray
    computed: FloatArray
    measured: FloatArray
