"""Motor torques along records with noise of many colours: right, or doubtful."""

import numpy as np
import pytest
from samples.noisy_records import COLOURS, MOTIONS, record
from scipy.interpolate import make_interp_spline

from vsacli.actuators.antagonistic import Antagonistic
from vsacli.actuators.elastic import Elastic
from vsacli.actuators.laws.cubic import Cubic
from vsacli.actuators.motor import Motor
from vsacli.analysis.run import Run
from vsacli.base.signals import STIFFNESS
from vsacli.control.simulation.simulate import simulate
from vsacli.dynamics.inverse import compute_block
from vsacli.robot.joint import DenavitHartenberg, Inertia, Joint, Link
from vsacli.robot.model import Robot
from vsacli.trajectory.curves import Constant
from vsacli.trajectory.motion import Motion
from vsacli.trajectory.trajectory import Trajectory

RATE = 250
STIFFNESS_ASKED = 1200.0

QUICK = "12 bits, zero-phase 20 Hz"
"""The colour that is tried at every run of the tests."""


def arm(actuator):
    """One joint that lifts a link, of the size of an elbow."""
    link = Link(mass=5.0894, com=(-0.15, 0, 0), inertia=Inertia(xx=0.0104, yy=0.0434, zz=0.0434))
    joint = Joint(
        name="elbow",
        type="revolute",
        dh=DenavitHartenberg(a=0.3, alpha=0),
        link=link,
        damping=1e-5,
        actuator=actuator,
    )
    return Robot(name="arm", gravity=(0, -9.81, 0), joints=(joint,))


MOTOR, SPRING = Motor(inertia=1.98, damping=1e-4), Cubic(k=400, k_c=2000)
ARMS = {
    "antagonistic": arm(Antagonistic(motor=(MOTOR, MOTOR), spring=(SPRING, SPRING))),
    "elastic": arm(Elastic(motor=MOTOR, stiffness=1000.0)),
    "soft": arm(Elastic(motor=Motor(inertia=0.3, damping=1e-4), stiffness=60.0)),
}
"""From one whose preload outweighs the motion to one whose torque is little else than d4q."""


def exact_motion(of, motion, seed):
    """What was recorded, with all derivatives: those of a spline through exact values at 2 kHz."""
    fine = np.linspace(0, of.time[-1], 20_001)
    spline = make_interp_spline(fine, motion(fine, seed)[0], k=9)
    names = ("q", "dq", "ddq", "d3q", "d4q")
    arrays = {name: spline(of.time, nu=order)[:, None] for order, name in enumerate(names)}
    still = np.zeros((len(of.time), 1))
    arrays |= {"stiffness": still + STIFFNESS_ASKED, "dstiffness": still, "ddstiffness": still}
    return Motion.of(of.time, arrays)


def outcomes(motion, colour, seed):
    """For each arm its name, the verdict, the relative error of tau_motor, and the share of it within two
    deviations, None if none is stated; away from the doubtful ends."""
    of = record(MOTIONS[motion], colour, seed, RATE)
    recorded = Trajectory.from_samples(of.time, of.values[:, None])
    firm = Constant(signal=STIFFNESS, span=(0.0, recorded.duration), value=(STIFFNESS_ASKED,))
    exact = exact_motion(of, MOTIONS[motion], seed)
    (estimate,) = recorded.estimates.values()
    start, end = estimate.fit.parts[0].inside
    inside = (of.time >= start) & (of.time <= end)
    for name, robot in ARMS.items():
        chosen = {"stiffness": firm} if name == "antagonistic" else {}
        run = Run(robot, Trajectory(recorded.times, recorded.position, chosen, name=motion))
        (block,) = run
        motors = slice(robot.joints[0].actuator.motor_count)
        found, deviation = (array[inside, 0, motors] for array in (block.tau_motor, block.tau_motor_std))
        true = compute_block(robot, exact).tau_motor[inside, 0, motors]
        error = np.sqrt(np.mean((found - true) ** 2, axis=0) / np.mean(true**2, axis=0)).max()
        stated = not np.isnan(deviation).any()
        within = np.mean(np.abs(found - true) <= 2 * deviation) if stated else None
        yield name, run.report().verdict, error, within


@pytest.mark.parametrize(
    "colour", [name if name == QUICK else pytest.param(name, marks=pytest.mark.slow) for name in COLOURS]
)
def test_torques_from_rest_to_rest_are_right_and_as_uncertain_as_stated(colour):
    covered = []
    for seed in (20, 21, 22):
        for name, verdict, error, within in outcomes("rest to rest, pauses", colour, seed):
            assert verdict == "ok" or seed > 20, name  # of other draws some are doubtful, though right
            assert error < 0.02, name  # 1.4 % was the largest of twelve colours, six seeds and two rates
            covered += [] if within is None else [within]
    # errors of one record go together: of single ones 0.82 to 1; of a colour 0.935 to 0.975 were seen
    assert not covered or 0.9 < np.mean(covered) < 0.99


@pytest.mark.parametrize(
    "colour", [name if name == QUICK else pytest.param(name, marks=pytest.mark.slow) for name in COLOURS]
)
def test_torques_of_steps_of_velocity_are_right_or_doubtful(colour):
    for name, verdict, error, _ in outcomes("velocity steps, 50 ms", colour, 20):
        assert verdict == "doubtful" or error < 0.1, name
        if name == "elastic":
            assert verdict == "doubtful"


@pytest.mark.slow
def test_a_simulation_along_a_doubtful_record_says_so():
    of = record(MOTIONS["velocity steps, 50 ms"], QUICK, 20, RATE)
    trajectory = Trajectory.from_samples(of.time, of.values[:, None])
    warnings = simulate(ARMS["elastic"], trajectory).report.warnings
    assert any(each.startswith("elbow: tau_motor is not determined by the record: ") for each in warnings)
