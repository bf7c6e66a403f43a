"""Signals that are commanded over time: the motion, others of joints such as stiffness, the wrench.

Each signal is declared once. Keys and columns of trajectory files, variables of results with their
attributes, rows of kernels and fields of commands follow from that. A further signal of joints is an entry of
`COMMANDED`.
"""

from __future__ import annotations

from typing import NamedTuple

from vsacli.base import units
from vsacli.base.units import Quantity
from vsacli.base.wrench import WRENCH_AXES, WRENCH_NAMES


class Signal(NamedTuple):
    """A function of time: a value, and the derivatives of it that are needed.

    Attributes:
        key: in trajectory files.
        names: of the value and its derivatives, as in tables of samples and in results.
        quantities: their units.
        long_names: a few words on each.
        meaning: a few words, for the documentation of trajectory files.
        spline_degree: odd degree of the spline through recorded values.
        positive: whether the value must be positive.
        optional: whether a component may have no value, so that it is NaN all the time.
        components: how many numbers a value has; None: one a joint.
        device: key in the robot file of what a joint takes it by, if that is not its actuator; a device that
            is not commanded stays where it is.
    """

    key: str
    names: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    long_names: tuple[str, ...]
    meaning: str
    spline_degree: int
    positive: bool = False
    optional: bool = False
    components: int | None = None
    device: str | None = None

    @property
    def orders(self) -> int:
        """Number of functions: the value and its derivatives."""
        return len(self.names)


POSITION = Signal(
    key="position",
    names=("q", "dq", "ddq", "d3q", "d4q"),
    quantities=(units.POSITION, units.VELOCITY, units.JOINT_ACCELERATION, units.JERK, units.SNAP),
    long_names=(
        "commanded joint position",
        "commanded joint velocity",
        "commanded joint acceleration",
        "commanded joint jerk",
        "commanded joint snap",
    ),
    meaning="motion of the joints",
    spline_degree=7,
)

STIFFNESS = Signal(
    key="stiffness",
    names=("stiffness", "dstiffness", "ddstiffness"),
    quantities=(units.STIFFNESS, units.STIFFNESS_RATE, units.STIFFNESS_ACCELERATION),
    long_names=(
        "commanded joint stiffness",
        "rate of the commanded stiffness",
        "second derivative of the commanded stiffness",
    ),
    meaning="stiffness of the antagonistic and serial joints",
    spline_degree=5,
    positive=True,
    optional=True,
)

DAMPING = Signal(
    key="damping",
    names=("damping", "ddamping", "dddamping"),
    quantities=(units.DAMPING, units.DAMPING_RATE, units.DAMPING_ACCELERATION),
    long_names=(
        "commanded damping of the joint's damper",
        "rate of the commanded damping",
        "second derivative of the commanded damping",
    ),
    meaning="damping of the dampers, which adds to that of the joints; by default the least of their ranges",
    spline_degree=5,
    optional=True,
    device="damper",
)

WRENCH = Signal(
    key="wrench",
    names=WRENCH_NAMES,
    quantities=(units.WRENCH, units.WRENCH_RATE, units.WRENCH_ACCELERATION),
    long_names=(
        "wrench exerted on the end effector",
        "rate of the wrench",
        "second derivative of the wrench",
    ),
    meaning=(
        "what the environment exerts on the end effector: force, and moment about the tool frame's origin"
    ),
    spline_degree=5,
    components=len(WRENCH_AXES),
)

COMMANDED: dict[str, Signal] = {signal.key: signal for signal in (STIFFNESS, DAMPING)}
"""Signals besides the position that joints can be commanded by, by key."""


def commanded_names() -> tuple[str, ...]:
    """Names of all commanded signals and their derivatives."""
    return tuple(name for signal in COMMANDED.values() for name in signal.names)


def orders_of_derivation() -> dict[str, int]:
    """Return the order of derivation of each commanded variable of the joints."""
    signals = (POSITION, *COMMANDED.values())
    return {name: order for signal in signals for order, name in enumerate(signal.names)}
