"""Dry friction along a run: undetermined torques at rest, and changes of sign between the samples."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vsacli.actuators.friction import sign_of_motion
from vsacli.actuators.motor import JointMotor
from vsacli.analysis.run_dynamics import RunDynamics
from vsacli.base.arrays import FloatArray
from vsacli.base.json_records import Stored, named
from vsacli.base.texts import counted
from vsacli.base.units import TORQUE, time_text
from vsacli.base.variables import Block
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

SMOOTH_WIDTHS = 3.0
"""Velocity, in widths, up to which smooth friction changes: tanh is within 0.5 % of its limit there."""

COARSE_WIDTHS = 0.5
"""Largest change of velocity from sample to sample, in widths, at which the samples show the friction."""

LEVELS, HALVINGS = 25, 40
"""Number of velocities in a passage at which torques are computed, and of bisections to find their times."""

MAX_PASSAGES = 200
"""Largest number of passages of a joint that are computed, the fastest ones."""

NOTABLE_RATIO = 1.05
"""Smallest ratio of the torque in a passage to the largest torque at the samples that is reported."""


class FrictionPassages:
    """Passages of a run: smooth friction changes its sign; `add` blocks in order, then call `notes`."""

    def __init__(self, robot: Robot) -> None:
        self._smooth_joints: list[tuple[int, Joint, float]] = [
            (index, joint, joint.friction.width)
            for index, joint in enumerate(robot.joints)
            if joint.friction is not None and joint.friction.width and any(joint.friction.coulomb)
        ]
        self._passages = [np.empty((0, 4)) for _ in self._smooth_joints]
        self._peaks = [0.0] * len(self._smooth_joints)
        self._last_time, self._last_dq = np.empty(0), np.empty((0, len(robot.joints)))

    def add(self, block: Block) -> None:
        """Add the next block."""
        time, dq = np.append(self._last_time, block.time), np.concatenate([self._last_dq, block.dq])
        self._last_time, self._last_dq = time[-1:], dq[-1:]
        for passage_index, (index, _, width) in enumerate(self._smooth_joints):
            torques = np.abs(block.tau_motor[:, index])
            self._peaks[passage_index] = np.max(
                torques, where=np.isfinite(torques), initial=self._peaks[passage_index]
            )
            before, after = dq[:-1, index], dq[1:, index]
            is_near_zero = (np.minimum(abs(before), abs(after)) < SMOOTH_WIDTHS * width) | (
                before * after < 0
            )
            is_hidden = is_near_zero & (np.abs(after - before) > COARSE_WIDTHS * width)
            passages = np.stack([time[:-1], time[1:], before, after], axis=1)[is_hidden]
            all_passages = np.concatenate([self._passages[passage_index], passages])
            fastest_index = np.sort(
                np.argsort(-np.abs(all_passages[:, 3] - all_passages[:, 2]), kind="stable")[:MAX_PASSAGES]
            )
            self._passages[passage_index] = all_passages[fastest_index]

    def notes(self, dynamics: RunDynamics) -> Iterator[str]:
        """Yield a sentence for each joint on friction that the samples do not show."""
        trajectory = dynamics.trajectories[0]
        for (index, joint, width), passages, peak in zip(
            self._smooth_joints, self._passages, self._peaks, strict=True
        ):
            if not passages.size:
                continue
            start = f"from t = {time_text(passages[0, 0])} on"
            finding = (
                f"{joint.name}: friction between the links changes its sign within a sample or two {start}"
            )
            advice = "a larger rate shows them, a larger width makes them smaller"
            if not trajectory.known_between:
                yield f"{finding}; what the motors do meanwhile is not known: {advice}"
                continue
            passage_block = dynamics.at(_passage_times(trajectory, passages, index, width))
            torques = np.abs(passage_block.tau_motor[:, index])
            peak_in_passage = float(np.max(torques, where=np.isfinite(torques), initial=0.0))
            if peak_in_passage > NOTABLE_RATIO * peak:
                peaks_text = (
                    f"{peak_in_passage:.3g} {TORQUE.unit(joint.type)} there, {peak:.3g} at the samples"
                )
                yield f"{finding}: motor torques reach {peaks_text}; {advice}"


def _passage_times(trajectory: Trajectory, passages: FloatArray, index: int, width: float) -> FloatArray:
    """Return when the velocity of a joint is at levels between -3 and 3 widths, by bisection."""
    earlier, later, before, after = np.repeat(passages, LEVELS, axis=0).T
    level = np.tile(width * np.linspace(-SMOOTH_WIDTHS, SMOOTH_WIDTHS, LEVELS), len(passages))
    level = np.clip(level, np.minimum(before, after), np.maximum(before, after))
    for _ in range(HALVINGS):
        midpoint = (earlier + later) / 2
        is_passed = (trajectory.at(midpoint).dq[:, index] - level) * (after - before) > 0
        earlier, later = np.where(is_passed, earlier, midpoint), np.where(is_passed, midpoint, later)
    return np.sort(later)


@dataclass(frozen=True)
class DryFriction(Stored):
    """Samples at which a motor with sharp friction rests or turns back, where its torque is two-valued.

    Attributes:
        motor: 1 or 2.
        lowest: Lower end of the range of torque to add at rest, N m (N), joint side; zero or negative.
        highest: Upper end of that range; zero or positive.
        start: Number of samples at rest from the first sample on.
        between: Number of samples at rest on the way.
        end: Number of samples at rest up to the last sample.
        reversals: Number of reversals; the torque jumps by `highest` - `lowest` at each.
        first_reversal: Time of the first sample after the first reversal, s; NaN without a reversal.
    """

    motor: int
    lowest: float
    highest: float
    start: int
    between: int
    end: int
    reversals: int
    first_reversal: float

    shape: ClassVar = {
        "motor": "motor",
        "torque": named("lowest", "highest"),
        "steps_at_rest": named("start", "between", "end"),
        "reversals": "reversals",
        "first_reversal": "first_reversal",
    }

    @property
    def jump(self) -> float:
        """Jump of the torque at a reversal, N m (N)."""
        return self.highest - self.lowest


class DryFrictionSummary:
    """Search for rest and reversals of one motor; `add` samples in order, then call `report`.

    Attributes:
        number: Number of the motor, 1 or 2.
    """

    def __init__(self, number: int, motor: JointMotor) -> None:
        assert motor.friction is not None
        self.number, (self._backward, self._forward) = number, motor.friction.coulomb
        self._direction, self._sample_count, self._first_moving, self._last_moving, self._resting_count = (
            0.0,
            0,
            -1,
            -1,
            0,
        )
        self._reversals, self._first_reversal = 0, math.nan

    def add(self, time: FloatArray, dtheta: FloatArray) -> None:
        """Add consecutive samples, (samples,)."""
        direction = sign_of_motion(dtheta)
        moving = np.flatnonzero(direction)
        self._resting_count += len(time) - len(moving)
        if moving.size:
            is_reversal = np.diff(direction[moving], prepend=self._direction or direction[moving[0]]) != 0
            if is_reversal.any() and not self._reversals:
                self._first_reversal = float(time[moving[is_reversal.argmax()]])
            self._reversals += int(np.count_nonzero(is_reversal))
            if self._first_moving < 0:
                self._first_moving = self._sample_count + int(moving[0])
            self._last_moving, self._direction = (
                self._sample_count + int(moving[-1]),
                float(direction[moving[-1]]),
            )
        self._sample_count += len(time)

    def report(self) -> DryFriction:
        """Return the findings so far."""
        start = self._sample_count if self._first_moving < 0 else self._first_moving
        end = self._sample_count - 1 - self._last_moving if self._last_moving >= 0 else 0
        return DryFriction(
            motor=self.number,
            lowest=-self._backward,
            highest=self._forward,
            start=start,
            between=self._resting_count - start - end,
            end=end,
            reversals=self._reversals,
            first_reversal=self._first_reversal,
        )


def dry_frictions(motors: Sequence[JointMotor]) -> list[DryFrictionSummary]:
    """Return a summary of each motor of a joint with sharp friction."""
    return [
        DryFrictionSummary(number, motor)
        for number, motor in enumerate(motors, 1)
        if motor.friction is not None and motor.friction.sharp
    ]


def dry_friction_lines(motors: Sequence[tuple[str, str, DryFriction]]) -> Iterator[str]:
    """Yield a line on rest and one on reversals, from (joint name, joint type, motor) entries."""
    resting = [entry for entry in motors if entry[2].start + entry[2].between + entry[2].end]
    if resting:
        name, joint_type, worst = max(resting, key=lambda entry: entry[2].jump)
        rest_text = ", ".join(filter(None, _resting_texts([friction for _, _, friction in resting])))
        positive_text, negative_text, unit = (
            f"{worst.highest:.3g}",
            f"{-worst.lowest:.3g}",
            TORQUE.unit(joint_type),
        )
        range_text = (
            f"{positive_text} {unit} more or less"
            if positive_text == negative_text
            else f"{positive_text} {unit} more or {negative_text} less"
        )
        yield f"dry friction: motors that rest ({rest_text}) would do so with up to {range_text} ({name})"
    turning = [entry for entry in motors if entry[2].reversals]
    if turning:
        name, _, first = min(turning, key=lambda entry: entry[2].first_reversal)
        worst_joint, joint_type, worst = max(turning, key=lambda entry: entry[2].jump)
        reversal_count = sum(friction.reversals for _, _, friction in turning)
        times_text, rest_text = (
            "once" if reversal_count == 1 else f"{reversal_count} times",
            time_text(first.first_reversal),
        )
        yield f"dry friction: motors turn back {times_text}, first {name} {first.motor} at t = {rest_text}"
        jump_text = f"{worst.jump:.3g} {TORQUE.unit(joint_type)} ({worst_joint})"
        yield f"where they do, their torques jump by up to {jump_text}"


def _resting_texts(motors: Sequence[DryFriction]) -> Iterator[str]:
    """Yield when motors rest."""
    yield "at the start" if any(friction.start for friction in motors) else ""
    between = max(friction.between for friction in motors)
    yield f"up to {counted(between, 'sample')} on the way" if between else ""
    yield "at the end" if any(friction.end for friction in motors) else ""
