"""Joint axes of a URDF to Denavit-Hartenberg frames: exact, and sane where axes are almost parallel."""

from __future__ import annotations

import math

import numpy as np
import pytest
from oracles.kinematics import tool_pose
from oracles.urdf_pinocchio import UrdfOracle
from samples.urdf import joint, link, random_serial, robot, serial, write

from vsacli import import_urdf, link_torques
from vsacli.robot.urdf.link_tree import pose_matrix, roll_pitch_yaw

RIGHT = "1.5707963267948966"


@pytest.fixture
def path(tmp_path):
    """Writes a URDF, with the limits without which Pinocchio's reader refuses joints."""
    limits = '<limit lower="-4" upper="4" effort="1" velocity="1"/>'
    return lambda text: write(tmp_path / "arm.urdf", text.replace("</joint>", f"{limits}</joint>"))


def strays(conversion, samples: int = 20) -> tuple[float, float]:
    """Largest distance of the tips, and largest relative error of torques, from Pinocchio's reading."""
    chain, built = conversion.tree, conversion.robot
    oracle, names = UrdfOracle(conversion.file), [each.urdf.name for each in chain.joints]
    q, dq, ddq = np.random.default_rng(1).uniform(-2, 2, (3, samples, len(chain.joints)))
    expected = np.array([oracle.torques(names, *row) for row in zip(q, dq, ddq, strict=True)])
    found = link_torques(built, q, dq, ddq, 0 * q, 0 * q)[0]
    tips = [
        tool_pose(built, row).real - oracle.tip_pose(names, chain.base, chain.tips[0].link, row) for row in q
    ]
    return float(np.abs(tips).max()), float(np.abs(found - expected).max() / np.abs(expected).max())


@pytest.mark.parametrize("letters", ["R", "P", "RRP", "PRPR", "CRRPCRR"])
@pytest.mark.parametrize("seed", range(8))
def test_random_chains_are_converted_exactly(path, letters, seed):
    conversion = import_urdf(path(random_serial(letters, seed)))
    assert conversion.snaps == ()
    tip, torque = strays(conversion)
    # Rounding alone: numbers shortened within 1e-11, common normals within FAR.
    assert tip < 1e-10
    assert torque < 1e-10
    assert conversion.residual.position < 1e-10


def test_rows_of_a_planar_arm(path):
    rows = [each.dh for each in import_urdf(path(serial("RRR", xyz="0.3 0 0"))).robot.joints]
    assert [(row.a, row.alpha, row.d, row.theta) for row in rows] == [
        (0.3, 0, 0, 0),
        (0.3, 0, 0, 0),
        (0, 0, 0, 0),
    ]


def test_rows_of_a_wrist(path):
    text = serial("RRR", ["0 0 0", f"{RIGHT} 0 0", f"-{RIGHT} 0 0"], xyz="0 0 0")
    rows = [each.dh for each in import_urdf(path(text)).robot.joints]
    assert [(row.a, row.d) for row in rows] == [(0, 0)] * 3
    assert [row.alpha for row in rows] == [math.pi / 2, -math.pi / 2, 0]


def test_axes_that_point_against_each_other(path):
    conversion = import_urdf(path(serial("RR", ["0 0 0", "3.141592653589793 0 0"])))
    assert abs(conversion.robot.joints[0].dh.alpha) == math.pi
    assert strays(conversion)[0] < 1e-14  # rounding


@pytest.mark.parametrize("tilt", [1e-5, -3.7e-6, 1e-8, 3e-10])
def test_almost_parallel_axes_are_made_parallel(path, tilt):
    conversion = import_urdf(path(serial("RRR", ["0 0 0", f"0 {tilt} 0", "0 0 0"])))
    assert [snap.joint for snap in conversion.snaps] == ["j2", "j3"]
    for snap in conversion.snaps:
        assert math.isclose(snap.angle, abs(tilt), rel_tol=1e-6)  # rounding is 1e-16/3e-10 of the smallest
    assert any("axis of j3 made parallel to the one before it" in note for note in conversion.notes())
    assert max(abs(each.dh.d) for each in conversion.robot.joints) < 1
    # The tilt times the lengths behind it: the tip is 0.316 m from the second joint.
    assert 0.1 * abs(tilt) < conversion.residual.position < abs(tilt)
    # Half a turn about an axis that is off by an angle ends twice that angle off; 256 draws come close to it.
    assert math.isclose(conversion.residual.orientation, 2 * abs(tilt), rel_tol=0.2)
    assert strays(conversion)[0] < 2 * abs(tilt)


def test_unsnapped_they_would_meet_far_away(path):
    conversion = import_urdf(path(serial("RR", ["0 0 0", "1e-6 0 0"], xyz="0 0.4 0")), snap=0)
    assert conversion.snaps == ()
    assert math.isclose(abs(conversion.robot.joints[0].dh.d), 4e5, rel_tol=1e-9)


@pytest.mark.parametrize("tilt", [1e-6, 1e-8, 3e-11])
def test_almost_parallel_axes_that_meet_nearby_stay_as_they_are(path, tilt):
    conversion = import_urdf(path(serial("RR", ["0.3 0.5 0.7", f"{tilt} 0 0"], xyz="0 0 0.4")))
    assert conversion.snaps == ()
    assert math.isclose(conversion.robot.joints[0].dh.alpha, tilt, rel_tol=1e-4)  # 1e-16/3e-11, and some
    assert strays(conversion)[0] < 1e-11  # lengths that are short but for 1e-11


def test_what_the_file_rounded_is_no_tilt(path):
    text = serial("RRR", ["0 0 0", "0 1.57079632679 0", "0 -1.57079632679 0"])
    conversion = import_urdf(path(text))
    assert conversion.snaps == ()
    assert [each.dh.alpha for each in conversion.robot.joints] == [math.pi / 2, -math.pi / 2, 0]
    assert 0 < strays(conversion)[0] < 1e-11  # 5e-12 rad, over less than a meter


def test_a_slide_almost_parallel_to_the_next_axis_needs_no_snapping(path):
    conversion = import_urdf(path(serial("PR", ["0 0 0", "0 1e-6 0"])))
    assert conversion.snaps == ()
    assert strays(conversion)[0] < 1e-13  # rounding


def test_joint_zeros_go_into_theta_and_d(path):
    text = robot(
        link("a"), link("b"), link("c"),
        joint("turn", "a", "b", "R", xyz="0 0 0.2", rpy="0 0 0.3"),
        joint("slide", "b", "c", "P", xyz="0 0 0.1"),
    )  # fmt: skip
    conversion = import_urdf(path(text))
    turn, slide = conversion.robot.joints
    assert math.isclose(turn.dh.theta + slide.dh.theta, 0.3, rel_tol=1e-15)
    assert math.isclose(turn.dh.d + slide.dh.d + conversion.robot.base.xyz[2], 0.3, rel_tol=1e-15)
    assert conversion.robot.tool.rpy == (0, 0, 0)


def test_a_small_robot_keeps_its_digits(path):
    text = serial("RR", xyz="1.23456789e-6 0 0").replace("0.1 0 0.2", "1e-7 0 0")
    assert import_urdf(path(text)).robot.joints[0].dh.a == 1.23456789e-6


@pytest.mark.parametrize("pitch", [0.3, math.pi / 2, -math.pi / 2, math.pi / 2 - 1e-9])
def test_roll_pitch_yaw_gives_the_rotation_back(pitch):
    rotation = pose_matrix((0, 0, 0), (0.7, pitch, -2.1))[:3, :3]
    again = pose_matrix((0, 0, 0), roll_pitch_yaw(rotation))[:3, :3]
    np.testing.assert_allclose(again, rotation, rtol=0, atol=1e-15)  # rounding
