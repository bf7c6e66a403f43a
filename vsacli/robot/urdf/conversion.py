"""A robot made from a URDF, and what was done to it, as text: what may be wrong, what was left out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from vsacli.robot.model import Robot
from vsacli.robot.urdf.dh import Snap
from vsacli.robot.urdf.held_joints import HeldJoint
from vsacli.robot.urdf.placeholders import JointLoad, Placeholders
from vsacli.robot.urdf.residual import Residual
from vsacli.robot.urdf.serial_chain import SerialChain

EXACT_RESIDUAL = 1e-9
"""m and rad; kinematics that stray less are called the same."""

SMALLEST_RESIDUAL = 1e-12
"""m and rad; smaller residuals differ between machines, and are not told apart."""

_HEADER = ("joint", "a/m", "alpha/rad", "d/m", "theta/rad", "mass/kg", "links")


@dataclass(frozen=True)
class Conversion:
    """A robot made from a URDF, and what was done to it.

    Attributes:
        file: path of the URDF as given.
        chain: the joints and links it was made from; `chain.joints` belong to `robot.joints` in turn.
        robot: the result.
        placeholders: its actuators, as they were asked for.
        loads: what each joint carries at most, to which the actuators were sized.
        snaps: axes that were made parallel.
        residual: how far its tip strays from the chain's.
    """

    file: str
    chain: SerialChain
    robot: Robot
    placeholders: Placeholders
    loads: tuple[JointLoad, ...]
    snaps: tuple[Snap, ...]
    residual: Residual

    @property
    def one_motor_each(self) -> bool:
        """Whether a single motor drives each joint, so that what the URDF knows of motors holds for it."""
        return all(joint.actuator.motor_count == 1 for joint in self.robot.joints)

    def __str__(self) -> str:
        """The Denavit-Hartenberg table, how exact it is, what may be wrong, what was left out or changed."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        robot, count = self.robot, len(self.robot.joints)
        joints = f"{count} joint{'s' if count > 1 else ''}"
        yield f"{robot.name}: {joints} from {self.chain.base} to {self.chain.tip}"
        yield from _aligned(self._rows())
        yield f"total mass of the moving links: {sum(joint.link.mass for joint in robot.joints):.6g} kg"
        yield _exactness(self.residual)
        yield from (f"warning: {warning}" for warning in self.warnings())
        yield from self.notes()

    def _rows(self) -> Iterator[tuple[str, ...]]:
        yield _HEADER
        for joint, origin in zip(self.robot.joints, self.chain.joints, strict=True):
            row = (joint.dh.a, joint.dh.alpha, joint.dh.d, joint.dh.theta, joint.link.mass)
            others = len(origin.links) - 1
            carried = origin.links[0].name + (f" + {others}" if others else "")
            yield (joint.name, *(f"{number:.6g}" for number in row), carried)

    def warnings(self) -> Iterator[str]:
        """What may not be what was meant, one sentence each."""
        yield from (warning for held in self.chain.held for warning in held.warnings())
        yield from self.robot.warnings

    def notes(self) -> Iterator[str]:
        """What was left out or changed, one sentence each."""
        joints = [joint.urdf for joint in self.chain.joints]
        yield from _held("below the base", self.chain.held_below)
        yield from _held("beside the chain, their links lumped", self.chain.held_beside)
        for snap in self.snaps:
            yield f"axis of {snap.joint} made parallel to the one before it, {snap.angle:.2g} rad off"
        yield from self._of_motors()
        for what in dict.fromkeys(label for joint in joints for label in joint.left_out):
            yield f"{what} left out: {', '.join(joint.name for joint in joints if what in joint.left_out)}"

    def _of_motors(self) -> Iterator[str]:
        """What becomes of effort limits and gears, which are those of a single motor."""
        joints = [joint.urdf for joint in self.chain.joints]
        known = {
            "effort limits (joint side)": [joint.name for joint in joints if joint.limit.effort],
            "gear reductions": [f"{joint.name} {joint.gear_ratio:g}" for joint in joints if joint.gear_ratio],
        }
        taken = "taken over" if self.one_motor_each else "not taken over, since two motors share a joint"
        for what, names in known.items():
            if names:
                yield f"{what} {taken}: {', '.join(names)}"


def _held(place: str, joints: Sequence[HeldJoint]) -> Iterator[str]:
    """Which joints stand at zero, and which elsewhere."""
    at_zero = [joint.urdf.name for joint in joints if joint.position == 0]
    elsewhere = [str(joint) for joint in joints if joint.position != 0]
    if at_zero:
        yield f"held at zero {place}: {', '.join(at_zero)}"
    if elsewhere:
        yield f"held {place}: {', '.join(elsewhere)}"


def _exactness(residual: Residual) -> str:
    verdict = "the same as" if max(residual) <= EXACT_RESIDUAL else "not quite"
    position, orientation = (max(error, SMALLEST_RESIDUAL) for error in residual)
    errors = f"{position:.1e} m and {orientation:.1e} rad"
    return f"forward kinematics: {verdict} the URDF's, the tip within {errors}"


def _aligned(rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    """Columns of one width, numbers to the right."""
    table = list(rows)
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for first, *numbers, last in table:
        cells = [f"{cell:>{width}}" for cell, width in zip(numbers, widths[1:-1], strict=True)]
        yield "  ".join([f"{first:<{widths[0]}}", *cells, last])
