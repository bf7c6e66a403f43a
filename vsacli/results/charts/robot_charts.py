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

TORQUE_COUNT, LEVEL_COUNT = 201, 37
"""Number of torques of a map, and of stiffness values at each torque for the curves of limits."""

DEFLECTION_COUNT = 2001
"""Number of deflections of the torque of a mechanism, enough for its steepest setting."""

STIFFNESS_MARGIN, TORQUE_MARGIN = 1.5, 1.3
"""Factors of the ends of both axes before the exact ends are known, larger than a step of the search."""

SEARCHED_TORQUES = np.geomspace(1e-5, 1e7, 121)
"""Torques, N m (N), among which the end of the torque axis is searched."""

RATIOS, SHARES = np.geomspace(1 + 1e-6, 1e3, 25)[:, None], np.linspace(0.02, 1 - 1e-6, 13)[:, None]
"""Stiffness values tried at each of these torques: relative to the minimum, and as shares of the range."""

FREE_GROWTH = 1.5
"""Growth of the minimum stiffness up to the end of the torque axis, where no limit ends it."""

FREE_HEIGHT = 2.5
"""Height of the stiffness axis relative to the largest minimum stiffness, where no limit ends it."""

LOAD_SHARE = 1.5
"""Smallest end of the torque axis relative to the static load."""

MARGIN = 1.08
"""Factor by which axes extend beyond their content."""

END_DISTANCE = 1e-6
"""Relative distance of the lowest and highest levels from the ends of the attainable range, at which
rounding would make some samples infeasible."""

SETTING_COUNT, ZERO_SHARE = 5, 1e-3
"""Number of settings of motor 2 for which the torque of a mechanism is shown, and share of their range within
which a setting counts as 0."""

LIMITS = {"tau_motor": "limit of motor torque at rest", "phi": "limit of deflection"}
"""Meanings of the limits in a map, by the variable that they bound."""


ROTOR_FIELDS = ("motor", "coupled_inertia")
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
    def within_limits(self) -> BoolArray:
        """Marks of the values of the levels that keep all limits, (levels, points)."""
        return _within_limits(self.levels, self.clearance)


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
        parts = [self.joints[0].actuator_type]
        mechanism = getattr(self.actuator, "mechanism", None)
        if mechanism is not None:
            parts.append(MECHANISMS.name_of(type(mechanism)).replace("_", " "))
        else:
            laws = [element.law for element in self.actuator.spring_elements or ()]
            parts += dict.fromkeys(_law_name(law) for law in laws)
        return ", ".join(parts)

    @property
    def commanded(self) -> bool:
        """Whether a trajectory commands the stiffness."""
        return "stiffness" in self.actuator.commanded

    @property
    def limits(self) -> list[float]:
        """Finite limits of the stiffness in the robot file, of all joints, ascending."""
        bounds = {bound for joint in self.joints for bound in joint.limits.stiffness if math.isfinite(bound)}
        return sorted(bounds)

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
            solution = self.actuator.solve(tau_e, np.ones_like(tau_e), np.full_like(tau_e, self.q))
        return solution.lower, solution.upper, solution.lower_critical, solution.upper_critical

    def clearance(self, tau_e: FloatArray, levels: FloatArray) -> tuple[dict[str, FloatArray], FloatArray]:
        """Return the distances to limits, and the coordinates of the springs, as in `StiffnessMap`."""
        torques = np.broadcast_to(tau_e, levels.shape).ravel()
        state = self.at_rest(torques, levels.ravel())
        infeasible = has_flag(state.flags, Flag.INFEASIBLE).reshape(levels.shape)
        clearance: dict[str, FloatArray] = {}
        for limit in self.actuator.limits:
            if limit.variable in LIMITS and math.isfinite(limit.range[1]):
                values = np.where(infeasible, np.nan, limit.clearance(state.by_name()).reshape(levels.shape))
                caption = LIMITS[limit.variable]
                clearance[caption] = np.minimum(clearance.get(caption, np.inf), values)
        unknowns = np.stack(list(self.actuator.unknowns(state.phi, state.theta)))
        return clearance, np.where(infeasible, np.nan, unknowns.reshape(-1, *levels.shape))

    @cached_property
    def stiffness(self) -> StiffnessMap:
        """Attainable stiffness over torque."""
        max_torque, max_stiffness = self._search_axis_ends()
        return self._map(*self._axis_ends(self._map(max_torque, max_stiffness)))

    def _map(self, max_torque: float, max_stiffness: float) -> StiffnessMap:
        """Return the map up to these ends of its axes."""
        tau_e = np.linspace(-max_torque, max_torque, TORQUE_COUNT)
        lower, upper, lower_singular, upper_singular = self.ends(tau_e)
        shares = (
            np.linspace(END_DISTANCE ** (1 / 3), 1 - END_DISTANCE, LEVEL_COUNT)[:, None] ** 3
        )  # dense at the minimum
        levels = lower + shares * np.maximum(np.minimum(upper, max_stiffness) - lower, 0.0)
        clearance, unknowns = self.clearance(tau_e, levels)
        return StiffnessMap(
            tau_e, lower, upper, lower_singular, upper_singular, levels, clearance, unknowns, max_stiffness
        )

    def _search_axis_ends(self) -> tuple[float, float]:
        """Return ends of both axes beyond which nothing keeps the limits, to within a factor of 1.5.

        Where no limit bounds them, the minimum stiffness determines both.
        """
        tau_e = np.concatenate((-SEARCHED_TORQUES[::-1], SEARCHED_TORQUES))
        lower, upper, *_ = self.ends(tau_e)
        largest = np.where(np.isinf(upper), lower * RATIOS[-1], upper)
        levels = np.concatenate((np.minimum(lower * RATIOS, largest), lower + SHARES * (largest - lower)))
        within_limits = _within_limits(levels, self.clearance(tau_e, levels)[0])
        is_carried, magnitudes = np.any(within_limits, axis=0), np.abs(tau_e)
        if is_carried[[0, -1]].any() or not is_carried.any():
            is_carried = lower <= FREE_GROWTH * np.nanmin(lower)
        max_torque = TORQUE_MARGIN * float(np.max(magnitudes, where=is_carried, initial=0.0))
        max_torque = max(max_torque, LOAD_SHARE * self.load)
        visible = within_limits & (magnitudes <= max_torque)
        max_stiffness = float(np.max(levels, where=visible, initial=0.0))
        if not max_stiffness or np.any(
            visible & (levels >= lower * RATIOS[-1] * (1 - END_DISTANCE)) & np.isinf(upper)
        ):
            in_range = (magnitudes <= max_torque) & np.isfinite(lower)
            max_stiffness = FREE_HEIGHT / STIFFNESS_MARGIN * float(np.max(lower, where=in_range, initial=0.0))
        return max_torque, max(
            [STIFFNESS_MARGIN * max_stiffness or 1.0, *(MARGIN * limit for limit in self.limits)]
        )

    def _axis_ends(self, stiffness_map: StiffnessMap) -> tuple[float, float]:
        """Return the ends of both axes just beyond the values that keep all limits."""
        within_limits, magnitudes = stiffness_map.within_limits, np.abs(stiffness_map.tau_e)
        is_carried = np.any(within_limits, axis=0)
        max_torque, max_stiffness = float(magnitudes[-1]), stiffness_map.top
        if is_carried.any() and not is_carried[[0, -1]].any():
            max_torque = max(MARGIN * float(magnitudes[is_carried].max()), LOAD_SHARE * self.load)
        if is_carried.any() and not within_limits[-1][stiffness_map.upper > max_stiffness].any():
            max_stiffness = MARGIN * max([*self.limits, float(stiffness_map.levels[within_limits].max())])
            if not np.ptp(
                stiffness_map.levels[within_limits]
            ):  # a linear spring, whose line is in the middle
                max_stiffness *= 2
        return max_torque, max_stiffness

    @property
    def torques(self) -> list[TorqueCurve]:
        """Torques of the springs over the deflections that occur in the map within all limits."""
        within_limits = self.stiffness.within_limits
        unknowns = np.where(within_limits | ~within_limits.any(), self.stiffness.unknowns, np.nan)
        torque_curves = (
            self._mechanism_curves if self.actuator.spring_elements is None else self._spring_curves
        )
        return list(torque_curves(unknowns))

    def _spring_curves(self, unknowns: FloatArray) -> Iterator[TorqueCurve]:
        """Yield the torque of each spring, of equal springs only once."""
        theta = self.actuator.motor_positions(unknowns, np.asarray(self.q))
        elements = self.actuator.spring_elements or ()
        limits = (*self.actuator.max_deflections, *[math.inf] * len(elements))
        springs = [(element.law, limit) for element, limit in zip(elements, limits, strict=False)]
        for index, (element, (law, limit)) in enumerate(zip(elements, springs, strict=True)):
            if (law, limit) in springs[:index]:
                continue
            weighted_motors = zip(element.motors, theta, strict=True)
            deflection = element.joint * self.q + sum(
                weight * position for weight, position in weighted_motors
            )
            max_deflection = limit if math.isfinite(limit) else MARGIN * float(np.nanmax(np.abs(deflection)))
            low, high = (min(max(bound, -max_deflection), max_deflection) for bound in law.domain)
            deflections = np.linspace(low, high, TORQUE_COUNT)
            equal_numbers = [number for number, spring in enumerate(springs, 1) if spring == (law, limit)]
            label = "spring between the motors" if element.joint == 0 else _spring_label(equal_numbers)
            yield TorqueCurve(label, deflections, law.torque(deflections), limit)

    def _mechanism_curves(self, unknowns: FloatArray) -> Iterator[TorqueCurve]:
        """Yield the torque of a mechanism at several settings of motor 2."""
        settings = np.linspace(np.nanmin(unknowns[1]), np.nanmax(unknowns[1]), SETTING_COUNT)
        max_deflection = float(np.nanmax(np.abs(unknowns[0])))
        deflections = np.linspace(-max_deflection, max_deflection, DEFLECTION_COUNT)
        elasticity = self.actuator.elasticity([self.actuator])
        q = np.full((DEFLECTION_COUNT, 1), self.q)
        settings = np.where(np.abs(settings) < ZERO_SHARE * np.ptp(settings), 0.0, settings)
        for setting in np.unique(settings):
            theta = np.stack((deflections + self.q, np.full_like(deflections, setting)), axis=-1)[:, None]
            torque = elasticity.torques(elasticity.coordinates(q, theta)).tau_e[:, 0]
            is_shown = np.abs(torque) <= self.stiffness.tau_e[-1]
            ranged_values = np.moveaxis(elasticity.ranged(q, theta)[:, 0], -1, 0)
            for values, (low, high) in zip(ranged_values, self.actuator.phi_ranges, strict=True):
                is_shown &= (values >= low - END_DISTANCE) & (values <= high + END_DISTANCE)
            yield TorqueCurve(f"{setting:.3g}", deflections, np.where(is_shown, torque, np.nan))


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
            if _have_equal_charts(robot.joints[group[0]], joint):
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


def _have_equal_charts(joint: Joint, other_joint: Joint) -> bool:
    """Return whether the charts of two joints are equal: springs and limits, whatever the rotors' inertia."""
    return joint.type == other_joint.type and _charted_parameters(joint.actuator) == _charted_parameters(
        other_joint.actuator
    )


def _charted_parameters(actuator: Actuator) -> tuple[object, ...]:
    """Return the parts of an actuator that its charts show."""
    parameters = [
        getattr(actuator, field.name)
        for field in fields(cast("DataclassInstance", actuator))
        if field.name not in ROTOR_FIELDS
    ]
    limits = [limit for limit in actuator.limits if limit.variable in LIMITS]
    return type(actuator), parameters, limits


def _within_limits(levels: FloatArray, clearance: dict[str, FloatArray]) -> BoolArray:
    """Return where stiffness values exist and keep all limits."""
    within_limits = np.isfinite(levels)
    for limit_clearance in clearance.values():
        within_limits &= limit_clearance >= 0
    return within_limits


def _law_name(law: SpringLaw) -> str:
    """Return the name of a law in robot files."""
    if law.is_linear:
        return "linear"
    declared_law = law.law if isinstance(law, Mirrored) else law  # a tendon that acts on side 2
    return LAWS.name_of(type(declared_law)).replace("_", " ")


def _spring_label(numbers: Sequence[int]) -> str:
    """Return the names of springs by their numbers."""
    return f"springs {' and '.join(map(str, numbers))}" if len(numbers) > 1 else f"spring {numbers[0]}"
