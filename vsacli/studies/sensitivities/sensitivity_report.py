"""Report of a sensitivity analysis, as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar

from vsacli.base.json_records import Published, named
from vsacli.base.tables import ReportText, TextReport, headline
from vsacli.base.texts import counted, warnings_and_notes
from vsacli.base.units import in_header
from vsacli.studies.sensitivities.band import JointBand, TorqueCurves
from vsacli.studies.sensitivities.tolerances import MonteCarlo

MAX_TABLE_ROWS = 15
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
class Sensitivity(Published, TextReport):
    """The dependence of a run on each parameter of its robot.

    Attributes:
        robot, trajectory: names of robot and trajectory.
        verdict: verdict on the unchanged run: ok, over_limit, singular or infeasible.
        failed: number of its infeasible or singular samples, counted for each joint, which are left out.
        samples: number of its samples.
        left_out: number of samples at which at least one joint is infeasible or singular.
        parameters: effects of the parameters, the most important first.
        band: effect of tolerances on each joint, by name; empty without tolerances.
        curves: motor torques and their standard deviations; None without tolerances; not in JSON.
        monte_carlo: results of robots drawn from the tolerances; None without draws.
        units: unit of the torques of each joint, by name.
        warnings: sentences about implausible values of robot and trajectory.
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
    samples: int = 0
    left_out: int = 0
    warnings: tuple[str, ...] = ()

    format: ClassVar[str] = "vsacli-sensitivity/2"
    shape: ClassVar = {
        "format": "format",
        **named("robot", "trajectory", "verdict", "failed", "samples", "left_out", "warnings", "parameters"),
        "band?": "band",
        "monte_carlo?": "monte_carlo",
    }

    @property
    def title(self) -> str:
        """Names, and with tolerances the largest uncertainty of a motor torque, else the largest effect."""
        finite_bands = {joint: band for joint, band in self.band.items() if math.isfinite(band.share)}
        worst_joint = max(finite_bands, key=lambda joint: finite_bands[joint].share, default=None)
        if worst_joint is not None:
            band = finite_bands[worst_joint]
            uncertainty = (
                f"{band.torque:.3g} {self.units[worst_joint]} ({_percent(band.share)} of its peak, "
                f"{worst_joint})"
            )
            answer = f"motor torque +- {uncertainty}"
        elif self.top and self.top[0].most is not None:
            (joint, effect), top_effect = self.top[0].most, self.top[0]
            change = f"{top_effect.words} of {top_effect.path} changes motor torque"
            answer = f"{change} by {_percent(effect.share)} of its peak ({joint})"
        else:
            answer = "no parameter changes a motor torque"
        return f"{self.robot}, {self.trajectory}: {counted(len(self.parameters), 'parameter')}; {answer}"

    def as_text(self) -> ReportText:
        """Return the report in parts; the first table is that of tolerances, if there are any."""
        tables = [self._band_rows(), self._rows() if self.top else []]
        first_line = headline(self.verdict, self.title) if self.left_out else self.title
        return ReportText(first_line, list(self._findings()), tables, list(self._lines()))

    def _findings(self) -> Iterator[str]:
        if self.left_out:
            verb = "is" if self.left_out == 1 else "are"
            yield (
                f"{self.left_out} of {counted(self.samples, 'sample')} {verb} {self.verdict} and left out; "
                "check-feasibility says why"
            )
        yield from warnings_and_notes(self.warnings, ())
        reversing_joints = [joint for joint, band in self.band.items() if band.reverses]
        if reversing_joints and self.monte_carlo is None:
            yield (
                f"{', '.join(reversing_joints)}: dry friction jumps where a motor reverses, at a "
                "time known only to "
                "first order; --monte-carlo computes robots drawn from the tolerances"
            )

    @property
    def top(self) -> tuple[ParameterEffect, ...]:
        """Effects of the parameters in the table."""
        return tuple(each for each in self.parameters[:MAX_TABLE_ROWS] if each.most is not None)

    def _rows(self) -> list[tuple[str, ...]]:
        units = in_header(self.units[each.most[0]] for each in self.top if each.most)
        rows: list[tuple[str, ...]] = [
            (
                "parameter",
                "change",
                "joint",
                "peak torque\n%",
                f"torque\n{units}",
                "at\ns",
                "margin\npoints",
                "motor work\nJ",
            )
        ]
        for each in self.top:
            assert each.most is not None
            joint, effect = each.most
            spent = sum(of_joint.spent for of_joint in each.joints.values())
            rows.append(
                (
                    each.path,
                    each.words,
                    joint,
                    _percentage_points(effect.share),
                    f"{effect.torque:.3g}",
                    f"{effect.time:.3f}",
                    _margins(each, joint),
                    f"{spent:+.2g}" if spent else "0",
                )
            )
        return rows

    def _lines(self) -> Iterator[str]:
        """Yield what the table of parameters leaves out."""
        other_count = sum(each.most is not None for each in self.parameters[MAX_TABLE_ROWS:])
        without_effect = sum(each.most is None for each in self.parameters)
        if other_count:
            others = counted(other_count, "other parameter")
            effect = _percent(self.parameters[MAX_TABLE_ROWS].share)
            yield (
                f"{others} {'has' if other_count == 1 else 'have'} an effect of {effect} or less; "
                "--json lists all"
            )
        if without_effect:
            yield f"{counted(without_effect, 'parameter')} without effect on motor torques, or zero"
        if self.monte_carlo is not None:
            draws = self.monte_carlo
            refused_clause = (
                f", of which {counted(draws.refused, 'draw')} made no valid robot" if draws.refused else ""
            )
            yield f"Monte Carlo: {counted(draws.drawn, 'robot')} drawn{refused_clause}"

    def _band_rows(self) -> list[tuple[str, ...]]:
        """Return the table of the effects of tolerances on each joint; empty without tolerances."""
        if not self.band:
            return []
        units = in_header(self.units[joint] for joint in self.band)
        draws = self.monte_carlo
        header = (
            "joint",
            f"torque +-\n{units}",
            "of peak\n%",
            "at\ns",
            "margin\n%",
            "at\ns",
            "P(infeasible)\n%",
            *([] if draws is None else [f"drawn +-\n{units}", "infeasible\n% of draws"]),
            *(["mostly by"] if any(_is_mostly_friction(band) for band in self.band.values()) else []),
        )
        rows = [header]
        for joint, band in self.band.items():
            has_torque, has_margin = math.isfinite(band.share), math.isfinite(band.margin)
            torque_cells = (
                (f"{band.torque:.3g}", _percentage_points(band.share), f"{band.time:.3f}")
                if has_torque
                else ["-"] * 3
            )
            margin_cells = (
                (
                    f"{100 * band.margin:.2f} +- {_percentage_points(band.margin_deviation)}",
                    f"{band.margin_time:.3f}",
                    _probability(band.lost),
                )
                if has_margin
                else ["-"] * 3
            )
            draw_cells: list[str] = []
            if draws is not None:
                draw_cells = ["-", "-"]
                if joint in draws.lost:
                    deviation = draws.torque[joint]
                    deviation_text = "-" if math.isnan(deviation) else f"{deviation:.3g}"
                    draw_cells = [deviation_text, _probability(draws.lost[joint])]
            friction_cells = (
                ["reversal" if _is_mostly_friction(band) else "-"] if header[-1] == "mostly by" else []
            )
            rows.append((joint, *torque_cells, *margin_cells, *draw_cells, *friction_cells))
        return rows


def _is_mostly_friction(band: JointBand) -> bool:
    """Return whether most of the uncertainty is that of the time at which dry friction reverses."""
    return band.reversals > 1 / 2


def _margins(effect: ParameterEffect, shown: str) -> str:
    """Return the largest change of a smallest margin, with the joint unless the row shows it."""
    changes = {name: each.margin for name, each in effect.joints.items() if math.isfinite(each.margin)}
    joint = max(changes, key=lambda name: abs(changes[name]), default=None)
    if joint is None or not changes[joint]:
        return "-"
    return ("" if joint == shown else f"{joint} ") + f"{100 * changes[joint]:+.2g}"


def _probability(share: float) -> str:
    """Return a probability in percent."""
    return _percentage_points(share) if share >= 1e-6 or share == 0 else "< 1e-4"


def _percent(share: float) -> str:
    """Return a percentage with two digits, or as an integer from 100 % on."""
    return f"{_percentage_points(share)} %"


def _percentage_points(share: float) -> str:
    return f"{100 * share:.2g}" if abs(share) < 0.995 else f"{100 * share:.0f}"
