"""Short motions to simulate, runs of robots with any actuators, and their errors in linear theory."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.linalg import expm

from samples.moves import move
from samples.robots import vsa_3r
from vsacli import Elastic, Gains, InitialError, Motor, Robot, State, Tolerances, Trajectory, motor_torques
from vsacli.base.signals import WRENCH
from vsacli.control.simulation.boundaries import boundaries
from vsacli.control.simulation.closed_loop import ClosedLoop, LinearizingFeedback
from vsacli.control.simulation.ending import Budget
from vsacli.control.simulation.history import History, concatenate_histories, histories, integrate_continuous
from vsacli.control.simulation.integrator import Integrator
from vsacli.control.simulation.loop_equations import Computing, RecordedEquations
from vsacli.control.simulation.tabulated import TabulatedReference
from vsacli.trajectory.curves import RestToRest
from vsacli.trajectory.profile import WrenchProfile


def short_motion(
    joints: int,
    *,
    duration: float = 0.8,
    rate: float = 200,
    size: float = 0.3,
    stiffness: tuple[float, float] = (1100, 1300),
    wrench: str | None = None,
) -> Trajectory:
    """Rest to rest, each joint by `size` to and fro in turn; `wrench` is the frame of one that sets in."""
    span = (0.0, duration)
    ends = tuple(size * (-1) ** joint for joint in range(joints))
    low, high = ((end,) * joints for end in stiffness)
    force = RestToRest(
        signal=WRENCH, span=span, degree=3, start=(0,) * 6, end=(15.0, -10.0, 12.0, 1.0, 2.0, -1.5)
    )
    push = None if wrench is None else WrenchProfile(force, wrench)
    return move(duration, rate, ((0.1,) * joints, ends), stiffness=(low, high), wrench=push, name="short")


def mixed_3r() -> tuple[Robot, Robot]:
    """The 3R arm with an elastic shoulder, and with none."""
    robot = vsa_3r()
    actuator = Elastic(motor=Motor(inertia=6.1, damping=2e-4), stiffness=1200.0)
    base, shoulder, elbow = robot.joints
    return dataclasses.replace(
        robot, joints=(base, dataclasses.replace(shoulder, actuator=actuator), elbow)
    ), robot


def start_of(robot: Robot, paired: Robot, trajectory: Trajectory, error: InitialError) -> State:
    """State at the start, from that of the robot with pairs of springs everywhere: tau_e is the same."""
    command = trajectory.at(np.array([0.0]))
    stiffness = command.commanded["stiffness"] + error.stiffness
    command = dataclasses.replace(
        command, q=command.q + error.q, commanded={**command.commanded, "stiffness": stiffness}
    )
    block = motor_torques(paired, command)
    theta, dtheta = block.theta[0].copy(), block.dtheta[0].copy()
    for index, joint in enumerate(robot.joints):
        if isinstance(joint.actuator, Elastic):
            theta[index] = block.q[0, index] + block.tau_e[0, index] / joint.actuator.stiffness
            dtheta[index] = block.dq[0, index] + block.dtau_e[0, index] / joint.actuator.stiffness
    return State(block.q[0], block.dq[0], theta, dtheta)


def linearized_run(
    robot: Robot, paired: Robot, trajectory: Trajectory, gains: Gains, error: InitialError
) -> tuple[History, State]:
    """What happens under feedback linearization, and the states (samples first)."""
    reference = TabulatedReference(trajectory)
    loop = ClosedLoop(robot, LinearizingFeedback(robot, reference, gains), reference)
    start = loop.packing.pack(*loop.plant.unpack_state(start_of(robot, paired, trajectory, error)))
    times = trajectory.times.block(0, trajectory.samples)
    budget = Budget(None, times)
    equations = RecordedEquations(loop, list(boundaries(loop, start)), budget, Computing("auto"))
    integrator = Integrator(equations, Tolerances(), lambda _: None)
    integrated = integrate_continuous(loop, integrator, times, start)
    past = concatenate_histories(list(histories(robot, loop, integrated, 0.0)))
    return past, State(past.q, past.dq, past.theta, past.dtheta)


def error_course(
    poles: list[complex], first: float, times: np.ndarray, *, integral: bool = False
) -> np.ndarray:
    """Solution of the linear error dynamics (33) from (first, 0, 0, ...), with the integral zero at first."""
    companion = np.diag(np.ones(len(poles) - 1), 1)
    companion[-1] = -np.poly(poles).real[:0:-1]
    start = np.zeros(len(poles))
    start[int(integral)] = first
    return np.array([(expm(companion * time) @ start)[int(integral)] for time in times])
