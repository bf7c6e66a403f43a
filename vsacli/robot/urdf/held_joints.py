"""Joints that could move but stand still, below the base or beside the chain: where each of them stands."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import NamedTuple

from vsacli.base.did_you_mean import did_you_mean
from vsacli.documents.expression import ExpressionError
from vsacli.documents.number import evaluate
from vsacli.documents.source import Problems
from vsacli.documents.tree import quoted
from vsacli.robot.urdf.link_tree import LARGEST_NUMBER, MOVING, Urdf, UrdfJoint

Hold = Mapping[str, float | str]
"""Positions by name of the joint, rad (m), or texts such as "90 deg"."""

LIMIT_ROUNDING = 1e-9
"""rad or m; a joint that is this far beyond a limit stands at it."""


class HeldJoint(NamedTuple):
    """A joint that could move but stands still.

    Attributes:
        urdf: the joint as its file describes it.
        position: where it stands, rad (m).
        leader: name of the joint that it follows in the end, its own if it follows none that there is.
    """

    urdf: UrdfJoint
    position: float
    leader: str

    @property
    def follows(self) -> bool:
        """Whether another joint takes it where it stands."""
        return self.leader != self.urdf.name

    def __str__(self) -> str:
        following = f" (follows {self.leader})" if self.follows else ""
        return f"{self.urdf.name} at {self.position:.6g} {self.urdf.unit()}{following}"

    def warnings(self) -> Iterator[str]:
        """That it may not stand where it should, and how to mend that."""
        mimic, limit = self.urdf.mimic, self.urdf.limit.position
        if mimic is not None and not self.follows and self.position == _resting(self.urdf):
            reason = f"there is no joint {quoted(mimic.leader)}, which it should follow (<mimic>)"
            yield f"{self}: {reason}; if it stands elsewhere, say so by --hold {self.leader}=VALUE"
        if limit is not None and not limit[0] - LIMIT_ROUNDING <= self.position <= limit[1] + LIMIT_ROUNDING:
            low, high = limit
            value = "VALUE" if self.follows else f"{max(low, min(high, self.position)):.6g}"
            limits = f"is outside its limits, {low:.6g} to {high:.6g} {self.urdf.unit()}"
            yield f"{self} {limits}; hold it elsewhere by --hold {self.leader}={value}"


def held_joints(
    urdf: Urdf, standing: Iterable[UrdfJoint], moving: Collection[str], hold: Hold
) -> list[HeldJoint]:
    """The joints that stand still, each where it is held or follows another one to, else at zero.

    Args:
        urdf: the robot.
        standing: the joints.
        moving: names of those that move, which none of them follows.
        hold: positions of joints that follow none.

    Raises:
        InputError: such a position cannot be given, or has no effect.
    """
    followed = [(joint, urdf.followed(joint)) for joint in standing]
    leaders = {mimic.leader: _resting(urdf.joints[mimic.leader]) for _, mimic in followed}
    problems = Problems(urdf.file)
    for name, value in hold.items():
        leaders[name] = _given(urdf, name, value, leaders, moving, problems)
    problems.check()
    held = [
        HeldJoint(joint, mimic.multiplier * leaders[mimic.leader] + mimic.offset, mimic.leader)
        for joint, mimic in followed
    ]
    for joint, position, leader in held:
        if not abs(position) <= LARGEST_NUMBER:
            message = f"following {quoted(leader)} it stands at {position:g} {joint.unit()}"
            problems.add(joint.line, f"joint {quoted(joint.name)}: {message}, more than can be computed with")
    problems.check()
    return held


def _resting(joint: UrdfJoint) -> float:
    """Where a joint stands if nobody says where: as if what it follows, but is not there, stood at zero."""
    return 0.0 if joint.mimic is None else joint.mimic.offset


def _given(
    urdf: Urdf,
    name: str,
    value: float | str,
    leaders: Collection[str],
    moving: Collection[str],
    problems: Problems,
) -> float:
    """The position at which a joint is to be held; 0 if a problem was noted."""
    reason = _reason_against(urdf, name, leaders, moving)
    if reason:
        problems.add(0, f"hold: {reason}")
        return 0.0
    unit = urdf.joints[name].unit()
    try:
        return evaluate(str(value), unit)
    except ExpressionError as error:
        found = quoted(str(value))
        problems.add(0, f"hold: {quoted(name)}: expected a number in {unit}, found {found}: {error}")
        return 0.0


def _reason_against(urdf: Urdf, name: str, leaders: Collection[str], moving: Collection[str]) -> str:
    """Why a joint cannot be held; empty if it can."""
    joint, shown = urdf.joints.get(name), quoted(name)
    if joint is None:
        return f"there is no joint {shown}{did_you_mean(name, leaders)}"
    if joint.type not in MOVING:
        return f"{shown} is {joint.type}, so it has no position to choose"
    if name in moving:
        return f"{shown} belongs to the chain, where it moves"
    if (leader := urdf.followed(joint).leader) != name:
        return f"{shown} follows {quoted(leader)} (<mimic>); hold that one"
    if name not in leaders:
        return f"{shown} is neither beside the chain nor below its base, so that it has no effect"
    return ""
