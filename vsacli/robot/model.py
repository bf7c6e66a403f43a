"""The robot: a tree of links by Denavit-Hartenberg rows, each joint with its motors and springs."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

from vsacli.actuators.actuator import Actuator
from vsacli.base import units
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import FieldProblem, InputError, Problem, check_type
from vsacli.base.signals import COMMANDED, Signal
from vsacli.base.tables import aligned, html_table
from vsacli.base.variables import (
    LOSSES,
    MIN_STIFFNESS,
    OF_ANY_ROBOT,
    TOOLS,
    VARIABLES,
    Labels,
    Variable,
    dimension_labels,
)
from vsacli.documents.fields import (
    Items,
    ItemsByName,
    Name,
    RecordOf,
    boolean,
    text,
    value,
    vector,
)
from vsacli.documents.record_checks import DeclaredRecord, construct_unchecked
from vsacli.documents.source import Source
from vsacli.robot.joint import FRAME_0, Joint, Pose, Tool

if TYPE_CHECKING:
    from vsacli.robot.plausibility.checked_robot import CheckedRobot

AT_LINK = Pose()
"""Place of a tool at the frame of its link."""

END_EFFECTOR = "end_effector"
"""Name of the tool of a robot without `tools`."""

PLACEHOLDER_WARNING = (
    "the springs and motors of this robot are placeholders: replace them by those of your devices "
    "and remove `placeholder: true`"
)
WITHOUT_MASSES = "no link has a mass, so that hardly anything but the motor inertia requires torque"


@dataclass(frozen=True, repr=False)
class Robot(DeclaredRecord):
    """A chain or tree of joints from a fixed base."""

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
    tools: tuple[Tool, ...] = value(
        ItemsByName(RecordOf(Tool), "tool"), "end effectors by name, instead of `tool`", default=()
    )
    joints: tuple[Joint, ...] = value(
        Items(RecordOf(Joint), unique="name"), "joints, each after the one that carries it"
    )
    sources: tuple[Source, ...] = field(default=(), kw_only=True, repr=False, compare=False)

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        """Hash of all parameters, computed once: robots are keys of recorded functions."""
        return hash(tuple(getattr(self, parameter.name) for parameter in fields(self) if parameter.compare))

    def _problems(self) -> Iterator[FieldProblem]:
        """Yield problems of parents, or else of tools."""
        yield from list(self._parent_problems()) or self._tool_problems()

    def _parent_problems(self) -> Iterator[FieldProblem]:
        names = self.joint_names
        for index, joint in enumerate(self.joints):
            if joint.parent in (None, FRAME_0, *names[:index]):
                continue
            if joint.parent == joint.name:
                reason = "a joint is not mounted on its own link; name an earlier joint, or null for the base"
            elif joint.parent in names:
                order = "list joints after the one that carries them (a cycle has no such order)"
                reason = f"{joint.parent!r} comes later in the file; {order}"
            else:
                hint = did_you_mean(str(joint.parent), names[:index]) if index else ""
                reason = f"no earlier joint is called {joint.parent!r} (null stands for the base){hint}"
            yield FieldProblem(("joints", index, "parent"), reason)

    def _tool_problems(self) -> Iterator[FieldProblem]:
        if self.tool != AT_LINK and self.tools:
            yield FieldProblem(("tool",), "give `tool` or `tools`, not both")
        if self.tool != AT_LINK and not self.tools and len(self.tips) > 1:
            tips = ", ".join(self.joint_names[tip] for tip in self.tips)
            example = f"tools: {{NAME: {{joint: {self.joint_names[self.tips[-1]]}, xyz: [...]}}}}"
            yield FieldProblem(("tool",), f"which of the tips {tips} carries it? Give `{example}` instead")
        for tool in self.tools:
            if tool.joint not in self.joint_names:
                hint = did_you_mean(tool.joint, self.joint_names)
                yield FieldProblem(("tools", tool.name, "joint"), f"no joint is called {tool.joint!r}{hint}")

    def __repr__(self) -> str:
        return "\n".join([f"Robot {self.name}", *aligned(self._joint_rows())])

    def _repr_html_(self) -> str:
        return html_table(f"Robot {self.name}", self._joint_rows())

    def _joint_rows(self) -> list[tuple[str, ...]]:
        joints = [(joint.name, joint.type, joint.actuator_type) for joint in self.joints]
        rows: list[tuple[str, ...]] = [("joint", "type", "actuator"), *joints]
        if self.is_plain_chain:
            return rows
        tools = [
            ", ".join(tool.name for tool in self.end_effectors if tool.joint == name) or "-"
            for name in self.joint_names
        ]
        return [
            (*row, *other_cells)
            for row, *other_cells in zip(rows, ["on", *self.parent_names], ["tools", *tools], strict=True)
        ]

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
        """Names of the joints, in the order of the file: each after the one that carries it."""
        return tuple(joint.name for joint in self.joints)

    @property
    def joint_types(self) -> tuple[str, ...]:
        """Type of each joint, "revolute" or "prismatic"."""
        return tuple(joint.type for joint in self.joints)

    @property
    def actuators(self) -> tuple[Actuator, ...]:
        """Actuator of each joint."""
        return tuple(joint.actuator for joint in self.joints)

    @cached_property
    def parents(self) -> tuple[int, ...]:
        """Index of the joint on whose link each joint is mounted; -1 for frame 0."""
        joint_indices = {FRAME_0: -1, **{name: number for number, name in enumerate(self.joint_names)}}
        return tuple(
            number - 1 if joint.parent is None else joint_indices[joint.parent]
            for number, joint in enumerate(self.joints)
        )

    @property
    def parent_names(self) -> tuple[str, ...]:
        """Name of the joint on whose link each joint is mounted, or `FRAME_0`."""
        return tuple(FRAME_0 if parent < 0 else self.joint_names[parent] for parent in self.parents)

    @cached_property
    def paths(self) -> tuple[tuple[int, ...], ...]:
        """Joints that move the link of each joint, from the base to this joint."""
        paths: list[tuple[int, ...]] = []
        for index, parent in enumerate(self.parents):
            paths.append((*(paths[parent] if parent >= 0 else ()), index))
        return tuple(paths)

    @cached_property
    def subtrees(self) -> tuple[tuple[int, ...], ...]:
        """Joints that stand on the base together, because one on the base carries the others."""
        first_joints = [path[0] for path in self.paths]
        return tuple(
            tuple(index for index, first_joint in enumerate(first_joints) if first_joint == base)
            for base in dict.fromkeys(first_joints)
        )

    @property
    def is_plain_chain(self) -> bool:
        """Whether each link carries the next joint at its frame, and the tool is not one of `tools`."""
        has_mount = any(joint.mount is not None for joint in self.joints)
        return not (has_mount or self.tools) and self.parents == tuple(range(-1, len(self.joints) - 1))

    @property
    def tips(self) -> tuple[int, ...]:
        """Joints whose links carry no other joint."""
        return tuple(sorted(set(range(len(self.joints))) - set(self.parents)))

    @cached_property
    def end_effectors(self) -> tuple[Tool, ...]:
        """All tools: `tools`, or else `tool` at the only tip; none if there are several tips."""
        if self.tools or len(self.tips) > 1:
            return self.tools
        pose = {"xyz": self.tool.xyz, "rpy": self.tool.rpy}
        return (construct_unchecked(Tool, {**pose, "name": END_EFFECTOR, "joint": self.joints[-1].name}),)

    @cached_property
    def tool_joints(self) -> tuple[int, ...]:
        """Index of the joint whose link carries each of `end_effectors`."""
        return tuple(self.joint_names.index(tool.joint) for tool in self.end_effectors)

    @property
    def tool_names(self) -> tuple[str, ...]:
        """Names of `end_effectors`."""
        return tuple(tool.name for tool in self.end_effectors)

    @property
    def limited_tools(self) -> tuple[str, ...]:
        """Names of the tools with a `min_stiffness`."""
        return tuple(tool.name for tool in self.tools if tool.min_stiffness is not None)

    def without_tool_limits(self, names: Collection[str]) -> Self:
        """Return the robot without the `min_stiffness` of some of its tools."""
        tools = (replace(tool, min_stiffness=None) if tool.name in names else tool for tool in self.tools)
        return replace(self, tools=tuple(tools))

    @property
    def labels(self) -> Labels:
        """Labels along each dimension of the variables of results."""
        return dimension_labels(self.joint_names, self.tool_names)

    def end_effector(self, name: str | None = None) -> int:
        """Return the index of a tool among `end_effectors`; None stands for the only one.

        Raises:
            InputError: there is no such tool, or which one is not said.
            TypeError: name is of another type.
        """
        names = self.tool_names
        if name is None and len(names) == 1:
            return 0
        if not names:
            raise InputError.one(f"{self.name} has no tools; give `tools` in its file")
        if name is None:
            raise InputError.one(f"{self.name} has the tools {', '.join(names)}; say which one")
        check_type("tool", name, str, f"tools are given by name, such as {names[0]!r}")
        if name not in names:
            raise InputError.one(f"{self.name} has no tool {name!r}{did_you_mean(name, names)}")
        return names.index(name)

    def has_variable(self, variable: Variable) -> bool:
        """Return whether results of the robot contain a variable unless it is asked for."""
        if variable.requires == TOOLS:
            return bool(self.end_effectors)
        if variable.requires == MIN_STIFFNESS:
            return bool(self.limited_tools)
        if variable.requires == LOSSES:
            return any(joint.has_friction or joint.damper is not None for joint in self.joints)
        is_in_any_result = variable.requires in OF_ANY_ROBOT
        return is_in_any_result or any(any(joint.has_columns(variable)) for joint in self.joints)

    @cached_property
    def signals(self) -> tuple[Signal, ...]:
        """Commanded signals in results besides the motion: stiffness, others where a joint has them."""
        return tuple(signal for signal in COMMANDED.values() if self.has_variable(VARIABLES[signal.key]))

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
            self.joints,
            self.parents,
            self.base,
            self.gravity,
            tuple(numbers_in_record(self)),
            self.placeholder,
            tuple(range(len(self.joints))),
            dict(enumerate(self.tool_joints)),
            self.end_effectors,
        )

    @cached_property
    def checked_subtrees(self) -> tuple[CheckedRobot, ...]:
        """The data that plausibility rules need, of each of `subtrees`."""
        return tuple(self.checked.subtree(joints) for joints in self.subtrees)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences about implausible values."""
        return tuple(map(str, self.located_warnings))

    @property
    def located_warnings(self) -> tuple[Problem, ...]:
        """Warnings about implausible values, with the line if they concern a number of the robot file."""
        from vsacli.robot.plausibility import robot_findings

        findings = robot_findings(self.checked, self.checked_subtrees, self.sources)
        massless = not any(joint.link.mass for joint in self.joints)
        of_robot = {PLACEHOLDER_WARNING: self.placeholder, WITHOUT_MASSES: massless}
        of_joints = (warning for joint in self.joints for warning in joint.warnings())
        whole = (*(warning for warning, applies in of_robot.items() if applies), *of_joints)
        return (*(Problem("", 0, warning) for warning in whole), *findings)


def check_robot(value: object) -> None:
    """Check that an argument is a robot.

    Raises:
        TypeError: it is not a `Robot`; the message says how to get one.
    """
    check_type("robot", value, Robot, "load_robot({}) reads one; it is the first argument")
