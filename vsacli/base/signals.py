"""Signals commanded over time: the motion, other signals of joints such as stiffness, and the wrench.

Each signal is declared once. Keys and columns of trajectory files, result variables and their attributes,
rows of kernels and fields of commands follow from the declaration. To add a signal of joints, add an entry to
`COMMANDED`.
"""

from __future__ import annotations

from typing import NamedTuple

from vsacli.base import units
from vsacli.base.units import Quantity
from vsacli.base.wrench import WRENCH_AXES, WRENCH_NAMES


class Signal(NamedTuple):
    """A function of time: its value and the time derivatives that are needed.

    Attributes:
        key: key in trajectory files.
        names: names of the value and its derivatives in tables of samples and in results.
        quantities: their units.
        long_names: their short descriptions.
        meaning: short description of the signal in the documentation of trajectory files.
        spline_degree: odd degree of the spline through recorded values.
        positive: whether the value must be positive.
        optional: whether components without a value, NaN throughout, are allowed.
        components: number of components of a value; None: one a joint.
        device: key in the robot file of the joint's device that follows the signal, if that is not the
            actuator; a device without a command stays where it is.
        tool: name of the tool on which a wrench acts, if it is given by tool.
        first: index of the first component in `variables`, which hold the wrenches on all tools.
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
    tool: str = ""
    first: int = 0

    @property
    def is_wrench(self) -> bool:
        """Whether it is a wrench, with its components instead of one value a joint."""
        return self.components is not None

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the result variables that hold value and derivatives."""
        return WRENCH_NAMES if self.tool else self.names

    @property
    def columns(self) -> slice:
        """Components that are its own in `variables`."""
        return slice(self.first, self.first + len(WRENCH_AXES) if self.tool else None)

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
    meaning=(
        "damping of the dampers, in addition to the damping of the joints; by default the lower "
        "end of their ranges"
    ),
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
        "wrench that the environment exerts on the end effector: force, and moment about the "
        "origin of the tool frame"
    ),
    spline_degree=5,
    components=len(WRENCH_AXES),
)

WRENCHES = "wrenches"
"""Key of the wrenches by tool in trajectory files."""


def wrench_on(tool: str, index: int) -> Signal:
    """Return the wrench on one of several tools, given by its name and its index among the robot's tools."""
    return WRENCH._replace(
        key=f"{WRENCHES}.{tool}",
        names=tuple(f"{tool}.{name}" for name in WRENCH.names),
        tool=tool,
        first=len(WRENCH_AXES) * index,
    )


COMMANDED: dict[str, Signal] = {signal.key: signal for signal in (STIFFNESS, DAMPING)}
"""Signals other than the position that joints can be commanded by, by key."""


def commanded_names() -> tuple[str, ...]:
    """Return the names of all commanded signals and their derivatives."""
    return tuple(name for signal in COMMANDED.values() for name in signal.names)


def orders_of_derivation() -> dict[str, int]:
    """Return the order of the time derivative of each commanded joint variable, by name."""
    signals = (POSITION, *COMMANDED.values())
    return {name: order for signal in signals for order, name in enumerate(signal.names)}
