"""What small changes of numbers do to a run: to its torques, its margins, the energy it takes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsacli.actuators.reach import margin
from vsacli.base.arrays import FloatArray
from vsacli.base.flags import LIMITS, Flag, has
from vsacli.studies.sensitivities.drive_derivatives import MARGIN
from vsacli.studies.sensitivities.sensitivity_run import Derivatives


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

    def __init__(self, steps: FloatArray, joints: int) -> None:
        """Begin.

        Args:
            steps: by how much each parameter changes.
            joints: how many there are.
        """
        shape = (len(steps), joints)
        self._steps = steps
        self.peak = np.zeros(joints)
        self.largest, self.time, self.spent = np.zeros((3, *shape))
        self.motor = np.ones(shape, dtype=int)
        self.smallest = Smallest(np.full(joints, np.inf), np.zeros(joints), np.zeros(shape))
        self.failed = 0
        self._flags = np.zeros(1, dtype=np.uint16)
        self._last: tuple[float, FloatArray] | None = None

    def add(self, part: Derivatives) -> None:
        """Merge the next block."""
        time, flags = np.asarray(part.block.time), np.asarray(part.block.flags)
        self._flags |= np.bitwise_or.reduce(flags, axis=None)
        self.failed += int(np.count_nonzero(has(flags, Flag.INFEASIBLE | Flag.SINGULAR)))
        self._add_torque(time, np.asarray(part.block.tau_motor), part.by_name["tau_motor"])
        self._add_margin(time, part)
        self._add_energy(time, np.asarray(part.block.motor_power), part.by_name["motor_power"])

    @property
    def verdict(self) -> str:
        """On the run with the numbers as they are."""
        judged = {"infeasible": Flag.INFEASIBLE, "singular": Flag.SINGULAR, "over_limit": LIMITS}
        return next((verdict for verdict, bits in judged.items() if has(self._flags, bits).any()), "ok")

    def _add_torque(self, time: FloatArray, torque: FloatArray, slopes: FloatArray) -> None:
        self.peak = np.fmax(self.peak, np.fmax.reduce(np.abs(torque), axis=(0, 2)))
        changes = np.abs(slopes) * self._steps[:, None, None, None]
        changes = np.nan_to_num(np.moveaxis(changes, 1, -1), nan=0.0)  # (parameters, joints, 2, samples)
        flat = changes.reshape(*changes.shape[:2], -1)
        worst = flat.argmax(axis=-1)
        found = np.take_along_axis(flat, worst[..., None], axis=-1)[..., 0]
        larger = found > self.largest
        self.largest = np.where(larger, found, self.largest)
        self.time = np.where(larger, time[worst % len(time)], self.time)
        self.motor = np.where(larger, 1 + worst // len(time), self.motor)

    def _add_margin(self, time: FloatArray, part: Derivatives) -> None:
        block = part.block
        gap = margin(block.stiffness, block.stiffness_lower, block.stiffness_upper)
        gap = np.where(np.isfinite(gap) & np.isfinite(part.by_name[MARGIN]).all(axis=0), gap, np.inf)
        worst = gap.argmin(axis=0)
        joints = np.arange(gap.shape[1])
        smaller = gap[worst, joints] < self.smallest.value
        self.smallest = Smallest(
            np.where(smaller, gap[worst, joints], self.smallest.value),
            np.where(smaller, time[worst], self.smallest.time),
            np.where(smaller, part.by_name[MARGIN][:, worst, joints], self.smallest.slopes),
        )

    def _add_energy(self, time: FloatArray, power: FloatArray, slopes: FloatArray) -> None:
        """By the trapezoidal rule; what motors take back does not count as spent."""
        spending = np.where(np.isfinite(slopes) & (power > 0), slopes, 0.0).sum(axis=-1)
        if self._last is not None:
            before, rate = self._last
            time = np.concatenate(([before], time))
            spending = np.concatenate((rate[:, None], spending), axis=1)
        if len(time) > 1:
            means = (spending[:, 1:] + spending[:, :-1]) / 2
            self.spent += np.einsum("pkj,k,p->pj", means, np.diff(time), self._steps)
        self._last = float(time[-1]), spending[:, -1]
