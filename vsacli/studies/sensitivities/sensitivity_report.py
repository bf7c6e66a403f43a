"""Report of a sensitivity analysis, as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar

from vsacli.base.json_records import Published, named
from vsacli.base.tables import aligned
from vsacli.studies.sensitivities.band import JointBand, TorqueCurves
from vsacli.studies.sensitivities.tolerances import MonteCarlo

SHOWN = 15
"""Number of parameters in the table, the most important first."""


@dataclass(frozen=True)
class JointEffect(Published):
    """The effect of a change of a parameter on a joint.

    Attributes:
        torque: largest |change of a motor torque|, N m (N).
        share: ratio of that to the joint's largest motor torque.
        time: time of the largest change, s.
        motor: motor with the largest change, 1 or 2.
        margin: change of the smallest margin; NaN without a margin.
        spent: change of the positive motor work, J.
    """

    torque: float
    share: float
    time: float
    motor: int
    margin: float
    spent: float

    shape: ClassVar = named("torque", "share", "time", "motor", "margin", "spent")


@dataclass(frozen=True)
class ParameterEffect(Published):
    """The effect of a change of a parameter.

    Attributes:
        path: path of the parameter in the robot.
        value, unit: value and unit of the parameter, in SI units.
        step: change of the parameter, in SI units.
        words: change as text.
        joints: effects on the affected joints, by name.
        tolerance: standard deviation of the parameter, SI units; None without tolerances.
    """

    path: str
    value: float
    unit: str
    step: float
    words: str
    joints: dict[str, JointEffect]
    tolerance: float | None = None

    shape: ClassVar = {**named("path", "value", "unit", "step", "joints"), "tolerance?": "tolerance"}

    @property
    def most(self) -> tuple[str, JointEffect] | None:
        """Joint with the largest change relative to its peak torque, and the effect on it; None if none."""
        changed = [each for each in self.joints.items() if each[1].share > 0]
        return max(changed, key=lambda each: each[1].share, default=None)

    @property
    def share(self) -> float:
        """Largest change of a motor torque relative to the joint's peak torque."""
        return 0.0 if self.most is None else self.most[1].share


@dataclass(frozen=True)
class Sensitivity(Published):
    """The dependence of a run on each parameter of its robot.

    Attributes:
        robot, trajectory: names of robot and trajectory.
        verdict: verdict on the unchanged run: ok, over_limit, singular or infeasible.
        failed: number of its infeasible or singular samples, counted for each joint, which are ignored.
        parameters: effects of the parameters, the most important first.
        band: effect of tolerances on each joint, by name; empty without tolerances.
        curves: motor torques and their standard deviations; None without tolerances; not in JSON.
        monte_carlo: results of robots drawn from the tolerances; None without draws.
        units: unit of the torques of each joint, by name.
    """

    robot: str
    trajectory: str
    verdict: str
    failed: int
    parameters: tuple[ParameterEffect, ...]
    band: dict[str, JointBand] = field(default_factory=dict)
    monte_carlo: MonteCarlo | None = None
    curves: TorqueCurves | None = field(default=None, repr=False)
    units: dict[str, str] = field(default_factory=dict)

    format: ClassVar[str] = "vsacli-sensitivity/2"
    shape: ClassVar = {
        "format": "format",
        **named("robot", "trajectory", "verdict", "failed", "parameters"),
        "band?": "band",
        "monte_carlo?": "monte_carlo",
    }

    def __str__(self) -> str:
        title = f"{self.robot}, {self.trajectory}: {len(self.parameters)} numbers"
        if self.failed:
            title += f"; {self.failed} steps of joints are {self.verdict} and do not count"
        return "\n".join([title, *aligned(list(self._rows())), *self._more(), *self._bands(), *self._drawn()])

    @property
    def top(self) -> tuple[ParameterEffect, ...]:
        """Effects of the parameters in the table."""
        return tuple(each for each in self.parameters[:SHOWN] if each.most is not None)

    def _rows(self) -> Iterator[tuple[str, ...]]:
        yield ("number", "change", "peak motor torque", "", "at", "smallest margin", "energy spent")
        for each in self.top:
            assert each.most is not None
            joint, effect = each.most
            spent = sum(of_joint.spent for of_joint in each.joints.values())
            yield (
                each.path,
                each.words,
                f"{joint} {100 * effect.share:.2g} %",
                f"{effect.torque:.3g} {self.units[joint]}",
                f"{effect.time:.3f} s",
                _margins(each),
                f"{spent:+.2g} J",
            )

    def _more(self) -> Iterator[str]:
        rest = sum(each.most is not None for each in self.parameters[SHOWN:])
        without = sum(each.most is None for each in self.parameters)
        if rest:
            last = self.parameters[SHOWN].share
            yield f"and {rest} more, with {100 * last:.2g} % and less; all with --json"
        if without:
            yield f"{without} change no motor torque, or are zero"

    def _bands(self) -> Iterator[str]:
        for joint, band in self.band.items():
            said = []
            if math.isfinite(band.share):
                size = f"{band.torque:.3g} {self.units[joint]} ({_percent(band.share)} of its peak)"
                mostly = ", mostly by when dry friction reverses" if band.reversals > 1 / 2 else ""
                said.append(f"motor torque +- {size} at t = {band.time:.3f} s{mostly}")
            if math.isfinite(band.margin):
                said.append(
                    f"margin {100 * band.margin:.2f} +- {_percent(band.margin_deviation)} at t = "
                    f"{band.margin_time:.3f} s, lost with a probability of {_probability(band.lost)}"
                )
            yield f"{joint}: {'; '.join(said) or 'no motor torque, since no step is feasible and regular'}"
        reversing = [joint for joint, band in self.band.items() if band.reverses]
        if reversing and self.monte_carlo is None:
            yield (
                f"{', '.join(reversing)}: dry friction jumps where a motor reverses; when it does is known "
                "to first order, and --monte-carlo draws robots, which tell more"
            )

    def _drawn(self) -> Iterator[str]:
        if self.monte_carlo is None:
            return
        drawn = self.monte_carlo
        refused = f", {drawn.refused} of them no robots" if drawn.refused else ""
        each = ", ".join(
            f"{joint} {self._deviation(joint, drawn.torque[joint])}, {_probability(lost)} lost"
            for joint, lost in drawn.lost.items()
        )
        yield f"of {drawn.drawn} robots drawn{refused}: {each}"

    def _deviation(self, joint: str, torque: float) -> str:
        if math.isnan(torque):
            return "+- unknown (fewer than two have torques)"
        return f"+- {torque:.3g} {self.units[joint]}"


def _margins(effect: ParameterEffect) -> str:
    """Return the largest change of a smallest margin."""
    changes = {name: each.margin for name, each in effect.joints.items() if math.isfinite(each.margin)}
    joint = max(changes, key=lambda name: abs(changes[name]), default=None)
    return "-" if joint is None or not changes[joint] else f"{joint} {100 * changes[joint]:+.2g} points"


def _probability(share: float) -> str:
    return _percent(share) if share >= 1e-6 else "less than 1e-4 %"


def _percent(share: float) -> str:
    """Return a percentage with two digits, or as an integer from 100 % on."""
    return f"{100 * share:.2g} %" if abs(share) < 0.995 else f"{100 * share:.0f} %"
