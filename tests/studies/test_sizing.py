"""Sizing: every choice against a run of the robot with that motor in it, and against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from samples.catalogs import GENERIC, random_motor, shares_used, write
from samples.command_line import REPOSITORY
from samples.marks import slow

from vsacli import (
    DenavitHartenberg,
    Inertia,
    InputError,
    Joint,
    Link,
    Motor,
    Rigid,
    Robot,
    Trajectory,
    inverse_dynamics,
    load_robot,
    load_trajectory,
    size_drives,
)
from vsacli.studies.sizing import sized_text
from vsacli.studies.sizing.catalog import read_catalog
from vsacli.studies.sizing.choices import choices
from vsacli.studies.sizing.ratios import Gears

RUN = 1e-9
"""Relative to peaks: torques of a run are multiplied by the ratio there, here the load is divided by it."""

QUICK = ("mixed_3r", "rp_2", "awas_1r")
ARMS = [*QUICK, *map(slow, ("vsa_3r", "scara_4", "compact_1r", "coupled_1r", "maccepa_1r"))]
"""Springs on two motors, one, and none; slides; setting motors; a coupled rotor, a damper, a third spring."""

MOTIONS = {"vsa_3r": "rest_to_rest"}


def shipped(name):
    robot = load_robot(REPOSITORY / "robots" / f"{name}.yaml")
    trajectory = load_trajectory(REPOSITORY / "trajectories" / f"{MOTIONS.get(name, name)}.yaml", robot)
    return robot, trajectory


@pytest.fixture
def generic(tmp_path):
    path = tmp_path / "motors.csv"
    path.write_text(GENERIC)
    return path


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", ARMS)
def test_what_a_choice_does_is_what_a_run_with_that_motor_computes(name, generic, tmp_path):
    robot, trajectory = shipped(name)
    prismatic = [joint.name for joint in robot.joints if not joint.is_revolute]
    gears = ["60..200", *(f"{joint}=300..2000" for joint in prismatic)]
    sizing = size_drives(robot, [trajectory], generic, gears)
    path = tmp_path / "sized.yaml"
    path.write_text(sized_text(robot, sizing, tmp_path))
    result = inverse_dynamics(load_robot(path), trajectory)
    weight = np.gradient(result.time)
    weight[[0, -1]] /= 2
    for motor in sizing.motors:
        joint, side = robot.joint_names.index(motor.joint), motor.motor - 1
        ratio, points = motor.best.ratio, motor.chosen
        torque, velocity = result.tau_motor[:, joint, side] / ratio, result.dtheta[:, joint, side] * ratio
        close = {"rel": RUN}
        np.testing.assert_allclose(points.torques, torque, rtol=0, atol=RUN * np.abs(torque).max())
        assert points.torque.value == pytest.approx(np.abs(torque).max(), **close)
        assert points.velocity.value == pytest.approx(np.abs(velocity).max(), **close)
        rms = math.sqrt(np.average(torque**2, weights=weight))
        assert points.rms_torque == pytest.approx(rms, **close)
        assert points.current == pytest.approx(np.abs(result.current[:, joint, side]).max(), **close)
        assert points.voltage == pytest.approx(np.abs(result.voltage[:, joint, side]).max(), **close)
        loss = np.average(result.copper_loss[:, joint, side], weights=weight)
        assert points.copper_loss == pytest.approx(loss, **close)
        assert motor.best.copper_loss == pytest.approx(loss, **close)
        assert points.power == pytest.approx(np.max(result.motor_power[:, joint, side], initial=0), **close)


@pytest.mark.slow
def test_the_robots_own_motors_are_what_the_run_says():
    robot, trajectory = shipped("ur5_6r")
    sizing, result = size_drives(robot, [trajectory]), inverse_dynamics(robot, trajectory)
    for motor in sizing.motors:
        joint = robot.joint_names.index(motor.joint)
        peak = np.abs(result.tau_motor[:, joint, motor.motor - 1]).max()
        assert motor.own.points.torque.value == pytest.approx(peak / motor.gear_ratio, rel=RUN)
        limit = robot.joints[joint].actuator.motors[motor.motor - 1].max_torque
        assert motor.own.shares["torque"] == pytest.approx(peak / limit, rel=RUN)
        assert motor.own.low <= motor.gear_ratio <= motor.own.high
    assert sizing.verdict == "ok"


def test_of_a_motor_that_stands_still_any_gear_from_some_on_does(tmp_path):
    """T = load/n: the smallest that does is taken, as nothing speaks for a larger one but the torque."""
    robot, _ = shipped("hardening_1r")
    time = np.linspace(0, 1, 11)
    held = Trajectory.from_samples(
        time, np.full((11, 1), 0.5), **{name: np.zeros((11, 1)) for name in ("dq", "ddq", "d3q", "d4q")}
    )
    motor = {"name": "m", "inertia": 1e-4, "continuous_torque": 0.1, "max_velocity": 300}
    sizing = size_drives(robot, [held], write(tmp_path / "m.csv", [motor]))
    load = abs(inverse_dynamics(robot, held).tau_transmission[0, 0, 0])
    best = sizing.motors[0].best
    assert (best.low, best.high) == (pytest.approx(load / 0.1, rel=1e-12), math.inf)
    assert best.ratio == pytest.approx(load / 0.1, rel=1e-3)
    assert best.does


def test_what_is_no_list_of_trajectories_is_refused():
    robot, trajectory = shipped("hardening_1r")
    with pytest.raises(TypeError, match=r"trajectories must be a Sequence, not a .*Trajectory; size_drives"):
        size_drives(robot, trajectory)
    with pytest.raises(InputError, match="there is no trajectory to size for"):
        size_drives(robot, [])
    with pytest.raises(TypeError, match="robot must be a Robot"):
        size_drives("arm.yaml", [trajectory])


def test_a_motion_twice_is_as_often_once_and_has_two_names():
    robot, trajectory = shipped("hardening_1r")
    once, twice = size_drives(robot, [trajectory]), size_drives(robot, [trajectory, trajectory])
    assert [each.trajectory for each in twice.outcomes] == ["hardening-1r", "hardening-1r (2)"]
    one, two = (sizing.motors[0].own.points for sizing in (once, twice))
    assert two.rms_torque == pytest.approx(one.rms_torque, rel=1e-12)  # sums of twice as many
    assert two.torque == one.torque


INERTIA, REACH, FREQUENCY = 0.8, 0.5, 3.0
"""Of a turntable, kg m^2, and of its motion, rad and rad/s."""


@pytest.fixture
def turntable():
    """A rigid joint about a vertical axis that swings to and fro for whole periods."""
    link = Link(mass=1, com=(0, 0, 0), inertia=Inertia(xx=INERTIA, yy=INERTIA, zz=INERTIA))
    joint = Joint(
        name="table",
        type="revolute",
        dh=DenavitHartenberg(a=0, alpha=0, d=0, theta=0),
        link=link,
        actuator=Rigid(motor=Motor(inertia=1e-4, gear_ratio=50, side="shaft")),
    )
    time = np.linspace(0, 2 * 2 * math.pi / FREQUENCY, 4001)
    phase = FREQUENCY * time
    q, dq = REACH * np.sin(phase), REACH * FREQUENCY * np.cos(phase)
    derivatives = {"dq": dq, "ddq": -(FREQUENCY**2) * q, "d3q": -(FREQUENCY**2) * dq, "d4q": FREQUENCY**4 * q}
    columns = {name: values[:, None] for name, values in derivatives.items()}
    return Robot(name="turntable", joints=(joint,)), Trajectory.from_samples(time, q[:, None], **columns)


def test_a_turntable_in_closed_form(turntable, tmp_path):
    """T = (J n + I/n) q'': of the least at n^2 = I/J, within bounds between roots of quadratic equations."""
    rotor, most, lasting = 2e-4, 0.7, 0.3
    motor = {"name": "m", "inertia": rotor, "max_torque": most, "continuous_torque": lasting}
    sizing = size_drives(*[turntable[0], [turntable[1]]], write(tmp_path / "m.csv", [motor]))
    best = sizing.motors[0].best
    fastest = REACH * FREQUENCY**2

    def roots(bound):
        half = bound / (2 * rotor)
        return half - math.sqrt(half**2 - INERTIA / rotor), half + math.sqrt(half**2 - INERTIA / rotor)

    low, high = np.array([roots(most / fastest), roots(lasting * math.sqrt(2) / fastest)]).T
    assert best.low == pytest.approx(low.max(), rel=1e-6)  # samples miss the peaks by 1e-6 of them
    assert best.high == pytest.approx(high.min(), rel=1e-6)
    assert sizing.criterion == "utilization"
    assert best.ratio == pytest.approx(math.sqrt(INERTIA / rotor), rel=1e-4)  # to four digits


def test_the_gear_of_least_copper_loss_in_closed_form(turntable, tmp_path):
    rotor = 2e-4
    motor = {"name": "m", "inertia": rotor, "max_torque": 5, "torque_constant": 0.1, "resistance": 0.5}
    sizing = size_drives(turntable[0], [turntable[1]], write(tmp_path / "m.csv", [motor]))
    best = sizing.motors[0].best
    assert sizing.criterion == "copper_loss"
    assert best.ratio == pytest.approx(math.sqrt(INERTIA / rotor), rel=1e-3)  # it is rounded to four digits
    rms = 2 * math.sqrt(INERTIA * rotor) * REACH * FREQUENCY**2 / math.sqrt(2)
    assert best.copper_loss == pytest.approx(0.5 / 0.1**2 * rms**2, rel=1e-6)


@pytest.mark.cases(4)
@pytest.mark.parametrize("seed", [0, *map(slow, range(1, 12))])
def test_ranges_of_gears_against_a_dense_scan(seed, tmp_path):
    """Shares of limits in plain arithmetic, at many ratios within and beyond the ends of the range."""
    rng = np.random.default_rng(seed)
    robot, trajectory = shipped(["hardening_1r", "awas_1r", "coupled_1r", "maccepa_1r"][seed % 4])
    motors = {name: random_motor(rng, name) for name in "abcdef"}
    criterion = [None, "utilization"][seed % 2]
    sizing = size_drives(robot, [trajectory], write(tmp_path / "m.csv", list(motors.values())), (), criterion)
    for place in sizing.motors:
        few = slice(None, None, 10)  # plain Python takes a microsecond a sample
        demand = place.demand
        asked = demand.velocity[few], demand.acceleration[few], demand.load[few], demand.weight[few]
        for choice in place.choices:
            motor = motors[choice.motor]
            whole = shares_used(
                motor, choice.ratio, demand.velocity, demand.acceleration, demand.load, demand.weight
            )
            assert choice.shares == pytest.approx(whole, rel=1e-9)
            assert choice.does == (max(whole.values()) <= 1 + 1e-9)
            for ratio in np.geomspace(1, 5000, 40):
                largest = max(shares_used(motor, ratio, *asked).values())
                inside = choice.low <= ratio <= choice.high
                # a tenth of the steps misses some of a peak, and changes the mean a little
                assert largest <= 1.001 if inside else largest >= 0.95
            if not math.isnan(choice.low):
                assert choice.does, "any gear will do"


@pytest.mark.parametrize("criterion", ["copper_loss", "utilization", "mass"])
@pytest.mark.parametrize("coupling", [slow(0.001), 0.05, slow(0.3)])
def test_coupled_motors_are_the_best_pair_with_which_the_robot_can_be_built(criterion, coupling, tmp_path):
    """All pairs of the catalog, each tried by building the robot with it."""
    robot, trajectory = shipped("awas_1r")
    motor = {"joints.0.actuator.motor": [{"inertia": 2.0, "damping": 0.1}, {"inertia": 0.5, "damping": 0.1}]}
    robot = robot.replace(motor).replace("joints.0.actuator.coupled_inertia", coupling)
    columns = {"torque_constant": 0.1, "resistance": 0.2}
    inertias = {"light": 1e-6, "middle": 3e-6, "heavy": 3e-5, "heaviest": 4e-4}
    rows = [
        {"name": name, "inertia": inertia, "max_torque": 8.0, "mass": 1 + place, **columns}
        for place, (name, inertia) in enumerate(inertias.items())
    ]
    path = write(tmp_path / "m.csv", rows)
    sizing = size_drives(robot, [trajectory], path, ["100"], criterion)
    motors = read_catalog(path).records
    first, second = (choices(each.demand, motors, Gears.read("100"), criterion) for each in sizing.motors)

    def buildable(one, other):
        motors = [
            {"inertia": inertias[each.motor], "gear_ratio": 100.0, "side": "shaft"} for each in (one, other)
        ]
        changes = {"joints.0.actuator.coupled_inertia": coupling / 100**2, "joints.0.actuator.motor": motors}
        try:
            robot.replace(changes)
        except InputError:
            return False
        return True

    def key(one, other):
        costs = [
            {"copper_loss": each.copper_loss, "utilization": each.largest[1], "mass": each.mass}[criterion]
            for each in (one, other)
        ]
        return max(costs) if criterion == "utilization" else sum(costs)

    assert all(choice.does for choice in (*first, *second))
    pairs = [(one, other) for one in first for other in second if buildable(one, other)]
    assert 0 < len(pairs) <= len(first) * len(second)
    best = min(key(*pair) for pair in pairs)
    chosen = [motor.best for motor in sizing.motors]
    assert key(*chosen) == pytest.approx(best, rel=1e-12)  # sums in another order
    assert buildable(*chosen)
    for motor, other in zip(sizing.motors, reversed(chosen), strict=True):
        assert all(buildable(choice, other) for choice in motor.choices)
