"""The recursion against its peers: 1 casadi, 2 Pinocchio, 3 the paper."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from casadi_peer import CasadiPeer
from pinocchio_peer import link_torques as pinocchio_torques
from subjects import motion, seven_joints
from timing import cpu_seconds, medians

from vsacli import link_torques

DURATION = 3.0
OURS = "vsacli, NumPy"
CASADI = "casadi.SX, twice jtimes, C"
PINOCCHIO = "pin.rnea in a Python loop, finite differences"


class Kernel(NamedTuple):
    """One way to compute tau_e, dtau_e, ddtau_e of the arm with seven joints.

    Attributes:
        name: of the way.
        seconds: of processor time a sample.
        differences: of the three from what vsacli finds, relative to their peaks; None for itself.
    """

    name: str
    seconds: float
    differences: tuple[float, ...] | None


def compare(samples: int, python_samples: int, repeats: int) -> list[Kernel]:
    """Time and compare them in one run; the Python loop runs over fewer samples."""
    robot = seven_joints()
    moving, few = motion(7, samples), motion(7, python_samples)
    step = DURATION / (python_samples - 1)
    with tempfile.TemporaryDirectory() as folder:
        casadi = CasadiPeer(robot, Path(folder))
        ways = {
            OURS: cpu_seconds(lambda: link_torques(robot, *moving)),
            CASADI: lambda: casadi(moving)[0],
            PINOCCHIO: cpu_seconds(lambda: pinocchio_torques(robot, few, step)),
        }
        seconds = medians(ways, repeats)
        by_casadi = np.split(casadi(moving)[1], 3, axis=1)
    ours, ours_of_few = link_torques(robot, *moving), link_torques(robot, *few)
    return [
        Kernel(OURS, seconds[OURS] / samples, None),
        Kernel(CASADI, seconds[CASADI] / samples, _differences(by_casadi, ours)),
        Kernel(
            PINOCCHIO,
            seconds[PINOCCHIO] / python_samples,
            _differences(pinocchio_torques(robot, few, step), ours_of_few),
        ),
    ]


def _differences(found: Iterable[np.ndarray], expected: Iterable[np.ndarray]) -> tuple[float, ...]:
    return tuple(
        float(np.abs(theirs - ours).max() / np.abs(ours).max())
        for theirs, ours in zip(found, expected, strict=True)
    )
