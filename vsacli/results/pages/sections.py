"""Which variables a page shows together, and in which order."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import NamedTuple

from vsacli.base.simulation_variables import ERRORS, error
from vsacli.base.variables import deviation
from vsacli.results.corridors import BOUNDS
from vsacli.results.store.stored_limits import ACHIEVED


class Section(NamedTuple):
    """Variables below one heading.

    Attributes:
        heading: of the section.
        names: of the variables; of simulations those that were commanded.
        shown: whether their plots are there from the start, as those of `plot` are.
    """

    heading: str
    names: tuple[str, ...]
    shown: bool = False


SECTIONS = (
    Section("Tracking errors", tuple(map(error, ERRORS)), shown=True),
    Section("Position and stiffness", ("q", "stiffness"), shown=True),
    Section("Motor torque", ("tau_motor",), shown=True),
    Section("Elastic torque", ("tau_e",), shown=True),
    Section("Springs", ("phi", "tau_spring", "elastic_energy", "det_A")),
    Section("Motion of the motors", ("theta", "dtheta", "ddtheta", "dphi")),
    Section("Power, work and losses", ("motor_power", "motor_energy", "dissipated_power", "copper_loss")),
    Section("Current and voltage", ("current", "voltage")),
    Section("Damping", ("damping", "tau_damper", "ddamping", "dddamping")),
    Section("Wrench", ("wrench", "dwrench", "ddwrench")),
    Section("Derivatives", ("dq", "ddq", "d3q", "d4q", "dstiffness", "ddstiffness", "dtau_e", "ddtau_e")),
)
"""Sections of a page; what is in none of them follows at its end."""


def sections_of(variables: Collection[str]) -> Iterator[Section]:
    """The sections of a file with these variables, each with those that have plots of their own.

    Standard deviations and the bounds of stiffness are drawn beside what they belong to, flags as stretches.
    """
    with_others = {"flags", *BOUNDS, *map(deviation, variables)}
    own = dict.fromkeys(ACHIEVED.get(name, name) for name in variables if name not in with_others)
    for section in SECTIONS:
        names = tuple(name for name in section.names if name in own)
        if names:
            yield section._replace(names=names)
    rest = tuple(name for name in own if not any(name in section.names for section in SECTIONS))
    if rest:
        yield Section("Further variables", rest)
