"""Report of a sizing, as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

from vsacli.analysis.report_text import warnings_and_notes
from vsacli.base.json_records import Published, named
from vsacli.base.tables import aligned
from vsacli.base.units import JOINT_ACCELERATION, POSITION, TORQUE, VELOCITY, time_text
from vsacli.studies.sizing.choices import CRITERIA, Choice
from vsacli.studies.sizing.demand import Outcome, Peak, SpringDemand
from vsacli.studies.sizing.motor_sizing import MotorSizing
from vsacli.studies.sizing.shaft import LIMITS


@dataclass(frozen=True, eq=False)
class Sizing(Published):
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

    def __str__(self) -> str:
        """Return the lines that the command prints, without a final newline."""
        known = [motor for motor in self.motors if motor.asked is not None]
        several = len(self.outcomes) > 1
        return "\n".join(
            [
                self._headline(),
                *left_out(self.outcomes),
                *(asked_table(known, several=several) if self.catalog else ()),
                *(choice_table(known) if self.catalog else own_table(known, several=several)),
                *lacking(self.lacking),
                *spring_table(self.springs, several=several),
                *warnings_and_notes(self.warnings, self.notes),
            ]
        )

    @property
    def title(self) -> str:
        """Names of robot and trajectories, with durations."""
        return ", ".join(
            [self.robot, *(f"{each.trajectory} ({each.duration:g} s)" for each in self.outcomes)]
        )

    def _headline(self) -> str:
        return f"{self.title}: {self._answer()}"

    def _answer(self) -> str:
        places, lacking = len(self.motors), len(self.lacking)
        every = f"all {places} motors" if places > 1 else "the motor"
        which = f"{places - lacking} of {places} motors" if lacking else every
        if self.catalog is None:
            if not any(motor.own and motor.own.shares for motor in self.motors):
                return "what is asked of its motors, for which the robot file has no limits"
            return f"the limits of {which} suffice"
        assert self.criterion is not None, "as of every catalog"
        offered = f"{self.catalog} ({self.candidates} motors) has"
        if lacking == places:
            return f"{offered} none that does"
        return f"{offered} one for {which}, chosen by {CRITERIA[self.criterion]}"


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
            yield (
                f"{outcome.trajectory}: {outcome.left_out} of {outcome.samples} steps cannot be done and are "
                "left out, so that this is not for the whole motion; check-feasibility says why"
            )


def asked_table(motors: Sequence[MotorSizing], *, several: bool) -> Iterator[str]:
    """Yield the lines of the table of demands, whatever the motors."""
    if not motors:
        return
    rows = [("asked, joint side", "peak load", "at", "rms load", "speed", "acceleration")]
    for motor in motors:
        asked, joint_type = motor.asked, motor.demand.joint_type
        assert asked is not None, "motors of which something is known"
        rows.append(
            (
                motor.name,
                _number(asked.load.value, TORQUE.unit(joint_type)),
                _when(asked.load, several=several),
                _number(asked.rms_load, TORQUE.unit(joint_type)),
                _number(asked.velocity.value, VELOCITY.unit(joint_type)),
                _number(asked.acceleration, JOINT_ACCELERATION.unit(joint_type)),
            )
        )
    yield from aligned(rows)


def own_table(motors: Sequence[MotorSizing], *, several: bool) -> Iterator[str]:
    """Yield the lines of the table of the robot's own motors, on the joint side if gears are unknown."""
    if not motors:
        return
    rows = [
        ("motor", "peak torque", "at", "rms", "speed", "power", "current", "voltage", "loss", "uses most")
    ]
    for motor in motors:
        assert motor.own is not None, "motors of which something is known"
        points, on_joint = motor.own.points, motor.gear_ratio is None
        torque, velocity = motor.units
        rows.append(
            (
                motor.name + (" (joint side)" if on_joint else ""),
                _number(points.torque.value, torque),
                _when(points.torque, several=several),
                _number(points.rms_torque, torque),
                _number(points.velocity.value, velocity),
                _number(points.power, "W"),
                _number(points.current, "A"),
                _number(points.voltage, "V"),
                _number(points.copper_loss, "W"),
                _most(motor.own.shares),
            )
        )
    yield from aligned(_without_empty(rows))


def choice_table(motors: Sequence[MotorSizing]) -> Iterator[str]:
    """Yield the lines of the table of the best motor of a catalog for each motor."""
    if not motors:
        return
    used = [name for name in LIMITS if any(motor.best and name in motor.best.shares for motor in motors)]
    rows = [
        (
            "motor",
            "choice",
            "gear",
            "gears that do",
            *(WORDS[name] for name in used),
            "loss",
            "motors that do",
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
                _gears(best),
                *(_share(best.shares.get(name, math.nan)) for name in used),
                _number(best.copper_loss, "W"),
                f"{sum(choice.does for choice in motor.choices)}",
            )
        )
    yield from aligned(_without_empty(rows))


def lacking(motors: Sequence[MotorSizing]) -> Iterator[str]:
    """Yield a sentence for each motor for which nothing suffices: nearest choice and violated limits."""
    for motor in motors:
        shares = motor.best.shares if motor.best else motor.own.shares if motor.own else {}
        beyond = [
            f"{_share(shares[name])} of its {WORDS[name]}" for name in LIMITS if shares.get(name, 0) > 1
        ]
        if motor.asked is None:
            yield f"{motor.name}: no step can be done, so that nothing is known of it"
        elif motor.best is not None:
            with_gear = f"{motor.best.motor} with the gear {motor.best.ratio:.4g}"
            yield f"{motor.name}: no motor does; nearest is {with_gear}, which would use {_listed(beyond)}"
        else:
            reason = f"it uses {_listed(beyond)}{_other_gears(motor)}"
            yield f"{motor.name}: its limits do not suffice, {reason}"


def _other_gears(motor: MotorSizing) -> str:
    if motor.own is None or motor.own.low is None or motor.own.high is None:
        return ""
    if math.isnan(motor.own.low):
        return "; no other gear would do"
    return f"; gears {_range(motor.own.low, motor.own.high)} would do"


def spring_table(springs: Sequence[SpringDemand], *, several: bool) -> Iterator[str]:
    """Yield the lines of the table of springs."""
    known = [spring for spring in springs if math.isfinite(spring.energy.value)]
    if not known:
        return
    header = ("spring", "energy", "at", "torque", "deflection", "of admissible")
    yield from aligned(_without_empty([header, *(_spring_row(spring, several=several) for spring in known)]))


def _spring_row(spring: SpringDemand, *, several: bool) -> tuple[str, ...]:
    return (
        f"{spring.joint} {spring.spring}",
        _number(spring.energy.value, "J"),
        _when(spring.energy, several=several),
        _number(spring.torque.value, TORQUE.unit(spring.joint_type)),
        _number(spring.deflection.value, POSITION.unit(spring.joint_type)),
        _share(spring.share),
    )


def _without_empty(rows: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Return a table, header first, without columns that are empty in all rows."""
    kept = [index for index in range(len(rows[0])) if any(row[index] != "-" for row in rows[1:])]
    return [tuple(row[index] for index in kept) for row in rows]


def _gears(choice: Choice) -> str:
    if choice.ratios:
        return ", ".join(f"{ratio:g}" for ratio in choice.ratios)
    return "-" if math.isnan(choice.low) else _range(choice.low, choice.high)


def _range(low: float, high: float) -> str:
    if low == 0:
        return "any" if math.isinf(high) else f"up to {high:.4g}"
    return f"from {low:.4g}" if math.isinf(high) else f"{low:.4g} to {high:.4g}"


def _most(shares: dict[str, float]) -> str:
    if not shares:
        return "-"
    name = max(shares, key=lambda each: shares[each])
    return f"{_share(shares[name])} of {WORDS[name]}"


def _number(value: float, unit: str) -> str:
    return f"{value:.3g} {unit}" if math.isfinite(value) else "-"


def _share(share: float) -> str:
    if math.isnan(share):
        return "-"
    return f"{100 * share:.3g} %" if share < 10 else f"{share:.3g} times"


def _when(peak: Peak, *, several: bool) -> str:
    if math.isnan(peak.time):
        return "-"
    return f"{peak.trajectory} {time_text(peak.time)}" if several else time_text(peak.time)


def _listed(words: Sequence[str]) -> str:
    return " and ".join(words)
