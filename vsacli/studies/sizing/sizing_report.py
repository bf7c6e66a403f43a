"""Report of a sizing, as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

from vsacli.base.json_records import Published, named
from vsacli.base.tables import ReportText, TextReport, cell, headline
from vsacli.base.texts import counted, joined, warnings_and_notes
from vsacli.base.units import JOINT_ACCELERATION, POSITION, TORQUE, VELOCITY, in_header, time_text, units_of
from vsacli.studies.sizing.catalog import LIMITS
from vsacli.studies.sizing.choices import CRITERIA, Choice
from vsacli.studies.sizing.demand import Outcome, Peak, SpringDemand
from vsacli.studies.sizing.motor_sizing import MotorSizing


@dataclass(frozen=True, eq=False)
class Sizing(Published, TextReport):
    """The demands of motions on the drives of a robot, and the drives that meet them.

    Attributes:
        robot: name of the robot.
        outcomes: runs along the trajectories.
        catalog: path of the catalog; None without one.
        candidates: number of motors in the catalog.
        criterion: criterion of the best choice, one of `CRITERIA`; None without a catalog.
        motors: sizing of each motor, joint by joint.
        springs: demand on each spring.
        warnings: warnings about the inputs.
        notes: assumptions that are not obvious.
    """

    robot: str
    outcomes: tuple[Outcome, ...]
    catalog: str | None
    candidates: int
    criterion: str | None
    motors: tuple[MotorSizing, ...]
    springs: tuple[SpringDemand, ...]
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    format: ClassVar[str] = "vsacli-sizing/2"
    shape: ClassVar = {
        **named("format", "verdict", "robot"),
        "trajectories": "outcomes",
        **named("catalog", "criterion", "warnings", "notes", "motors", "springs"),
    }

    @property
    def verdict(self) -> str:
        """First verdict that applies.

        They are self_check_failed (as for a run), insufficient if nothing suffices for some motor, incomplete
        if samples were left out, unreliable (as for a run), and ok.
        """
        verdicts = [outcome.verdict for outcome in self.outcomes]
        applies = {
            "self_check_failed": "self_check_failed" in verdicts,
            "insufficient": bool(self.lacking),
            "incomplete": any(outcome.left_out for outcome in self.outcomes),
            "unreliable": "unreliable" in verdicts,
        }
        return next((verdict for verdict, holds in applies.items() if holds), "ok")

    @property
    def lacking(self) -> tuple[MotorSizing, ...]:
        """Motors for which nothing suffices."""
        return tuple(motor for motor in self.motors if not motor.does)

    def as_text(self) -> ReportText:
        """Return the report in parts: motors and their utilization, then demands on joints and springs."""
        known = [motor for motor in self.motors if motor.asked is not None]
        several = len(self.outcomes) > 1
        tables = [
            choice_rows(known) if self.catalog else own_rows(known, several=several),
            demand_rows(known, several=several) if self.catalog else [],
            spring_rows(self.springs, several=several),
        ]
        found = [
            *lacking(self.lacking),
            *left_out(self.outcomes),
            *warnings_and_notes(self.warnings, self.notes),
        ]
        first = headline(self.verdict, f"{self.title}: {self._answer()}")
        return ReportText(first, found, [table for table in tables if len(table) > 1])

    @property
    def title(self) -> str:
        """Names of robot and trajectories, with durations."""
        return ", ".join(
            [self.robot, *(f"{each.trajectory} ({each.duration:g} s)" for each in self.outcomes)]
        )

    def _answer(self) -> str:
        places, lacking = len(self.motors), len(self.lacking)
        every = f"all {places} motors" if places > 1 else "the motor"
        which = f"{places - lacking} of {places} motors" if lacking else every
        if self.catalog is None:
            if not any(motor.own and motor.own.shares for motor in self.motors):
                limits = "the robot file has no motor limits to compare with (such as max_torque)"
                return f"requirements on the motors; {limits}, and no catalog is given"
            suffice = "suffices" if places - lacking == 1 else "suffice"
            return f"{which} {suffice}{_highest(self.motors)}"
        assert self.criterion is not None, "as of every catalog"
        offered = f"{self.catalog} ({counted(self.candidates, 'motor')})"
        if lacking == places:
            return f"no motor of {offered} suffices"
        return (
            f"{offered} has a choice for {which}{_highest(self.motors)}, chosen by {CRITERIA[self.criterion]}"
        )


def _highest(motors: Sequence[MotorSizing]) -> str:
    """Return a clause with the highest utilization of all motors; empty if no limit is known."""
    known = [motor for motor in motors if _limit_shares(motor)]
    if not known:
        return ""
    motor = max(known, key=lambda each: max(_limit_shares(each).values()))
    return f", utilization up to {_share_text(max(_limit_shares(motor).values()))} ({motor.name})"


def _limit_shares(motor: MotorSizing) -> dict[str, float]:
    """Return the used share of each limit, of the best choice if there is a catalog."""
    return motor.best.shares if motor.best else motor.own.shares if motor.own else {}


WORDS = {
    "torque": "peak torque",
    "continuous_torque": "rms torque",
    "velocity": "speed",
    "voltage": "voltage",
}
"""Limits of a motor in words."""


def left_out(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Yield a sentence for each trajectory with samples that were left out."""
    for outcome in outcomes:
        if outcome.left_out:
            missing = f"{outcome.left_out} of {counted(outcome.samples, 'sample')}"
            were = "was" if outcome.left_out == 1 else "were"
            yield (
                f"{outcome.trajectory}: {missing} {were} left out as infeasible or singular, so the result "
                "does not hold for the whole motion; see vsacli check-feasibility"
            )


def demand_rows(motors: Sequence[MotorSizing], *, several: bool) -> list[tuple[str, ...]]:
    """Return the table of demands on the joint side, whatever the motors."""
    types = [motor.demand.joint_type for motor in motors]
    torque, velocity = units_of(TORQUE, types), units_of(VELOCITY, types)
    acceleration = units_of(JOINT_ACCELERATION, types)
    rows: list[tuple[str, ...]] = [
        (
            "demand, joint side",
            f"peak load\n{torque}",
            "at",
            f"rms load\n{torque}",
            f"speed\n{velocity}",
            f"acceleration\n{acceleration}",
        )
    ]
    for motor in motors:
        asked = motor.asked
        assert asked is not None, "motors of which something is known"
        rows.append(
            (
                motor.name,
                cell(asked.load.value),
                _when(asked.load, several=several),
                cell(asked.rms_load),
                cell(asked.velocity.value),
                cell(asked.acceleration),
            )
        )
    return rows


def own_rows(motors: Sequence[MotorSizing], *, several: bool) -> list[tuple[str, ...]]:
    """Return the table of the robot's own motors, on the joint side if gears are unknown."""
    torque, velocity = (
        (in_header(units) for units in zip(*(motor.units for motor in motors), strict=True))
        if motors
        else ("", "")
    )
    rows: list[tuple[str, ...]] = [
        (
            "motor",
            "utilization\n%",
            "limit",
            f"peak torque\n{torque}",
            "at",
            f"rms torque\n{torque}",
            f"speed\n{velocity}",
            "power\nW",
            "current\nA",
            "voltage\nV",
            "copper loss\nW",
        )
    ]
    for motor in motors:
        assert motor.own is not None, "motors of which something is known"
        points, on_joint = motor.own.points, motor.gear_ratio is None
        rows.append(
            (
                motor.name + (" (joint side)" if on_joint else ""),
                *_most(motor.own.shares),
                cell(points.torque.value),
                _when(points.torque, several=several),
                cell(points.rms_torque),
                cell(points.velocity.value),
                cell(points.power),
                cell(points.current),
                cell(points.voltage),
                cell(points.copper_loss),
            )
        )
    return _without_empty(rows)


def choice_rows(motors: Sequence[MotorSizing]) -> list[tuple[str, ...]]:
    """Return the table of the best motor of a catalog for each motor."""
    used = [name for name in LIMITS if any(motor.best and name in motor.best.shares for motor in motors)]
    rows: list[tuple[str, ...]] = [
        (
            "motor",
            "choice",
            "gear",
            *(f"{WORDS[name]}\n% of limit" for name in used),
            "copper loss\nW",
            "sufficient\ngears",
            "sufficient\nmotors",
        )
    ]
    for motor in motors:
        best = motor.best
        assert best is not None, "a catalog has motors"
        rows.append(
            (
                motor.name,
                best.motor if best.does else f"none, nearest {best.motor}",
                f"{best.ratio:.4g}",
                *(_percentage(best.shares.get(name, math.nan)) for name in used),
                cell(best.copper_loss),
                _gears(best),
                f"{sum(choice.does for choice in motor.choices)}",
            )
        )
    return _without_empty(rows)


def lacking(motors: Sequence[MotorSizing]) -> Iterator[str]:
    """Yield a sentence for each motor for which nothing suffices: nearest choice and violated limits."""
    for motor in motors:
        shares = _limit_shares(motor)
        beyond = [_used_text(shares[name], WORDS[name]) for name in LIMITS if shares.get(name, 0) > 1]
        if motor.asked is None:
            yield f"{motor.name}: no sample is feasible, so nothing is known of it"
        elif motor.best is not None:
            with_gear = f"{motor.best.motor} with the gear {motor.best.ratio:.4g}"
            others = "" if math.isnan(motor.best.low) else f"; gears {_gears(motor.best)} would suffice"
            yield f"{motor.name}: no motor suffices; {with_gear} would use {joined(beyond)}{others}"
        else:
            reason = f"it uses {joined(beyond)}{_other_gears(motor)}"
            yield f"{motor.name}: {reason}"


def _other_gears(motor: MotorSizing) -> str:
    if motor.own is None or motor.own.low is None or motor.own.high is None:
        return ""
    if math.isnan(motor.own.low):
        return "; no other gear would suffice"
    return f"; gears {_gear_range_text(motor.own.low, motor.own.high)} would suffice"


def spring_rows(springs: Sequence[SpringDemand], *, several: bool) -> list[tuple[str, ...]]:
    """Return the table of springs."""
    known = [spring for spring in springs if math.isfinite(spring.energy.value)]
    types = [spring.joint_type for spring in known]
    torque, position = (units_of(quantity, types) for quantity in (TORQUE, POSITION))
    header = (
        "spring",
        "energy\nJ",
        "at",
        f"torque\n{torque}",
        f"deflection\n{position}",
        "of admissible\n%",
    )
    return _without_empty([header, *(_spring_row(spring, several=several) for spring in known)])


def _spring_row(spring: SpringDemand, *, several: bool) -> tuple[str, ...]:
    return (
        f"{spring.joint} {spring.spring}",
        cell(spring.energy.value),
        _when(spring.energy, several=several),
        cell(spring.torque.value),
        cell(spring.deflection.value),
        _percentage(spring.share),
    )


def _without_empty(rows: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Return a table, header first, without columns that are empty in all rows."""
    kept = [index for index in range(len(rows[0])) if any(row[index] != "-" for row in rows[1:])]
    return [tuple(row[index] for index in kept) for row in rows]


def _gears(choice: Choice) -> str:
    if choice.ratios:
        return ", ".join(f"{ratio:g}" for ratio in choice.ratios)
    return "-" if math.isnan(choice.low) else _gear_range_text(choice.low, choice.high)


def _gear_range_text(low: float, high: float) -> str:
    if low == 0:
        return "any" if math.isinf(high) else f"up to {high:.4g}"
    return f"from {low:.4g}" if math.isinf(high) else f"{low:.4g} to {high:.4g}"


def _most(shares: dict[str, float]) -> tuple[str, str]:
    """Return the highest utilization in percent, and the limit it is of."""
    if not shares:
        return "-", "-"
    name = max(shares, key=lambda each: shares[each])
    return _percentage(shares[name]), WORDS[name]


def _percentage(share: float) -> str:
    return cell(100 * share)


MANY = 10
"""Share of a limit from which on it is shown as a multiple."""


def _share_text(share: float) -> str:
    if math.isnan(share):
        return "-"
    return f"{100 * share:.3g} %" if share < MANY else f"{share:.3g} times"


def _used_text(share: float, limit: str) -> str:
    return f"{_share_text(share)} {'of ' if share < MANY else ''}its {limit}"


def _when(peak: Peak, *, several: bool) -> str:
    if math.isnan(peak.time):
        return "-"
    return f"{peak.trajectory} {time_text(peak.time)}" if several else time_text(peak.time)
