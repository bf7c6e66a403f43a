"""Dampers parallel to the springs: what moves inside, followed by models of their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy
from samples.driven_arm import ARM, DURATION, LINK, assert_follows, motion_of, robot_of
from samples.full_model import Drive, springs_of
from samples.marks import slow
from samples.mechanisms import DEVICES
from samples.moves import move

from vsacli import (
    Antagonistic,
    Damper,
    Elastic,
    Flag,
    Gains,
    InputError,
    Motor,
    Robot,
    Trajectory,
    inverse_dynamics,
    laws,
    simulate,
)
from vsacli.actuators.actuator import Actuator
from vsacli.actuators.damped_springs import DampedSprings
from vsacli.actuators.transmission import Command
from vsacli.analysis.run import Run
from vsacli.base.signals import DAMPING
from vsacli.dynamics.internal_motion import March, _CellSolution, _Peaks, internal_motions
from vsacli.trajectory.curves.sinusoids import Sinusoids

MOTOR = Motor(inertia=0.2, damping=0.1)
PARALLEL = Damper(location="transmission", range=(0, 10))
Ends = tuple[float, float]


def pair(q: Any, *theta: Any) -> Any:
    return sum(200 * (x - q) ** 2 + 500 * (x - q) ** 4 for x in theta)


CASES: dict[str, tuple[Actuator, Drive, Ends]] = {
    "antagonistic": (
        Antagonistic(motor=(MOTOR, MOTOR), spring=(laws.Cubic(k=400, k_c=2000),) * 2),
        Drive(np.diag([0.2, 0.2]), [0.1, 0.1], springs_of(pair, 2)),
        (900, 1200),
    ),
    "elastic": (
        Elastic(motor=MOTOR, stiffness=800),
        Drive(0.2, [0.1], springs_of(lambda q, theta: 400 * (theta - q) ** 2, 1)),
        (np.nan, np.nan),
    ),
    "awas": (DEVICES["awas"].actuator, DEVICES["awas"].drive, DEVICES["awas"].stiffness),
}
DAMPERS = {"antagonistic": 2, "elastic": 1, "awas": 1}
"""Motors that a spring lies behind."""


def over_time(start: float, end: float) -> Callable[[float], float]:
    """The polynomial of degree 7 from rest to rest, written out."""

    def damping(time: float) -> float:
        x = time / DURATION
        return start + (end - start) * x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3)

    return damping


def damped(name: str, damping: Ends) -> Drive:
    return replace(CASES[name][1], transmission_dampers=[over_time(*damping)] * DAMPERS[name])


def pendulum(name: str, damper: Damper = PARALLEL) -> Robot:
    return robot_of(LINK, [CASES[name][0]], [damper])


def swing(name: str, damping: Ends = (2, 8)) -> Trajectory:
    return motion_of([CASES[name][2]], [damping])


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("damping", [(2, 8), slow((8, 2)), slow((0.2, 0.1))])
def test_the_full_model_follows(name: str, damping: Ends) -> None:
    actuator, _, stiffness = CASES[name]
    result = assert_follows(LINK, [actuator], [damped(name, damping)], [stiffness], [PARALLEL], [damping])
    behind = np.nansum(result.dphi[:, 0, : DAMPERS[name]], axis=1)
    np.testing.assert_allclose(result.tau_damper[:, 0], result.damping[:, 0] * behind, rtol=1e-12, atol=1e-14)


@pytest.mark.slow
def test_springs_that_know_the_position_of_the_joint_follow() -> None:
    device = DEVICES["potential"]
    drive = replace(device.drive, transmission_dampers=[over_time(2, 8)])
    assert_follows(LINK, [device.actuator], [drive], [device.stiffness], [PARALLEL], [(2, 8)])


@pytest.mark.slow
def test_an_arm_of_damped_joints_follows() -> None:
    actuators, _, stiffness = zip(*CASES.values(), strict=True)
    damping = [(2, 5), (3, 3), (8, 2)]
    drives = [damped(name, each) for name, each in zip(CASES, damping, strict=True)]
    assert_follows(ARM, list(actuators), drives, list(stiffness), [PARALLEL] * 3, damping)


def test_motion_inside_by_a_potential() -> None:
    """w, w', the motors' accelerations and the slope of the motion inside, for a potential left open."""
    t, d = sympy.symbols("t d")
    phi, s = (sympy.Function(name)(t) for name in ("phi", "s"))
    energy = sympy.Function("U")(phi, s)
    torque, stiffness = energy.diff(phi), energy.diff(phi, 2)
    pivot = stiffness.diff(s)
    tau_l = torque + d * phi.diff(t)
    rate = stiffness.diff(t)
    slope = torque.diff(phi) - torque.diff(s) * stiffness.diff(phi) / pivot
    determinant = torque.diff(phi) * stiffness.diff(s) - torque.diff(s) * stiffness.diff(phi)
    assert sympy.simplify(slope - determinant / pivot) == 0
    assert sympy.simplify((tau_l - torque) / d - phi.diff(t)) == 0
    assert sympy.simplify((rate - stiffness.diff(phi) * phi.diff(t)) / pivot - s.diff(t)) == 0


def start_apart(name: str, apart: float, damping: float) -> tuple[np.ndarray, np.ndarray]:
    """The spread over time of two motions inside that start apart, while the joint stands still."""
    robot = pendulum(name)
    time = np.linspace(0, 0.02, 21)
    load, zero = np.full(1, 5.0), np.zeros(1)
    springs = DampedSprings(robot.joints[0].actuator)

    def demand(at: np.ndarray) -> Command:
        rows = np.ones_like(at)
        commanded = {"stiffness": 300 * rows, "dstiffness": 0 * rows, "ddstiffness": 0 * rows}
        commanded |= {"damping": damping * rows, "ddamping": 0 * rows, "dddamping": 0 * rows}
        return Command(0 * rows, 0 * rows, 0 * rows, load * rows, zero * rows, zero * rows, commanded)

    begin = springs.equilibrium(demand(time[:1]))
    away = springs.deflections_at_spread(springs.spread(begin) + apart, begin, demand(time[:1]))
    march = March(springs, demand)
    ways = [march.solve_cells(time[[0, -1]], start).phi for start in (begin, away)]
    assert all(way is not None for way in ways)
    return time, np.diff([springs.spread(way.at(time)) for way in ways if way], axis=0)[0]


def test_two_starts_approach_each_other_as_fast_as_the_slope_says() -> None:
    """AwAS: at (sigma^2 + 4 T^2)/(sigma d); near enough, what is quadratic in the distance is below 1e-5."""
    damping, sigma, torque = 5.0, 300.0, 5.0
    time, apart = start_apart("awas", 1e-6, damping)
    rate = -np.gradient(np.log(apart), time)[1:-1]
    np.testing.assert_allclose(rate, (sigma**2 + 4 * torque**2) / (sigma * damping), rtol=1e-4)


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_little_damping_tends_to_none(name: str) -> None:
    """Linearly in d, far from the start and its motion that dies away."""
    without = inverse_dynamics(pendulum(name), swing(name, (0, 0)))
    plain = inverse_dynamics(robot_of(LINK, [CASES[name][0]]), motion_of([CASES[name][2]]))
    np.testing.assert_array_equal(without.tau_motor, plain.tau_motor)  # zero takes the algebraic way
    gaps = []
    for damping in (4e-3, 2e-3, 1e-3):
        result = inverse_dynamics(pendulum(name), swing(name, (damping, damping)))
        assert result.report.self_check.passed
        gaps.append(np.nanmax(np.abs(result.phi - plain.phi)))
    np.testing.assert_allclose(np.divide(gaps[:-1], gaps[1:]), 2, rtol=0.02)  # what is quadratic in d


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", CASES)
def test_neither_blocks_nor_engine_decide(name: str) -> None:
    robot, trajectory = pendulum(name), swing(name)
    whole = inverse_dynamics(robot, trajectory)
    pieces = np.concatenate([block.tau_motor for block in Run(robot, trajectory, block_samples=7)])
    np.testing.assert_array_equal(pieces, whole.tau_motor)
    compiled = inverse_dynamics(robot, trajectory, engine="c")
    np.testing.assert_array_equal(compiled.flags, whole.flags)
    for variable in ("tau_motor", "theta", "ddtheta", "tau_damper", "dissipated_power"):
        values = getattr(whole, variable)
        atol = 1e-12 * np.nanmax(np.abs(values))
        np.testing.assert_allclose(getattr(compiled, variable), values, rtol=0, atol=atol)


@pytest.mark.parametrize("name", CASES)
def test_energy_closes(name: str) -> None:
    """Work of the motors against everything that has energy, and what dampers and damping take."""
    actuator, drive, _ = CASES[name]
    robot = robot_of(LINK, [actuator], [PARALLEL])
    result = inverse_dynamics(robot, swing(name))
    turning = LINK.masses[0] * LINK.centers[0] ** 2 + LINK.inertias[0]
    kinetic = turning * result.dq[:, 0] ** 2 / 2
    height = LINK.centers[0] * np.sin(result.q[:, 0])
    motors = np.atleast_2d(drive.inertia)
    dtheta = result.dtheta[:, 0, : len(motors)]
    rotors = np.einsum("si,ij,sj->s", dtheta, motors, dtheta) / 2
    held = kinetic + rotors + LINK.masses[0] * LINK.gravity * height + result.elastic_energy[:, 0]
    rates = np.nan_to_num(result.dphi[:, 0, : DAMPERS[name]])
    taken = result.damping[:, 0] * np.sum(rates**2, axis=1) + LINK.damping[0] * result.dq[:, 0] ** 2
    taken += np.sum(np.array(drive.damping) * dtheta**2, axis=1)
    np.testing.assert_allclose(result.dissipated_power[:, 0], taken, rtol=1e-12, atol=1e-14)
    energy = result.report.joints[0].energy
    work = energy.spent - energy.recovered
    assert energy.dissipated is not None
    assert abs(work - (held[-1] - held[0]) - energy.dissipated) < 1e-8 * work  # the quadrature's error
    assert energy.dissipated == pytest.approx(np.trapezoid(taken, result.time), rel=1e-6)


@pytest.mark.parametrize("name", ["antagonistic", slow("elastic"), slow("awas")])
def test_simulation_follows(name: str) -> None:
    robot, trajectory = pendulum(name), swing(name)
    past, expected = simulate(robot, trajectory).history, inverse_dynamics(robot, trajectory)
    assert np.abs(past.q_error).max() < 1e-8  # the integrator's tolerance
    np.testing.assert_allclose(past.tau_damper, expected.tau_damper, atol=1e-5)
    np.testing.assert_allclose(past.tau_e, expected.tau_e, atol=1e-5)


def test_it_starts_where_the_robot_says() -> None:
    damper = Damper(location="transmission", range=(0, 10), start=0.02)
    result = inverse_dynamics(pendulum("elastic", damper), swing("elastic"))
    assert result.phi[0, 0, 0] == pytest.approx(0.02, rel=1e-14)
    at_rest = inverse_dynamics(pendulum("elastic"), swing("elastic"))
    assert at_rest.phi[0, 0, 0] == pytest.approx(at_rest.tau_e[0, 0] / 800, rel=1e-14)
    assert result.report.self_check.passed
    np.testing.assert_allclose(result.phi[-1, 0], at_rest.phi[-1, 0], atol=1e-6)


@pytest.mark.slow
def test_beyond_the_largest_torque_it_is_unstable() -> None:
    """Sides that differ have a largest torque at a stiffness; it starts beyond, and comes back at once."""
    springs = laws.Cubic(k=30, k_c=100), laws.Cubic(k=30, k_c=900)
    actuator = Antagonistic(motor=(MOTOR, MOTOR), spring=springs)
    damper = Damper(location="transmission", range=(0, 10), start=0.3325)
    result = inverse_dynamics(robot_of(LINK, [actuator], [damper]), motion_of([(90, 90)], [(5, 5)]))
    phi = result.phi[0, 0]
    k_c = np.array([100, 900])
    sigma, zeta = 30 + 3 * k_c * phi**2, 6 * k_c * phi
    slope = (sigma[0] * zeta[1] - sigma[1] * zeta[0]) / (zeta[1] - zeta[0])
    assert slope < 0
    assert result.flags[0, 0] & Flag.INTERNAL_INSTABILITY
    assert not result.flags[100:].any()
    assert np.isfinite(result.tau_motor).all()  # what is singular is something else
    report = result.report
    assert report.verdict == "singular"
    assert 0 < report.joints[0].samples["singular"] < 100
    said = "the motion inside its damped transmission is unstable from t = 0.000 s on: its damper carries -"
    assert said in str(report)


def test_damping_may_not_vanish_on_the_way() -> None:
    message = (
        "the damping of joint_1 is 0 at t = 0.500 s; parallel to springs it must be positive all the time"
    )
    with pytest.raises(InputError, match=message):
        inverse_dynamics(pendulum("awas"), swing("awas", (2, 0)))


def waving(name: str, offset: float, sine: float) -> Trajectory:
    """The swing with a damping that goes up and down."""
    wave = Sinusoids(
        signal=DAMPING, span=(0.0, DURATION), cycles=1.3, offset=(offset,), sine=((sine,),), cosine=((0.0,),)
    )
    swinging = swing(name)
    commanded = {**swinging.commanded, DAMPING.key: wave}
    return Trajectory(swinging.times, swinging.position, commanded, name="waving")


def test_damping_may_not_touch_zero_between_the_times_that_are_looked_at() -> None:
    with pytest.raises(InputError, match=r"the damping of joint_1 is .* at t = 0\.288"):  # 3/4 of 0.5/1.3 s
        inverse_dynamics(pendulum("awas"), waving("awas", 1, 1))


@pytest.mark.parametrize(("offset", "sine"), [(1, 0.9), (100, 0), (1e6, 0), (0.01, 0)])
def test_little_much_and_changing_damping_pass_the_self_check(offset: float, sine: float) -> None:
    """What dies away at the start is resolved, and rates are had by the way that rounding spares."""
    pendular = pendulum("awas", Damper(location="transmission", range=(0, 1e9)))
    result = inverse_dynamics(pendular, waving("awas", offset, sine))
    check = result.report.self_check
    assert check.spring_residual < 1e-12
    assert check.ladder < check.ladder_bound == 1e-8  # springs held by 1e6 N m s/rad move by 1e-6 rad


@pytest.mark.parametrize("end", [0.2, 0.9])
def test_loads_that_begin_and_pass_zero_do_not_make_cells_small(end: float) -> None:
    """Without gravity the load is rounding at rest, and again where the motion begins to brake."""
    pendular = pendulum("awas", Damper(location="transmission", range=(0, 1)))
    light = replace(pendular.joints[0], damping=0.0)
    robot = replace(pendular, gravity=(0, 0, 0), joints=(light,))
    constant = {"stiffness": ([600.0],) * 2, "damping": ([0.001],) * 2}
    inside = internal_motions(robot, move(2.0, 200, ([0.2], [end]), degrees=(9, 3), **constant))
    assert not inside.stops
    assert len(inside.breakpoints) < 200


@pytest.mark.parametrize("turns", [0, slow(20)])
def test_positions_of_many_turns_do_not_make_cells_small(turns: int) -> None:
    """Deflections are differences of positions: nothing below their rounding is resolved by shorter cells."""
    commanded = {"stiffness": ([600.0], [800.0]), "damping": ([2.0], [10.0])}
    position = [800.0], [800.5 + 6 * turns]
    inside = internal_motions(pendulum("awas"), move(1.5, 200, position, degrees=(9, 5), **commanded))
    assert not inside.stops
    assert len(inside.breakpoints) < 50 + 10 * turns


def test_feedback_linearization_says_why_not() -> None:
    message = r"motors act on the third where a damper lies parallel to the springs \(joint_1\)"
    with pytest.raises(InputError, match=message):
        simulate(pendulum("awas"), swing("awas"), gains=Gains.from_poles([-20] * 4))


def test_motions_inside_go_as_far_as_the_trajectory() -> None:
    inside = internal_motions(pendulum("awas"), swing("awas"))
    assert inside.joints == (0,)
    assert not inside.stops
    assert np.isfinite(inside.at(np.linspace(0, DURATION, 9))[0].acceleration).all()


def test_simulation_knows_how_fast_it_settles() -> None:
    """Degree 7 begins with a jump of the snap: what moves inside settles within milliseconds."""
    trajectory = move(4.0, 100, ([-1.2], [0.3]), damping=([1.0], [2.0]))
    robot = pendulum("elastic")
    past, expected = simulate(robot, trajectory).history, inverse_dynamics(robot, trajectory)
    peak = np.nanmax(np.abs(expected.tau_motor))
    np.testing.assert_allclose(past.tau_motor_cmd, expected.tau_motor, rtol=0, atol=1e-9 * peak)
    assert np.abs(past.q_error).max() < 1e-8


class _Springs:
    """Springs with a stiffness of 1 that stay together."""

    def slope(self, phi, _q):
        return np.ones_like(phi)

    def spread(self, phi):
        return np.zeros(phi.shape[-1])


def test_last_coefficients_count_relative_to_the_largest_deflection():
    demand = Command(*np.ones((6, 1)), commanded={})
    peaks = _Peaks(_Springs(), demand, np.ones((2, 1)))
    found = _CellSolution(
        np.ones((2, 1)),
        np.zeros((2, 1)),
        torque=1.0,
        damping=0.0,
        time_constants=1.0,
        rounding=0.0,
        slope=1.0,
    )
    phi = np.array([[1e-3, 1e-4, 1e-7, 1e-8], [1e-3, 0, 0, 0]])
    assert peaks.share(phi, np.zeros((2, 2)), found) == pytest.approx(1e-4, rel=1e-15)
