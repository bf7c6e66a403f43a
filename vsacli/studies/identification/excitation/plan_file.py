"""A planned excitation as a trajectory file with comments."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import Any

from vsacli.base.signals import COMMANDED, POSITION
from vsacli.base.texts import one_line
from vsacli.base.version import __version__
from vsacli.documents.commented import WIDTH, commented_document
from vsacli.studies.identification.excitation.design import RATE
from vsacli.studies.identification.excitation.plan_report import Excitation
from vsacli.studies.remedies.formulas import formula
from vsacli.trajectory import file as trajectory_file


def excitation_text(excitation: Excitation) -> str:
    """The trajectory file of a planned excitation, as text."""
    trajectory = excitation.trajectory
    profiles = {POSITION.key: trajectory.position}
    profiles |= {
        key: profile
        for key, profile in trajectory.commanded.items()
        if trajectory.chosen(key).any() and COMMANDED[key].device is None
    }
    values: dict[str, Any] = {
        "name": trajectory.name,
        "duration": trajectory.duration,
        "rate": RATE,
    }
    values |= {key: formula(profile) for key, profile in profiles.items()}
    head = [part for line in _head(excitation) for part in textwrap.wrap(one_line(line), WIDTH - 2)]
    return commented_document(trajectory_file.FORMAT, trajectory_file.OF_ANY_ROBOT, values, head)


def _head(excitation: Excitation) -> Iterator[str]:
    """What reads the file should know."""
    names = ", ".join(excitation.robot.joint_names)
    yield (
        f"Excitation to identify {excitation.robot.name} by; planned by vsacli {__version__}, seed "
        f"{excitation.seed}. Lists have an entry for each joint: {names}."
    )
    yield (
        "The plan knows the limits of the robot and nothing of what stands about it: look at the motion, and "
        "try it slowly, before the robot moves."
    )
    yield from excitation.assumptions
