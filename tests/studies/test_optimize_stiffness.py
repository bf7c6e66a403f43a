"""The best stiffness of a motion, against a dense grid, another optimizer, and runs of the result."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from samples.command_line import REPOSITORY, REST_TO_REST, ROBOT
from samples.fixes import CUBIC, K_C, K, pendulum, rest_to_rest
from samples.marks import slow

from vsacli import Friction, InputError, inverse_dynamics, load_robot, load_trajectory, optimize
from vsacli.base.signals import STIFFNESS
from vsacli.dynamics.drive import drive
from vsacli.studies.search.acceptance import Acceptance, admissible_stiffness
from vsacli.studies.search.criteria import CRITERIA, Scale
from vsacli.studies.search.loads import joint_loads
from vsacli.studies.search.splines import SplineSpace
from vsacli.studies.search.stiffness import StiffnessSearch

MARGIN = 0.03
SHOULDER = 1

TENDON = (REPOSITORY / "robots" / "tendon_1r.yaml", REPOSITORY / "trajectories" / "tendon_1r.yaml")
WEAK = ("--set", "joints.*.actuator.motor.max_torque=0.5")

SWING = """
format: vsacli-trajectory/1
name: swing
duration: 0.125
rate: 800
position: {type: sinusoids, frequency: 8, offset: [0, 0.3, -0.4], sine: [[0.1, 0.1, 0.1]]}
stiffness: {type: constant, value: 4000}
"""


@pytest.fixture(scope="module")
def arm():
    return load_robot(ROBOT)


@pytest.fixture(scope="module")
def swing(arm, tmp_path_factory):
    """Fast and periodic."""
    path = tmp_path_factory.mktemp("swing") / "swing.yaml"
    path.write_text(SWING)
    return load_trajectory(path, arm)


@pytest.fixture(scope="module")
def load(arm, swing):
    return joint_loads(arm, swing, [SHOULDER])[0]


def search_of(arm, load, criterion, space=SplineSpace.periodic):
    return StiffnessSearch(
        Acceptance(arm, MARGIN), arm.joints[SHOULDER], load, criterion, space, 0, lambda: None
    )


def search(arm, load, criterion, space):
    return search_of(arm, load, criterion, space).best()


def driven(robot, load, rows):
    """What the motors of the shoulder do with a stiffness and its derivatives, (3, instants)."""
    commanded = {**load.command.commanded, **dict(zip(STIFFNESS.names, rows, strict=True))}
    return drive(robot.joints[SHOULDER], load.command._replace(commanded=commanded))


def costs(arm, load, criterion, rows):
    """Of many profiles at once, rows (3, profiles, instants); infinite where one is not admitted."""
    joint, profiles = arm.joints[SHOULDER], rows.shape[1]
    command = {name: np.tile(row, profiles) for name, row in load.command.arrays().items()}
    asked = dict(zip(STIFFNESS.names, rows.reshape(3, -1), strict=True))
    tiled = load.command._replace(
        **{name: row for name, row in command.items() if name in load.command._fields},
        commanded={**{name: command[name] for name in load.command.commanded}, **asked},
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        driven = drive(joint, tiled)
    torques = driven.tau_motor.reshape(2, profiles, -1)
    low, high = admissible_stiffness(joint, load.command, MARGIN)
    kept = np.all((rows[0] >= low) & (rows[0] <= high), axis=1)
    if criterion == "energy":
        power = np.maximum(driven.motor_power, 0).sum(axis=0).reshape(profiles, -1)
        loaded = driven.elastic_energy.reshape(profiles, -1)[:, 0]
        return np.where(kept, np.trapezoid(power, load.time) + loaded, np.inf)
    if criterion == "peak":
        return np.where(kept, np.abs(torques).max(axis=(0, 2)), np.inf)
    squares = np.trapezoid((torques**2).mean(axis=0), load.time) / (load.time[-1] - load.time[0])
    return np.where(kept, np.sqrt(squares), np.inf)


@pytest.mark.parametrize("criterion", ["torque", slow("peak"), slow("energy")])
def test_no_profile_of_a_dense_grid_is_better(arm, load, criterion):
    """Of splines with two shapes, so that the grid has two dimensions; refined about its best four times."""
    spaces = lambda span, *_: SplineSpace.at_rest(span, 1)  # noqa: E731
    found = search(arm, load, CRITERIA[criterion](), spaces)
    basis = SplineSpace.at_rest((load.time[0], load.time[-1]), 1).basis(load.time, 3)
    center, width = np.array([3000.0, 3000.0]), 2500.0
    for _ in range(5):
        axis = np.linspace(-width, width, 15)
        amounts = center[:, None] + np.stack(np.meshgrid(axis, axis)).reshape(2, -1)
        on_grid = costs(arm, load, criterion, np.einsum("ain,np->api", basis, amounts))
        center, width = amounts[:, on_grid.argmin()], width / 5
    found_cost = costs(arm, load, criterion, found.rows[:, None])[0]
    # The last grid is 0.3 N m/rad wide, at a flat minimum; bounds are kept with 1e-6 to spare.
    assert found_cost == pytest.approx(on_grid.min(), rel=1e-4)


@pytest.mark.slow
def test_scipys_optimizer_comes_to_the_same_cost(arm, load):
    """Without bounds, since none of them holds this motion back."""
    from scipy.optimize import minimize

    found = search(arm, load, CRITERIA["torque"](), lambda span, *_: SplineSpace.periodic(span, 8))
    basis = SplineSpace.periodic((load.time[0], load.time[-1]), 8).basis(load.time, 3)

    def other_cost(amounts):
        return costs(arm, load, "torque", (basis @ (1000 * amounts))[:, None])[0] / 1000

    other = minimize(
        other_cost, np.full(8, 4.0), jac="3-point", method="trust-constr", options={"gtol": 1e-5}
    )
    # SciPy stops where a slope is left that is worth 1e-5 of the cost.
    assert costs(arm, load, "torque", found.rows[:, None])[0] == pytest.approx(1000 * other.fun, rel=1e-4)


def test_a_fast_periodic_motion_has_its_optimum_inside_the_corridor(arm, load):
    found = search(arm, load, CRITERIA["torque"](), SplineSpace.periodic)
    low, high = admissible_stiffness(arm.joints[SHOULDER], load.command, MARGIN)
    assert np.all((found.rows[0] > 1.2 * low) & (found.rows[0] < high))
    assert found.found
    assert (found.agreeing, found.bounding) == (found.starts, {})
    np.testing.assert_allclose(found.rows[:, 0], found.rows[:, -1], rtol=1e-9, atol=1e-6)
    near_edge = SplineSpace.periodic((load.time[0], load.time[-1]), 12)
    rows = near_edge.basis(load.time, 3) @ near_edge.fitted(load.time, 1.02 * low)
    best = costs(arm, load, "torque", found.rows[:, None])[0]
    assert costs(arm, load, "torque", rows[:, None])[0] > 1.5 * best


@pytest.mark.slow
def test_like_motors_heat_least_where_their_torques_are_least(arm, load):
    numbers = {"gear_ratio": 1.0, "torque_constant": 2.0, "resistance": 3.0}
    wound = arm.replace(
        {f"joints.{SHOULDER}.actuator.motor.{name}": value for name, value in numbers.items()}
    )
    coolest, least = (
        search(robot, load, CRITERIA[name](), SplineSpace.periodic)
        for robot, name in ((wound, "copper_loss"), (arm, "torque"))
    )
    heat, torque = (
        CRITERIA["copper_loss"]().of(wound.joints[SHOULDER], driven(wound, load, coolest.rows), load.time),
        costs(arm, load, "torque", least.rows[:, None]),
    )
    # R/K^2 times the squares of both motors over the time; the step sums differ by less than the tolerance.
    assert heat == pytest.approx(3 / 4 * 2 * torque[0] ** 2 * load.time[-1], rel=1e-4)


@pytest.mark.slow
def test_what_is_written_runs_with_the_margin_and_costs_what_the_report_says(vsacli, arm):
    done = vsacli(
        "optimize",
        ROBOT,
        REST_TO_REST,
        "--min-margin",
        "2%",
        "--json",
        "-o",
        "best.yaml",
        "--plot",
        "figures",
        "-q",
    )
    assert done.code == 0
    found = json.loads(done.out)
    assert (found["format"], found["possible"]) == ("vsacli-optimum/2", True)
    assert [drawn.name for drawn in Path("figures").iterdir()] == ["vsa_3r-rest_to_rest-optimum.png"]
    result = inverse_dynamics(arm, load_trajectory("best.yaml", arm))
    assert result.report.verdict == "ok"
    assert min(joint.margin for joint in result.report.joints) >= 0.02
    for index, name in enumerate(arm.joint_names):
        mean = np.trapezoid((result.tau_motor[:, index] ** 2).mean(axis=-1), result.time) / result.time[-1]
        assert found["joints"][name]["after"] == pytest.approx(math.sqrt(mean), rel=1e-9)
        assert found["joints"][name]["after"] < 0.97 * found["joints"][name]["before"]
    assert np.abs(result.dstiffness[[0, -1]]).max() < 1e-6
    assert np.abs(result.ddstiffness[[0, -1]]).max() < 1e-3  # of some 1e3 N m/rad in 0.1 s^2


@pytest.mark.slow
def test_implausible_values_are_reported(vsacli):
    implausible = ("--set", "joints.elbow.link.com=[0,0,150]", "--set", "rate=20")
    done = vsacli("optimize", *TENDON, *WEAK, *implausible)
    assert done.code == 3
    assert "\nwarning: joints.elbow.link.com.2 (z) = 150 m is " in done.out


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("criterion", ["torque", "energy", "peak"])
def test_nothing_feasible_is_said_and_nothing_written(vsacli, criterion):
    done = vsacli("optimize", *TENDON, *WEAK, "--minimize", criterion, "-o", "best.yaml")
    assert done.code == 3
    assert "nothing feasible was found" in done.out
    assert "best.yaml is not written" in done.err


def test_what_cannot_be_minimized_is_refused(arm, swing):
    with pytest.raises(InputError, match=r"the motors of base have no resistance.*or use --minimize torque"):
        optimize(arm, swing, "copper_loss")
    with pytest.raises(InputError, match="unknown objective 'power'; valid: torque, energy, copper_loss"):
        optimize(arm, swing, "power")
    elastic = load_robot(REPOSITORY / "robots" / "hardening_1r.yaml")
    moved = load_trajectory(REPOSITORY / "trajectories" / "hardening_1r.yaml", elastic)
    with pytest.raises(InputError, match=r"no joint of .* has a stiffness to choose"):
        optimize(elastic, moved)


@pytest.mark.parametrize("criterion", ["torque", "energy", "peak"])
def test_no_constant_of_a_dense_grid_is_better(arm, load, criterion):
    found = search_of(arm, load, CRITERIA[criterion]()).best_constant()
    low, high = admissible_stiffness(arm.joints[SHOULDER], load.command, MARGIN)
    grid = np.geomspace(low.max(), min(high.min(), 100 * low.max()), 2000)
    rows = np.zeros((3, len(grid), len(load.time)))
    rows[0] = grid[:, None]
    best = costs(arm, load, criterion, found.rows[:, None])[0]
    assert best <= (1 + 1e-5) * costs(arm, load, criterion, rows).min()
    assert np.ptp(found.rows[0]) < 1e-9 * found.rows[0, 0]


@pytest.mark.slow
def test_sharp_friction_leaves_an_optimum(arm, load):
    """Unsmoothed, sums over instants jump wherever a motor stops at another one, and a search gets stuck."""
    shoulder = arm.joints[SHOULDER]
    motors = tuple(
        replace(motor, friction=Friction(coulomb=(60.0, 60.0))) for motor in shoulder.actuator.motor
    )
    rough = replace(shoulder, actuator=replace(shoulder.actuator, motor=motors))
    robot = replace(arm, joints=(arm.joints[0], rough, arm.joints[2]))
    without = search(arm, load, CRITERIA["torque"](), SplineSpace.periodic)
    found = search(robot, load, CRITERIA["torque"](), SplineSpace.periodic)
    assert found.found
    assert found.agreeing == found.starts
    before, after = (costs(robot, load, "torque", each.rows[:, None])[0] for each in (without, found))
    assert after < before


def test_a_motion_has_the_torque_cost_1_in_its_own_scale(arm, load):
    """On this scale the accuracy counts by which an optimum is said to be one."""
    criterion, joint, steps = CRITERIA["torque"](), arm.joints[SHOULDER], load.at(load.steps)
    motors = drive(joint, steps.command)
    scale = Scale(criterion.size(joint, motors, steps.time), float(steps.time[-1]))
    (integrand,) = criterion.integrands(joint, motors, None, scale)
    assert criterion.weights(steps.time)[0] @ integrand == pytest.approx(1.0, rel=1e-12)


@pytest.mark.slow
def test_least_torque_of_a_weak_joint_is_a_local_optimum_too():
    """Its masses, inertia and springs are a thousandth: so are all torques, and nothing else changes."""
    optima = [optimize(*weakened(share), "torque").joints["swing"] for share in (1.0, 1e-3)]
    assert all((each.found, each.agreeing) == (True, each.starts) for each in optima)
    strong, weak = ((each.before, each.after) for each in optima)
    assert weak == pytest.approx(np.multiply(1e-3, strong), rel=1e-6)  # stops at 1e-7 of its scale


def weakened(share):
    """A pendulum with a share of its masses and stiffness, and its motion."""
    spring = replace(CUBIC, k=share * K, k_c=share * K_C)
    (joint,) = pendulum(spring, mass=share * 5.0).joints
    motors = tuple(replace(motor, inertia=share * motor.inertia) for motor in joint.actuator.motor)
    actuator = replace(joint.actuator, motor=motors)
    robot = replace(pendulum(), joints=(replace(joint, actuator=actuator),))
    return robot, rest_to_rest(1.0, share * 1000.0, start=(0.0,), end=(1.0,), rate=100)


@pytest.mark.slow
def test_a_command_beyond_the_margin_is_noted(vsacli):
    """Its cost is below that of the best constant, which keeps the margin."""
    for margin, noted in ((5, False), (60, True)):
        out = vsacli("optimize", *TENDON, "--set", "rate=40", "--min-margin", f"{margin}%").out
        note = f"note: as commanded, the motion breaks a limit or the margin of {margin} %, which the optimum"
        assert (note in out) is noted, out
