"""Uncertainty of motor torques and margins from tolerances of the parameters of a robot.

Uncertainty is propagated to first order, except through sharp dry friction. Friction of width 0 jumps where
the speed changes its sign and has no derivative there; with uncertain speeds, motors reverse earlier or
later, or not at all. For normally distributed speed v and torque tau no derivative is needed: friction is F
with probability P(v > 0), and -B with P(v < 0). By Stein's lemma (C. M. Stein, Annals of Statistics 9
(1981)), its covariance with tau is cov(tau, v) times the mean of its derivative, F + B times the density of v
at 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.friction import REST, FrictionLaws
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.json_records import Published
from vsacli.studies.sensitivities.joint_derivatives import MARGIN, SPEED
from vsacli.studies.sensitivities.slopes import Derivatives

NEAR = 5.0
"""Speed in standard deviations below which the direction is uncertain. In a normal distribution, one motor in
three million runs the other way, but near the ends of the attainable stiffness speeds grow without bound and
their distributions have longer tails."""


class Reversals:
    """The sharp dry friction of the motors of some joints.

    Args:
        actuators: actuators of the joints.
    """

    def __init__(self, actuators: Sequence[Actuator]) -> None:
        sides = [side.friction if side else None for each in actuators for side in each.sides]
        friction = FrictionLaws.of(sides)
        shape = (len(actuators), -1)
        zero = np.zeros(len(sides)).reshape(shape)
        self._forward = self._backward = zero
        if friction is not None:
            self._forward = np.where(friction.sharp, friction.forward, 0.0).reshape(shape)
            self._backward = np.where(friction.sharp, friction.backward, 0.0).reshape(shape)

    @property
    def possible(self) -> bool:
        """Whether any motor has sharp dry friction."""
        return bool(np.any(self._forward + self._backward))

    def variance(self, speed: FloatArray, deviation: FloatArray, covariance: FloatArray) -> FloatArray:
        """Return the contribution of sharp friction to the variance of motor torques, (samples, joints, 2).

        Args:
            speed: speeds of the motors, (samples, joints, 2).
            deviation: standard deviations of the speeds, (samples, joints, 2).
            covariance: covariances of speed and torque without sharp friction, (samples, joints, 2).
        """
        uncertain = deviation > 0
        scale = np.where(uncertain, deviation, 1.0)
        above, below = (speed - REST) / scale, (-speed - REST) / scale
        forward, backward = self._forward, self._backward
        up, down = scipy.special.ndtr(above), scipy.special.ndtr(below)
        spread = forward**2 * up + backward**2 * down - (forward * up - backward * down) ** 2
        slope = (forward * np.exp(-(above**2) / 2) + backward * np.exp(-(below**2) / 2)) / np.sqrt(2 * np.pi)
        return np.where(uncertain, spread + 2 * covariance / scale * slope, 0.0)

    def uncertain(self, speed: FloatArray, deviation: FloatArray) -> BoolArray:
        """Return a mask of joints with a motor of uncertain direction, (samples, joints); see `variance`."""
        near = (deviation > 0) & (np.abs(speed) < NEAR * deviation)
        return np.asarray(np.any(near & (self._forward + self._backward > 0), axis=-1))


@dataclass(frozen=True)
class JointBand(Published):
    """The effect of tolerances on a joint.

    Attributes:
        torque: largest standard deviation of a motor torque, N m (N).
        share: ratio of that to the largest motor torque.
        time: time of the largest standard deviation, s.
        reverses: whether the direction of a motor with sharp dry friction is uncertain at any time.
        reversals: share of the variance at `time` due to earlier or later reversals; negative if these make
            the torque more certain.
        margin: margin at the sample where it is smallest in units of its standard deviation; NaN without one.
        margin_deviation: standard deviation of this margin.
        margin_time: time of this margin, s.
        lost: probability that this margin is negative; the probability over the whole run is at least this.
    """

    torque: float
    share: float
    time: float
    reverses: bool
    reversals: float
    margin: float
    margin_deviation: float
    margin_time: float
    lost: float


class TorqueCurves(NamedTuple):
    """Motor torques over a run.

    Attributes:
        time: times, (samples,) in s.
        tau_motor, deviation: torques and their standard deviations, (samples, joints, 2), N m (N).
    """

    time: FloatArray
    tau_motor: FloatArray
    deviation: FloatArray


class _BandBlock(NamedTuple):
    """A block of a run: variables, their standard deviations, and the effect of motor reversals on them."""

    time: FloatArray
    tau_motor: FloatArray
    margin: FloatArray
    of_torque: FloatArray
    of_margin: FloatArray
    by_reversals: FloatArray
    uncertain: BoolArray


class Band:
    """Variances over a run for independent parameters; `add` its blocks in order.

    Args:
        deviations: standard deviations of the parameters.
        actuators: actuators of the joints.
    """

    def __init__(self, deviations: FloatArray, actuators: Sequence[Actuator]) -> None:
        self._variances = deviations**2
        self._reversals = Reversals(actuators)
        self._parts: list[_BandBlock] = []

    def add(self, part: Derivatives) -> None:
        """Include the next block."""
        block = part.block
        of_torque, of_speed, of_both = np.zeros((3, *block.tau_motor.shape))
        of_margin = np.zeros_like(part.margin)
        for joint, slopes, variances in self._of_joints(part):
            torque, of_gap = slopes["tau_motor"], slopes[MARGIN]
            of_torque[:, joint] += np.einsum("pms,p->sm", torque**2, variances)
            of_margin[:, joint] += np.einsum("ps,p->s", of_gap**2, variances)
            if self._reversals.possible:
                speed = slopes[SPEED]
                of_speed[:, joint] += np.einsum("pms,p->sm", speed**2, variances)
                of_both[:, joint] += np.einsum("pms,pms,p->sm", torque, speed, variances)
        by_reversals, uncertain = np.zeros_like(of_torque), np.zeros(of_margin.shape, dtype=bool)
        if self._reversals.possible:
            of_speed = np.sqrt(of_speed)
            by_reversals = self._reversals.variance(block.dtheta, of_speed, of_both)
            uncertain = self._reversals.uncertain(block.dtheta, of_speed)
        of_torque = np.sqrt(np.maximum(of_torque + by_reversals, 0.0))
        of_run = (part.time, block.tau_motor, part.margin, of_torque, np.sqrt(of_margin))
        self._parts.append(_BandBlock(*of_run, by_reversals, uncertain))

    def _of_joints(self, part: Derivatives) -> Iterator[tuple[int, dict[str, FloatArray], FloatArray]]:
        """Yield joint, slopes by uncertain parameters, and the variances of these parameters."""
        names = ("tau_motor", SPEED, MARGIN) if self._reversals.possible else ("tau_motor", MARGIN)
        for group in part.groups:
            variances = self._variances[group.places]
            known = np.flatnonzero(variances)
            for joint, slopes in enumerate(group.of_joints if known.size else ()):
                if slopes is not None:
                    yield joint, {name: slopes[name][known] for name in names}, variances[known]

    def curves(self) -> TorqueCurves:
        """Return the torques and their standard deviations so far."""
        run = self._together()
        return TorqueCurves(run.time, run.tau_motor, run.of_torque)

    def joints(self) -> list[JointBand]:
        """Return the band of each joint."""
        run = self._together()
        return [
            _joint_band(
                _BandBlock(
                    time=run.time,
                    tau_motor=run.tau_motor[:, joint],
                    margin=run.margin[:, joint],
                    of_torque=run.of_torque[:, joint],
                    of_margin=run.of_margin[:, joint],
                    by_reversals=run.by_reversals[:, joint],
                    uncertain=run.uncertain[:, joint],
                )
            )
            for joint in range(run.margin.shape[1])
        ]

    def _together(self) -> _BandBlock:
        return _BandBlock(*map(np.concatenate, zip(*self._parts, strict=True)))


def _joint_band(run: _BandBlock) -> JointBand:
    spread = np.nan_to_num(np.fmax(*run.of_torque.T))
    worst = int(spread.argmax())
    deviation, motor = float(spread[worst]), int(np.nan_to_num(run.of_torque[worst]).argmax())
    peak = float(np.nanmax(np.abs(run.tau_motor), initial=0.0))
    reversing = float(run.by_reversals[worst, motor]) / deviation**2 if deviation > 0 else 0.0
    of_torque = (
        deviation,
        share_of_peak(deviation, peak),
        float(run.time[worst]),
        bool(run.uncertain.any()),
        reversing,
    )
    known = np.isfinite(run.margin) & (run.of_margin > 0)
    if not known.any():
        return JointBand(*of_torque, math.nan, math.nan, math.nan, 0.0)
    distance = np.where(known, run.margin / np.where(known, run.of_margin, 1.0), np.inf)
    near = int(distance.argmin())
    return JointBand(
        *of_torque,
        float(run.margin[near]),
        float(run.of_margin[near]),
        float(run.time[near]),
        math.erfc(float(distance[near]) / math.sqrt(2)) / 2,
    )


def share_of_peak(size: float, peak: float) -> float:
    """Return the ratio of a size to a peak; NaN without one."""
    return size / peak if peak > 0 else math.nan
