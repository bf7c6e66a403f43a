"""The wrench that the environment exerts on the end effector, over samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from vsacli.base.arrays import FloatArray
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.errors import InputError, check_type

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

WRENCH_AXES = ("fx", "fy", "fz", "mx", "my", "mz")
"""Components: the force, and the moment about the origin of the tool frame."""

WRENCH_NAMES = ("wrench", "dwrench", "ddwrench")
"""Names of the wrench and its derivatives in `Wrench`, files and results."""

WRENCH_FRAMES = ("end_effector", "base")
"""Frames along whose axes the components may be expressed."""


@dataclass(frozen=True, eq=False)
class Wrench:
    """The force and moment that the environment exerts on the end effector.

    Attributes:
        wrench: force and moment about the origin of the tool frame, (samples, 6), or (6,) at one instant, by
            `WRENCH_AXES`; N and N m, as are the derivatives per s^k.
        dwrench: first time derivative of these components.
        ddwrench: second time derivative of these components.
        frame: frame along whose axes the components are expressed, one of `WRENCH_FRAMES`.
    """

    wrench: FloatArray
    dwrench: FloatArray
    ddwrench: FloatArray
    frame: str = field(default="end_effector", kw_only=True)

    def __post_init__(self) -> None:
        check_frame(self.frame)

    @classmethod
    def constant(cls, wrench: ArrayLike, frame: str = "end_effector") -> Wrench:
        """Return a wrench ([samples,] 6) that does not change over time: its derivatives are zero."""
        components = np.asarray(wrench, dtype=np.float64)
        return cls(components, np.zeros_like(components), np.zeros_like(components), frame=frame)

    def mapped(self, function: Callable[[FloatArray, int], FloatArray]) -> Wrench:
        """Return the wrench with a function applied to each array and its order of derivation."""
        arrays = (function(getattr(self, name), order) for order, name in enumerate(WRENCH_NAMES))
        return Wrench(*arrays, frame=self.frame)


def check_frame(frame: str, of: str = "wrench") -> None:
    """Refuse an unknown frame of a wrench, or of a similar quantity `of`.

    Raises:
        InputError: with the nearest valid frame.
    """
    if frame not in WRENCH_FRAMES:
        raise InputError.one(f"unknown frame {frame!r} of the {of}{did_you_mean(frame, WRENCH_FRAMES)}")


def check_wrench(value: object) -> None:
    """Refuse an argument that is not a wrench.

    Raises:
        TypeError: with the calls that create one.
    """
    check_type(
        "wrench", value, Wrench, "make one by Wrench.constant, or by Wrench(wrench, dwrench, ddwrench)"
    )


def wrench_columns(name: str) -> list[str]:
    """Return the CSV headers of the wrench or of a derivative of it, e.g. `dfx` for `dwrench`."""
    return [name.removesuffix("wrench") + axis for axis in WRENCH_AXES]
