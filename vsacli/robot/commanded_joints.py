"""The signals that can command each joint of a robot, as far as a trajectory needs to know them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from vsacli.actuators.kinds import ACTUATORS
from vsacli.base.signals import COMMANDED, Signal, wrench_on
from vsacli.robot.model import Robot


@dataclass(frozen=True)
class CommandedJoints:
    """The joints that a trajectory commands, and the tools on which it may let wrenches act.

    Attributes:
        types: joint types by joint name, in the order of the robot file.
        exempt: joints that a signal does not command, by signal key; each name with the reason, a clause.
        rigid: whether all joints are rigid, so that torques do not depend on jerk and snap.
        tools: names of the tools on which wrenches may act.
    """

    types: Mapping[str, str]
    exempt: Mapping[str, Mapping[str, str]]
    rigid: bool = False
    tools: tuple[str, ...] = ()

    @classmethod
    def of(cls, robot: Robot) -> Self:
        """Return the joints of a robot."""
        exempt = {
            key: {
                joint.name: joint.uncommanded(signal) for joint in robot.joints if key not in joint.commanded
            }
            for key, signal in COMMANDED.items()
        }
        rigid = not any(joint.actuator.sprung for joint in robot.joints)
        return cls(
            dict(zip(robot.joint_names, robot.joint_types, strict=True)), exempt, rigid, robot.tool_names
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(self.types)

    @property
    def wrenches(self) -> dict[str, Signal]:
        """The wrench on each tool, by the name of the tool."""
        return {tool: wrench_on(tool, index) for index, tool in enumerate(self.tools)}

    @property
    def commanding_signals(self) -> frozenset[str]:
        """Keys of the signals that command at least one joint."""
        return frozenset(key for key, exempt in self.exempt.items() if len(exempt) < len(self.types))

    @property
    def absent_device_signals(self) -> tuple[Signal, ...]:
        """Signals of devices that are on no joint."""
        return tuple(
            each for each in COMMANDED.values() if each.device and each.key not in self.commanding_signals
        )

    def joints_of(self, signal: Signal) -> dict[int, str]:
        """Return the names of the joints that a signal commands, by index."""
        exempt = self.exempt.get(signal.key, {})
        return {index: name for index, name in enumerate(self.types) if name not in exempt}


def describe_commanded_joints(signal: Signal, joint: str = "joint") -> str:
    """Return a phrase for the joints that a signal commands, built on the word "joint" or "joints"."""
    if signal.device is not None:
        return f"{joint} with a {signal.device}"
    kinds = (kind for kind, actuator in ACTUATORS.items() if signal.key in actuator.commanded)
    return f"{' or '.join(kinds)} {joint}"
