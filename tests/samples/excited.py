"""Records of robots that move all joints and change their stiffness, with noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vsacli import Robot, Trajectory, inverse_dynamics
from vsacli.studies.identification.conditioning import ConditionedRecording, bandwidth_of, conditioned

POSITION_LINES, STIFFNESS_LINES = (0.15, 0.4, 0.7), (0.2, 0.55)
"""Hz."""

POSITION_NOISE, TORQUE_NOISE = 2e-5, 0.5
"""Standard deviations, rad (m) and N m (N)."""


class Excitation(NamedTuple):
    """How a robot is moved: about what, and how far at most, of each joint.

    Attributes:
        position, reach: of the joints.
        stiffness, swing: None of robots that take none.
        duration: s.
        rate: samples a second.
    """

    position: Sequence[float]
    reach: Sequence[float]
    stiffness: Sequence[float] | None
    swing: Sequence[float] = ()
    duration: float = 24.0
    rate: float = 250.0


class Recorded(NamedTuple):
    """What sensors say: (samples,), (samples, joints), (samples, joints, 2) twice."""

    time: np.ndarray
    q: np.ndarray
    theta: np.ndarray
    tau_motor: np.ndarray

    @property
    def signals(self) -> ConditionedRecording:
        """Ready for equations."""
        return conditioned(*self, bandwidth_of(self.time, self.q, self.theta))

    def noisy(self, seed: int, torque: float = TORQUE_NOISE) -> Recorded:
        """With noise."""
        rng = np.random.default_rng(seed)
        sizes = (POSITION_NOISE, POSITION_NOISE, torque)
        noisy = (
            each + size * rng.normal(size=each.shape) for each, size in zip(self[1:], sizes, strict=True)
        )
        return Recorded(self.time, *noisy)

    def write(self, path: Path, robot: Robot) -> Path:
        """As a CSV file."""
        columns = {"time": self.time, **dict(self._columns(robot))}
        rows = np.column_stack(list(columns.values()))
        np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
        return path

    def _columns(self, robot: Robot) -> Iterator[tuple[str, np.ndarray]]:
        for index, joint in enumerate(robot.joints):
            yield f"{joint.name}.q", self.q[:, index]
            for motor in range(joint.actuator.motor_count):
                yield f"{joint.name}.theta_{motor + 1}", self.theta[:, index, motor]
                yield f"{joint.name}.tau_motor_{motor + 1}", self.tau_motor[:, index, motor]


def excited(robot: Robot, excitation: Excitation, seed: int = 0) -> Recorded:
    """The motion without noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(excitation.duration * excitation.rate) + 1) / excitation.rate
    q = _sines(time, rng, excitation.position, excitation.reach, POSITION_LINES)
    given = dict(zip(("dq", "ddq", "d3q", "d4q"), q[1:], strict=True))
    if excitation.stiffness is not None:
        stiffness = _sines(time, rng, excitation.stiffness, excitation.swing, STIFFNESS_LINES)
        given |= dict(zip(("stiffness", "dstiffness", "ddstiffness"), stiffness, strict=False))
    run = inverse_dynamics(robot, Trajectory.from_samples(time, q[0], **given))
    assert np.isfinite(run.tau_motor[:, :, 0]).all()
    return Recorded(time, run.q, run.theta, run.tau_motor)


def _sines(
    time: np.ndarray,
    rng: np.random.Generator,
    middle: Sequence[float],
    reach: Sequence[float],
    lines: Sequence[float],
) -> list[np.ndarray]:
    """Sums of sines of any phases with their first four derivatives, (samples, joints) each."""
    omega, count = 2 * np.pi * np.array(lines), (len(middle), len(lines))
    phase, size = rng.uniform(0, 2 * np.pi, count), rng.uniform(0.5, 1, count) / len(lines)
    amplitude = np.array(reach)[:, None] * size
    angles = time[:, None, None] * omega + phase
    waves = [
        np.sum(amplitude * omega**order * np.sin(angles + order * np.pi / 2), axis=-1) for order in range(5)
    ]
    return [waves[0] + np.array(middle), *waves[1:]]
