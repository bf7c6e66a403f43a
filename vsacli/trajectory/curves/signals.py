"""What a profile may describe: position, stiffness, wrench, and how many derivatives of each are needed."""

from __future__ import annotations

from typing import NamedTuple

from vsacli.base.wrench import WRENCH_AXES, WRENCH_NAMES


class Signal(NamedTuple):
    """What a profile describes: a value, and the derivatives of it that are needed.

    Attributes:
        names: the value and its derivatives, as in files and in `Motion`.
        spline_degree: odd degree of the spline through recorded values.
        positive: whether the value must be positive.
        optional: whether a component may have no value, so that it is NaN all the time.
        components: how many numbers a value has; None: one a joint.
    """

    names: tuple[str, ...]
    spline_degree: int
    positive: bool = False
    optional: bool = False
    components: int | None = None

    @property
    def orders(self) -> int:
        """Number of functions in a profile: the value and its derivatives."""
        return len(self.names)


POSITION = Signal(("q", "dq", "ddq", "d3q", "d4q"), spline_degree=7)
STIFFNESS = Signal(("stiffness", "dstiffness", "ddstiffness"), spline_degree=5, positive=True, optional=True)
WRENCH = Signal(WRENCH_NAMES, spline_degree=5, components=len(WRENCH_AXES))
