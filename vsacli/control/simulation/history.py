"""The history of a run in blocks: integration to state vectors, and every variable evaluated from them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vsacli.actuators.transmission import JointVariables
from vsacli.base.arrays import FLAG_TYPE, FlagArray, FloatArray, of_joint
from vsacli.base.simulation_variables import COMMANDS, ERRORS, SIMULATION_VARIABLES, TRACKED, error
from vsacli.base.variables import VARIABLES, Block
from vsacli.compute.vector import add
from vsacli.control.simulation.closed_loop import ClosedLoop, Phase
from vsacli.control.simulation.ending import Ending
from vsacli.control.simulation.integrator import Integrator
from vsacli.control.simulation.sensors import Readings
from vsacli.control.simulation.stepping import Pieces, StateSamples
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

    def add(self, measured: Phase, elapsed: float) -> None:
        """Add a sample of the positions, `elapsed` seconds after the previous one."""
        retention = math.exp(-2 * math.pi * CUTOFF)
        dq, dtheta = (
            retention * rate + (1 - retention) * (position - previous) / elapsed
            for rate, position, previous in (
                (self.phase.dq, measured.q, self.phase.q),
                (self.phase.dtheta, measured.theta, self.phase.theta),
            )
        )
        self.phase = measured._replace(dq=dq, dtheta=dtheta)


BLOCK_SAMPLES = 2048
"""Samples whose variables are evaluated at a time: 15 MB of an arm of seven joints, in 30 ms."""


class StateBlock(NamedTuple):
    """Consecutive samples of a run: times (samples,), states (samples, entries), commanded torques.

    Torques, (samples, motors), are constant between samples if `held`. The early end of a run, if there is
    one, is in its last block.
    """

    time: FloatArray
    states: FloatArray
    demand: FloatArray
    ending: Ending | None = None
    held: bool = False


def integrate_continuous(
    loop: ClosedLoop, integrator: Integrator, times: FloatArray, start: FloatArray
) -> Iterator[StateBlock]:
    """Integrate a run whose controller acts at every instant, on the true state; yield its blocks."""
    for (time, states), ending in _collect_blocks(integrator.integrate(times, start), loop.controller.ending):
        yield StateBlock(time, states, loop.controller.torque(time, loop.packing.unpack(states)), ending)


def integrate_sampled(
    loop: ClosedLoop,
    integrator: Integrator,
    times: FloatArray,
    start: FloatArray,
    readings: Readings | None = None,
) -> Iterator[StateBlock]:
    """Integrate a run whose controller acts on measured positions at the times, and holds torques in between.

    Measured positions are the readings of sensors, or the true ones without `readings`. Yields the blocks of
    the run.
    """
    demands: list[FloatArray] = []
    pieces = _integrate_intervals(loop, integrator, times, start, readings, demands)
    for (time, states), ending in _collect_blocks(pieces, loop.controller.ending):
        demand = np.array(demands[: len(time)])
        del demands[: len(time)]
        yield StateBlock(time, states, demand, ending, held=True)


def _integrate_intervals(
    loop: ClosedLoop,
    integrator: Integrator,
    times: FloatArray,
    start: FloatArray,
    readings: Readings | None,
    demands: list[FloatArray],
) -> Pieces:
    """Integrate interval by interval; append the torques of each sample to `demands` before it is yielded."""

    def read_phase(state: FloatArray, sample: int) -> Phase:
        truth = loop.packing.unpack(state)
        return truth if readings is None else readings.phase(truth, sample)

    filtered = RateFilter(read_phase(start, 0))
    demands.append(loop.controller.torque(float(times[0]), filtered.phase))
    loop.hold(demands[-1])
    yield StateSamples(times[:1], start[None])
    state, ending = start, None
    for sample, interval in enumerate(np.stack((times[:-1], times[1:]), axis=1), 1):
        (time, states), ending = _collect_samples(integrator.integrate(interval, state))
        if time[-1] == time[0]:  # the budget was used up before the first step of the interval
            break
        state = states[-1]
        filtered.add(read_phase(state, sample), time[-1] - time[0])
        torques = integrator.equations.torques(float(time[-1]), loop.packing.pack_phase(filtered.phase))
        demands += [torques] * (len(time) - 1)
        loop.hold(torques)
        yield StateSamples(time[1:], states[1:])
        if ending is not None:
            break
    return ending


def _collect_blocks(
    pieces: Pieces, controller_end: Ending | None
) -> Iterator[tuple[StateSamples, Ending | None]]:
    """Yield a run in blocks of at least `BLOCK_SAMPLES` samples, except the last one, which has the end.

    Without one, it has the end of the controller's torques, `controller_end`.
    """
    collected: list[StateSamples] = []
    count = 0
    while True:
        try:
            piece = next(pieces)
        except StopIteration as finished:
            yield _concatenate_pieces(collected), controller_end if finished.value is None else finished.value
            return
        if count >= BLOCK_SAMPLES:
            yield _concatenate_pieces(collected), None
            collected, count = [], 0
        collected.append(piece)
        count += len(piece.time)


def _collect_samples(pieces: Pieces) -> tuple[StateSamples, Ending | None]:
    """Return all samples of a short run, and its early end."""
    collected: list[StateSamples] = []
    while True:
        try:
            collected.append(next(pieces))
        except StopIteration as finished:
            return _concatenate_pieces(collected), finished.value


def _concatenate_pieces(pieces: Sequence[StateSamples]) -> StateSamples:
    return StateSamples(*map(np.concatenate, zip(*pieces, strict=True)))


class History(Block):
    """Variables of a simulation, (samples, joints[, 2]); see `SIMULATION_VARIABLES`.

    Variables that a joint does not have are NaN: motor 2 of an elastic joint, the stiffness of a rigid one.
    """

    declared = SIMULATION_VARIABLES


def concatenate_histories(blocks: Sequence[History]) -> History:
    """Return the variables of consecutive blocks of a run."""
    arrays = [block.arrays() for block in blocks]
    names = list(arrays[0])
    return History(
        **{name: np.concatenate([block_arrays.pop(name) for block_arrays in arrays]) for name in names}
    )


def histories(
    robot: Robot,
    loop: ClosedLoop,
    blocks: Iterable[StateBlock],
    first: float,
    readings: Readings | None = None,
) -> Iterator[History]:
    """Evaluate every variable along a run, block by block; `first` is the stamp of its time zero, s."""
    work = _MotorWork()
    for integrated in blocks:
        yield _history_block(robot, loop, integrated, first, readings, work)


def _history_block(
    robot: Robot,
    loop: ClosedLoop,
    state_block: StateBlock,
    first: float,
    readings: Readings | None,
    work: _MotorWork,
) -> History:
    reference = loop.reference(state_block.time).of_joints
    references = {name: reference[name] for name in TRACKED}
    variables = _simulated_variables(loop, state_block, work)
    if robot.has_variable(VARIABLES["dissipated_power"]):
        variables_of_joints = (
            JointVariables.of(of_joint(variables, index)) for index in range(len(robot.joints))
        )
        variables["dissipated_power"] = np.stack(
            list(map(dissipated_power, robot.joints, variables_of_joints)), axis=1
        )
    has_commanded_stiffness = np.isin(np.arange(len(robot.joints)), loop.plant.drivetrain.chosen)
    for name in ("stiffness", "dstiffness"):  # without a command, the reference is the actual value
        references[name] = np.where(has_commanded_stiffness, references[name], variables[name])
    demand = loop.plant.drivetrain.of_joints(state_block.demand)
    measured: dict[str, FloatArray] = {}
    if readings is not None:
        states = loop.packing.unpack(state_block.states)
        measured = readings.variables(states, loop.plant.drivetrain.limited(state_block.demand))
    return History(
        time=first + state_block.time,
        **variables,
        **{COMMANDS[name]: values for name, values in {**references, "tau_motor": demand}.items()},
        **{error(name): variables[name] - references[name] for name in ERRORS},
        **measured,
        flags=_history_flags(robot, {**variables, "tau_motor": demand}, state_block.ending),
    )


def _simulated_variables(
    loop: ClosedLoop, state_block: StateBlock, work: _MotorWork
) -> dict[str, FloatArray]:
    plant, drivetrain = loop.plant, loop.plant.drivetrain
    phase, torque = loop.packing.unpack(state_block.states), loop.plant.drivetrain.limited(state_block.demand)
    ddq, _, friction = loop.response(state_block.time, phase, state_block.demand)
    springs = drivetrain.state(phase.q, phase.theta, phase.dq, phase.dtheta)
    transmitted_torque = torque if friction is None else torque - friction
    dampers = plant.dampers.parallel_torques(loop.reference.damping(state_block.time), phase.dq, phase.dtheta)
    tau_e = plant.link_torque(phase.dq, ddq, add(springs.tau_e, dampers.links), transmitted_torque)
    deflected = drivetrain.deflected
    theta, dtheta = (
        drivetrain.of_motors_by_joint(phase.theta, phase.q),
        drivetrain.of_motors_by_joint(phase.dtheta, phase.dq),
    )
    tau_motor = drivetrain.of_joints(torque)
    variables = {
        "q": phase.q,
        "dq": phase.dq,
        "ddq": ddq,
        "stiffness": np.where(drivetrain.rigid, np.nan, springs.stiffness),  # (11)
        "dstiffness": np.where(drivetrain.rigid, np.nan, springs.dstiffness),  # (18)
        "tau_e": tau_e,
        "phi": np.where(deflected, theta - phase.q[..., None], np.nan),
        "dphi": np.where(deflected, dtheta - phase.dq[..., None], np.nan),
        "theta": theta,
        "dtheta": dtheta,
        "tau_transmission": drivetrain.of_motors_by_joint(springs.tau_transmission, tau_e),
        "tau_motor": tau_motor,
        "elastic_energy": drivetrain.energy(phase.q, phase.theta),
        "motor_power": tau_motor * dtheta,
        "motor_energy": work.add_samples(theta, tau_motor, held=state_block.held),
        "det_A": drivetrain.determinant(phase.q, phase.theta),
        **plant.dampers.variables(loop.reference.damping(state_block.time), phase.dq, phase.dtheta),
    }
    if drivetrain.windings is not None:
        electrical = drivetrain.windings.variables(torque, drivetrain.of_all_motors(phase.dq, phase.dtheta))
        variables |= {name: drivetrain.of_joints(values) for name, values in electrical.items()}
    return variables


class _MotorWork:
    """Work of motors along a run; rounding does not depend on its blocks."""

    def __init__(self) -> None:
        self._last_sample: tuple[FloatArray, ...] = ()

    def add_samples(self, theta: FloatArray, torque: FloatArray, *, held: bool) -> FloatArray:
        """Return the work up to each sample of the next block, (samples, ...), J.

        Torques are held from sample to sample, or linear in between.
        """
        initial_work = 0 * torque[:1]
        if self._last_sample:
            *last_values, initial_work = self._last_sample
            theta, torque = map(np.concatenate, zip(last_values, (theta, torque), strict=True))
        mean_torque = torque[:-1] if held else (torque[:-1] + torque[1:]) / 2
        work = np.cumsum(np.concatenate((initial_work, mean_torque * np.diff(theta, axis=0))), axis=0)
        new_work = work[1:] if self._last_sample else work
        self._last_sample = (theta[-1:].copy(), torque[-1:].copy(), work[-1:].copy())
        return new_work


def _history_flags(robot: Robot, values: dict[str, FloatArray], ending: Ending | None) -> FlagArray:
    """Return flags of exceeded limits, of actual values and commanded torques, and of an early end."""
    flags = np.zeros(values["q"].shape, dtype=FLAG_TYPE)
    for index, joint in enumerate(robot.joints):
        flags[:, index] = limit_flags(joint, of_joint(values, index), flags[:, index])
    if ending is not None and ending.joint is not None and ending.flag is not None:
        flags[-1, ending.joint] |= FLAG_TYPE(ending.flag)
    return flags
