"""Closed loops of all kinds, with states around their start, for comparing ways to evaluate them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from samples.plants import with_actuators
from samples.robots import vsa_3r
from samples.shipped import shipped_run
from samples.simulated import short_motion
from vsacli import Friction, Gains, InitialError, Motor, Rigid, Robot, Trajectory
from vsacli.control.simulation.boundaries import Boundary, boundaries
from vsacli.control.simulation.closed_loop import ClosedLoop, Feedforward, LinearizingFeedback
from vsacli.control.simulation.start import start_state
from vsacli.control.simulation.tabulated import TabulatedReference

SHIPPED = {
    "cubic springs": ("vsa_3r", "rest_to_rest"),
    "prismatic joints": ("scara_4", "scara_4"),
    "rigid joints beside others": ("mixed_3r", "mixed_3r"),
    "a lever": ("awas_1r", "awas_1r"),
    "a cam, by iteration": ("cam_1r", "cam_1r"),
    "a damped transmission": ("compact_1r", "compact_1r"),
    "a coupling spring": ("coupled_1r", "coupled_1r"),
    "one spring": ("hardening_1r", "hardening_1r"),
    "a damper of the link": ("maccepa_vd_1r", "maccepa_vd_1r"),
    "a measured spring": ("measured_1r", "measured_1r"),
    "smooth friction, seven joints": ("panda_7r", "panda_7r"),
    "shifted cams": ("shifted_cams_1r", "shifted_cams_1r"),
    "tendons": ("tendon_1r", "tendon_1r"),
}
"""Robots and trajectories that come along, by what is particular to them."""

MADE = ("wrench", "friction", "limits", "computed torque")


class Loop(NamedTuple):
    """A closed loop, where its runs end, and where one starts."""

    loop: ClosedLoop
    boundaries: list[Boundary]
    start: np.ndarray
    times: tuple[float, float]

    def states(self, count: int, seed: int = 0) -> Iterator[tuple[float, np.ndarray]]:
        """Times and states near the start: within a spring's range, and of all signs of velocity."""
        rng = np.random.default_rng(seed)
        for _ in range(count):
            scale = np.maximum(np.abs(self.start), 1.0)
            yield rng.uniform(*self.times), self.start + 1e-3 * scale * rng.standard_normal(len(self.start))


def loop_of(
    robot: Robot, trajectory: Trajectory, gains: Gains | None = None, model: Robot | None = None
) -> Loop:
    trajectory = trajectory.from_zero()
    reference = TabulatedReference(trajectory)
    believed = model or robot
    controller = (
        Feedforward(believed, trajectory)
        if gains is None
        else LinearizingFeedback(believed, reference, gains)
    )
    loop = ClosedLoop(robot, controller, reference)
    start = loop.packing.pack(*loop.plant.unpack_state(start_state(robot, trajectory, InitialError())))
    first, last = trajectory.times.span
    return Loop(loop, list(boundaries(loop, start)), start, (float(first), float(last)))


def shipped_loop(what: str, *, feedback: bool = False) -> Loop:
    return loop_of(*shipped_run(*SHIPPED[what]), gains=_gains(4) if feedback else None)


def made_loop(what: str) -> Loop:
    robot, integrating = vsa_3r(), Gains.from_poles([-20] * 5, [-20] * 3)
    if what == "wrench":
        return loop_of(robot, short_motion(3, wrench="end_effector"), integrating)
    if what == "computed torque":
        rigid = with_actuators(robot, dict.fromkeys(range(3), Rigid(motor=Motor(inertia=2.0, damping=0.1))))
        return loop_of(rigid, short_motion(3), _gains(2))
    motors: dict[str, dict[str, object]] = {
        "friction": {"friction": Friction(coulomb=(2.0, 3.0), offset=0.4, width=0.05)},
        "limits": {"max_torque": 8.0},
    }
    return loop_of(_with_motors(robot, **motors[what]), short_motion(3), integrating)


def _with_motors(robot: Robot, **changes: object) -> Robot:
    joints = [
        dataclasses.replace(
            joint,
            actuator=dataclasses.replace(
                joint.actuator,
                motor=tuple(dataclasses.replace(motor, **changes) for motor in joint.actuator.motor),
            ),
        )
        for joint in robot.joints
    ]
    return dataclasses.replace(robot, joints=tuple(joints))


def _gains(order: int) -> Gains:
    return Gains.from_poles([-20] * order, [-20] * 2)
