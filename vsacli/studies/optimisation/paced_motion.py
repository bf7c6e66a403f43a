"""A motion along its path at another pace: what joints are asked to do then, as functions of the pace.

The path parameter s is the time of the motion as commanded; the pace is p = dt/ds, so that time is its
integral. A function of s has the rates df/dt = f_s/p and so on, by the chain rule.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from vsacli.actuators.transmission import Command
from vsacli.base.arrays import BoolArray, FloatArray, IndexArray, by_joint
from vsacli.base.signals import COMMANDED, POSITION, STIFFNESS
from vsacli.base.wrench import WRENCH_NAMES
from vsacli.compute.duals import value_of
from vsacli.dynamics.elastic_torques import TORQUES, LinkTorques
from vsacli.robot.model import Robot
from vsacli.studies.optimisation.periods import AT_REST
from vsacli.trajectory.trajectory import Trajectory

Row: TypeAlias = Any
"""(instants,), which may carry derivatives."""

PACE_ORDERS = 4
"""The pace and its derivatives by s that the fourth derivative of a motion takes."""


class Speeds(NamedTuple):
    """Derivatives of s by time, from the first to the fourth, each (instants,)."""

    first: Row
    second: Row
    third: Row
    fourth: Row

    @classmethod
    def of(cls, pace: Sequence[Row]) -> Speeds:
        """From the pace and its first three derivatives by s.

        With v = 1/p: s'' = v v_s, s''' = v (v v_s)_s, and so on.
        """
        p, p_s, p_ss, p_sss = pace
        v = 1 / p
        squared = v * v
        v_s = -p_s * squared
        v_ss = -p_ss * squared - 2 * p_s * v * v_s
        v_sss = -p_sss * squared - 4 * p_ss * v * v_s - 2 * p_s * (v_s * v_s + v * v_ss)
        return cls(
            v,
            v * v_s,
            v * (v_s * v_s + v * v_ss),
            v * (v_s * v_s * v_s + 4 * v * v_s * v_ss + squared * v_sss),
        )

    def rates(self, by_s: Sequence[Row]) -> list[Row]:
        """A function of s, whose derivatives by s are given, and its derivatives by time, at most four."""
        f, *slopes = by_s
        s1, s2, s3, s4 = self
        rates = [f, slopes[0] * s1, slopes[1] * (s1 * s1) + slopes[0] * s2]
        if len(slopes) > 2:
            f1, f2, f3, f4 = slopes
            square = s1 * s1
            rates += [
                f3 * (square * s1) + f2 * (3 * s1 * s2) + f1 * s3,
                f4 * (square * square) + f3 * (6 * square * s2) + f2 * (3 * s2 * s2 + 4 * s1 * s3) + f1 * s4,
            ]
        return rates


class PacedMotion:
    """A robot's motion at instants of its path.

    Args:
        robot: the robot.
        trajectory: whose smooth functions are the path.
        s: instants, (instants,), seconds from the start of the trajectory.
    """

    def __init__(self, robot: Robot, trajectory: Trajectory, s: FloatArray) -> None:
        self.robot, self.s = robot, s
        motion = trajectory.at(trajectory.start + s)
        self._variables = {
            name: by_joint(each) for name, each in motion.variables().items() if name != "time"
        }
        self._frame = None if motion.wrench is None else motion.wrench.frame
        self._signals = [POSITION, *(COMMANDED[key] for key in trajectory.commanded)]
        self._known: tuple[bytes, list[Command]] | None = None

    def commands(self, pace: Sequence[Row], instants: IndexArray) -> list[Command]:
        """What each joint is asked to do, with the torque of its link, at a pace given with its derivatives.

        What was asked for last is remembered: joints are looked at one after the other.
        """
        values = np.stack([*(value_of(row) for row in pace), instants])
        key = values.tobytes() + type(pace[0]).__name__.encode()
        if self._known is None or self._known[0] != key:
            self._known = key, self._computed(Speeds.of(pace), instants)
        return self._known[1]

    @property
    def resting(self) -> BoolArray:
        """Where all joints rest, and go on resting, (instants,)."""
        still: BoolArray = np.all(
            [
                np.abs(row) <= AT_REST * np.abs(row).max()
                for name in POSITION.names[1:]
                for row in self._variables[name]
            ],
            axis=0,
        )
        inner = (self.s > 0) & (self.s < self.s[-1])
        resting: BoolArray = still & np.roll(still, 1) & np.roll(still, -1) & inner
        return resting

    def stiffness(self, joint: int) -> FloatArray:
        """As commanded, (instants,)."""
        stiffness: FloatArray = self._variables[STIFFNESS.key][joint]
        return stiffness

    def stiffness_rates(self, pace: Sequence[Row], by_s: Sequence[Row]) -> list[Row]:
        """A stiffness along the path, and its two derivatives by time."""
        return Speeds.of(pace).rates(by_s)

    def _computed(self, speeds: Speeds, instants: IndexArray) -> list[Command]:
        rows: dict[str, list[Row]] = {}
        for signal in self._signals:
            rows |= self._rates(signal.names, speeds, instants)
        if self._frame is not None:
            rows |= self._rates(WRENCH_NAMES, speeds, instants)
        kernel = LinkTorques(self.robot, self._frame)
        torques = kernel.results.unpack(kernel(kernel.arguments.pack(rows)))
        like = rows["q"][0]
        return [
            Command.of(
                {
                    **{
                        name: of_joints[joint] for name, of_joints in rows.items() if name not in WRENCH_NAMES
                    },
                    **{name: _whole(torques[name][joint], like) for name in TORQUES},
                }
            )
            for joint in range(len(self.robot.joints))
        ]

    def _rates(self, names: Sequence[str], speeds: Speeds, instants: IndexArray) -> Mapping[str, list[Row]]:
        """The rows of a signal by the names of its derivatives by time."""
        by_s = np.stack([self._variables[name] for name in names])[..., instants]
        components = [speeds.rates(list(by_s[:, component])) for component in range(by_s.shape[1])]
        return {name: [each[order] for each in components] for order, name in enumerate(names)}


def _whole(torque: Row, like: Row) -> Row:
    """Of a joint that moves nothing, the recursion finds a plain zero."""
    return np.full_like(like, torque) if isinstance(torque, int | float) else torque
