"""What small changes of numbers do to a run: to its torques, its margins, the energy it takes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.flags import LIMITS, Flag, has
from vsacli.studies.sensitivities.drive_derivatives import MARGIN
from vsacli.studies.sensitivities.slopes import Derivatives


class Smallest(NamedTuple):
    """The smallest margin of each joint, and its derivatives there.

    Attributes:
        value: (joints,); infinite as long as there is none.
        time: when, (joints,), s.
        slopes: (parameters, joints).
    """

    value: FloatArray
    time: FloatArray
    slopes: FloatArray


class Effects:
    """Sums up derivatives over a run; `add` its blocks in order.

    Steps at which a value or its derivative does not exist, infeasible and singular ones, do not count.

    Attributes:
        peak: largest |tau_motor| of each joint, (joints,).
        largest: largest |change of tau_motor| of each joint by each parameter's step, (parameters, joints).
        time, motor: when, s, and of which motor, 1 or 2; likewise.
        smallest: the smallest margins.
        spent: change of the energy that the motors spend by each parameter's step, (parameters, joints), J.
        failed: how many steps of joints are infeasible or singular.
    """

    def __init__(self, steps: FloatArray, times: FloatArray, joints: int) -> None:
        """Begin.

        Args:
            steps: by how much each parameter changes.
            times: of all steps of the run, s.
            joints: how many there are.
        """
        shape = (len(steps), joints)
        self._steps = steps
        self._weights = _trapezoidal(times)
        self._done = 0
        self.peak = np.zeros(joints)
        self.largest, self.time, self.spent = np.zeros((3, *shape))
        self.motor = np.ones(shape, dtype=int)
        self.smallest = Smallest(np.full(joints, np.inf), np.zeros(joints), np.zeros(shape))
        self.failed = 0
        self._flags = np.zeros(1, dtype=np.uint16)

    def add(self, part: Derivatives) -> None:
        """Merge the next block."""
        block = part.block
        self._flags |= np.bitwise_or.reduce(block.flags, axis=None)
        self.failed += int(np.count_nonzero(has(block.flags, Flag.INFEASIBLE | Flag.SINGULAR)))
        self.peak = np.fmax(self.peak, np.fmax.reduce(np.abs(block.tau_motor), axis=(0, 2)))
        weights = self._weights[self._done : self._done + len(part.time), None, None]
        spending = weights * (block.motor_power > 0)  # what motors take back does not count as spent
        gap = np.where(np.isfinite(part.margin), part.margin, np.inf)
        worst, joints = gap.argmin(axis=0), np.arange(gap.shape[1])
        smaller = gap[worst, joints] < self.smallest.value
        self.smallest.slopes[:, smaller] = 0.0
        for group in part.groups:
            for joint, slopes in enumerate(group.of_joints):
                if slopes is None or not group.places:
                    continue
                self._add_torque(part.time, slopes["tau_motor"], group.places, joint)
                energy = slopes.total("motor_power", spending[:, joint].T)
                self.spent[group.places, joint] += energy * self._steps[group.places]
                if smaller[joint]:
                    self.smallest.slopes[group.places, joint] = slopes[MARGIN][:, worst[joint]]
        self.smallest = self.smallest._replace(
            value=np.where(smaller, gap[worst, joints], self.smallest.value),
            time=np.where(smaller, part.time[worst], self.smallest.time),
        )
        self._done += len(part.time)

    @property
    def verdict(self) -> str:
        """On the run with the numbers as they are."""
        judged = {"infeasible": Flag.INFEASIBLE, "singular": Flag.SINGULAR, "over_limit": LIMITS}
        return next((verdict for verdict, bits in judged.items() if has(self._flags, bits).any()), "ok")

    def _add_torque(self, time: FloatArray, slopes: FloatArray, places: Sequence[int], joint: int) -> None:
        changes = np.abs(slopes).reshape(len(places), -1)
        np.copyto(changes, 0.0, where=np.isnan(changes))
        worst = changes.argmax(axis=1)
        found = changes[np.arange(len(places)), worst] * self._steps[places]
        larger = found > self.largest[places, joint]
        at = np.asarray(places)[larger]
        self.largest[at, joint] = found[larger]
        self.time[at, joint] = time[worst[larger] % len(time)]
        self.motor[at, joint] = 1 + worst[larger] // len(time)


def _trapezoidal(times: FloatArray) -> FloatArray:
    """Weights of the trapezoidal rule over times, (samples,), s."""
    halves = np.diff(times) / 2
    weights: FloatArray = np.append(halves, 0.0) + np.append(0.0, halves)
    return weights
