"""Trajectory files for a revolute joint `arm` and a prismatic joint `slide`, in pieces."""

from __future__ import annotations

import functools
from pathlib import Path

import pytest

from vsacli import InputError, Robot, Trajectory, load_robot, load_trajectory

ROOT = Path(__file__).parents[2]
HEAD = "format: vsacli-trajectory/1\nname: move\n"
LASTING = HEAD + "duration: 4\nrate: 100\n"
STANDING = "position: {type: constant, value: 0}\n"
FIRM = "stiffness: {type: constant, value: 9000}\n"
VIA = "position:\n  type: via\n  degree: 7\n  points: [0, {arm: 60 deg, slide: 0.2}, [1, 0.1]]\n"
SOFTENING = "stiffness:\n  type: via\n  degree: 3\n  points: [9000, [900, 8000], 9000]\n"
SINUSOIDS = "position:\n  type: sinusoids\n  frequency: 0.5\n  offset: {arm: 30 deg, slide: 0.1}\n"
SWINGING = "stiffness:\n  type: sinusoids\n  frequency: 0.25\n  offset: [900, 8000]\n"
STEPS = "stiffness:\n  type: steps\n  degree: 5\n  levels: [9000, [900, 8000], 9500]\n"
PUSH = (
    "wrench:\n  type: steps\n  frame: base\n  degree: 5\n  levels: [[0, 0, 0, 0, 0, 0], [1, 2, 3, 4, 5, 6]]\n"
)
SEQUENCE = "position:\n  type: sequence\n  parts:\n"
GO = "  - {type: polynomial, duration: 1.5, degree: 9, start: [0, 0.1], end: [1, 0.2]}\n"
DWELL = "  - {type: dwell, duration: 0.7}\n"
ON = "  - {type: polynomial, duration: 0.9, degree: 9, end: 0}\n"


@functools.cache
def two_joints() -> Robot:
    """The robot."""
    return load_robot(ROOT / "robots" / "rp_2.yaml")


def load(text: str) -> Trajectory:
    """The trajectory that a text declares, as `move.yaml` in the working folder."""
    Path("move.yaml").write_text(text)
    return load_trajectory("move.yaml", two_joints())


def problems(text: str) -> list[str]:
    """What is wrong with it, line by line."""
    with pytest.raises(InputError) as caught:
        load(text)
    return str(caught.value).splitlines()
