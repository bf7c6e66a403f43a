"""Joints of a URDF that could move but are held: at zero, where chosen, or where another takes them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import NamedTuple

from vsacli.base.did_you_mean import did_you_mean
from vsacli.documents.expression import ExpressionError
from vsacli.documents.number import evaluate
from vsacli.documents.source import Problems
from vsacli.documents.tree import quoted
from vsacli.robot.urdf.link_tree import LARGEST_NUMBER, MOVING, Urdf, UrdfJoint
from vsacli.robot.urdf.moving_joints import MovingJoints

Hold = Mapping[str, float | str]
"""Positions of held joints by name, rad (m), or texts such as "90 deg"."""

LIMIT_ROUNDING = 1e-9
"""Distance, rad or m, by which a held joint may be beyond a limit without a warning."""


class HeldJoint(NamedTuple):
    """A joint that could move but is held.

    Attributes:
        urdf: joint of the URDF.
        position: position at which it is held, rad (m).
        leader: name of the last leader in a chain of mimics; its own without an existing leader.
        released: whether it is held although it follows a joint that moves.
    """

    urdf: UrdfJoint
    position: float
    leader: str
    released: bool = False

    @property
    def follows(self) -> bool:
        """Whether its position follows from another joint."""
        return self.leader != self.urdf.name

    def __str__(self) -> str:
        following = f" (follows {self.leader})" if self.follows else ""
        return f"{self.urdf.name} at {self.position:.6g} {self.urdf.unit()}{following}"

    def warnings(self) -> Iterator[str]:
        """Yield warnings that the position may be wrong, with a fix."""
        mimic, limit = self.urdf.mimic, self.urdf.limit.position
        if mimic is not None and self.released:
            yield f"{self}: it follows {mimic.leader} (<mimic>), and its motion with that joint is neglected"
        elif mimic is not None and not self.follows and self.position == _default_position(self.urdf):
            reason = f"there is no joint {quoted(mimic.leader)}, which it should follow (<mimic>)"
            yield f"{self}: {reason}; if it stands elsewhere, say so by --hold {self.leader}=VALUE"
        if limit is not None and not limit[0] - LIMIT_ROUNDING <= self.position <= limit[1] + LIMIT_ROUNDING:
            low, high = limit
            value = "VALUE" if self.follows else f"{max(low, min(high, self.position)):.6g}"
            limits = f"is outside its limits, {low:.6g} to {high:.6g} {self.urdf.unit()}"
            yield f"{self} {limits}; hold it elsewhere by --hold {self.leader}={value}"


def held_joints(
    urdf: Urdf, standing: Iterable[UrdfJoint], moving: MovingJoints, hold: Hold
) -> list[HeldJoint]:
    """Return held joints, at their given position, at one that follows from a leader, or at zero.

    Args:
        urdf: robot.
        standing: joints to hold.
        moving: joints that move.
        hold: positions of joints that follow no other, or one that moves.

    Raises:
        InputError: a position cannot be given, or has no effect.
    """
    followed = [(joint, urdf.relation_to_leader(joint, hold)) for joint in standing]
    leaders = {mimic.leader: _default_position(urdf.joints[mimic.leader]) for _, mimic in followed}
    problems = Problems(urdf.file)
    for name, value in hold.items():
        leaders[name] = _read_hold_position(urdf, name, value, leaders, moving, problems)
    problems.check()
    held = [
        HeldJoint(
            joint,
            mimic.multiplier * leaders[mimic.leader] + mimic.offset,
            mimic.leader,
            joint.name in hold and urdf.relation_to_leader(joint).leader in moving.names,
        )
        for joint, mimic in followed
    ]
    for joint, position, leader, _ in held:
        if not abs(position) <= LARGEST_NUMBER:
            message = f"following {quoted(leader)} it stands at {position:g} {joint.unit()}"
            problems.add(joint.line, f"joint {quoted(joint.name)}: {message}, more than can be computed with")
    problems.check()
    return held


def _default_position(joint: UrdfJoint) -> float:
    """Return the default position of a joint: zero, or that at which its missing leader is at zero."""
    return 0.0 if joint.mimic is None else joint.mimic.offset


def _read_hold_position(
    urdf: Urdf,
    name: str,
    value: float | str,
    leaders: Collection[str],
    moving: MovingJoints,
    problems: Problems,
) -> float:
    """Return the given position of a held joint; 0 after adding a problem."""
    option = f"--hold {name}={value}"
    reason = _reason_against(urdf, name, leaders, moving)
    if reason:
        problems.add(0, f"{option}: {reason}")
        return 0.0
    unit = urdf.joints[name].unit()
    try:
        return evaluate(str(value), unit)
    except ExpressionError as error:
        problems.add(0, f"{option}: {error}")
        return 0.0


def _reason_against(urdf: Urdf, name: str, leaders: Collection[str], moving: MovingJoints) -> str:
    """Return the reason why a joint cannot be held; empty if it can."""
    joint, shown = urdf.joints.get(name), quoted(name)
    if joint is None:
        return f"there is no joint {shown} outside the {moving.shape}{did_you_mean(name, leaders)}"
    if joint.type not in MOVING:
        return f"{shown} is {joint.type}, so it has no position to choose"
    if name in moving.names:
        return f"{shown} belongs to the {moving.shape}, where it moves"
    if (leader := urdf.relation_to_leader(joint).leader) != name and leader not in moving.names:
        return f"{shown} follows {quoted(leader)} (<mimic>); hold that one"
    if name not in leaders:
        return f"{shown} is neither outside the {moving.shape} nor below its base, so that it has no effect"
    return ""
