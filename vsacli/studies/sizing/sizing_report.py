"""What a sizing says, as text and as JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from vsacli.analysis.report_text import warnings_and_notes
from vsacli.base.json_records import Published, named
from vsacli.studies.sizing import sizing_text as text
from vsacli.studies.sizing.choices import CRITERIA
from vsacli.studies.sizing.demand import Outcome
from vsacli.studies.sizing.motor_sizing import MotorSizing
from vsacli.studies.sizing.spring_demand import SpringDemand


@dataclass(frozen=True, eq=False)
class Sizing(Published):
    """What motions ask of the drives of a robot, and which would do.

    Attributes:
        robot: its name.
        outcomes: the runs.
        catalogue: path of the file; None if there is none.
        candidates: how many motors are in it.
        criterion: by which the best is chosen, one of `CRITERIA`; None without a catalogue.
        motors: those of all joints in turn.
        springs: what each must bear.
        warnings: why the inputs may not be what was meant.
        notes: how the numbers are meant, where that is not obvious.
    """

    robot: str
    outcomes: tuple[Outcome, ...]
    catalogue: str | None
    candidates: int
    criterion: str | None
    motors: tuple[MotorSizing, ...]
    springs: tuple[SpringDemand, ...]
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    format: ClassVar[str] = "vsacli-sizing/1"
    shape: ClassVar = {
        **named("format", "verdict", "robot"),
        "trajectories": "outcomes",
        **named("catalogue", "criterion", "warnings", "notes", "motors", "springs"),
    }

    @property
    def verdict(self) -> str:
        """The first that applies.

        self_check_failed or doubtful as of a run; incomplete if steps were left out; insufficient if nothing
        does for some motor; else ok.
        """
        verdicts = [outcome.verdict for outcome in self.outcomes]
        applies = {
            "self_check_failed": "self_check_failed" in verdicts,
            "insufficient": bool(self.lacking),
            "incomplete": any(outcome.left_out for outcome in self.outcomes),
            "doubtful": "doubtful" in verdicts,
        }
        return next((verdict for verdict, holds in applies.items() if holds), "ok")

    @property
    def lacking(self) -> tuple[MotorSizing, ...]:
        """The motors for which nothing does."""
        return tuple(motor for motor in self.motors if not motor.does)

    def __str__(self) -> str:
        """The lines that the command prints, without a final newline."""
        known = [motor for motor in self.motors if motor.asked is not None]
        several = len(self.outcomes) > 1
        return "\n".join(
            [
                self._headline(),
                *text.left_out(self.outcomes),
                *(text.asked_table(known, several=several) if self.catalogue else ()),
                *(text.choice_table(known) if self.catalogue else text.own_table(known, several=several)),
                *text.lacking(self.lacking),
                *text.spring_table(self.springs, several=several),
                *warnings_and_notes(self.warnings, self.notes),
            ]
        )

    @property
    def title(self) -> str:
        """Robot and motions."""
        return ", ".join(
            [self.robot, *(f"{each.trajectory} ({each.duration:g} s)" for each in self.outcomes)]
        )

    def _headline(self) -> str:
        return f"{self.title}: {self._answer()}"

    def _answer(self) -> str:
        places, lacking = len(self.motors), len(self.lacking)
        every = f"all {places} motors" if places > 1 else "the motor"
        which = f"{places - lacking} of {places} motors" if lacking else every
        if self.catalogue is None:
            if not any(motor.own and motor.own.shares for motor in self.motors):
                return "what is asked of its motors, for which the robot file has no limits"
            return f"the limits of {which} suffice"
        assert self.criterion is not None, "as of every catalogue"
        offered = f"{self.catalogue} ({self.candidates} motors) has"
        if lacking == places:
            return f"{offered} none that does"
        return f"{offered} one for {which}, chosen by {CRITERIA[self.criterion]}"
