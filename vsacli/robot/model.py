"""The robot: a Denavit-Hartenberg chain of links, each joint with its motors and springs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

from vsacli.actuators.actuator import Actuator
from vsacli.base import units
from vsacli.base.errors import Problem, check_type
from vsacli.base.signals import COMMANDED, Signal
from vsacli.base.tables import aligned, html_table
from vsacli.base.variables import LOSSES, OF_ANY_ROBOT, VARIABLES, Variable
from vsacli.documents.fields import (
    Items,
    Name,
    RecordOf,
    boolean,
    text,
    value,
    vector,
)
from vsacli.documents.record_checks import DeclaredRecord
from vsacli.documents.source import Source
from vsacli.robot.joint import Joint, Pose

if TYPE_CHECKING:
    from vsacli.robot.plausibility.checked_robot import CheckedRobot

OF_PLACEHOLDERS = (
    "the springs and motors of this robot are placeholders: replace them by those of your devices "
    "and remove `placeholder: true`"
)
WITHOUT_MASSES = "no link has a mass, so that hardly anything but the motor inertia requires torque"


@dataclass(frozen=True, repr=False)
class Robot(DeclaredRecord):
    """A serial chain of joints from a fixed base."""

    name: str = value(Name(), "name of the robot")
    description: str = text("description of the robot and source of its parameters", default="")
    placeholder: bool = boolean(
        "whether springs and motors are placeholders for unknown ones; every report repeats it",
        default=False,
    )
    gravity: tuple[float, float, float] = vector(
        3, units.ACCELERATION, "gravity acceleration in the base frame", default=(0.0, 0.0, -9.81)
    )
    base: Pose = value(RecordOf(Pose), "DH frame 0 in the base frame", default=Pose())
    tool: Pose = value(RecordOf(Pose), "end effector in the last DH frame (frame N)", default=Pose())
    joints: tuple[Joint, ...] = value(
        Items(RecordOf(Joint), unique="name"), "joints from the base to the tip"
    )
    sources: tuple[Source, ...] = field(default=(), kw_only=True, repr=False, compare=False)

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        """Hash of all parameters, computed once: robots are keys of recorded functions."""
        return hash(tuple(getattr(self, each.name) for each in fields(self) if each.compare))

    def __repr__(self) -> str:
        return "\n".join([f"Robot {self.name}", *aligned(self._joint_rows())])

    def _repr_html_(self) -> str:
        return html_table(f"Robot {self.name}", self._joint_rows())

    def _joint_rows(self) -> list[tuple[str, ...]]:
        joints = ((joint.name, joint.type, joint.actuator_type) for joint in self.joints)
        return [("joint", "type", "actuator"), *joints]

    def replace(self, path: str | Mapping[str, Any], value: Any = None) -> Self:
        """Return a robot with another value at a path; the original is unchanged.

        Examples: `robot.replace("joints.elbow.link.mass", 2.5)`, or several at once:
        `robot.replace({"joints.*.damping": 0, "gravity.2": -1.62})`. The new robot is checked as a whole.

        Args:
            path: keys of the robot file joined by dots; an entry of a list is given by its name or index, `*`
                stands for all entries. Or a mapping of such paths to values, which are replaced in turn; keys
                that need each other, such as `gear_ratio` and `side`, may be in any order.
            value: any value that a file may have there: a number, a text such as "90 deg", a list or a
                mapping.

        Raises:
            InputError: the path does not exist (the message lists existing ones), or the value is invalid.
        """
        from vsacli.documents import paths

        return paths.replace_all(self, {path: value} if isinstance(path, str) else path)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, base to tip."""
        return tuple(joint.name for joint in self.joints)

    @property
    def joint_types(self) -> tuple[str, ...]:
        """Type of each joint, "revolute" or "prismatic"."""
        return tuple(joint.type for joint in self.joints)

    @property
    def actuators(self) -> tuple[Actuator, ...]:
        """Actuator of each joint."""
        return tuple(joint.actuator for joint in self.joints)

    def has_variable(self, variable: Variable) -> bool:
        """Return whether results of the robot contain a variable of joints."""
        if variable.requires == LOSSES:
            return any(joint.has_friction or joint.damper is not None for joint in self.joints)
        required_of_none = variable.requires in OF_ANY_ROBOT
        return required_of_none or any(any(joint.has_columns(variable)) for joint in self.joints)

    @cached_property
    def signals(self) -> tuple[Signal, ...]:
        """Commanded signals in results besides the motion: stiffness, others where a joint has them."""
        return tuple(each for each in COMMANDED.values() if self.has_variable(VARIABLES[each.key]))

    @property
    def spring_sources(self) -> tuple[Source, ...]:
        """Files that springs were read from, without duplicates."""
        sources = (source for joint in self.joints for source in joint.actuator.sources)
        return tuple(dict.fromkeys(sources))

    @cached_property
    def checked(self) -> CheckedRobot:
        """The robot's data that plausibility rules need."""
        from vsacli.documents.record_values import numbers_in_record
        from vsacli.robot.plausibility.checked_robot import CheckedRobot

        return CheckedRobot(
            self.joints, self.base, self.gravity, tuple(numbers_in_record(self)), self.placeholder
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences about implausible values."""
        return tuple(map(str, self.located_warnings))

    @property
    def located_warnings(self) -> tuple[Problem, ...]:
        """Warnings about implausible values, with the line if they concern a number of the robot file."""
        from vsacli.robot.plausibility import robot_findings

        massless = not any(joint.link.mass for joint in self.joints)
        of_robot = {OF_PLACEHOLDERS: self.placeholder, WITHOUT_MASSES: massless}
        of_joints = (warning for joint in self.joints for warning in joint.warnings())
        whole = (*(warning for warning, applies in of_robot.items() if applies), *of_joints)
        return (*(Problem("", 0, warning) for warning in whole), *robot_findings(self.checked, self.sources))


def check_robot(value: object) -> None:
    """Check that an argument is a robot.

    Raises:
        TypeError: it is not a `Robot`; the message says how to get one.
    """
    check_type("robot", value, Robot, "load_robot({}) reads one; it is the first argument")
