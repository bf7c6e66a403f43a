"""How far motor torques and margins may be off while the numbers of a robot are uncertain: to first order."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.json_records import Published, named
from vsacli.studies.sensitivities.drive_derivatives import MARGIN
from vsacli.studies.sensitivities.slopes import Derivatives


@dataclass(frozen=True)
class JointBand(Published):
    """What tolerances do to a joint.

    Attributes:
        torque: largest standard deviation of a motor torque, N m (N).
        share: that over the largest motor torque.
        time: when, s.
        margin: the margin that is the smallest number of its own standard deviations, NaN if there is none.
        margin_deviation: that deviation.
        margin_time: when, s.
        lost: probability that the margin is lost there; that it is lost at all is at least as large.
    """

    torque: float
    share: float
    time: float
    margin: float
    margin_deviation: float
    margin_time: float
    lost: float

    shape: ClassVar = named("torque", "share", "time", "margin", "margin_deviation", "margin_time", "lost")


class TorqueCurves(NamedTuple):
    """Motor torques over a run.

    Attributes:
        time: (samples,), s.
        tau_motor, deviation: (samples, joints, 2), N m (N).
    """

    time: FloatArray
    tau_motor: FloatArray
    deviation: FloatArray


class Band:
    """Variances over a run; independent parameters, first order. `add` its blocks in order."""

    def __init__(self, deviations: FloatArray) -> None:
        self._variances = deviations**2
        self._parts: list[tuple[FloatArray, ...]] = []

    def add(self, part: Derivatives) -> None:
        """Merge the next block."""
        block = part.block
        gap = part.margin
        of_torque, of_margin = np.zeros_like(block.tau_motor), np.zeros_like(gap)
        for group in part.groups:
            variances = self._variances[group.places]
            known = np.flatnonzero(variances)
            for joint, slopes in enumerate(group.of_joints if known.size else ()):
                if slopes is not None:
                    torque, of_gap = (slopes[name][known] ** 2 for name in ("tau_motor", MARGIN))
                    of_torque[:, joint] += np.einsum("pms,p->sm", torque, variances[known])
                    of_margin[:, joint] += np.einsum("ps,p->s", of_gap, variances[known])
        self._parts.append((part.time, block.tau_motor, gap, np.sqrt(of_torque), np.sqrt(of_margin)))

    def curves(self) -> TorqueCurves:
        """Torques and their deviations so far."""
        time, torque, _, deviation, _ = (np.concatenate(parts) for parts in zip(*self._parts, strict=True))
        return TorqueCurves(time, torque, deviation)

    def joints(self) -> list[JointBand]:
        """What was found, of each joint."""
        time, torque, gap, of_torque, of_margin = (
            np.concatenate(parts) for parts in zip(*self._parts, strict=True)
        )
        return [
            _of_joint(time, torque[:, joint], gap[:, joint], of_torque[:, joint], of_margin[:, joint])
            for joint in range(gap.shape[1])
        ]


def _of_joint(
    time: FloatArray, torque: FloatArray, gap: FloatArray, of_torque: FloatArray, of_margin: FloatArray
) -> JointBand:
    spread = np.nan_to_num(np.fmax(*of_torque.T))
    worst = int(spread.argmax())
    peak = float(np.nanmax(np.abs(torque), initial=0.0))
    known = np.isfinite(gap) & (of_margin > 0)
    if not known.any():
        nothing = (math.nan,) * 3 + (0.0,)
        return JointBand(
            float(spread[worst]), _share(float(spread[worst]), peak), float(time[worst]), *nothing
        )
    distance = np.where(known, gap / np.where(known, of_margin, 1.0), np.inf)
    near = int(distance.argmin())
    return JointBand(
        float(spread[worst]),
        _share(float(spread[worst]), peak),
        float(time[worst]),
        float(gap[near]),
        float(of_margin[near]),
        float(time[near]),
        math.erfc(float(distance[near]) / math.sqrt(2)) / 2,
    )


def _share(spread: float, peak: float) -> float:
    return spread / peak if peak > 0 else math.nan
