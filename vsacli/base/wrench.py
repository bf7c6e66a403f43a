"""The wrenches that the environment exerts on the tools of a robot, over samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError, check_type
from vsacli.base.texts import counted

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

WRENCH_AXES = ("fx", "fy", "fz", "mx", "my", "mz")
"""Components: the force, and the moment about the origin of the tool frame."""

DISPLACEMENT_AXES = ("x", "y", "z", "rx", "ry", "rz")
"""Components of a small displacement: translation along, and rotation about the axes of a frame."""

WRENCH_NAMES = ("wrench", "dwrench", "ddwrench")
"""Names of the wrench and its derivatives in `Wrench`, files and results."""

WRENCH_FRAMES = ("end_effector", "base")
"""Frames along whose axes the components may be expressed: those of the tool, or the base."""

WrenchFrame: TypeAlias = str | tuple[str | None, ...]
"""Frame of the wrench on the only tool of a robot; or that of each of several tools, None for an idle one."""


@dataclass(frozen=True, eq=False)
class Wrench:
    """The force and moment that the environment exerts on each tool.

    Attributes:
        wrench: force and moment about the origin of the tool frame, ([samples,] 6), by `WRENCH_AXES`; of
            several tools the six components of each in turn; N and N m, as are the derivatives per s^k.
        dwrench: first time derivative of these components.
        ddwrench: second time derivative of these components.
        frame: frame along whose axes the components are expressed, one of `WRENCH_FRAMES`; for several tools
            a tuple with the frame of each, None for a tool on which nothing acts.
    """

    wrench: FloatArray
    dwrench: FloatArray
    ddwrench: FloatArray
    frame: WrenchFrame = field(default="end_effector", kw_only=True)

    def __post_init__(self) -> None:
        for frame in frames_by_tool(self.frame):
            if frame is not None:
                check_frame(frame)

    @classmethod
    def constant(cls, wrench: ArrayLike, frame: WrenchFrame = "end_effector") -> Wrench:
        """Return a wrench, ([samples,] 6 tools), that does not change: its derivatives are zero."""
        components = np.asarray(wrench, dtype=np.float64)
        return cls(components, np.zeros_like(components), np.zeros_like(components), frame=frame)

    def mapped(self, function: Callable[[FloatArray, int], FloatArray]) -> Wrench:
        """Return the wrench with a function applied to each array and its order of derivation."""
        arrays = (function(getattr(self, name), order) for order, name in enumerate(WRENCH_NAMES))
        return Wrench(*arrays, frame=self.frame)


def frames_by_tool(frame: WrenchFrame) -> tuple[str | None, ...]:
    """Return the frame of the wrench on each tool, None where nothing acts."""
    return (frame,) if isinstance(frame, str) else frame


def wrench_components(frame: WrenchFrame) -> int:
    """Return the number of components of a wrench: six for each tool."""
    return len(WRENCH_AXES) * len(frames_by_tool(frame))


def check_frame(frame: str, quantity: str = "wrench") -> None:
    """Refuse an unknown frame of a wrench, or of a similar quantity `quantity`.

    Raises:
        InputError: with the nearest valid frame.
    """
    if frame not in WRENCH_FRAMES:
        raise InputError.one(f"unknown frame {frame!r} of the {quantity}{did_you_mean(frame, WRENCH_FRAMES)}")


def check_wrench(value: object, tools: Sequence[str]) -> None:
    """Refuse an argument that is not a wrench on these tools.

    Raises:
        TypeError: with the calls that create a wrench.
        InputError: the wrench is for another number of tools.
    """
    check_type(
        "wrench", value, Wrench, "make one by Wrench.constant, or by Wrench(wrench, dwrench, ddwrench)"
    )
    assert isinstance(value, Wrench)
    check_wrench_frame(value.frame, tools)


def check_wrench_frame(frame: WrenchFrame, tools: Sequence[str]) -> None:
    """Refuse the frame of a wrench for another number of tools than these.

    Raises:
        InputError: with the number and names of the tools.
    """
    count = len(frames_by_tool(frame))
    if count != len(tools):
        tools_text = (
            f"{len(tools)}: {', '.join(tools)}" if tools else "none: name them by `tools` in its file"
        )
        advice = "for several tools give a tuple as frame, None for a tool on which nothing acts"
        raise InputError.one(
            f"the wrench is for {counted(count, 'tool')}, the robot has {tools_text}; {advice}"
        )


def wrench_columns(name: str) -> list[str]:
    """Return the CSV headers of a wrench or of a derivative of it.

    They are e.g. `dfx` for `dwrench`, and `hand.dfx` for `hand.dwrench`, that of one of several tools.
    """
    return [name.removesuffix("wrench") + axis for axis in WRENCH_AXES]
