"""Commanded motion of a block of steps: what every trajectory yields and the pipeline consumes."""

from __future__ import annotations

from dataclasses import dataclass

from vsacli.arrays import FloatArray


@dataclass(frozen=True)
class Motion:
    """Motion and stiffness over a block of times.

    Attributes:
        time: (samples,) in s.
        q, dq, ddq, d3q, d4q: position and its four derivatives, (samples, joints), rad (m) per s^k.
        stiffness, dstiffness, ddstiffness: joint stiffness and two derivatives, (samples, joints),
            N m/rad (N/m) per s^k.
    """

    time: FloatArray
    q: FloatArray
    dq: FloatArray
    ddq: FloatArray
    d3q: FloatArray
    d4q: FloatArray
    stiffness: FloatArray
    dstiffness: FloatArray
    ddstiffness: FloatArray
