"""The history of a run: its integration to state vectors, and every variable evaluated from them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vsacli.base.arrays import FLAG_TYPE, FlagArray, FloatArray, of_joint
from vsacli.base.simulation_variables import COMMANDS, ERRORS, SIMULATION_VARIABLES, TRACKED, error
from vsacli.base.variables import VARIABLES, Block
from vsacli.compute.vector import add
from vsacli.control.simulation.closed_loop import ClosedLoop, Phase
from vsacli.control.simulation.ending import Ending
from vsacli.control.simulation.integrator import Effort, Integrator
from vsacli.control.simulation.sensors import Readings
from vsacli.dynamics.limits import limit_flags
from vsacli.dynamics.losses import dissipated_power
from vsacli.robot.model import Robot

CUTOFF = 0.1
"""Cut-off frequency of the low-pass as a share of the sample rate: a delay of about two samples."""


class RateFilter:
    """Velocities by backward differences of joint and motor positions, smoothed by a first-order low-pass.

    Args:
        start: readings of the first sample, whose velocities are known: the robot rests.
    """

    def __init__(self, start: Phase) -> None:
        self.phase = start

    def add(self, read: Phase, elapsed: float) -> None:
        """Add a sample of the positions, `elapsed` seconds after the previous one."""
        keep = math.exp(-2 * math.pi * CUTOFF)
        dq, dtheta = (
            keep * rate + (1 - keep) * (new - old) / elapsed
            for rate, new, old in (
                (self.phase.dq, read.q, self.phase.q),
                (self.phase.dtheta, read.theta, self.phase.theta),
            )
        )
        self.phase = read._replace(dq=dq, dtheta=dtheta)


class StateTrajectory(NamedTuple):
    """A run: times (samples,), states (samples, entries), commanded torques (samples, motors).

    Torques are constant between samples if `held`.
    """

    time: FloatArray
    states: FloatArray
    demand: FloatArray
    ending: Ending | None
    effort: Effort
    held: bool = False


def continuous(
    loop: ClosedLoop, integrator: Integrator, times: FloatArray, start: FloatArray
) -> StateTrajectory:
    """Integrate a run whose controller acts at every instant, on the true state."""
    time, states, ending = integrator.over(times, start)
    demand = loop.controller.torque(time, loop.packing.unpack(states))
    return StateTrajectory(time, states, demand, ending, integrator.effort)


def sampled(
    loop: ClosedLoop,
    integrator: Integrator,
    times: FloatArray,
    start: FloatArray,
    readings: Readings | None = None,
) -> StateTrajectory:
    """Integrate a run whose controller acts on measured positions at the times, and holds torques in between.

    Measured positions are the readings of sensors, or the true ones without `readings`.
    """

    def read(state: FloatArray, sample: int) -> Phase:
        truth = loop.packing.unpack(state)
        return truth if readings is None else readings.phase(truth, sample)

    measurement = RateFilter(read(start, 0))
    reached, states, ending = [times[:1]], [start[None]], None
    demands = [loop.controller.torque(float(times[0]), measurement.phase)]
    loop.hold(demands[0])
    for sample, interval in enumerate(np.stack((times[:-1], times[1:]), axis=1), 1):
        time, after, ending = integrator.over(interval, states[-1][-1])
        if time[-1] == time[0]:  # the budget was used up before the first step of the interval
            break
        reached.append(time[1:])
        states.append(after[1:])
        measurement.add(read(after[-1], sample), time[-1] - time[0])
        demands.append(integrator.equations.torques(float(time[-1]), loop.packing.joined(measurement.phase)))
        loop.hold(demands[-1])
        if ending is not None:
            break
    rows = (np.concatenate(reached), np.concatenate(states), np.array(demands)[: sum(map(len, reached))])
    return StateTrajectory(*rows, ending, integrator.effort, held=True)


class History(Block):
    """Variables of a simulation, (samples, joints[, 2]); see `SIMULATION_VARIABLES`.

    Variables that a joint does not have are NaN: motor 2 of an elastic joint, the stiffness of a rigid one.
    """

    declared = SIMULATION_VARIABLES


def history(
    robot: Robot,
    loop: ClosedLoop,
    integrated: StateTrajectory,
    first: float,
    readings: Readings | None = None,
) -> History:
    """Evaluate every variable along a run; `first` is the stamp of its time zero, s."""
    reference = loop.reference(integrated.time).of_joints
    commanded = {name: reference[name] for name in TRACKED}
    found = _simulated(loop, integrated)
    if robot.has(VARIABLES["dissipated_power"]):
        of_joints = (of_joint(found, index) for index in range(len(robot.joints)))
        found["dissipated_power"] = np.stack(list(map(dissipated_power, robot.joints, of_joints)), axis=1)
    chosen = np.isin(np.arange(len(robot.joints)), loop.plant.drivetrain.chosen)
    for name in ("stiffness", "dstiffness"):  # without a command, the reference is the actual value
        commanded[name] = np.where(chosen, commanded[name], found[name])
    demand = loop.plant.drivetrain.of_joints(integrated.demand)
    read: dict[str, FloatArray] = {}
    if readings is not None:
        states = loop.packing.unpack(integrated.states)
        read = readings.variables(states, loop.applied(integrated.demand))
    return History(
        time=first + integrated.time,
        **found,
        **{COMMANDS[name]: values for name, values in {**commanded, "tau_motor": demand}.items()},
        **{error(name): found[name] - commanded[name] for name in ERRORS},
        **read,
        flags=_flags(robot, {**found, "tau_motor": demand}, integrated.ending),
    )


def _simulated(loop: ClosedLoop, integrated: StateTrajectory) -> dict[str, FloatArray]:
    plant, drivetrain = loop.plant, loop.plant.drivetrain
    phase, torque = loop.packing.unpack(integrated.states), loop.applied(integrated.demand)
    ddq, _, friction = loop.response(integrated.time, phase, integrated.demand)
    phi, dphi = drivetrain.deflections(phase.q, phase.theta), drivetrain.deflections(phase.dq, phase.dtheta)
    springs = drivetrain.state(phase.q, phase.theta, phase.dq, phase.dtheta)
    passed_on = torque if friction is None else torque - friction
    dampers = plant.dampers.passed(loop.reference.damping(integrated.time), phase.dq, phase.dtheta)
    tau_e = plant.link_torque(phase.dq, ddq, add(springs.tau_e, dampers.links), passed_on)
    still, deflected = np.zeros_like(phase.q), drivetrain.deflected
    theta, dtheta = drivetrain.merged(phase.theta, phase.q), drivetrain.merged(phase.dtheta, phase.dq)
    tau_motor = drivetrain.of_joints(torque)
    found = {
        "q": phase.q,
        "dq": phase.dq,
        "ddq": ddq,
        "stiffness": np.where(drivetrain.rigid, np.nan, springs.stiffness),  # (11)
        "dstiffness": np.where(drivetrain.rigid, np.nan, springs.dstiffness),  # (18)
        "tau_e": tau_e,
        "phi": np.where(deflected, drivetrain.merged(phi, still), np.nan),
        "dphi": np.where(deflected, drivetrain.merged(dphi, still), np.nan),
        "theta": theta,
        "dtheta": dtheta,
        "tau_transmission": drivetrain.merged(springs.tau_transmission, tau_e),
        "tau_motor": tau_motor,
        "elastic_energy": drivetrain.energy(phase.q, phase.theta),
        "motor_power": tau_motor * dtheta,
        "motor_energy": _work(theta, tau_motor, held=integrated.held),
        "det_A": drivetrain.determinant(phase.q, phase.theta),
        **plant.dampers.variables(loop.reference.damping(integrated.time), phase.dq, phase.dtheta),
    }
    if drivetrain.windings is not None:
        electrical = drivetrain.windings.variables(torque, drivetrain.of_all(phase.dq, phase.dtheta))
        found |= {name: drivetrain.of_joints(values) for name, values in electrical.items()}
    return found


def _work(theta: FloatArray, torque: FloatArray, *, held: bool) -> FloatArray:
    """Return the work of motors up to each sample, (samples, ...), J; torques held or linear in between."""
    given = torque[:-1] if held else (torque[:-1] + torque[1:]) / 2
    return np.cumsum(np.concatenate((0 * torque[:1], given * np.diff(theta, axis=0))), axis=0)


def _flags(robot: Robot, values: dict[str, FloatArray], ending: Ending | None) -> FlagArray:
    """Return flags of exceeded limits, of actual values and commanded torques, and of an early end."""
    flags = np.zeros(values["q"].shape, dtype=FLAG_TYPE)
    for index, joint in enumerate(robot.joints):
        flags[:, index] = limit_flags(joint, of_joint(values, index), flags[:, index])
    if ending is not None and ending.joint is not None and ending.flag is not None:
        flags[-1, ending.joint] |= FLAG_TYPE(ending.flag)
    return flags
