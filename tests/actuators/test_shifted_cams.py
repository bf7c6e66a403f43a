"""Cams that motor 2 turns against each other: as the pair of springs that they are, and as a device."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from samples.driven_arm import ARM, LINK, assert_follows, motion_of, robot_of
from samples.full_model import Drive, PlanarArm, springs_of
from samples.law_energies import SAMPLES
from samples.springs import SPRINGS, measured

from vsacli import Antagonistic, Flag, InputError, Motor, Serial, inverse_dynamics, laws, mechanisms, simulate

HEAVY = PlanarArm(lengths=[0.4], masses=[6.0], centers=[0.25], inertias=[0.12], damping=[0.2])
"""A pendulum that turns both cams by different angles."""

MOTORS = (Motor(inertia=0.2, damping=0.1), Motor(inertia=0.02, damping=0.05))


def serial(first: str, second: str, branch: str = "positive") -> Serial:
    cams = mechanisms.ShiftedCams(spring=(SAMPLES[first].law, SAMPLES[second].law), branch=branch)
    return Serial(motor=MOTORS, mechanism=cams)


def drive_of(first: str, second: str) -> Drive:
    """A tendon on side 2 pulls the other way, so that its energy counts from there."""
    one, two = SAMPLES[first].energy, SAMPLES[second].energy
    turned = -1 if SAMPLES[second].law.pulls_only else 1
    return Drive(
        np.diag([0.2, 0.02]),
        [0.1, 0.05],
        springs_of(lambda q, x, s: one(x - q + s) + two(turned * (x - q - s)), 2),
    )


@pytest.mark.parametrize(
    ("first", "second", "branch", "stiffness"),
    [
        ("cubic", "sinh", "positive", (290, 340)),
        ("table", "polynomial", "negative", (290, 340)),
        ("exponential", "exponential", "positive", (170, 220)),
    ],
)
def test_unlike_cams_and_tendons_drive_the_full_model(
    first: str, second: str, branch: str, stiffness: tuple[float, float]
) -> None:
    assert_follows(LINK, [serial(first, second, branch)], [drive_of(first, second)], [stiffness])


@pytest.mark.slow
def test_an_arm_with_a_pair_and_cams_follows() -> None:
    pair = Antagonistic(motor=(MOTORS[0],) * 2, spring=(SAMPLES["cubic"].law,) * 2)
    energy = SAMPLES["cubic"].energy
    of_pair = Drive(
        np.diag([0.2, 0.2]), [0.1, 0.1], springs_of(lambda q, x, y: energy(x - q) + energy(y - q), 2)
    )
    cams, drive = serial("cubic", "sinh"), drive_of("cubic", "sinh")
    assert_follows(ARM, [cams, pair, cams], [drive, of_pair, drive], [(290, 340)] * 3)


@pytest.mark.parametrize("branch", ["positive", "negative"])
@pytest.mark.parametrize("law", ["cubic", "sinh", "table", "four_bar"])
def test_the_solution_is_that_of_the_pair(law: str, branch: str) -> None:
    spring = SPRINGS[law][0][0], SPRINGS[law][1][0]
    pair = Antagonistic(motor=(MOTORS[0],) * 2, spring=spring, branch=branch)
    cams = Serial(motor=MOTORS, mechanism=mechanisms.ShiftedCams(spring=spring, branch=branch))
    rng = np.random.default_rng(3)
    tau_e, stiffness, q = rng.uniform(-4, 4, 200), rng.uniform(20, 200, 200), rng.uniform(-2, 2, 200)
    one, other = (each.solve(tau_e, stiffness, q) for each in (pair, cams))
    for name in ("lower", "upper", "lower_critical", "upper_critical", "slack_below"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    phi, s = other.deflections
    largest = np.nanmax(np.abs(one.deflections))
    np.testing.assert_allclose([phi + s, phi - s], one.deflections, rtol=0, atol=4e-16 * largest)
    determinant = pair.springs(one.deflections, q).determinant
    # where it vanishes it is the difference of equal numbers
    atol = 1e-12 * np.nanmax(np.abs(determinant))
    np.testing.assert_allclose(
        cams.springs(other.deflections, q).determinant, -2 * determinant, rtol=1e-9, atol=atol
    )
    expected = pair.other_branch(tau_e, stiffness, q)
    np.testing.assert_array_equal(cams.other_branch(tau_e, stiffness, q), expected)


def test_signs_follow_from_the_potential() -> None:
    phi, s = sympy.symbols("phi s", real=True)
    one, two = sympy.Function("U_1"), sympy.Function("U_2")
    energy = one(phi + s) + two(phi - s)
    torque = energy.diff(phi)
    matrix = [[torque.diff(phi), torque.diff(s)], [torque.diff(phi, 2), torque.diff(phi, s)]]
    sigma_1, sigma_2 = one(phi + s).diff(phi, 2), two(phi - s).diff(phi, 2)
    of_pair = sigma_1 * sigma_2.diff(phi) - sigma_2 * sigma_1.diff(phi)
    assert sympy.simplify((sympy.Matrix(matrix).det() + 2 * of_pair).doit()) == 0
    setting_torque = one(phi + s).diff(phi) - two(phi - s).diff(phi)
    assert sympy.simplify((energy.diff(s) - setting_torque).doit()) == 0


@pytest.mark.slow
@pytest.mark.parametrize("ending", [(0,), (1,), (0, 1)])
def test_a_simulation_ends_where_a_cam_does(ending: tuple[int, ...]) -> None:
    """The controller takes cams for longer than they are: phi + s is bounded, not phi and s."""
    turns, cubic = np.linspace(-0.4, 0.4, 25), SAMPLES["cubic"].law
    short = measured(turns, cubic.torque(turns))
    plant, model = (
        robot_of(HEAVY, [Serial(motor=MOTORS, mechanism=mechanisms.ShiftedCams(spring=cams))])
        for cams in (tuple(short if side in ending else cubic for side in range(2)), (cubic, cubic))
    )
    simulation = simulate(plant, motion_of([(290, 1500)]), model=model)
    assert "a spring left the range of its law" in str(simulation.report.ending)
    history = simulation.history
    phi, s = history.phi[-1, 0, 0], history.theta[-1, 0, 1]
    rotations = abs(phi + s), abs(phi - s)
    assert max(rotations[side] for side in ending) == pytest.approx(0.4, rel=1e-9)


def test_tendons_go_slack() -> None:
    result = inverse_dynamics(robot_of(LINK, [serial("exponential", "exponential")]), motion_of([(60, 60)]))
    slack = result.flags[:, 0] == Flag.INFEASIBLE | Flag.SLACK
    assert slack.any()
    assert np.isnan(result.theta[slack]).all()


def test_like_cams_have_no_other_branch() -> None:
    assert serial("cubic", "cubic").opposite_branch is None
    assert serial("cubic", "sinh").opposite_branch == "negative"
    assert serial("exponential", "exponential").opposite_branch is None


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"spring": (laws.Polynomial(c1=3),) * 2}, "spring: both are linear"),
        ({"spring": (laws.Exponential(c=1, a=2),) * 2, "branch": "negative"}, "branch: must be positive"),
        (
            {"spring": (laws.Cubic(k=1, k_c=2, max_deflection=1),) * 2},
            "max_deflection: is not known of a cam",
        ),
    ],
)
def test_what_no_cams_can_be_is_refused(options: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        mechanisms.ShiftedCams(**options)
