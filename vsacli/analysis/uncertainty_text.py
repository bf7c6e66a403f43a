"""What a report says of recorded signals: how uncertain the torques are, what is not determined."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from vsacli.analysis.joint_report import DETERMINED, JUDGED, JointReport, JointUncertainty, Spread
from vsacli.analysis.report_text import by_joint, count, number, of_motors, percent
from vsacli.analysis.trouble_text import excess

DIFFERENT_PEAK = 1.1
"""Factor between a peak at the ends of a record and that inside from which on it is said where it is."""


def uncertainty_lines(joints: Sequence[JointReport]) -> Iterator[str]:
    """How uncertain the motor torques of recorded motions are, and what that means for the rest."""
    found = [(joint, joint.uncertainty) for joint in joints if joint.uncertainty is not None]
    for joint, uncertainty in found:
        yield from (f"{joint.name}: {sentence}" for sentence in _sentences(joint, uncertainty))
    torques = [(joint.name, each.variables[JUDGED]) for joint, each in found if JUDGED in each.variables]
    if torques:
        yield by_joint(
            "motor torque, random noise only: ", [_spread(name, spread) for name, spread in torques]
        )


def _sentences(joint: JointReport, uncertainty: JointUncertainty) -> Iterator[str]:
    yield from map(undetermined_text, uncertainty.undetermined)
    for kind, steps in uncertainty.steps.items():
        if steps:
            all_of_them = count(joint.steps[kind])
            yield f"{steps} of {all_of_them} that are {kind} may be otherwise within their uncertainty"
    for worst in uncertainty.limits.values():
        yield f"{excess(worst)} by less than its uncertainty, and does not count"
    if JUDGED in uncertainty.variables:
        yield from _peak_at_an_end(joint, uncertainty.variables[JUDGED])


def _peak_at_an_end(joint: JointReport, spread: Spread) -> Iterator[str]:
    largest = max(of_motors(joint, joint.peak_tau_motor))
    if largest > DIFFERENT_PEAK * spread.peak:
        outside, inside = (f"{number(peak)} {spread.unit}" for peak in (largest, spread.peak))
        yield f"its peak motor torque of {outside} is at a doubtful end of the record, else it is {inside}"


def _spread(name: str, spread: Spread) -> str:
    if not math.isnan(spread.rms):
        return f"{name} +- {spread.rms:.2g} {spread.unit} ({percent(spread.share)})"
    within = "" if math.isnan(spread.bound) else f", wrong by at most {percent(spread.bound)}"
    return f"{name} +- unknown{within}"


def undetermined_text(spread: Spread) -> str:
    """That a record does not determine a variable, and by how much it may be wrong."""
    what = f"{spread.name} is not determined by the record"
    if math.isnan(spread.bound):
        return f"{what}, since a signal that it depends on is not"
    wrong = f"it may be wrong by {percent(spread.bound)} of its root mean square"
    if not math.isnan(spread.rms):
        wrong += f", twice its standard deviation of {spread.rms:.2g} {spread.unit}"
    return f"{what}: {wrong}; {100 * DETERMINED:.0f} % is allowed"
