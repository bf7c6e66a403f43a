"""Commands of joints along a path at any speed, as polynomials in the speed with coefficients along the path.

Along q(s), gravity, environment and inertia require tau = g(s) + b(s) v^2 + a(s) v' of each joint, where
v = ds/dt, a = M q_s and b = M q_ss + c(q, q_s) (Bobrow, Dubowsky & Gibson, International Journal of Robotics
Research 4(3), 1985, equation 7). The derivatives of tau by time follow by the chain rule from those of g, b
and a by s. Five evaluations of the recursion yield all of these; a search needs no others. With the
recursion at each speed, the timing of least energy of a 3R takes 1.4 times as long. Friction and dampers are
not polynomials in the speed and are added joint by joint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from vsacli.actuators.transmission import Command
from vsacli.base.arrays import FloatArray, IndexArray, by_joint
from vsacli.base.signals import COMMANDED, DAMPING, POSITION, WRENCH
from vsacli.base.wrench import WRENCH_NAMES
from vsacli.compute.vector import add, exact, mul
from vsacli.dynamics.elastic_torques import TORQUES, LinkTorques, link_resistance
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Motion

Row: TypeAlias = Any
"""Array (..., instants), which may carry derivatives."""


class Speeds(NamedTuple):
    """Derivatives of s by time, from the first to the fourth, each (instants,)."""

    first: Row
    second: Row
    third: Row
    fourth: Row

    @classmethod
    def uniform(cls, factor: FloatArray) -> Speeds:
        """Return the speeds along a path that is uniformly slowed down by factors, (instants,)."""
        zero = np.zeros_like(factor)
        return cls(1 / factor, zero, zero, zero)

    @classmethod
    def of(cls, pace: Sequence[Row]) -> Speeds:
        """Return the speeds from the pace and its first three derivatives by s.

        With v = 1/p: s'' = v v_s, s''' = v (v v_s)_s, and so on.
        """
        p, p_s, p_ss, p_sss = pace
        v = 1 / p
        v_squared = v * v
        v_s = -p_s * v_squared
        v_ss = -p_ss * v_squared - 2 * p_s * v * v_s
        v_sss = -p_sss * v_squared - 4 * p_ss * v * v_s - 2 * p_s * (v_s * v_s + v * v_ss)
        return cls(
            v,
            v * v_s,
            v * (v_s * v_s + v * v_ss),
            v * (v_s * v_s * v_s + 4 * v * v_s * v_ss + v_squared * v_sss),
        )

    def rates(self, by_s: Sequence[Row]) -> list[Row]:
        """Return a function and its derivatives by time, from the function and its derivatives by s."""
        f, *slopes = by_s
        s1, s2, s3, s4 = self
        rates = [f, slopes[0] * s1, slopes[1] * (s1 * s1) + slopes[0] * s2]
        if len(slopes) > 2:
            f1, f2, f3, f4 = slopes
            s1_squared = s1 * s1
            rates += [
                f3 * (s1_squared * s1) + f2 * (3 * s1 * s2) + f1 * s3,
                f4 * (s1_squared * s1_squared)
                + f3 * (6 * s1_squared * s2)
                + f2 * (3 * s2 * s2 + 4 * s1 * s3)
                + f1 * s4,
            ]
        return rates


class PathCommands:
    """The commands of a robot's joints at instants of a path, with link torques.

    Args:
        robot: robot that executes the motion.
        motion: motion along the path; its time is the path coordinate s.

    Attributes:
        by_s: signals and their derivatives by s, each (components, instants), by name.
    """

    def __init__(self, robot: Robot, motion: Motion) -> None:
        self._robot = robot
        self._frame = None if motion.wrench is None else motion.wrench.frame
        self.by_s = {name: by_joint(each) for name, each in motion.variables().items() if name != "time"}

    def at(self, speeds: Speeds, instants: IndexArray | slice = slice(None)) -> list[Command]:
        """Return the command of each joint at some instants; speeds may carry derivatives."""
        path_derivatives = {name: by_s[:, instants] for name, by_s in self.by_s.items()}
        rows = _time_derivatives(path_derivatives, speeds) | self._torques(speeds, instants)
        commands = []
        for index, joint in enumerate(self._robot.joints):
            joint_rows = {name: row[index] for name, row in rows.items() if name not in WRENCH_NAMES}
            _, *rates = (joint_rows[name] for name in POSITION.names)
            resistance = link_resistance(joint, rates, [joint_rows.get(name, 0) for name in DAMPING.names])
            viscous = [mul(exact(joint.damping), rate) for rate in rates[: len(TORQUES)]]
            for name, *parts in zip(TORQUES, viscous, resistance, strict=True):
                joint_rows[name] = add(joint_rows[name], add(*parts))
            commands.append(Command.of(joint_rows))
        return commands

    def _torques(self, speeds: Speeds, instants: IndexArray | slice) -> dict[str, Row]:
        """Return tau_e and its derivatives by time without friction and dampers, each (joints, instants)."""
        s1, s2, s3, s4 = speeds
        s1_squared, s1_s2 = s1 * s1, s1 * s2
        powers = (
            (np.ones_like(s1), s1_squared, s2),
            (s1, s1_squared * s1, s1_s2, s3),
            (s1_squared, s2, s1_squared * s1_squared, s1_squared * s2, s2 * s2, s1 * s3, s4),
        )
        return {
            name: np.sum(factors[..., instants] * np.stack(each)[:, None], axis=0)
            for name, factors, each in zip(TORQUES, self._power_coefficients, powers, strict=True)
        }

    @cached_property
    def _power_coefficients(self) -> tuple[FloatArray, ...]:
        """Coefficients of the powers of the speed in tau_e, tau_e', tau_e'', each (powers, joints, instants).

        With k = a_s + 2 b: tau' = g_s v + b_s v^3 + k v v' + a v'', and tau'' = g_ss v^2 + g_s v' + b_ss v^4
        + (k_s + 3 b_s) v^2 v' + k v'^2 + (k + a_s) v v'' + a v'''.
        """
        g = self._recursion(0.0, 0.0)[0]
        (once, once_1, once_2), (_, twice_1, twice_2) = self._recursion(1.0, 0.0), self._recursion(2.0, 0.0)
        b, b_s, b_ss = once - g, (twice_1 - 2 * once_1) / 6, (twice_2 - 4 * once_2) / 12
        g_s, g_ss = once_1 - b_s, once_2 - b_ss
        accelerated = self._recursion(0.0, 1.0)
        a, k = accelerated[0] - g, accelerated[2] - g_s
        k_s_plus_3_b_s = self._recursion(1.0, 1.0)[2] - (g_ss + g_s + b_ss + k)  # k_s + 3 b_s
        return (
            np.stack([g, b, a]),
            np.stack([g_s, b_s, k, a]),
            np.stack([g_ss, g_s, b_ss, k_s_plus_3_b_s, k, 2 * (k - b), a]),
        )

    def _recursion(self, speed: float, acceleration: float) -> list[FloatArray]:
        """Return tau_e, tau_e' and tau_e'' at v and v', each (joints, instants)."""
        joints = [replace(joint, damping=0.0, friction=None, damper=None) for joint in self._robot.joints]
        kernel = LinkTorques(replace(self._robot, joints=tuple(joints)), self._frame)
        rows = _time_derivatives(self.by_s, Speeds(speed, acceleration, 0.0, 0.0))
        torques = kernel.results.unpack(kernel(kernel.arguments.pack(rows)))
        template = rows["q"][0]  # the recursion returns a plain zero for joints that move nothing
        return [np.stack([np.broadcast_to(row, template.shape) for row in torques[name]]) for name in TORQUES]


def _time_derivatives(by_s: Mapping[str, FloatArray], speeds: Speeds) -> dict[str, Row]:
    """Return signals and their derivatives by time from those by s, each (components, instants), by name."""
    signals = [each for each in (POSITION, *COMMANDED.values(), WRENCH) if each.names[0] in by_s]
    return {
        name: rate
        for signal in signals
        for name, rate in zip(signal.names, speeds.rates([by_s[name] for name in signal.names]), strict=True)
    }
