"""The ranking of parameters by their effect on motor torques, from the report of a sensitivity analysis."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from vsacli.base.texts import counted
from vsacli.results.charts.parameter_words import parameter_words

MOST_BARS = 15
"""Maximum number of parameters in the figure, the most important ones."""

ABSOLUTE = {"m": (1e-3, "1 mm"), "rad": (math.radians(1), "1 deg")}
"""Absolute changes of lengths and angles, by unit; other parameters change by a share of their value."""


class EffectBar(NamedTuple):
    """The effect of a change of a parameter.

    Attributes:
        label: parameter and its change.
        share: largest change of a motor torque, relative to the largest torque of its joint.
        joint: joint of that motor.
    """

    label: str
    share: float
    joint: str


class Ranking(NamedTuple):
    """The most important parameters, in order, with the title of their figure."""

    title: str
    bars: Sequence[EffectBar]

    @classmethod
    def of(cls, report: Mapping[str, Any], joints: Sequence[str]) -> Ranking:
        """Return the ranking in a report.

        Args:
            report: report of a sensitivity analysis as JSON.
            joints: names of the joints, in the order of the robot file.

        Raises:
            LookupError, TypeError, AttributeError, ArithmeticError: the content is not such a report.
        """
        effects = report["parameters"]
        bars = list(_bars(effects[:MOST_BARS], joints))
        parameters = counted(len(effects), "parameter")
        shown = parameters if len(bars) == len(effects) else f"{len(bars)} of {parameters}"
        return cls(f"sensitivity of {report['robot']}, {report['trajectory']}: {shown}", bars)


def _bars(effects: Sequence[Mapping[str, Any]], joints: Sequence[str]) -> Iterator[EffectBar]:
    """Yield a bar for each parameter that changes a motor torque."""
    for effect in effects:
        shares = {joint: joint_effect["share"] or 0.0 for joint, joint_effect in effect["joints"].items()}
        joint = max(shares, key=lambda name: shares[name], default=None)
        if joint is not None and shares[joint] > 0:
            words = parameter_words(effect["path"], effect["unit"], joints)
            yield EffectBar(f"{_change_text(effect)} of {words}", shares[joint], joint)


def _change_text(effect: Mapping[str, Any]) -> str:
    """Return the change of a parameter in words."""
    step, words = ABSOLUTE.get(effect["unit"], (math.nan, ""))
    if math.isclose(effect["step"], step):
        return words
    return f"{100 * effect['step'] / abs(effect['value']):.3g} %"
