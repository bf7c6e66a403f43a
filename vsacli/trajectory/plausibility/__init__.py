"""Numbers of a trajectory that are hardly what was meant, for the robot that is to execute it."""

from __future__ import annotations

from vsacli.base.errors import Problem
from vsacli.documents.plausibility import Written, findings
from vsacli.documents.source import Source
from vsacli.robot.plausibility import strange_of_robot
from vsacli.trajectory.plausibility.effort_rules import EFFORT_RULES
from vsacli.trajectory.plausibility.facts import Facts
from vsacli.trajectory.plausibility.motion_rules import MOTION_RULES

TRAJECTORY_RULES = (*MOTION_RULES, *EFFORT_RULES)


def implausible(facts: Facts, source: Source) -> tuple[Problem, ...]:
    """What the rules find, with the lines of the trajectory file."""
    known = strange_of_robot(facts.robot.facts, facts.robot.sources)
    return findings(TRAJECTORY_RULES, facts, Written(source), known)
