"""Exported models in MuJoCo: its accelerations at any state, and its inverse dynamics along runs."""

from __future__ import annotations

import dataclasses
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from samples.mechanisms import DEVICES
from samples.mujoco_models import (
    accelerations,
    compiled,
    coordinates,
    frame_of_wrenches,
    inverse_error,
    mujoco,
)
from samples.robots import inertia_from_tensor, random_robot, vsa_3r
from samples.shipped import shipped_robot, shipped_run
from samples.springs import SPRINGS

from vsacli import (
    Antagonistic,
    Damper,
    Elastic,
    Friction,
    Inertia,
    InputError,
    Limits,
    Link,
    Motor,
    Pose,
    Rigid,
    Serial,
    State,
    inverse_dynamics,
    laws,
    state_derivative,
)
from vsacli.robot.models.mjcf import mjcf_model
from vsacli.robot.models.mjcf_drives import Start

pytestmark = pytest.mark.slow

ROUNDING = 1e-12
"""Of inverse dynamics, relative to the largest torque: sums of some hundred terms, each good to 1e-16, and
bodies of 1e-14 kg where a motor has none."""

OF_ACCELERATIONS = 1e-10
"""Of forward dynamics, relative to the largest: the same times the condition of the mass matrix, some 100."""

CUBIC = SPRINGS["cubic"][0][0]
SMOOTH = Friction(coulomb=(0.4, 0.4), offset=0.1, width=0.2)


def check_accelerations(robot, states, damping=None):
    """MuJoCo's accelerations at random velocities and torques are those of the equations of motion."""
    rng = np.random.default_rng(8)
    q, theta = states
    dq, dtheta = rng.uniform(-1, 1, q.shape), rng.uniform(-1, 1, theta.shape)
    torque = rng.uniform(-5, 5, theta.shape)
    state = State(q, dq, theta, dtheta)
    rates = state_derivative(robot, state, torque, damping=damping)
    found_q, found_theta = accelerations(robot, state, torque, damping)
    expected = np.where(np.isnan(found_theta), np.nan, rates.ddtheta)
    largest = max(np.abs(rates.ddq).max(), np.nanmax(np.abs(expected), initial=0))
    np.testing.assert_allclose(found_q, rates.ddq, rtol=0, atol=OF_ACCELERATIONS * largest)
    np.testing.assert_allclose(found_theta, expected, rtol=0, atol=OF_ACCELERATIONS * largest)


def drawn(robot, samples=20):
    """Positions within a turn, and motors within a tenth of a radian of them."""
    rng = np.random.default_rng(7)
    q = rng.uniform(-3, 3, (samples, len(robot.joints)))
    return q, q[..., None] + rng.uniform(-0.1, 0.1, (*q.shape, 2))


def with_actuators(robot, *actuators):
    joints = (
        dataclasses.replace(joint, actuator=actuator)
        for joint, actuator in zip(robot.joints, actuators, strict=True)
    )
    return dataclasses.replace(robot, joints=tuple(joints))


CHAINS = [(types, seed) for types in ("RRR", "RPRP", "PRR", "PP") for seed in range(4)]


@pytest.mark.parametrize(("types", "seed"), CHAINS)
def test_random_chains_under_odd_gravity(types, seed):
    robot = dataclasses.replace(
        random_robot(types, seed),
        base=Pose(xyz=(0.3, -0.2, 0.5), rpy=(0.3, -0.7, 2.1)),
        tool=Pose(xyz=(0.1, 0.2, 0.3), rpy=(1.0, 0.2, -0.4)),
    )
    check_accelerations(robot, drawn(robot))


def test_rigid_elastic_and_antagonistic_joints_of_both_types():
    robot = random_robot("RPRPR", 5)
    geared = Motor(inertia=1e-4, damping=1e-5, gear_ratio=-80, side="shaft")
    actuators = (
        Rigid(motor=geared),
        Rigid(motor=Motor(inertia=2, damping=0.3)),
        Elastic(motor=geared, stiffness=700),
        Elastic(motor=Motor(inertia=1.5), spring=laws.Polynomial(c1=300, c3=900)),
        robot.joints[4].actuator,
    )
    mixed = with_actuators(robot, *actuators)
    check_accelerations(mixed, drawn(mixed))


def test_smooth_friction_of_joints_and_motors():
    sides = Motor(inertia=0.5, friction=Friction(coulomb=(0.3, 0.7), offset=-0.1, width=0.1))
    geared = Motor(
        inertia=1e-4, gear_ratio=-50, side="shaft", friction=Friction(coulomb=(0.01, 0.02), width=3)
    )
    robot = random_robot("RPR", 2)
    actuators = (
        Rigid(motor=geared),
        Elastic(motor=sides, stiffness=500),
        dataclasses.replace(robot.joints[2].actuator, motor=(sides, geared)),
    )
    robot = with_actuators(robot, *actuators)
    joints = tuple(dataclasses.replace(joint, friction=SMOOTH) for joint in robot.joints)
    check_accelerations(dataclasses.replace(robot, joints=joints), drawn(robot))


@pytest.mark.parametrize("name", SPRINGS)
def test_every_spring_law_on_both_sides(name):
    """Within its domain."""
    (one, _), (two, _) = SPRINGS[name]
    motor = Motor(inertia=1)
    actuator = Antagonistic(motor=(motor, motor), spring=(one, two))
    robot = with_actuators(random_robot("R", 1), actuator)
    rng, q = np.random.default_rng(3), np.linspace(-2, 2, 30)[:, None]
    ends = ((max(-0.3, 0.9 * low), min(0.3, 0.9 * high)) for low, high in actuator.phi_ranges)
    phi = np.stack([rng.uniform(*each, q.shape) for each in ends], axis=-1)
    check_accelerations(robot, (q, q[..., None] + phi))


@pytest.mark.parametrize("name", ["quadratic", "exponential", "table, pulling"])
def test_a_tendon_that_is_slack_does_not_push(name):
    """Springs of the file, and of the forces beside it."""
    (one, _), (two, _) = SPRINGS[name]
    actuator = Antagonistic(motor=(Motor(inertia=1), Motor(inertia=1)), spring=(one, two))
    with compiled(with_actuators(random_robot("R", 1), actuator)) as (model, data):
        data.qpos[:] = [0, -0.3, 0.3]
        mujoco.mj_forward(model, data)
        assert not data.qfrc_passive.any()
        data.qpos[:] = [0, 0.3, 0.3]
        mujoco.mj_forward(model, data)
        assert data.qfrc_passive[1] < 0 == data.qfrc_passive[2]


@pytest.mark.cases(20)  # of every mechanism, with rotors coupled in either way or not
@pytest.mark.parametrize("coupled", [0, 0.06, -0.07])
@pytest.mark.parametrize("name", DEVICES)
def test_every_mechanism_with_coupled_rotors(name, coupled):
    device = DEVICES[name]
    actuator = Serial(
        motor=(Motor(inertia=0.3, damping=0.1), Motor(inertia=0.02, damping=0.05)),
        coupled_inertia=coupled,
        mechanism=device.mechanism,
    )
    robot = with_actuators(random_robot("RR", 4), actuator, actuator)
    rng, shape = np.random.default_rng(6), (20, 2)
    q = rng.uniform(-1, 1, shape)
    theta = np.stack((q + rng.uniform(*device.deflections, shape), rng.uniform(*device.settings, shape)), -1)
    check_accelerations(robot, (q, theta))


def test_a_spring_between_the_motors():
    robot = random_robot("R", 9)
    actuator = dataclasses.replace(robot.joints[0].actuator, coupling=CUBIC)
    coupled = with_actuators(robot, actuator)
    check_accelerations(coupled, drawn(coupled))


@pytest.mark.parametrize("location", ["link", "transmission"])
def test_dampers_whose_damping_is_a_control(location):
    robot = random_robot("RPR", 11)
    damper = Damper(location=location, range=(0, 20))
    elastic = Elastic(motor=Motor(inertia=1), stiffness=400)
    robot = with_actuators(robot, robot.joints[0].actuator, elastic, robot.joints[2].actuator)
    joints = (*(dataclasses.replace(joint, damper=damper) for joint in robot.joints[:2]), robot.joints[2])
    states = drawn(robot)
    damping = np.random.default_rng(1).uniform(0, 20, states[0].shape)
    check_accelerations(dataclasses.replace(robot, joints=joints), states, damping)


RUNS = {
    "vsa_3r": "rest_to_rest",
    "lwr_7r_vsa": "lwr_7r",
    "qbmove_arm_manual": "qbmove_arm",
    **{
        name: name
        for name in (
            *("rp_2", "mixed_3r", "planar_2r", "scara_4", "ur5_6r", "panda_7r", "maccepa_1r"),
            *("maccepa_vd_1r", "awas_1r", "cam_1r", "compact_1r", "coupled_1r", "hardening_1r"),
            *("measured_1r", "shifted_cams_1r", "sliding_anchor_1r", "tendon_1r", "torso_2x3r", "hand_3x2r"),
        )
    },
}
"""Robots that come along, and a motion of each."""


@pytest.mark.cases(6)
@pytest.mark.parametrize("name", RUNS)
def test_mujocos_inverse_dynamics_are_ours(name):
    robot, trajectory = shipped_run(name, RUNS[name])
    result = inverse_dynamics(robot, trajectory)
    assert inverse_error(robot, result, frame_of_wrenches(trajectory)) < ROUNDING


def test_controls_stand_in_the_order_of_exported_columns():
    robot = shipped_robot("maccepa_vd_1r")
    with compiled(robot) as (model, _):
        names = [model.actuator(index).name for index in range(model.nu)]
    assert names == ["elbow.motor_1.torque", "elbow.motor_2.torque", "elbow.damping"]


@pytest.mark.parametrize("name", ["mixed_3r", "maccepa_1r"])
def test_a_key_frame_has_the_start_of_a_run(name):
    robot, trajectory = shipped_run(name, name)
    result = inverse_dynamics(robot, trajectory)
    with compiled(robot, Start(*(getattr(result, each)[0] for each in Start._fields))) as (model, data):
        mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
        rows = coordinates(robot, model, result)
        np.testing.assert_array_equal(data.qpos, rows.positions[0])
        np.testing.assert_array_equal(data.qvel, rows.velocities[0])


def test_no_motion_begins_without_motors_positions():
    robot = vsa_3r()
    nothing = Start(np.zeros(3), np.zeros(3), np.full((3, 2), np.nan), np.zeros((3, 2)))
    with pytest.raises(InputError, match=r"no motion begins where base\.motor_1, base\.motor_2, shoulder"):
        mjcf_model(robot, nothing)


def test_the_tool_is_where_the_forward_kinematics_say():
    from vsacli import forward_kinematics

    robot = dataclasses.replace(random_robot("RPR", 3), tool=Pose(xyz=(0.1, 0.2, 0.3), rpy=(1.0, 0.2, -0.4)))
    q = np.array([0.4, -0.2, 2.0])
    with compiled(robot) as (model, data):
        for name, position in zip(robot.joint_names, q, strict=True):
            data.qpos[model.joint(name).qposadr[0]] = position
        mujoco.mj_kinematics(model, data)
        site = data.site("tool")
        pose = forward_kinematics(robot, q)[-1]
        np.testing.assert_allclose(site.xmat.reshape(3, 3), pose[:3, :3], atol=1e-14)  # products of rotations
        np.testing.assert_allclose(site.xpos, pose[:3, 3], atol=1e-14)


def test_flat_bodies_pass_whatever_way_they_lie():
    """MuJoCo compares principal moments without a tolerance."""
    rng = np.random.default_rng(0)
    for excess in np.linspace(0, 9e-13, 20):  # as far as it counts as rounding
        turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        moments = rng.uniform(1e-6, 1, 2)
        tensor = turn @ np.diag([*moments, moments.sum() * (1 + excess)]) @ turn.T
        link = Link(mass=1, com=(0, 0, 0), inertia=inertia_from_tensor(tensor))
        robot = vsa_3r()
        first = dataclasses.replace(robot.joints[0], link=link)
        with compiled(dataclasses.replace(robot, joints=(first,))):
            pass


def test_limits_are_there_and_do_not_act():
    robot = vsa_3r()
    limits = Limits(position=(-0.1, 0.1))
    motor = Motor(inertia=1, max_torque=2)
    joint = dataclasses.replace(robot.joints[0], limits=limits, actuator=Rigid(motor=motor))
    with compiled(dataclasses.replace(robot, joints=(joint,))) as (model, data):
        np.testing.assert_array_equal(model.jnt_range[0], [-0.1, 0.1])
        np.testing.assert_array_equal(model.actuator_ctrlrange[0], [-2, 2])
        data.qpos[0], data.ctrl[0] = 1, 5
        mujoco.mj_forward(model, data)
        assert not data.qfrc_constraint.any()
        assert data.qfrc_actuator[0] == 5


@pytest.mark.parametrize(
    ("mass", "moments", "match"),
    [
        (0, (1, 1, 1), "link of joint base: MuJoCo takes no body without mass"),
        (1, (1, 1, 0), "link of joint base: its smallest moment of inertia is 0 kg m"),
        (1, (1, 1, 3), r"breaks the triangle inequality \(3 > 1 \+ 1 kg m\^2\), which MuJoCo refuses"),
    ],
)
def test_what_mujoco_refuses_is_refused_with_the_link(mass, moments, match):
    inertia = Inertia(**dict(zip(("xx", "yy", "zz"), moments, strict=True)))
    robot, link = vsa_3r(), Link(mass=mass, com=(0, 0, 0), inertia=inertia)
    first = dataclasses.replace(robot.joints[0], link=link)
    with pytest.raises(InputError, match=match):
        mjcf_model(dataclasses.replace(robot, joints=(first, *robot.joints[1:])))


def test_friction_of_the_sign_is_refused():
    sharp = Motor(inertia=1, friction=Friction(coulomb=(1, 1)))
    actuator = Antagonistic(motor=(Motor(inertia=1), sharp), spring=(CUBIC, CUBIC))
    robot = with_actuators(random_robot("R", 1), actuator)
    with pytest.raises(InputError, match="joint joint_1: the friction of motor 2 has the width 0; MuJoCo's"):
        mjcf_model(robot)


WICKED = 'a<b>&"quoted" -- \'é\' 🤖 \\N{x} """'


def test_any_name_of_a_robot_is_a_model():
    robot = dataclasses.replace(shipped_robot("awas_1r"), name=WICKED)
    exported = mjcf_model(robot)
    assert ElementTree.fromstring(exported.text).get("model") == WICKED
    with compiled(robot) as (model, _):
        assert model.nu == 2


def test_numbers_have_all_their_digits():
    robot = random_robot("R", 21)
    text = mjcf_model(robot).text
    (body,) = (
        each for each in ElementTree.fromstring(text).iter("body") if each.get("name") == "joint_1.link"
    )
    inertial = body.find("inertial")
    assert float(inertial.get("mass")) == robot.joints[0].link.mass
    assert tuple(map(float, inertial.get("pos").split())) == robot.joints[0].link.com
