"""All lengths, masses or inertias of a robot in another unit, such as those of a CAD program."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vsacli.documents.plausibility import Measured, OtherUnit, Rule
from vsacli.robot.plausibility.bodies import (
    DENSITIES,
    LENGTHS,
    LONG_LINKS,
    ROUNDED,
    SIZES_OF_LINKS,
    UNIT_SYSTEM,
    UNITS_OF_INERTIA,
)
from vsacli.robot.plausibility.checked_robot import CheckedRobot, joint_path

PROPER_UNITS = ("m", "kg", "kg m^2")

COMMON_SYSTEMS = (("mm", "g", "g mm^2"), ("mm", "kg", "kg mm^2"), ("cm", "g", "g cm^2"), ("m", "g", "g m^2"))
"""Units that programs use together: a robot in these is as likely as one with a single field in another unit."""

UNLIKELY = 4.0
"""Misfit that a further field in another unit has to save."""

USUAL_SIZES = {"reach": (-0.1, 0.5), "density of reach": (1.4, 0.8), "density of links": (2.45, 0.6)}
"""Median and spread of the common logarithms of the reach, m, of the mass over the reach cubed, kg/m^3, and of
the median density of links. The medians are those of half of the bundled robots and of chains of real ones; the
spreads are rounded, that of the reach up from 0.35, since there are few fingers among them."""

DENSITY_OF_REACH = (3e-3, 2e4)
SIZE_RULES = {LENGTHS: (1, 0.5, -0.5), DENSITIES: (0, 2.5, -1.5), SIZES_OF_LINKS: (-1, -0.5, 0.5)}
"""Rules of the sizes of links with the powers of length, mass and inertia of these sizes."""

MOST, SHORT = 0.6, 3.0
"""Share of the lengths that have to be longer than so many largest radii of gyration, if all are in another unit."""


class UnitSystem(NamedTuple):
    """Units of all lengths, masses and inertias of a robot."""

    length: OtherUnit
    mass: OtherUnit
    inertia: OtherUnit

    @property
    def is_common(self) -> bool:
        """Whether it is one of `COMMON_SYSTEMS`."""
        return tuple(each.unit for each in self) in COMMON_SYSTEMS

    @property
    def changes(self) -> int:
        """Number of fields in another unit, 1 for a common system."""
        return 1 if self.is_common else sum(each.factor != 1 for each in self)

    def scale_of(self, length: float, mass: float, inertia: float) -> float:
        """Return the factor of a size with these powers of length, mass and inertia in the proper unit."""
        return self.length.factor**length * self.mass.factor**mass * self.inertia.factor**inertia

    def sizes(self, checked: CheckedRobot) -> dict[str, float]:
        """Return the sizes of a robot whose file is in this system, by the names of `USUAL_SIZES`."""
        reach = self.scale_of(1, 0, 0) * (checked.sizes.reach + checked.distance_from_base_frame)
        densities = [number.size for number in DENSITIES.measure(checked) if number.size > 0]
        return {
            "reach": reach,
            "density of reach": self.scale_of(0, 1, 0) * checked.sizes.mass / reach**3,
            "density of links": self.scale_of(0, 2.5, -1.5) * float(np.median(densities)),
        }

    def misfit(self, checked: CheckedRobot) -> float:
        """Return how unlikely a robot whose file is in this system is: less twice the log of the probability."""
        sizes = self.sizes(checked)
        deviations = (
            (math.log10(sizes[name]) - mean) / spread for name, (mean, spread) in USUAL_SIZES.items()
        )
        return sum(deviation**2 for deviation in deviations) + UNLIKELY * self.changes

    def is_plausible(self, checked: CheckedRobot) -> bool:
        """Return whether the sizes of robot and links are plausible if the file is in this system."""
        low, high = DENSITY_OF_REACH
        return low <= self.sizes(checked)["density of reach"] < high and all(
            rule.admits(number.size * self.scale_of(*powers))
            for rule, powers in SIZE_RULES.items()
            for number in rule.measure(checked)
        )


def _unit_systems() -> Iterator[UnitSystem]:
    """Yield the proper system of units first; moments in g m^2 are only computed from masses in g."""
    lengths = {"m": 1.0, "mm": 1e-3, "cm": 1e-2}
    moments = {"kg m^2": 1.0, **UNITS_OF_INERTIA, "g m^2": 1e-3}
    for units in itertools.product(lengths.items(), {"kg": 1.0, "g": 1e-3}.items(), moments.items()):
        system = UnitSystem(
            *(OtherUnit(*unit, instead_of=proper) for unit, proper in zip(units, PROPER_UNITS, strict=True))
        )
        if system.inertia.unit != "g m^2" or system.is_common:
            yield system


UNIT_SYSTEMS = tuple(_unit_systems())


def guess_system(checked: CheckedRobot) -> UnitSystem:
    """Return the system of units in which a robot is most likely, if its own sizes are implausible."""
    sizes, proper = checked.sizes, UNIT_SYSTEMS[0]
    if min(sizes.reach, sizes.mass, float(np.max(sizes.gyrations))) <= 0 or proper.is_plausible(checked):
        return proper
    likely = min(UNIT_SYSTEMS, key=lambda system: system.misfit(checked))
    return likely if _most_lengths_are_long(likely, checked) and likely.is_plausible(checked) else proper


def _most_lengths_are_long(system: UnitSystem, checked: CheckedRobot) -> bool:
    """Return whether most lengths differ from usual ones, unless they are in the proper unit.

    One of them, or all centers of mass, may be in another unit than the rest.
    """
    lengths = [number.size for number in LENGTHS.measure(checked) if number.size > ROUNDED]
    scale = system.scale_of(0, 0.5, -0.5)
    return system.length.factor == 1 or float(np.quantile(lengths, 1 - MOST)) * scale > SHORT


def _measure_unit_systems(checked: CheckedRobot) -> Iterator[Measured]:
    """Yield the first length, mass and inertia in another unit, with the number of its units in the proper one."""
    system, sizes, joint = guess_system(checked), checked.sizes, checked.joints[0]
    text = f"{sizes.reach:.3g} m, {sizes.mass:.3g} kg and {np.max(sizes.gyrations):.3g} m"
    lengths = (number for number in LONG_LINKS.measure(checked) if number.value)
    mass, moments = (joint_path(0, joint, "link", word) for word in ("mass", "inertia"))
    for kind, other, number in (
        ("lengths", system.length, next(lengths)),
        ("masses", system.mass, Measured(mass, joint.link.mass, "kg", math.nan)),
        ("inertias", system.inertia, Measured(moments, math.nan, "kg m^2", math.nan)),
    ):
        if other.factor != 1:
            yield number._replace(size=1 / other.factor, beside={"kind": kind, "sizes": text})


UNIT_SYSTEM_RULES: tuple[Rule[CheckedRobot], ...] = (
    Rule(UNIT_SYSTEM, "all of `dh.a`, `dh.d`, `com` and `xyz`, of `mass`, or of `inertia`",
        _measure_unit_systems,
        size="proper unit over that with which reach, density and radius of gyration are most usual", high=2,
        reason="only if reach, density or radius of gyration are implausible",
        finding="is too large, as are all {kind}: reach, mass and radius of gyration of {sizes} fit no robot",
        units=tuple(dict.fromkeys(unit for system in UNIT_SYSTEMS for unit in system))),
)  # fmt: skip
