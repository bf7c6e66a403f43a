"""Paths of parameters in words."""

from __future__ import annotations

import pytest

from vsacli.results.charts.parameter_words import parameter_words

JOINTS = ("base", "elbow")


@pytest.mark.parametrize(
    ("path", "unit", "words"),
    [
        ("joints.*.actuator.spring.k", "N m/rad", "spring stiffness k, all joints"),
        ("joints.elbow.actuator.spring.k_c", "N m/rad^3", "cubic spring stiffness k_c, elbow"),
        ("joints.1.actuator.spring.0.k", "N/m", "spring 1 stiffness k, elbow"),
        ("joints.el*.actuator.spring.k", "", "spring k, joints el*"),
        ("joints.elbow.actuator.motor.1.inertia", "kg m^2", "motor 2 inertia, elbow"),
        ("joints.elbow.actuator.motor.torque_constant", "N m/A", "motor torque constant, elbow"),
        ("joints.base.link.com.0", "m", "link center of mass x, base"),
        ("joints.base.dh.a", "m", "DH a, base"),
        ("base.rpy.1", "rad", "base pitch"),
        ("gravity.2", "m/s^2", "gravity z"),
        ("duration", "s", "duration"),
        ("stiffness.end.elbow", "N m/rad", "stiffness end, elbow"),
    ],
)
def test_words_name_the_quantity_and_the_joint(path: str, unit: str, words: str) -> None:
    assert parameter_words(path, unit, JOINTS) == words
