"""Charts of a robot's actuators: torques of springs over deflection, attainable stiffness over torque.

Joints with equal actuators share a chart. All values come from `Actuator.transmit`, the model of a run, at
states of rest.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from vsacli.actuators.actuator import Actuator
from vsacli.actuators.laws import LAWS, SpringLaw
from vsacli.actuators.laws.tendons import Mirrored
from vsacli.actuators.mechanisms import MECHANISMS
from vsacli.actuators.transmission import JointVariables
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.base.flags import Flag, has_flag
from vsacli.base.variables import VARIABLES
from vsacli.results.charts.arm_chart import home_position
from vsacli.robot.attainable import state_at_rest
from vsacli.robot.joint import Joint
from vsacli.robot.model import Robot

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

POINTS, LEVELS = 201, 37
"""Number of torques of a map, and of stiffness values at each torque for the curves of limits."""

FINE_POINTS = 2001
"""Number of deflections of the torque of a mechanism, enough for its steepest setting."""

BEYOND, BEYOND_TORQUE = 1.5, 1.3
"""Factors of the ends of both axes before the exact ends are known, larger than a step of the search."""

SEARCHED = np.geomspace(1e-5, 1e7, 121)
"""Torques, N m (N), among which the end of the torque axis is searched."""

RATIOS, SHARES = np.geomspace(1 + 1e-6, 1e3, 25)[:, None], np.linspace(0.02, 1 - 1e-6, 13)[:, None]
"""Stiffness values tried at each of these torques: relative to the minimum, and as shares of the range."""

FREE_GROWTH = 1.5
"""Growth of the minimum stiffness up to the end of the torque axis, where no limit ends it."""

FREE_HEIGHT = 2.5
"""Height of the stiffness axis relative to the largest minimum stiffness, where no limit ends it."""

LOAD_SHARE = 1.5
"""Smallest end of the torque axis relative to the static load."""

ROOM = 1.08
"""Factor by which axes extend beyond their content."""

INSIDE = 1e-6
"""Relative distance of the lowest and highest levels from the ends of the attainable range, at which
rounding would make some samples infeasible."""

SETTINGS, ROUNDED = 5, 1e-3
"""Number of settings of motor 2 for which the torque of a mechanism is shown, and share of their range within
which a setting counts as 0."""

LIMITS = {"tau_motor": "limit of motor torque at rest", "phi": "limit of deflection"}
"""Meanings of the limits in a map, by the variable that they bound."""


ROTORS = ("motor", "coupled_inertia")
"""Fields of actuators that do not matter at rest, except for their limits."""


class TorqueCurve(NamedTuple):
    """Torque over deflection of a spring, or of a mechanism at a setting of motor 2.

    Attributes:
        label: name of the curve.
        deflection: deflections, (points,), rad (m).
        torque: torques, (points,), N m (N).
        limit: largest admissible |deflection|, infinite without limit.
    """

    label: str
    deflection: FloatArray
    torque: FloatArray
    limit: float = math.inf


class StiffnessMap(NamedTuple):
    """Attainable stiffness over the elastic torque of a joint at rest.

    Attributes:
        tau_e: torques, (points,), N m (N), ascending.
        lower, upper: minimum and maximum stiffness, (points,), N m/rad (N/m); NaN where the torque cannot be
            carried, infinite where nothing bounds the stiffness; equal where no stiffness is commanded.
        lower_singular, upper_singular: where the decoupling matrix is singular at these ends, (points,).
        levels: stiffness values between the ends and below the end of the axis, (levels, points).
        clearance: distance to each limit at these values, relative to it, by the meaning of the limit;
            negative beyond it; the smaller one of two motors.
        unknowns: unknowns of the springs at these values, see `Actuator`, (motors, levels, points).
        top: end of the stiffness axis.
    """

    tau_e: FloatArray
    lower: FloatArray
    upper: FloatArray
    lower_singular: BoolArray
    upper_singular: BoolArray
    levels: FloatArray
    clearance: dict[str, FloatArray]
    unknowns: FloatArray
    top: float

    @property
    def within(self) -> BoolArray:
        """Marks of the values of the levels that keep all limits, (levels, points)."""
        return _within(self.levels, self.clearance)


@dataclass(frozen=True)
class ActuatorChart:
    """The charts of joints with equal actuators.

    Attributes:
        joints: the joints.
        load: largest torque of gravity at one of them, N m (N).
        q: position of the first joint, on which a few mechanisms depend, rad (m).
    """

    joints: tuple[Joint, ...]
    load: float
    q: float

    @property
    def title(self) -> str:
        """Names of the joints."""
        return ", ".join(joint.name for joint in self.joints)

    @property
    def actuator(self) -> Actuator:
        """Actuator of the joints."""
        return self.joints[0].actuator

    @property
    def kind(self) -> str:
        """Kind of the actuator, with its mechanism or the laws of its springs."""
        words = [self.joints[0].actuator_type]
        mechanism = getattr(self.actuator, "mechanism", None)
        if mechanism is not None:
            words.append(MECHANISMS.name_of(type(mechanism)).replace("_", " "))
        else:
            laws = [element.law for element in self.actuator.spring_elements or ()]
            words += dict.fromkeys(_law_name(law) for law in laws)
        return ", ".join(words)

    @property
    def commanded(self) -> bool:
        """Whether a trajectory commands the stiffness."""
        return "stiffness" in self.actuator.commanded

    @property
    def limits(self) -> list[float]:
        """Finite limits of the stiffness in the robot file, of all joints, ascending."""
        ends = {end for joint in self.joints for end in joint.limits.stiffness if math.isfinite(end)}
        return sorted(ends)

    def unit(self, variable: str) -> str:
        """Return the unit of a variable at these joints."""
        return VARIABLES[variable].quantity.unit(self.joints[0].type)

    def at_rest(self, tau_e: FloatArray, stiffness: FloatArray) -> JointVariables:
        """See `state_at_rest`; arrays of one shape (samples,)."""
        return state_at_rest(self.actuator, tau_e, stiffness, np.full_like(tau_e, self.q))

    def ends(self, tau_e: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray]:
        """Return minimum and maximum stiffness at torques, and where each is a singularity; (samples,)."""
        if not self.commanded:
            stiffness = np.asarray(self.at_rest(tau_e, tau_e).stiffness, dtype=np.float64)
            regular = np.zeros(tau_e.shape, dtype=bool)
            return stiffness, stiffness, regular, regular
        with np.errstate(all="ignore"):
            found = self.actuator.solve(tau_e, np.ones_like(tau_e), np.full_like(tau_e, self.q))
        return found.lower, found.upper, found.lower_critical, found.upper_critical

    def clearance(self, tau_e: FloatArray, levels: FloatArray) -> tuple[dict[str, FloatArray], FloatArray]:
        """Return the distances to limits, and the coordinates of the springs, as in `StiffnessMap`."""
        torques = np.broadcast_to(tau_e, levels.shape).ravel()
        state = self.at_rest(torques, levels.ravel())
        infeasible = has_flag(state.flags, Flag.INFEASIBLE).reshape(levels.shape)
        clearance: dict[str, FloatArray] = {}
        for check in self.actuator.limits:
            if check.variable in LIMITS and math.isfinite(check.range[1]):
                values = np.where(infeasible, np.nan, check.clearance(state.by_name()).reshape(levels.shape))
                words = LIMITS[check.variable]
                clearance[words] = np.minimum(clearance.get(words, np.inf), values)
        unknowns = np.stack(list(self.actuator.unknowns(state.phi, state.theta)))
        return clearance, np.where(infeasible, np.nan, unknowns.reshape(-1, *levels.shape))

    @cached_property
    def stiffness(self) -> StiffnessMap:
        """Attainable stiffness over torque."""
        end, top = self._sight()
        return self._map(*self._extent(self._map(end, top)))

    def _map(self, end: float, top: float) -> StiffnessMap:
        """Return the map up to these ends of its axes."""
        tau_e = np.linspace(-end, end, POINTS)
        lower, upper, at_lower, at_upper = self.ends(tau_e)
        shares = np.linspace(INSIDE ** (1 / 3), 1 - INSIDE, LEVELS)[:, None] ** 3  # dense at the minimum
        levels = lower + shares * np.maximum(np.minimum(upper, top) - lower, 0.0)
        clearance, phi = self.clearance(tau_e, levels)
        return StiffnessMap(tau_e, lower, upper, at_lower, at_upper, levels, clearance, phi, top)

    def _sight(self) -> tuple[float, float]:
        """Return ends of both axes beyond which nothing keeps the limits, to within a factor of 1.5.

        Where no limit bounds them, the minimum stiffness determines both.
        """
        tau_e = np.concatenate((-SEARCHED[::-1], SEARCHED))
        lower, upper, *_ = self.ends(tau_e)
        most = np.where(np.isinf(upper), lower * RATIOS[-1], upper)
        levels = np.concatenate((np.minimum(lower * RATIOS, most), lower + SHARES * (most - lower)))
        within = _within(levels, self.clearance(tau_e, levels)[0])
        usable, sizes = np.any(within, axis=0), np.abs(tau_e)
        if usable[[0, -1]].any() or not usable.any():
            usable = lower <= FREE_GROWTH * np.nanmin(lower)
        end = BEYOND_TORQUE * float(np.max(sizes, where=usable, initial=0.0))
        end = max(end, LOAD_SHARE * self.load)
        seen = within & (sizes <= end)
        highest = float(np.max(levels, where=seen, initial=0.0))
        if not highest or np.any(seen & (levels >= lower * RATIOS[-1] * (1 - INSIDE)) & np.isinf(upper)):
            carried = (sizes <= end) & np.isfinite(lower)
            highest = FREE_HEIGHT / BEYOND * float(np.max(lower, where=carried, initial=0.0))
        return end, max([BEYOND * highest or 1.0, *(ROOM * limit for limit in self.limits)])

    def _extent(self, seen: StiffnessMap) -> tuple[float, float]:
        """Return the ends of both axes just beyond the values that keep all limits."""
        within, sizes = seen.within, np.abs(seen.tau_e)
        usable = np.any(within, axis=0)
        end, top = float(sizes[-1]), seen.top
        if usable.any() and not usable[[0, -1]].any():
            end = max(ROOM * float(sizes[usable].max()), LOAD_SHARE * self.load)
        if usable.any() and not within[-1][seen.upper > top].any():
            top = ROOM * max([*self.limits, float(seen.levels[within].max())])
            if not np.ptp(seen.levels[within]):  # a linear spring, whose line is in the middle
                top *= 2
        return end, top

    @property
    def torques(self) -> list[TorqueCurve]:
        """Torques of the springs over the deflections that occur in the map within all limits."""
        within = self.stiffness.within
        unknowns = np.where(within | ~within.any(), self.stiffness.unknowns, np.nan)
        curves = self._of_mechanism if self.actuator.spring_elements is None else self._of_springs
        return list(curves(unknowns))

    def _of_springs(self, unknowns: FloatArray) -> Iterator[TorqueCurve]:
        """Yield the torque of each spring, of equal springs only once."""
        theta = self.actuator.motor_positions(unknowns, np.asarray(self.q))
        elements = self.actuator.spring_elements or ()
        limits = (*self.actuator.max_deflections, *[math.inf] * len(elements))
        kinds = [(element.law, limit) for element, limit in zip(elements, limits, strict=False)]
        for index, (element, (law, limit)) in enumerate(zip(elements, kinds, strict=True)):
            if (law, limit) in kinds[:index]:
                continue
            weights = zip(element.motors, theta, strict=True)
            deflection = element.joint * self.q + sum(weight * moved for weight, moved in weights)
            reached = limit if math.isfinite(limit) else ROOM * float(np.nanmax(np.abs(deflection)))
            low, high = (min(max(end, -reached), reached) for end in law.domain)
            points = np.linspace(low, high, POINTS)
            same = [number for number, kind in enumerate(kinds, 1) if kind == (law, limit)]
            name = "spring between the motors" if element.joint == 0 else _numbered(same)
            yield TorqueCurve(name, points, law.torque(points), limit)

    def _of_mechanism(self, unknowns: FloatArray) -> Iterator[TorqueCurve]:
        """Yield the torque of a mechanism at several settings of motor 2."""
        settings = np.linspace(np.nanmin(unknowns[1]), np.nanmax(unknowns[1]), SETTINGS)
        reached = float(np.nanmax(np.abs(unknowns[0])))
        points = np.linspace(-reached, reached, FINE_POINTS)
        springs = self.actuator.elasticity([self.actuator])
        q = np.full((FINE_POINTS, 1), self.q)
        settings = np.where(np.abs(settings) < ROUNDED * np.ptp(settings), 0.0, settings)
        for setting in np.unique(settings):
            theta = np.stack((points + self.q, np.full_like(points, setting)), axis=-1)[:, None]
            torque = springs.torques(springs.coordinates(q, theta)).tau_e[:, 0]
            shown = np.abs(torque) <= self.stiffness.tau_e[-1]
            ranged = np.moveaxis(springs.ranged(q, theta)[:, 0], -1, 0)
            for values, (low, high) in zip(ranged, self.actuator.phi_ranges, strict=True):
                shown &= (values >= low - INSIDE) & (values <= high + INSIDE)
            yield TorqueCurve(f"{setting:.3g}", points, np.where(shown, torque, np.nan))


def actuator_charts(robot: Robot, loads: Sequence[float]) -> list[ActuatorChart]:
    """Return the charts of a robot's compliant joints, one for joints with equal actuators.

    Args:
        robot: the robot.
        loads: largest torque of gravity of each joint, N m (N).
    """
    groups: list[list[int]] = []
    for index, joint in enumerate(robot.joints):
        if not joint.actuator.sprung:
            continue
        for group in groups:
            if _interchangeable(robot.joints[group[0]], joint):
                group.append(index)
                break
        else:
            groups.append([index])
    return [
        ActuatorChart(
            tuple(robot.joints[index] for index in group),
            max(float(loads[index]) for index in group),
            home_position(robot.joints[group[0]]),
        )
        for group in groups
    ]


def _interchangeable(one: Joint, other: Joint) -> bool:
    """Return whether the charts of two joints are equal: springs and limits, whatever the rotors' inertia."""
    return one.type == other.type and _drawn(one.actuator) == _drawn(other.actuator)


def _drawn(actuator: Actuator) -> tuple[object, ...]:
    """Return the parts of an actuator that its charts show."""
    parts = [
        getattr(actuator, each.name)
        for each in fields(cast("DataclassInstance", actuator))
        if each.name not in ROTORS
    ]
    limits = [check for check in actuator.limits if check.variable in LIMITS]
    return type(actuator), parts, limits


def _within(levels: FloatArray, clearance: dict[str, FloatArray]) -> BoolArray:
    """Return where stiffness values exist and keep all limits."""
    within = np.isfinite(levels)
    for distance in clearance.values():
        within &= distance >= 0
    return within


def _law_name(law: SpringLaw) -> str:
    """Return the name of a law in robot files."""
    if law.is_linear:
        return "linear"
    declared = law.law if isinstance(law, Mirrored) else law  # a tendon that acts on side 2
    return LAWS.name_of(type(declared)).replace("_", " ")


def _numbered(numbers: Sequence[int]) -> str:
    """Return the names of springs by their numbers."""
    return f"springs {' and '.join(map(str, numbers))}" if len(numbers) > 1 else f"spring {numbers[0]}"
