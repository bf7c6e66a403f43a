"""Every variable of a run, from the states it went through."""

from __future__ import annotations

import numpy as np

from vsacli.base.arrays import FlagArray, FloatArray, of_joint
from vsacli.base.simulation_variables import ERRORS, SIMULATION_VARIABLES, TRACKED, actual, error
from vsacli.base.variables import VARIABLES, Block
from vsacli.compute.vector import add
from vsacli.control.simulation.closed_loop import ClosedLoop
from vsacli.control.simulation.ending import Ending
from vsacli.control.simulation.sensors import Readings
from vsacli.control.simulation.state_trajectory import StateTrajectory
from vsacli.dynamics.limits import limit_flags
from vsacli.dynamics.losses import dissipated_power
from vsacli.robot.model import Robot


class History(Block):
    """What happened, (samples, joints[, 2]); see `SIMULATION_VARIABLES`.

    NaN where a joint does not have the variable: motor 2 of an elastic joint, the stiffness of a rigid one.
    """

    declared = SIMULATION_VARIABLES


def history(
    robot: Robot,
    loop: ClosedLoop,
    integrated: StateTrajectory,
    first: float,
    readings: Readings | None = None,
) -> History:
    """Evaluate every variable along a state trajectory; `first` is the stamp of its time zero, s."""
    reference = loop.reference(integrated.time).of_joints
    commanded = {name: reference[name] for name in TRACKED}
    found = _actual(loop, integrated)
    if robot.has(VARIABLES["dissipated_power"]):
        of_joints = (of_joint(found, index) for index in range(len(robot.joints)))
        found["dissipated_power"] = np.stack(list(map(dissipated_power, robot.joints, of_joints)), axis=1)
    chosen = np.isin(np.arange(len(robot.joints)), loop.plant.drivetrain.chosen)
    for name in ("stiffness", "dstiffness"):  # elsewhere there is none to command
        commanded[name] = np.where(chosen, commanded[name], found[name])
    demand = loop.plant.drivetrain.of_joints(integrated.demand)
    read: dict[str, FloatArray] = {}
    if readings is not None:
        states = loop.packing.unpack(integrated.states)
        read = readings.variables(states, loop.applied(integrated.demand))
    return History(
        time=first + integrated.time,
        **commanded,
        tau_motor=demand,
        **{actual(name): values for name, values in found.items()},
        **{error(name): found[name] - commanded[name] for name in ERRORS},
        **read,
        flags=_flags(robot, {**found, "tau_motor": demand}, integrated.ending),
    )


def _actual(loop: ClosedLoop, integrated: StateTrajectory) -> dict[str, FloatArray]:
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
        "tau_spring": drivetrain.merged(springs.tau_spring, tau_e),
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
    """Of motors up to each step, (samples, ...); the torque is held between steps, or linear."""
    given = torque[:-1] if held else (torque[:-1] + torque[1:]) / 2
    return np.cumsum(np.concatenate((0 * torque[:1], given * np.diff(theta, axis=0))), axis=0)


def _flags(robot: Robot, values: dict[str, FloatArray], ending: Ending | None) -> FlagArray:
    """Limits exceeded by what was, or was asked of the motors; at the last step, what ended the run."""
    flags = np.zeros(values["q"].shape, dtype=np.uint16)
    for index, joint in enumerate(robot.joints):
        flags[:, index] = limit_flags(joint, of_joint(values, index), flags[:, index])
    if ending is not None and ending.joint is not None and ending.flag is not None:
        flags[-1, ending.joint] |= np.uint16(ending.flag)
    return flags
