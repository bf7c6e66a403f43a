"""Inverse dynamics with a defect in one of its results, which checks must notice."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from vsacli.actuators.transmission import JointVariables
from vsacli.dynamics import inverse
from vsacli.dynamics.elastic_torques import LinkTorques

Defect = Callable[[np.ndarray], np.ndarray]


def scaled(factor: float) -> Defect:
    """The defect of a wrong factor."""
    return lambda values: values * factor


def spoil_torque(monkeypatch: pytest.MonkeyPatch, order: int, defect: Defect) -> None:
    """Let (36)-(60) return a derivative of tau_e, (samples, joints), with a defect."""

    class Spoiled(LinkTorques):
        def __call__(self, rows: Sequence[np.ndarray]) -> list[np.ndarray]:
            torques, joints = super().__call__(rows), len(self.robot.joints)
            part = slice(order * joints, (order + 1) * joints)
            torques[part] = list(defect(np.stack(torques[part], axis=-1)).T)
            return torques

    monkeypatch.setattr(inverse, "LinkTorques", Spoiled)


def spoil_drive(monkeypatch: pytest.MonkeyPatch, name: str, defect: Defect, joint_name: str = "") -> None:
    """Let (61)-(74) return a variable, (motors, samples), with a defect, at one joint or at all."""
    drive = inverse.drive

    def spoiled(joint, *arguments) -> JointVariables:
        driven = drive(joint, *arguments)
        if joint_name not in ("", joint.name):
            return driven
        return driven._replace(**{name: defect(getattr(driven, name))})

    monkeypatch.setattr(inverse, "drive", spoiled)
