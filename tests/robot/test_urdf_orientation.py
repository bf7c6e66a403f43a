"""Orientations in a URDF: quaternions, which turn as the same angles do, and angles in degrees."""

from __future__ import annotations

import re

import numpy as np
import pytest
from samples.urdf import random_serial, serial, write
from scipy.spatial.transform import Rotation

from vsacli import InputError, import_urdf, link_torques

ROUNDING = 1e-13
"""Relative, of torques at random positions; conversion between angles and quaternion rounds to 1e-16."""


@pytest.fixture
def urdf(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda text: write(tmp_path / "arm.urdf", text).name


def with_quaternions(text: str, lengths: np.random.Generator | None = None) -> str:
    """The same file with quaternions for all angles, of random length if asked for."""

    def written(angles: re.Match[str]) -> str:
        rotation = Rotation.from_euler("xyz", [float(word) for word in angles[1].split()])
        length = 1.0 if lengths is None else lengths.uniform(-3, 3)
        numbers = " ".join(repr(float(number)) for number in rotation.as_quat() * length)
        return f'quat_xyzw="{numbers}"'

    return re.sub('rpy="([^"]*)"', written, text).replace("<robot", '<robot version="1.1"')


def torques(path: str) -> np.ndarray:
    robot = import_urdf(path).robot
    q, dq, ddq = np.random.default_rng(3).uniform(-2, 2, (3, 5, len(robot.joints)))
    return link_torques(robot, q, dq, ddq, 0 * q, 0 * q)[0]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("lengths", [None, np.random.default_rng(5)], ids=["unit", "any length"])
def test_quaternions_turn_as_the_same_angles(urdf, seed, lengths):
    text = random_serial("RPR", seed)
    expected = torques(urdf(text))
    found = torques(urdf(with_quaternions(text, lengths)))
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())


ORIGIN = 'xyz="0.3 0 0.1" rpy="0 0 0"'
"""The origin of each joint of ARM; j1 stands in line 5."""

ARM = serial("RR")


@pytest.mark.parametrize(
    ("version", "orientation", "problem"),
    [
        ("1.1", 'rpy="0 0 0" quat_xyzw="0 0 0 1"', "rpy and quat_xyzw in one origin; remove one of them"),
        ("1.1", 'quat_xyzw="0 0 0 0"', "quat_xyzw: [0.0, 0.0, 0.0, 0.0] has no direction"),
        ("1.1", 'quat_xyzw="0 0 1"', "quat_xyzw: expected 4 numbers, found 3"),
        ("1.1", 'quat_xyzw="0 0 1 x"', "quat_xyzw: expected a number of at most 1e+09, found 'x'"),
        ("1.0", 'quat_xyzw="0 0 0 1"', 'quat_xyzw needs URDF 1.1; write version="1.1" in <robot>, or'),
    ],
)
def test_quaternions_that_are_none(urdf, version, orientation, problem):
    text = ARM.replace(ORIGIN, f'xyz="0.3 0 0.1" {orientation}', 1)
    path = urdf(text.replace("<robot", f'<robot version="{version}"'))
    with pytest.raises(InputError, match=f"^arm.urdf:5: {re.escape(problem)}"):
        import_urdf(path)


def warnings(conversion) -> list[str]:
    return [warning for warning in conversion.warnings() if "placeholder" not in warning]


@pytest.mark.parametrize(
    ("orientation", "warning"),
    [
        ('quat_xyzw="0 0 0 2"', "arm.urdf:5: quat_xyzw has the length 2, not 1; its direction is used"),
        ('quat_xyzw="0 0.707 0 0.707"', ""),
        ('rpy="0 90 0"', "arm.urdf:5: rpy: 90 rad is 14.3 turns; did you mean 90 deg?"),
        ('rpy="-180 0 45"', "arm.urdf:5: rpy: -180 rad is 28.6 turns; did you mean -180 deg?"),
        ('rpy="7 9.42477796 0"', "arm.urdf:5: rpy: 7 rad is 1.11 turns; did you mean 7 deg?"),
        ('rpy="0 6.2831853 0"', ""),
        ('rpy="0 9.42477796 0"', ""),  # a computed multiple of a right angle
    ],
)
def test_orientations_that_may_be_wrong(urdf, orientation, warning):
    text = ARM.replace(ORIGIN, f'xyz="0.3 0 0.1" {orientation}', 1)
    conversion = import_urdf(urdf(text.replace("<robot", '<robot version="1.1"')))
    assert warnings(conversion) == [warning] * (warning != "")


def test_a_file_in_degrees_has_one_warning(urdf):
    text = ARM.replace("0 0 0", "0 0 90")
    assert warnings(import_urdf(urdf(text))) == [
        "arm.urdf:5: rpy: 90 rad is 14.3 turns; did you mean 90 deg? (and 1 more below)"
    ]


@pytest.mark.parametrize("version", ["1.3", "2", "abc"])
def test_an_unknown_version_is_read_as_the_newest(urdf, version):
    text = with_quaternions(ARM).replace('"1.1"', f'"{version}"')
    assert warnings(import_urdf(urdf(text))) == [f"arm.urdf:1: version '{version}' is unknown; read as 1.2"]
