"""Simulation of a robot that is to follow a trajectory."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

from vsacli.base.errors import InputError
from vsacli.control.gains import Gains
from vsacli.control.simulation.boundaries import boundaries
from vsacli.control.simulation.closed_loop import ClosedLoop
from vsacli.control.simulation.controllers import Feedforward, LinearizingFeedback
from vsacli.control.simulation.history import History, history
from vsacli.control.simulation.integrator import Course, Integrator, Progress, Tolerances, continuous, sampled
from vsacli.control.simulation.reference import Reference
from vsacli.control.simulation.simulation_report import (
    Deviation,
    SimulationReport,
    joint_trackings,
    verdict_on,
)
from vsacli.control.simulation.start import InitialError, start_state
from vsacli.dynamics.forward import State
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

Measured = Literal["state", "positions"]


@dataclass(frozen=True)
class Setup:
    """Under which conditions a robot is simulated.

    Attributes:
        gains: of feedback linearization; None applies the torques of the inverse dynamics (feedforward).
        model: what the controller takes the robot for; the robot itself if None.
        initial_error: by how much the start differs from the command.
        measured: what the controller knows: the full state at every instant, or the positions of joints and
            motors at the steps of the trajectory, between which it holds its torques.
        tolerances: of the integration.
    """

    gains: Gains | None = None
    model: Robot | None = None
    initial_error: InitialError = field(default_factory=InitialError)
    measured: Measured = "state"
    tolerances: Tolerances = field(default_factory=Tolerances)

    def __post_init__(self) -> None:
        if self.gains is None and self.measured == "positions":
            raise InputError.one(
                "feedforward measures nothing: measured positions need the controller feedback-linearization"
            )

    @property
    def controller(self) -> str:
        """The controller, as the command line calls it."""
        return "feedforward" if self.gains is None else "feedback-linearization"


@dataclass(frozen=True)
class Simulation:
    """What happened, and the report on it."""

    history: History
    report: SimulationReport


def simulate(
    robot: Robot, trajectory: Trajectory, setup: Setup | None = None, progress: Progress | None = None
) -> Simulation:
    """Integrate the full model (5) of a robot under a controller.

    Args:
        robot: the robot as it is.
        trajectory: what it is to do; its wrench acts on the robot, and the controller knows it.
        setup: controller, errors and tolerances; feedforward from the exact state by default.
        progress: called with the time reached, s.

    Raises:
        InputError: a start that cannot be had, gains that do not fit, feedback linearization of a robot that
            mixes rigid joints with others, a mass matrix that is not positive definite.
    """
    setup = setup or Setup()
    loop = _closed_loop(robot, trajectory, setup)
    start = start_state(robot, trajectory, setup.initial_error)
    course = _course(loop, trajectory, start, setup, progress or (lambda _: None))
    past = history(robot, loop, course)
    report = SimulationReport(
        robot=robot.name,
        trajectory=trajectory.name,
        controller=setup.controller,
        samples=len(past.time),
        duration=trajectory.duration,
        verdict=verdict_on(past, complete=course.ending is None),
        ending=None if course.ending is None else course.ending.described(robot.joint_names),
        evaluations=course.evaluations,
        warnings=(*robot.warnings, *trajectory.warnings),
        notes=trajectory.notes,
        joints=joint_trackings(robot, past),
        with_full_state=_with_full_state(robot, trajectory, setup),
    )
    return Simulation(past, report)


def _closed_loop(robot: Robot, trajectory: Trajectory, setup: Setup) -> ClosedLoop:
    reference = Reference(trajectory)
    model = setup.model or robot
    if setup.gains is None:
        return ClosedLoop(robot, Feedforward(model, trajectory), reference)
    return ClosedLoop(robot, LinearizingFeedback(model, reference, setup.gains), reference)


def _course(
    loop: ClosedLoop, trajectory: Trajectory, start: State, setup: Setup, progress: Progress
) -> Course:
    """Integrate as far as the controller has torques and the springs obey their laws."""
    last = loop.controller.ending
    times = trajectory.times.block(0, trajectory.samples)
    if last is not None and last.time <= times[0]:
        raise InputError.one("the controller's model cannot execute the start of the trajectory")
    vector = loop.packing.pack(*loop.plant.unpacked(start))
    integrator = Integrator(list(boundaries(loop, vector)), setup.tolerances, progress)
    integrate = continuous if setup.measured == "state" else sampled
    course = integrate(loop, integrator, times if last is None else times[times <= last.time], vector)
    return course if course.ending is not None else course._replace(ending=last)


def _with_full_state(robot: Robot, trajectory: Trajectory, setup: Setup) -> tuple[Deviation, ...]:
    """Deviations of q in the same run when the controller knows the full state, if it does not."""
    if setup.measured == "state":
        return ()
    ideal = simulate(robot, trajectory, replace(setup, measured="state"))
    return tuple(joint.q for joint in ideal.report.joints)
