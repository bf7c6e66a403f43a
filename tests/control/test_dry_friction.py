"""Motors that stick and slide: against a block solved by hand, and the limit of smooth friction."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from samples.plants import with_actuators
from samples.robots import vsa_3r
from samples.simulated import error_course, short_motion
from samples.single_joint import LINK_INERTIA, single_joint, step_of
from scipy.integrate import solve_ivp

from vsacli import (
    Elastic,
    FeedbackLinearization,
    Friction,
    Gains,
    InitialError,
    Integral,
    Motor,
    Rigid,
    Robot,
    State,
    Tolerances,
    inverse_dynamics,
    perturbed,
    simulate,
    state_derivative,
)
from vsacli.actuators.drivetrain import Rotors
from vsacli.actuators.friction import FrictionLaws
from vsacli.control.simulation.closed_loop import ClosedLoop, Phase
from vsacli.control.simulation.ending import Budget
from vsacli.control.simulation.integrator import Integrator
from vsacli.control.simulation.loop_equations import LoopEquations
from vsacli.control.simulation.stick_slip import StickSlip
from vsacli.control.simulation.tabulated import TabulatedReference
from vsacli.dynamics.forward import Plant

SHARP = Friction(coulomb=(3.0, 2.0), offset=0.5)
GAINS = Gains.from_poles([-20.0] * 4, [-20.0] * 2)
ROTOR = 0.5


def block(friction: Friction = SHARP) -> Robot:
    """A block of 1 kg on a rail, 0.5 kg of it the motor's."""
    motor = Motor(inertia=ROTOR, friction=friction)
    return single_joint(Rigid(motor=motor), "prismatic")


class Push:
    """Forces over time, whatever the motors do."""

    ending = None

    def __init__(self, force: Callable[[float], float], motors: int = 1) -> None:
        self._force, self._motors = force, motors

    def torque(self, time: float, _phase: Phase, _slip: np.ndarray | None = None) -> np.ndarray:
        return np.full(self._motors, self._force(time))

    def error_rates(self, _time: float, phase: Phase) -> Integral:
        return Integral(np.zeros_like(phase.q), np.zeros_like(phase.q))


def pushed(
    robot: Robot, force: Callable[[float], float], times: np.ndarray, dq: float = 0.0, q: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity of the joint of a robot whose only motor exerts a force."""
    loop = ClosedLoop(robot, Push(force), TabulatedReference(step_of(0.0, duration=float(times[-1]))))
    laws = loop.plant.drivetrain.friction
    assert laws is not None
    slides = StickSlip(loop, laws)
    springs = loop.plant.drivetrain.sprung.sum()
    start = loop.packing.pack(np.array([q]), np.array([dq]), np.full(springs, q), np.full(springs, dq))
    start = slides.start(0.0, start)
    equations = LoopEquations(loop, [], Budget(None, times))
    integrator = Integrator(equations, Tolerances(), lambda _: None, slides)
    reached, states = map(np.concatenate, zip(*integrator.integrate(times, start), strict=True))
    np.testing.assert_array_equal(reached, times)
    return states[:, 0], states[:, 1]


def test_a_block_stops_and_stays():
    mass, times = LINK_INERTIA + ROTOR, np.linspace(0, 2, 81)
    q, dq = pushed(block(), lambda _: 0.0, times, dq=3.0)
    braking = (2.0 + 0.5) / mass  # both the friction and its offset are against it
    stop = 3.0 / braking
    moving = np.minimum(times, stop)
    np.testing.assert_allclose(q, 3.0 * moving - braking * moving**2 / 2, rtol=0, atol=1e-12)
    assert (dq[times > stop + 1e-9] == 0).all()  # at rest, not nearly so


@pytest.mark.slow
def test_a_block_is_held_until_the_force_is_too_large_and_slides_back():
    """A force that swings by more than the friction to one side alone, by the event times of the law."""
    mass, times = LINK_INERTIA + ROTOR, np.linspace(0, 4, 401)

    def force(time: float) -> float:
        return 0.5 + 2.8 * float(np.sin(np.pi * time))

    q, dq = pushed(block(), force, times)
    loose = float(np.arcsin(2.0 / 2.8)) / np.pi  # 2.8 sin = 2
    assert (dq[times < loose] == 0).all()
    assert (q[times < loose] == 0).all()
    first = (times > loose) & (times < 0.7)
    elapsed = times[first]
    gained = 2.8 / np.pi * (np.cos(np.pi * loose) - np.cos(np.pi * elapsed)) - 2.0 * (elapsed - loose)
    np.testing.assert_allclose(dq[first], gained / mass, rtol=0, atol=1e-9)
    assert (dq >= 0).all()  # 2.8 - 3 does not push it back
    assert (np.diff(q)[(times[:-1] > 1.5) & (times[1:] < 2 + loose)] == 0).all()  # held in between
    assert q[-1] == pytest.approx(2 * q[200], rel=1e-9)  # the second swing is as the first


@pytest.mark.slow
def test_the_sharp_law_is_the_limit_of_smooth_ones():
    """An elastic joint that is pulled to and fro; smooth friction creeps where sharp friction holds."""
    times = np.linspace(0, 2, 201)

    def run(width: float) -> np.ndarray:
        friction = Friction(coulomb=(1.5, 1.5), width=width)
        motor = Motor(inertia=ROTOR, damping=0.2, friction=friction)
        robot = single_joint(Elastic(motor=motor, stiffness=60.0))
        if width == 0:
            return pushed(robot, lambda time: 4 * float(np.sin(4 * time)), times)[0]

        def rates(time: float, y: np.ndarray) -> list[float]:  # by another text
            q, dq, theta, dtheta = y
            spring = 60.0 * (theta - q)
            friction = 1.5 * np.tanh(dtheta / width)
            pull = 4 * np.sin(4 * time) - 0.2 * dtheta - spring - friction
            return [dq, spring / LINK_INERTIA, dtheta, pull / ROTOR]

        return solve_ivp(rates, (0, 2), np.zeros(4), "Radau", times, rtol=1e-8, atol=1e-10).y[0]

    sharp = run(0.0)
    errors = [np.abs(run(width) - sharp).max() for width in (1e-2, 1e-3, 1e-4)]
    assert errors[0] < 2e-2
    assert errors[1] < errors[0] / 4
    assert errors[2] < errors[1] / 4
    assert errors[2] < 2e-4


def with_friction(robot: Robot, friction: Friction) -> Robot:
    return robot.replace(
        "joints.*.actuator.motor.friction",
        {"coulomb": list(friction.coulomb), "offset": friction.offset, "width": friction.width},
    )


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize(
    "friction", [SHARP, Friction(coulomb=(3.0, 2.0), width=0.02)], ids=["sharp", "smooth"]
)
def test_feedforward_follows(friction):
    robot = with_friction(vsa_3r(), friction)
    trajectory = short_motion(3, duration=0.6, size=0.2, stiffness=(1100, 1200))
    simulation = simulate(robot, trajectory)
    assert simulation.report.verdict == "ok"
    past, commanded = simulation.history, inverse_dynamics(robot, trajectory)
    # without friction 1e-10; torques jump as the motors turn back, which they do to within a millisecond/1000
    np.testing.assert_allclose(past.q, past.q_ref, rtol=0, atol=1e-7)
    assert past.dissipated_power.min() > -2.0  # the offset pushes along
    for was, planned in zip(simulation.report.joints, commanded.report.joints, strict=True):
        assert was.energy.dissipated == pytest.approx(planned.energy.dissipated, rel=1e-3)  # trapezoids


@pytest.mark.slow
def test_feedback_compensates_what_moves():
    """Away from rest the errors are those of linear theory, whatever the friction."""
    trajectory = short_motion(3, duration=0.5, size=0.2, stiffness=(1100, 1200))
    error = InitialError(0.01)
    plain = simulate(vsa_3r(), trajectory, gains=GAINS, initial_error=error).history
    smooth = with_friction(vsa_3r(), Friction(coulomb=(3.0, 2.0), offset=0.5, width=0.05))
    past = simulate(smooth, trajectory, gains=GAINS, initial_error=error).history
    np.testing.assert_allclose(past.q_error, plain.q_error, rtol=0, atol=1e-8)


@pytest.mark.slow
def test_feedback_moves_a_block_only_if_the_error_demands_more_than_its_friction():
    """What slides is compensated, so that the error decays as without friction; what is held stays."""
    gains, poles, mass = Gains.from_poles([-20.0] * 2), [-20.0] * 2, LINK_INERTIA + ROTOR
    held, loose = 0.99 * 3.0 / (400 * mass), 1.01 * 3.0 / (400 * mass)  # 400 1/s^2 is the gain
    for start in (held, loose):
        past = simulate(block(), step_of(0.0), gains=gains, initial_error=InitialError(start)).history
        expected = start if start == held else error_course(poles, start, past.time)
        # the integration is good to 1e-9 of what moves
        np.testing.assert_allclose(past.q_error[:, 0], expected, rtol=0, atol=1e-10)
        assert (past.dq == 0).all() == (start == held)


@pytest.mark.slow
def test_feedback_lets_a_motor_stick_until_the_error_breaks_it_loose():
    robot = with_friction(vsa_3r(), SHARP)
    trajectory = short_motion(3, duration=0.5, size=0.2, stiffness=(1100, 1200))
    simulation = simulate(robot, trajectory, gains=GAINS)
    past = simulation.history
    held = past.dtheta[1:20] == 0
    assert held.any()
    assert np.abs(past.q_error).max() > 1e-5  # what sticks is late
    assert np.abs(past.q_error[-1]).max() < 0.02
    again = simulate(robot, trajectory, gains=GAINS, tolerances=Tolerances(1e-11, 1e-12)).history
    np.testing.assert_allclose(past.q, again.q, rtol=0, atol=1e-5)


@pytest.mark.slow
def test_held_torques_break_a_block_loose():
    """The controller acts at samples: what it asks for then may at once be more than friction can hold."""
    trajectory, gains = step_of(0.15, duration=0.5, rate=100), Gains.from_poles([-10.0] * 2)
    past = simulate(block(), trajectory, gains=gains, feedback="positions").history
    assert (past.dq[:5] == 0).all()  # 100 1/s^2 times the error are less than 2 N
    assert past.q[-1, 0] > 0.3  # of 0.35


@pytest.mark.slow
def test_measured_positions_and_another_model_run():
    robot = with_friction(vsa_3r(), SHARP)
    trajectory = short_motion(3, duration=0.3, size=0.1, rate=1000, stiffness=(1100, 1200))
    model = perturbed(robot, 0.02, 1)
    before, after = (each.joints[0].actuator.motor[0].friction for each in (robot, model))
    assert after.coulomb != before.coulomb
    assert after.coulomb[0] / before.coulomb[0] == pytest.approx(after.coulomb[1] / before.coulomb[1])
    report = simulate(robot, trajectory, gains=GAINS, model=model, feedback="positions").report
    assert report.complete


def test_what_rests_is_held_as_far_as_friction_goes():
    robot = block()
    rest = State(*(np.zeros(shape) for shape in ((5, 1), (5, 1), (5, 1, 2), (5, 1, 2))))
    force = np.zeros((5, 1, 2))
    force[:, 0, 0] = [-4.0, -2.4, 0.0, 2.4, 4.0]
    ddq = state_derivative(robot, rest, force).ddq[:, 0]
    np.testing.assert_allclose(ddq, [-1.5, 0, 0, 0, 1.5], atol=1e-15)  # -4 - 0.5 + 3, 4 - 0.5 - 2


def test_a_held_joint_leaves_the_others_free():
    """Of two rigid joints one is held: the other moves as if it were welded."""
    motors = [Motor(inertia=0.5, friction=Friction(coulomb=(50.0, 50.0))), Motor(inertia=0.3)]
    robot = with_actuators(
        vsa_3r(), {0: Rigid(motor=motors[0])} | dict.fromkeys((1, 2), Rigid(motor=motors[1]))
    )
    rng = np.random.default_rng(3)
    q, dq = rng.uniform(-1, 1, 3), np.array([0.0, 0.7, -0.4])
    state = State(q, dq, np.zeros((3, 2)), np.zeros((3, 2)))
    torque = np.zeros((3, 2))
    torque[:, 0] = [20.0, 30.0, 5.0]
    ddq = state_derivative(robot, state, torque).ddq
    assert ddq[0] == 0
    plant = Plant(robot)
    matrix = plant.links.mass_matrix(q) + np.diag([0.5, 0.3, 0.3])
    left = torque[:, 0] - plant.links.bias(q, dq, None)
    np.testing.assert_allclose(ddq[1:], np.linalg.solve(matrix[1:, 1:], left[1:]), rtol=1e-12)
    assert abs(left[0] - matrix[0] @ ddq) < 50  # what holds it is what friction can


def test_a_held_motor_beside_one_that_rides_on_it():
    rotors = Rotors([_Riding()])
    torques = np.array([3.0, 1.0])
    for held in ([False, False], [True, False], [False, True], [True, True]):
        accelerations, holding = rotors.accelerations_with_held(torques, np.array(held))
        matrix = np.array([[2.0, 0.4], [0.4, 0.5]])
        np.testing.assert_allclose(matrix @ accelerations + holding, torques, rtol=1e-14)
        assert (accelerations[held] == 0).all()
        assert (holding[np.invert(held)] == 0).all()


class _Riding:
    """Two motors with B_12."""

    motors = (Motor(inertia=2.0).at_joint, Motor(inertia=0.5).at_joint)
    coupled_rotors = 0.4


def test_the_law_of_feedback_takes_the_direction_that_it_is_told():
    robot = with_friction(vsa_3r(), SHARP)
    law = FeedbackLinearization(robot, GAINS)
    laws = law.plant.drivetrain.friction
    assert isinstance(laws, FrictionLaws)
    still = np.zeros(6)
    told = laws.torque(still, np.array([1, -1, 0, 0, np.nan, 1.0]))
    np.testing.assert_allclose(told, [2.5, -2.5, 0.5, 0.5, 0.5, 2.5])
