"""Feedback linearization: what it cancels, whom it can serve, and the gains it takes."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pinocchio as pin
import pytest
from oracles import pinocchio
from samples.drives import motion
from samples.plants import all_rigid, elastic, random_state, rigid, with_actuators
from samples.robots import random_robot, vsa_3r
from samples.signals import by_name

from vsacli import (
    Antagonistic,
    FeedbackLinearization,
    Gains,
    InputError,
    Integral,
    Motion,
    Motor,
    Pose,
    Robot,
    State,
    Wrench,
    feedback_linearization,
    laws,
    link_torques,
    motor_torques,
    state_derivative,
)
from vsacli.control.poles import gains_from_text, load_gains, parse_poles

GAINS = Gains.from_poles([-9, -10, -11 + 4j, -11 - 4j], [-12, -15])


def random_reference(robot: Robot, samples: int, seed: int, wrench: Wrench | None = None) -> Motion:
    rng = np.random.default_rng(seed)
    shape = (samples, len(robot.joints))
    arrays = [rng.uniform(-1, 1, shape) * size for size in (2, 3, 9, 30, 90, 300, 500, 900)]
    arrays[5] += 1200
    return Motion(np.arange(samples), *arrays[:5], by_name(*arrays[5:]), wrench=wrench)


def random_wrench(samples: int, frame: str) -> Wrench:
    return Wrench(*np.random.default_rng(9).uniform(-20, 20, (3, samples, 6)), frame=frame)


def at(record, index):
    """One sample of a record of arrays."""
    if isinstance(record, Motion):
        return record.mapped(record.time[index], lambda array, _: array[index])
    return dataclasses.replace(
        record, **{name: array[index] for name, array in vars(record).items() if array is not None}
    )


def test_on_the_reference_it_gives_the_computed_torques():
    robot, trajectory = vsa_3r(), motion(rate=20)
    command = trajectory.block(0, trajectory.samples)
    computed = motor_torques(robot, command)
    state = State(computed.q, computed.dq, computed.theta, computed.dtheta)
    torque = feedback_linearization(robot, state, command, GAINS)
    # phi carries 1e-16/margin, here 1e-14, and the gains, up to 1e4, magnify what that does to d3q
    assert np.abs(torque - computed.tau_motor).max() < 1e-9 * np.abs(computed.tau_motor).max()


@pytest.mark.parametrize("frame", [None, "base", "end_effector"])
@pytest.mark.parametrize("mixed", [False, True])
def test_the_decoupled_derivatives_are_the_linear_control(frame, mixed):
    """Applied, the torque gives q'''' = v_q and sigma'' = v_sigma, by (58)-(60) read the other way round."""
    robot = random_robot("RPRR", seed=6)
    robot = dataclasses.replace(robot, tool=Pose(xyz=(0.1, 0.2, -0.1), rpy=(0.3, 0.1, 0.2)))
    if mixed:
        robot = with_actuators(robot, {0: elastic(700), 3: elastic(1100)})
    wrench = None if frame is None else random_wrench(5, frame)
    state, reference = random_state(robot, 5, seed=1), random_reference(robot, 5, seed=2, wrench=wrench)
    law = FeedbackLinearization(robot, GAINS, frame)
    rates = state_derivative(robot, state, law(state, reference), wrench)
    link = law.law.link_motion(*law.plant.unpack_state(state), wrench)

    assert rates.ddq == pytest.approx(link.ddq, rel=1e-12)  # the same formula (34)
    actual = (state.q, state.dq, link.ddq, link.d3q)
    wanted = (reference.q, reference.dq, reference.ddq, reference.d3q)
    v_q = reference.d4q + sum(map(weighted_error, GAINS.position[0], wanted, actual))
    needed = link_torques(robot, *actual, v_q, wrench=wrench)
    for index, joint in enumerate(robot.joints):
        *elastic_torque, stiffness, rate, acceleration = spring_sums(joint, index, state, rates)
        for found, torque in zip(elastic_torque, needed, strict=True):
            # M^-1, and terms that cancel in these sums, cost four digits of sixteen, and some spare ones
            assert found == pytest.approx(torque[:, index], rel=1e-10, abs=1e-10 * np.abs(torque).max())
        if isinstance(joint.actuator, Antagonistic):
            goals = reference.commanded["stiffness"][:, index], reference.commanded["dstiffness"][:, index]
            v_sigma = reference.commanded["ddstiffness"][:, index] + sum(
                map(weighted_error, GAINS.stiffness[0], goals, (stiffness, rate))
            )
            assert acceleration == pytest.approx(v_sigma, rel=1e-10, abs=1e-10 * np.abs(v_sigma).max())


def weighted_error(gain, wanted, found):
    return gain * (wanted - found)


def spring_sums(joint, index, state, rates):
    """tau_e, tau_e', tau_e'', sigma, sigma', sigma'' of a joint by the chain rule, each (samples,)."""
    phi = state.theta[:, index] - state.q[:, [index]]
    dphi = state.dtheta[:, index] - state.dq[:, [index]]
    ddphi = rates.ddtheta[:, index] - rates.ddq[:, [index]]
    if not isinstance(joint.actuator, Antagonistic):
        constant = joint.actuator.stiffness
        return [*(constant * part[:, 0] for part in (phi, dphi, ddphi)), constant, 0.0, 0.0]
    return sum(
        np.array([
            law.torque(x), law.stiffness(x) * v, law.slope(x) * v**2 + law.stiffness(x) * a,
            law.stiffness(x), law.slope(x) * v, law.curvature(x) * v**2 + law.slope(x) * a,
        ])
        for law, x, v, a in zip(joint.actuator.laws, phi.T, dphi.T, ddphi.T, strict=True)
    )  # fmt: skip


def test_one_instant_gives_what_a_block_gives():
    robot = with_actuators(random_robot("RPR", seed=6), {1: elastic()})
    state, reference = random_state(robot, 4, seed=1), random_reference(robot, 4, seed=2)
    block = feedback_linearization(robot, state, reference, GAINS)
    alone = feedback_linearization(robot, at(state, 2), at(reference, 2), GAINS)
    # math.cos and numpy.cos may differ by rounding, which M^-1 and the gains magnify
    assert alone == pytest.approx(block[2], rel=1e-10, nan_ok=True)
    assert np.isnan(alone[1, 1])
    assert np.isfinite(np.delete(alone.ravel(), 3)).all()


def test_a_rigid_robot_gets_the_computed_torque():
    robot = all_rigid("RPR", seed=3)
    model = pinocchio.build(robot)
    model.armature = np.array([1.0, 2.0, 3.0])
    data = model.createData()
    state, reference = random_state(robot, 4, seed=1), random_reference(robot, 4, seed=2)
    gains = Gains.from_poles([-5, -7])
    control = reference.ddq + 12 * (reference.dq - state.dq) + 35 * (reference.q - state.q)
    damping = 0.2 + np.array([joint.damping for joint in robot.joints])
    rows = zip(state.q, state.dq, control, strict=True)
    expected = np.array([pin.rnea(model, data, *row).copy() for row in rows]) + damping * state.dq
    torque = feedback_linearization(robot, state, reference, gains)
    assert torque[..., 0] == pytest.approx(expected, rel=1e-11)  # sums of some hundred terms
    assert np.isnan(torque[..., 1]).all()


def test_the_integral_enters_the_linear_control():
    robot = random_robot("RP", seed=3)
    state, reference = random_state(robot, 3, seed=1), random_reference(robot, 3, seed=2)
    gains = Gains.from_poles([-9, -10, -11, -12, -13], [-7, -8, -9])
    shifted = dataclasses.replace(
        reference,
        d4q=reference.d4q + gains.position_integral * 0.02,
        commanded={
            **reference.commanded,
            "ddstiffness": reference.commanded["ddstiffness"] + gains.stiffness_integral * 3.0,
        },
    )
    integral = Integral(np.full((3, 2), 0.02), np.full((3, 2), 3.0))
    found = feedback_linearization(robot, state, reference, gains, integral)
    assert found == pytest.approx(feedback_linearization(robot, state, shifted, gains), rel=1e-12)


def test_equal_quadratic_pairs_at_constant_stiffness_are_an_elastic_joint():
    """(phi_1 + phi_2)/2 = tau_e/sigma; the torques add up to that of a drive with K = sigma, 2B, 2D."""
    single = with_actuators(
        random_robot("RP", seed=7), {0: elastic(800, 3.0, 0.4), 1: elastic(800, 3.0, 0.4)}
    )
    motor = Motor(inertia=1.5, damping=0.2)
    pair = Antagonistic(motor=(motor, motor), spring=(laws.Quadratic(k=1500), laws.Quadratic(k=1500)))
    double = with_actuators(single, {0: pair, 1: pair})
    state = random_state(single, 4, seed=4)
    reference = dataclasses.replace(
        random_reference(single, 4, seed=2),
        commanded=by_name(np.full((4, 2), 800.0), np.zeros((4, 2)), np.zeros((4, 2))),
    )
    apart = np.array([1, -1]) * 800 / (4 * 1500)  # (phi_1 - phi_2)/2 = sigma/(4 k)
    twins = dataclasses.replace(
        state, theta=state.theta[..., :1] + apart, dtheta=np.repeat(state.dtheta[..., :1], 2, axis=-1)
    )
    expected = feedback_linearization(single, state, reference, GAINS)[..., 0]
    found = feedback_linearization(double, twins, reference, GAINS).sum(axis=-1)
    assert found == pytest.approx(expected, rel=1e-10)  # the same sums in another order, magnified by gains


def test_stiff_elastic_joints_come_down_to_the_rigid_linearization_of_their_links():
    """As K grows, tau_e''/K vanishes and (M + B) q'' + n + Dm q' remains: the error falls as 1/K."""
    soft = random_robot("RP", seed=7)
    rng = np.random.default_rng(0)
    q, dq, ddq, d3q, d4q = rng.uniform(-1, 1, (5, 3, 2))
    command = Motion(np.arange(3), q, dq, ddq, d3q, d4q, by_name(*[np.full((3, 2), np.nan)] * 3))
    tau_e, dtau_e, _ = link_torques(soft, q, dq, ddq, d3q, d4q)
    stiff = with_actuators(soft, {0: rigid(2.0, 0.3), 1: rigid(2.0, 0.3)})
    empty = np.zeros((3, 2, 2))
    expected = feedback_linearization(stiff, State(q, dq, empty, empty), command, Gains.from_poles([-5, -5]))
    errors = []
    for constant in (1e4, 1e5, 1e6):
        robot = with_actuators(soft, {0: elastic(constant, 2.0, 0.3), 1: elastic(constant, 2.0, 0.3)})
        theta, dtheta = (
            (link + part / constant)[..., None] * [1, 0] for link, part in ((q, tau_e), (dq, dtau_e))
        )
        torque = feedback_linearization(robot, State(q, dq, theta, dtheta), command, GAINS)
        errors.append(np.abs(torque - expected)[..., 0].max())
    assert errors[0] < 0.05 * np.abs(expected[..., 0]).max()
    # each factor of ten in K is one in the error; its next term, and rounding times K, are within a hundredth
    assert np.array(errors[:-1]) / errors[1:] == pytest.approx([10, 10], rel=0.01)


def test_where_a_is_singular_there_is_no_torque():
    robot = vsa_3r()
    state = random_state(robot, 1, seed=1)
    state.theta[0, 1] = state.q[0, 1] + 0.1  # phi_1 = phi_2
    torque = feedback_linearization(robot, state, random_reference(robot, 1, seed=1), GAINS)
    assert np.isnan(torque[0]).tolist() == [[False, False], [True, True], [False, False]]


def test_rigid_joints_among_others_are_refused():
    robot = with_actuators(vsa_3r(), {1: rigid()})
    with pytest.raises(
        InputError, match=r"springs at all joints or at none: shoulder is rigid, base, elbow are not"
    ):
        FeedbackLinearization(robot, GAINS)


@pytest.mark.parametrize(
    ("robot", "gains", "message"),
    [
        (
            vsa_3r(),
            Gains.from_poles([-5, -6]),
            "needs 4 poles of the position error .5 with integral action., not 2",
        ),
        (all_rigid("RR", 1), GAINS, "needs 2 poles of the position error .3 with integral action., not 4"),
        (
            vsa_3r(),
            Gains.from_poles([[-5] * 4] * 2),
            "there are position gains of 2 joints, but the robot has 3",
        ),
        (vsa_3r(), Gains.from_poles([-5] * 4, [[-5, -6]] * 2), "there are stiffness gains of 2 joints"),
    ],
)
def test_gains_of_another_robot_are_refused(robot, gains, message):
    with pytest.raises(InputError, match=message):
        FeedbackLinearization(robot, gains)


def test_gains_are_the_coefficients_of_the_polynomials():
    gains = Gains.from_poles([[-1, -2, -3, -4], [-1, -1, -1, -1]], [-2 + 1j, -2 - 1j, -3])
    # (s+1)(s+2)(s+3)(s+4) and (s+1)^4; (s^2+4s+5)(s+3)
    assert gains.position == pytest.approx(np.array([[24, 50, 35, 10], [1, 4, 6, 4]]))
    assert gains.position_integral.tolist() == [0, 0]
    assert gains.stiffness == pytest.approx(np.array([[17, 7]]))
    assert gains.stiffness_integral == pytest.approx([15])
    assert gains.integrates
    assert not GAINS.integrates


@pytest.mark.parametrize(
    ("position", "stiffness", "message"),
    [
        ([-1, -2, -3], [-1], "expected 2, 3 poles of the stiffness error, found 1"),
        ([-1] * 6, [-1, -1], "expected 2, 3, 4, 5 poles of the position error, found 6"),
        ([-1, -2, 0, -3], [-1, -1], "the pole 0 of the position error is unstable"),
        ([-1, -2, -3, -4], [-1, 2], "the pole 2 of the stiffness error is unstable"),
        (
            [-1, -2, -3 + 1j, -4],
            [-1, -1],
            r"complex pole -3\+1j of the .* has no conjugate; add -3-1j",
        ),
        ([-1, -2, np.nan, -4], [-1, -1], "is unstable"),
    ],
)
def test_poles_that_cannot_be_used_are_refused(position, stiffness, message):
    with pytest.raises(InputError, match=message):
        Gains.from_poles(position, stiffness)


def test_gains_that_are_not_hurwitz_are_refused():
    # s^4 + s^3 + s^2 + s + 1 has roots on the unit circle at 72 degrees: cos(72 deg) = 0.309
    with pytest.raises(InputError, match=r"position gains, row 0 are unstable: .* real part 0.309"):
        Gains(np.ones((1, 4)), np.ones((1, 2)), np.zeros(1), np.zeros(1))


@pytest.mark.parametrize("text", ["fast", "", "-1;-2", "-1,,-2"])
def test_text_that_holds_no_poles_is_refused(text):
    with pytest.raises(
        InputError, match=re.escape(f"expected poles such as -20,-21,-10+5j,-10-5j, found {text!r}")
    ):
        parse_poles(text)


def test_one_pole_stands_for_as_many_as_the_robot_needs():
    assert gains_from_text(vsa_3r(), "-3", "-4", integral=False).position == pytest.approx(
        np.array([[81, 108, 54, 12]])
    )
    assert gains_from_text(vsa_3r(), "-3", "-4", integral=True).position_integral == pytest.approx([243])
    assert gains_from_text(all_rigid("R", 1), "-3", "-4", integral=False).position.tolist() == [[9, 6]]


@pytest.mark.parametrize(("integral", "count"), [(False, "4 .* .5 with"), (True, "5 .* .4 without")])
def test_a_wrong_number_of_poles_is_refused(integral, count):
    count, other = count.split(" .* ")
    expected = f"expected {count} poles of the position error {other} integral action.,"
    with pytest.raises(InputError, match=f"{expected} or 1 that is repeated, found 2"):
        gains_from_text(vsa_3r(), "-3,-4", "-4", integral=integral)


POLES_FILE = """format: vsacli-poles/1
joints:
  - name: base
    position: -20, -21, -10+5j, -10-5j
  - name: shoulder
    position: -30
    stiffness: -25, -26
  - name: elbow
    position: -40
"""


def test_a_file_has_poles_for_each_joint(tmp_path):
    path = tmp_path / "poles.yaml"
    path.write_text(POLES_FILE)
    gains = load_gains(path, vsa_3r(), integral=False)
    assert [source.path for source in gains.sources] == [str(path)]
    assert gains.position[:, 3] == pytest.approx([61, 120, 160])
    assert gains.stiffness == pytest.approx(np.array([[400, 40], [650, 51], [400, 40]]))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "-30",
            "30",
            "poles.yaml:6: joints: position: the pole 30 of the .* is unstable; .* -30",
        ),
        ("-30", "quick", "poles.yaml:6: joints: position: expected poles such as"),
        ("shoulder", "sholder", "no joint 'sholder'; did you mean 'shoulder'"),
        ("  - name: elbow\n    position: -40\n", "", "no poles for elbow; each joint needs them"),
        ("-30", "-30, -31", "poles.yaml: shoulder: expected 4 poles of the position error"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused(tmp_path, old, new, message):
    path = tmp_path / "poles.yaml"
    path.write_text(POLES_FILE.replace(old, new))
    with pytest.raises(InputError, match=message):
        load_gains(path, vsa_3r(), integral=False)
