"""Simulation of a robot under a controller along a trajectory, from the initial state to the report.

`simulate` integrates the full model (5) from a state of the inverse dynamics, with an optional initial error.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np

from vsacli.analysis.run import Run
from vsacli.analysis.tool_stiffness import ToolStiffness
from vsacli.analysis.trouble_text import undetermined_text
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError
from vsacli.base.progress import Tell, unheard
from vsacli.base.signals import WRENCH
from vsacli.base.variables import Block
from vsacli.control.gains import Gains
from vsacli.control.simulation.boundaries import boundaries
from vsacli.control.simulation.closed_loop import ClosedLoop, Feedforward, LinearizingFeedback
from vsacli.control.simulation.ending import Budget, Ending, Progress
from vsacli.control.simulation.history import (
    History,
    StateBlock,
    concatenate_histories,
    histories,
    integrate_continuous,
    integrate_sampled,
)
from vsacli.control.simulation.integrator import Integrator, Tolerances
from vsacli.control.simulation.joint_tracking import GoalTolerance
from vsacli.control.simulation.loop_equations import Computing, RecordedEquations
from vsacli.control.simulation.sensors import Readings, Sensors
from vsacli.control.simulation.simulation_report import SimulationReport, verdict_on
from vsacli.control.simulation.simulation_summary import Summary
from vsacli.control.simulation.start import InitialError, start_state, strange_errors
from vsacli.control.simulation.stick_slip import sliding
from vsacli.control.simulation.stiff import check_rounding
from vsacli.control.simulation.tabulated import TabulatedReference
from vsacli.dynamics.forward import State
from vsacli.dynamics.inverse import adapt_trajectory, compute_block
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

Feedback = Literal["state", "positions"]


@dataclass(frozen=True, repr=False)
class Simulation:
    """A simulation: variables, report, and the backend that computed it: `engine`, `compiler`, `threads`."""

    history: History
    report: SimulationReport
    provenance: Mapping[str, str]

    def __repr__(self) -> str:
        return f"Simulation of {self.report}"


PEAK_SAMPLES = 100
"""Samples that estimate the largest torque of a motion; an order of magnitude is enough."""

_AMPLIFICATION_WARNING = (
    "model and start are exact, so the run ends off target by errors of the integration, which this motion "
    "amplifies and nothing feeds back: with another --rtol it ends elsewhere"
)


class SimulationRun:
    """A simulation, block by block: iterate over its blocks once, then `report`.

    Args: as for `simulate`.

    Attributes:
        robot: true robot.
        trajectory: commanded motion.
        progress: function called with the time reached, s.

    Raises:
        InputError: see `simulate`.
    """

    def __init__(
        self,
        robot: Robot,
        trajectory: Trajectory,
        *,
        gains: Gains | None = None,
        model: Robot | None = None,
        initial_error: InitialError = InitialError(),
        feedback: Feedback = "state",
        sensors: Sensors | None = None,
        goal_tolerance: GoalTolerance = GoalTolerance(),
        tolerances: Tolerances = Tolerances(),
        budget: int | None = None,
        progress: Progress = lambda _: None,
        engine: str = "auto",
        runs: int = 1,
        tell: Tell = unheard,
    ) -> None:
        self.robot, self.trajectory = robot, adapt_trajectory(robot, trajectory)
        check_feedback(feedback, gains)
        self._gains, self._initial_error, self._feedback = gains, initial_error, feedback
        self._is_exact = gains is None and (model is None or model is robot) and initial_error.is_zero
        self._full_state_options: Any = {
            "gains": gains,
            "model": model,
            "initial_error": initial_error,
            "tolerances": tolerances,
            "budget": budget,
            "engine": engine,
            "runs": runs,
        }
        start_time, elapsed_trajectory = self.trajectory.start, self.trajectory.from_zero()
        loop = _closed_loop(robot, elapsed_trajectory, model or robot, gains)
        start = start_state(robot, elapsed_trajectory, initial_error)
        drivetrain = loop.plant.drivetrain
        readings = (
            None if sensors is None else Readings(sensors, robot, drivetrain, elapsed_trajectory.samples)
        )

        def report_time(time: float) -> None:
            self.progress(start_time + time)

        self.progress = progress
        computing = Computing(engine, tell, runs)
        self._integrator, blocks = _start_integration(
            robot,
            loop,
            elapsed_trajectory,
            start,
            feedback,
            readings,
            tolerances,
            budget,
            report_time,
            computing,
        )
        self._ending: Ending | None = None
        self._blocks = histories(robot, loop, self._keep_ending(blocks), start_time, readings)
        self._summary = Summary(robot, goal_tolerance, self.trajectory.times.span)
        frame = None if trajectory.wrench is None else trajectory.wrench.frame
        self._tools = ToolStiffness(robot, frame, stored=False) if robot.limited_tools else None

    def __iter__(self) -> Iterator[History]:
        """Integrate, and yield the variables of the run; a block is released before the next one."""
        for block in self._blocks:
            self._summary.add(block)
            if self._tools is not None:
                self._tools.add(self._tool_variables(block))
            yield block
            del block

    def _tool_variables(self, block: History) -> Block:
        """Return the simulated variables that determine the stiffness of tools, and the wrench."""
        wrench = self.trajectory.at(block.time).wrench
        acting = {} if wrench is None else {WRENCH.key: wrench.wrench}
        return Block(time=block.time, q=block.q, stiffness=block.stiffness, flags=block.flags, **acting)

    def _keep_ending(self, blocks: Iterable[StateBlock]) -> Iterator[StateBlock]:
        for block in blocks:
            self._ending = block.ending
            yield block

    @property
    def provenance(self) -> Mapping[str, str]:
        """Backend of the computation so far: `engine`, `compiler`, `threads`."""
        return self._integrator.effort.provenance

    def report(self) -> SimulationReport:
        """Return the report on the run, after its last block.

        If positions are measured, the same run with the full state is simulated for comparison.
        """
        full = self._full_state_report() if self._feedback == "positions" else None
        joints = self._summary.joints()
        effort, ending = self._integrator.effort, self._ending
        tools = () if self._tools is None else self._tools.reports()
        verdict = verdict_on(self._summary.flags, joints, tools, ending)
        robot, trajectory = self.robot, self.trajectory
        return SimulationReport(
            robot=robot.name,
            trajectory=trajectory.name,
            controller="feedforward" if self._gains is None else "feedback-linearization",
            samples=self._summary.samples,
            duration=trajectory.duration,
            verdict=verdict,
            ending=None if ending is None else ending.as_sentence(robot.joint_names, trajectory.start),
            evaluations=effort.evaluations,
            budget=effort.budget,
            methods=tuple(
                replace(method, start=trajectory.start + method.start) for method in effort.methods
            ),
            warnings=(
                *(*robot.warnings, *trajectory.warnings),
                *strange_errors(robot, self._initial_error),
                *_undetermined_warnings(robot, trajectory),
                *([_AMPLIFICATION_WARNING] if self._is_exact and verdict == "off_target" else []),
                *(self._summary.unsettled_warnings(joints) if ending is None else []),
                *(self._summary.stiffness_warnings() if ending is None else []),
                *([f"the same run with the full state: {full.ending}"] if full and full.ending else []),
            ),
            notes=(*trajectory.notes, *([] if self._gains is None else _unlimited_torque_notes(robot))),
            joints=joints,
            with_full_state=tuple(joint.q for joint in full.joints) if full else (),
            tools=tools,
        )

    def _full_state_report(self) -> SimulationReport:
        run = SimulationRun(self.robot, self.trajectory, **self._full_state_options)
        deque(run, maxlen=0)
        return run.report()


def simulate(
    robot: Robot,
    trajectory: Trajectory,
    *,
    gains: Gains | None = None,
    model: Robot | None = None,
    initial_error: InitialError = InitialError(),
    feedback: Feedback = "state",
    sensors: Sensors | None = None,
    goal_tolerance: GoalTolerance = GoalTolerance(),
    tolerances: Tolerances = Tolerances(),
    budget: int | None = None,
    progress: Progress = lambda _: None,
    engine: str = "auto",
    runs: int = 1,
    tell: Tell = unheard,
) -> Simulation:
    """Integrate the full model (5) of a robot under a controller.

    Args:
        robot: true robot.
        trajectory: commanded motion; its wrench acts on the robot, and the controller knows it.
        gains: gains of feedback linearization; None for feedforward of the inverse dynamics' torques.
        model: robot as the controller knows it, e.g. from `perturbed`; None for the true robot.
        initial_error: difference of the initial state from the command.
        feedback: measurement of the controller: the full "state" at every instant, or the "positions" of
            joints and motors at the samples of the trajectory, between which it holds its torques.
        sensors: accuracy of measured positions and torques. None records no measurements, and a controller
            that measures positions has exact ones.
        goal_tolerance: largest position error of the joints at the end of the run.
        tolerances: tolerances of the integration.
        budget: number of evaluations of the equations of motion after which a run ends, incomplete; by
            default 200,000, or 100 per sample of the trajectory if that is more.
        progress: function called with the time reached, s.
        engine: backend of the equations of motion: "numpy", "c", or "auto", which compiles if that saves
            time.
        runs: number of runs planned, of robots that differ only in parameters; they share the compiled code,
            so compiling pays off sooner.
        tell: function called with problems of compiled code, and announcements of long work.

    Raises:
        InputError: the trajectory is not for the robot; the initial state does not exist; positions are
            measured without gains; gains do not fit; a robot under feedback linearization mixes rigid joints
            with others; the mass matrix is not positive definite; double precision does not resolve very
            stiff springs or fast poles; the budget is below 1; an encoder is at a prismatic joint without
            limits; the engine is unknown, or cannot compute the run.
        TypeError: robot or trajectory is of another type.
    """
    run = SimulationRun(
        robot,
        trajectory,
        gains=gains,
        model=model,
        initial_error=initial_error,
        feedback=feedback,
        sensors=sensors,
        goal_tolerance=goal_tolerance,
        tolerances=tolerances,
        budget=budget,
        progress=progress,
        engine=engine,
        runs=runs,
        tell=tell,
    )
    past = concatenate_histories(list(run))
    return Simulation(past, run.report(), run.provenance)


def check_feedback(feedback: Feedback, gains: Gains | None) -> None:
    """Raise an error for feedback that the controller cannot use.

    Raises:
        InputError: the measurement is unknown, or positions are measured without feedback.
    """
    if feedback not in (choices := get_args(Feedback)):
        raise InputError.one(f"unknown feedback {feedback!r}{did_you_mean(feedback, choices)}")
    if gains is None and feedback == "positions":
        raise InputError.one(
            "positions as feedback need the controller feedback-linearization; feedforward uses no "
            "measurements"
        )


def _undetermined_warnings(robot: Robot, trajectory: Trajectory) -> Iterator[str]:
    """Yield warnings about joints whose command a recorded motion leaves undetermined: unreliable runs."""
    if trajectory.estimates:
        run = Run(robot, trajectory)
        deque(run, maxlen=0)
        for joint in run.findings().joints:
            if joint.uncertainty is not None:
                yield from (
                    f"{joint.name}: {undetermined_text(quantity)}"
                    for quantity in joint.uncertainty.undetermined
                )


def _unlimited_torque_notes(robot: Robot) -> Iterator[str]:
    """Yield a note if no motor torque is limited: feedback then requires torques that no motor has."""
    motors = [motor for joint in robot.joints for motor in joint.actuator.motors]
    if all(math.isinf(motor.max_torque) for motor in motors):
        yield "no motor has max_torque, so that its torque is unlimited"


def _closed_loop(robot: Robot, trajectory: Trajectory, model: Robot, gains: Gains | None) -> ClosedLoop:
    reference = TabulatedReference(trajectory)
    if gains is None:
        return ClosedLoop(robot, Feedforward(model, trajectory), reference)
    return ClosedLoop(robot, LinearizingFeedback(model, reference, gains), reference)


def _peak_torque(robot: Robot, trajectory: Trajectory) -> float:
    """Return the largest motor torque at `PEAK_SAMPLES` samples of a trajectory, N m (N)."""
    motion = trajectory.at(np.linspace(*trajectory.times.span, PEAK_SAMPLES))
    return float(np.nanmax(np.abs(compute_block(robot, motion).tau_motor)))


def _start_integration(
    robot: Robot,
    loop: ClosedLoop,
    trajectory: Trajectory,
    start: State,
    feedback: Feedback,
    readings: Readings | None,
    tolerances: Tolerances,
    limit: int | None,
    progress: Progress,
    computing: Computing,
) -> tuple[Integrator, Iterator[StateBlock]]:
    """Return an integrator, and the blocks of its run, until torques or springs are undefined."""
    controller_end = loop.controller.ending
    times = trajectory.times.block(0, trajectory.samples)
    if controller_end is not None and controller_end.time <= times[0]:
        raise InputError.one(
            "the controller's model cannot execute the start of the trajectory; choose smaller model errors"
        )
    vector = loop.packing.pack(*loop.plant.unpack_state(start))
    stick_slip = sliding(loop)
    if stick_slip is not None:
        vector = stick_slip.start(float(times[0]), vector)
    check_rounding(robot, loop, vector, float(times[0]), _peak_torque(robot, trajectory))
    times_to_end = times if controller_end is None else times[times <= controller_end.time]
    budget = Budget(limit, times_to_end)
    run_boundaries = list(boundaries(loop, vector))
    equations = RecordedEquations(loop, run_boundaries, budget, computing)
    integrator = Integrator(equations, tolerances, progress, stick_slip)
    if feedback == "state":
        return integrator, integrate_continuous(loop, integrator, times_to_end, vector)
    return integrator, integrate_sampled(loop, integrator, times_to_end, vector, readings)
