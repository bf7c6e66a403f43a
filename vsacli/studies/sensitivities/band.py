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

REVERSAL_DEVIATIONS = 5.0
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
        forward_limit, backward_limit = (speed - REST) / scale, (-speed - REST) / scale
        forward, backward = self._forward, self._backward
        forward_probability, backward_probability = (
            scipy.special.ndtr(forward_limit),
            scipy.special.ndtr(backward_limit),
        )
        friction_variance = (
            forward**2 * forward_probability
            + backward**2 * backward_probability
            - (forward * forward_probability - backward * backward_probability) ** 2
        )
        mean_derivative = (
            forward * np.exp(-(forward_limit**2) / 2) + backward * np.exp(-(backward_limit**2) / 2)
        ) / np.sqrt(2 * np.pi)
        return np.where(uncertain, friction_variance + 2 * covariance / scale * mean_derivative, 0.0)

    def uncertain(self, speed: FloatArray, deviation: FloatArray) -> BoolArray:
        """Return a mask of joints with a motor of uncertain direction, (samples, joints); see `variance`."""
        is_near_rest = (deviation > 0) & (np.abs(speed) < REVERSAL_DEVIATIONS * deviation)
        return np.asarray(np.any(is_near_rest & (self._forward + self._backward > 0), axis=-1))


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
    torque_deviation: FloatArray
    margin_deviation: FloatArray
    reversal_variance: FloatArray
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
        torque_variance, speed_variance, covariance = np.zeros((3, *block.tau_motor.shape))
        margin_variance = np.zeros_like(part.margin)
        for joint, slopes, variances in self._uncertain_slopes(part):
            torque, margin_slopes = slopes["tau_motor"], slopes[MARGIN]
            torque_variance[:, joint] += np.einsum("pms,p->sm", torque**2, variances)
            margin_variance[:, joint] += np.einsum("ps,p->s", margin_slopes**2, variances)
            if self._reversals.possible:
                speed = slopes[SPEED]
                speed_variance[:, joint] += np.einsum("pms,p->sm", speed**2, variances)
                covariance[:, joint] += np.einsum("pms,pms,p->sm", torque, speed, variances)
        reversal_variance, uncertain = (
            np.zeros_like(torque_variance),
            np.zeros(margin_variance.shape, dtype=bool),
        )
        if self._reversals.possible:
            speed_deviation = np.sqrt(speed_variance)
            reversal_variance = self._reversals.variance(block.dtheta, speed_deviation, covariance)
            uncertain = self._reversals.uncertain(block.dtheta, speed_deviation)
        torque_deviation = np.sqrt(np.maximum(torque_variance + reversal_variance, 0.0))
        run_arrays = (part.time, block.tau_motor, part.margin, torque_deviation, np.sqrt(margin_variance))
        self._parts.append(_BandBlock(*run_arrays, reversal_variance, uncertain))

    def _uncertain_slopes(self, part: Derivatives) -> Iterator[tuple[int, dict[str, FloatArray], FloatArray]]:
        """Yield joint, slopes by uncertain parameters, and the variances of these parameters."""
        names = ("tau_motor", SPEED, MARGIN) if self._reversals.possible else ("tau_motor", MARGIN)
        for group in part.groups:
            variances = self._variances[group.places]
            uncertain_indices = np.flatnonzero(variances)
            for joint, slopes in enumerate(group.of_joints if uncertain_indices.size else ()):
                if slopes is not None:
                    yield (
                        joint,
                        {name: slopes[name][uncertain_indices] for name in names},
                        variances[uncertain_indices],
                    )

    def curves(self) -> TorqueCurves:
        """Return the torques and their standard deviations so far."""
        run = self._concatenated_blocks()
        return TorqueCurves(run.time, run.tau_motor, run.torque_deviation)

    def joints(self) -> list[JointBand]:
        """Return the band of each joint."""
        run = self._concatenated_blocks()
        return [
            _joint_band(
                _BandBlock(
                    time=run.time,
                    tau_motor=run.tau_motor[:, joint],
                    margin=run.margin[:, joint],
                    torque_deviation=run.torque_deviation[:, joint],
                    margin_deviation=run.margin_deviation[:, joint],
                    reversal_variance=run.reversal_variance[:, joint],
                    uncertain=run.uncertain[:, joint],
                )
            )
            for joint in range(run.margin.shape[1])
        ]

    def _concatenated_blocks(self) -> _BandBlock:
        return _BandBlock(*map(np.concatenate, zip(*self._parts, strict=True)))


def _joint_band(run: _BandBlock) -> JointBand:
    deviations = np.nan_to_num(np.fmax(*run.torque_deviation.T))
    worst_sample = int(deviations.argmax())
    deviation, motor = (
        float(deviations[worst_sample]),
        int(np.nan_to_num(run.torque_deviation[worst_sample]).argmax()),
    )
    peak = float(np.nanmax(np.abs(run.tau_motor), initial=0.0))
    reversal_share = (
        float(run.reversal_variance[worst_sample, motor]) / deviation**2 if deviation > 0 else 0.0
    )
    torque_values = (
        deviation,
        share_of_peak(deviation, peak),
        float(run.time[worst_sample]),
        bool(run.uncertain.any()),
        reversal_share,
    )
    has_margin = np.isfinite(run.margin) & (run.margin_deviation > 0)
    if not has_margin.any():
        return JointBand(*torque_values, math.nan, math.nan, math.nan, 0.0)
    distance = np.where(has_margin, run.margin / np.where(has_margin, run.margin_deviation, 1.0), np.inf)
    nearest_sample = int(distance.argmin())
    return JointBand(
        *torque_values,
        float(run.margin[nearest_sample]),
        float(run.margin_deviation[nearest_sample]),
        float(run.time[nearest_sample]),
        math.erfc(float(distance[nearest_sample]) / math.sqrt(2)) / 2,
    )


def share_of_peak(magnitude: float, peak: float) -> float:
    """Return the ratio of a size to a peak; NaN without one."""
    return magnitude / peak if peak > 0 else math.nan
