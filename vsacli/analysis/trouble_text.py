"""Findings of a run as sentences: what fails, when, by how much, how uncertain it is, and what to do.

`counts` is for the first line of a report, `findings` for the lines below it, the most critical first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from vsacli.analysis.joint_report import DETERMINED, JUDGED, JointReport, JointUncertainty, Spread, Worst
from vsacli.analysis.report_text import apart, by_joint, count, kind_of, number, of_joints, of_motors, percent
from vsacli.base.flags import Flag
from vsacli.base.units import time_text

DIFFERENT_PEAK = 1.1
"""Ratio of a peak at the ends of a recording to the peak inside, above which its place is reported."""


def uncertainty_lines(joints: Sequence[JointReport]) -> Iterator[str]:
    """Yield the uncertainty of motor torques of recorded motions, and its consequences."""
    found = [(joint, joint.uncertainty) for joint in joints if joint.uncertainty is not None]
    for joint, uncertainty in found:
        yield from (f"{joint.name}: {sentence}" for sentence in _sentences(joint, uncertainty))
    torques = [(joint.name, each.variables[JUDGED]) for joint, each in found if JUDGED in each.variables]
    if torques:
        yield by_joint(
            "standard deviation of motor torque, random noise only: ",
            [_spread(name, spread) for name, spread in torques],
        )


def _sentences(joint: JointReport, uncertainty: JointUncertainty) -> Iterator[str]:
    yield from map(undetermined_text, uncertainty.undetermined)
    for kind, samples in uncertainty.samples.items():
        if samples:
            yield f"{samples} of {count(joint.samples[kind])} that are {kind} may not be: uncertainty decides"
    for worst in uncertainty.limits.values():
        yield f"{excess(worst)}, but by less than its uncertainty, so it does not count"
    if JUDGED in uncertainty.variables:
        yield from _peak_at_an_end(joint, uncertainty.variables[JUDGED])


def _peak_at_an_end(joint: JointReport, spread: Spread) -> Iterator[str]:
    largest = max(of_motors(joint, joint.peak_tau_motor))
    if largest > DIFFERENT_PEAK * spread.peak:
        outside, inside = (f"{number(peak)} {spread.unit}" for peak in (largest, spread.peak))
        yield f"its peak motor torque {outside} is at an unreliable end of the recording; inside {inside}"


def _spread(name: str, spread: Spread) -> str:
    if not math.isnan(spread.rms):
        return f"{name} +- {spread.rms:.2g} {spread.unit} ({percent(spread.share)})"
    within = "" if math.isnan(spread.bound) else f", wrong by at most {percent(spread.bound)}"
    return f"{name} +- unknown{within}"


def undetermined_text(spread: Spread) -> str:
    """Return that a recording does not determine a variable, and its possible error."""
    subject = f"{spread.name} is not determined by the recording"
    if math.isnan(spread.bound):
        return f"{subject}, since a signal that it depends on is not"
    error = f"its error may reach {percent(spread.bound)} of its root mean square"
    if not math.isnan(spread.rms):
        error += f", twice its standard deviation of {spread.rms:.2g} {spread.unit}"
    return f"{subject}: {error}; {100 * DETERMINED:.0f} % is allowed"


MOST_IN_FULL = 3
"""Joints with a full sentence on a kind of problem, where more than one more have it."""

FAILURES = {
    "infeasible": "infeasible",
    "singular": "singular",
    "over_limit": "over a limit",
    "unreliable": "unreliable",
}
"""Verdicts that joints are counted for in the first line of a report, and their words there."""

GRAVEST = ("not_finite", "infeasible", "internal_instability", "singular")
"""Kinds of problems that come first; limits follow, and warnings come last."""


def counts(joints: Sequence[JointReport]) -> str:
    """Return how many joints fail which requirement; empty if none does, or there is only one."""
    failing = {words: sum(joint.shows(verdict) for joint in joints) for verdict, words in FAILURES.items()}
    failed = [(words, number) for words, number in failing.items() if number]
    if len(joints) == 1 or not failed:
        return ""
    (words, first), *others = failed
    return ", ".join(
        [f"{first} of {len(joints)} joints {words}", *(f"{number} {words}" for words, number in others)]
    )


def findings(joints: Sequence[JointReport], samples: int) -> Iterator[str]:
    """Yield a sentence for each kind of problem of a joint, the most critical first.

    Where many joints have a kind, those beyond `MOST_IN_FULL` follow in a few words each.

    Args:
        joints: reports of the joints, base to tip.
        samples: number of samples of the run.
    """
    kinds = sorted(dict.fromkeys(kind for joint in joints for kind in joint.worst), key=_rank)
    for kind in kinds:
        numbered = [(number, joint) for number, joint in enumerate(joints) if kind in joint.worst]
        numbered.sort(key=lambda each: _size(each[1], kind), reverse=True)
        in_full = len(numbered) if len(numbered) <= MOST_IN_FULL + 1 else MOST_IN_FULL
        for _, joint in numbered[:in_full]:
            yield f"{joint.name}: {_SENTENCES.get(kind, _limit)(joint, joint.worst[kind], samples)}"
        if others := {number: _briefly(joint, kind, samples) for number, joint in sorted(numbered[in_full:])}:
            yield of_joints(f"also {_words(kind)}: ", others, [joint.name for joint in joints])


def _rank(kind: str) -> tuple[int, int]:
    """Return the place of a kind of problem in a report; limits in the order of their flags."""
    if kind in GRAVEST:
        return 0, GRAVEST.index(kind)
    return (2, 0) if kind == "near_singular" else (1, Flag.labeled(kind).value)


def _size(joint: JointReport, kind: str) -> tuple[float, int]:
    """Return how large a problem is: by which share the bound is missed, then in how many samples."""
    return _share_beyond(joint.worst[kind]), joint.samples.get(kind, 0)


def _share_beyond(worst: Worst) -> float:
    """Return the excess as a share of the bound; infinite where there is none, as no stiffness would do."""
    known = worst.bound and not math.isnan(worst.bound)
    return abs(worst.value - worst.bound) / abs(worst.bound) if known else math.inf


def _words(kind: str) -> str:
    words = kind.replace("_", " ")
    return f"over the {words}" if kind.endswith("limit") else words


def _briefly(joint: JointReport, kind: str, samples: int) -> str:
    if kind in joint.samples:
        return f"({_when(joint, kind, samples)})"
    worst = joint.worst[kind]
    value, bound = apart(worst.value, worst.bound)
    return f"({value} {worst.unit}, limit {bound})"


def _when(joint: JointReport, kind: str, samples: int) -> str:
    """Return in how many samples a joint has a kind of problem, and from when on."""
    found = joint.samples[kind]
    if found == samples:
        return "all samples"
    return count(found) if found == 1 else f"{count(found)}, from {time_text(joint.first_time[kind])}"


def _between(joint: JointReport, worst: Worst) -> str:
    """Return a clause that the worst instant lies between two samples; empty if it is a sample."""
    return ", between two samples" if worst.time in {each.time for each in joint.between.values()} else ""


def _at(joint: JointReport, worst: Worst) -> str:
    return f"at t = {time_text(worst.time)}{_between(joint, worst)}"


def _infeasible(joint: JointReport, worst: Worst, samples: int) -> str:
    when, hints = _at(joint, worst), f"({_when(joint, 'infeasible', samples)}){_hints(joint)}"
    if math.isnan(worst.bound):
        return f"the springs cannot carry the elastic torque {when} at any stiffness; reduce the load {hints}"
    value, bound = apart(worst.value, worst.bound)
    low = worst.value < worst.bound
    relation = "below the minimum" if low else "above the maximum"
    if "stiffness" not in kind_of(joint).commanded:
        load = f"elastic torque {value} {worst.unit} {when} is {relation} of {bound} {worst.unit}"
        return f"{load} that its spring carries; reduce the load {hints}"
    return (
        f"stiffness {value} {worst.unit} {when} is {relation} of {bound} {worst.unit} at this load; "
        f"{'increase' if low else 'decrease'} it {hints}"
    )


def _hints(joint: JointReport) -> str:
    slack = f"; a tendon goes slack at {count(joint.samples['slack'])}" if joint.samples["slack"] else ""
    return slack + ("; the opposite branch reaches it" if joint.other_branch else "")


def _singular(joint: JointReport, worst: Worst, samples: int) -> str:
    when, where = _when(joint, "singular", samples), _at(joint, worst)
    if math.isnan(worst.bound):
        return f"the spring is slack {where}, so that motor torques are undefined ({when})"
    change = "decrease" if worst.bound == joint.attainable[1] else "increase"
    return (
        f"stiffness {worst.value:.6g} {worst.unit} {where} is singular: motor torques are undefined at the "
        f"end of the attainable range; {change} it ({when})"
    )


def _near_singular(joint: JointReport, worst: Worst, samples: int) -> str:
    gap = abs(worst.value - worst.bound) / worst.value
    return (
        f"warning: stiffness {worst.value:.6g} {worst.unit} {_at(joint, worst)} is {100 * gap:.2g} % "
        f"from singular, where motor torques grow without bound ({_when(joint, 'near_singular', samples)})"
    )


def _not_finite(joint: JointReport, worst: Worst, samples: int) -> str:
    return (
        f"a motor variable is not finite {_at(joint, worst)}: motion, stiffness or load are too large or not "
        f"numbers (infeasible: {_when(joint, 'infeasible', samples)})"
    )


def _unstable(joint: JointReport, worst: Worst, samples: int) -> str:
    return (
        f"the motion inside its damped transmission is unstable from t = {time_text(worst.time)} on: its "
        f"damper carries {number(worst.value)} {worst.unit} that the springs cannot; increase the stiffness "
        f"({_when(joint, 'singular', samples)})"
    )


def _limit(joint: JointReport, worst: Worst, _samples: int) -> str:
    return f"{excess(worst)}{_between(joint, worst)} (first at {time_text(joint.first_time[worst.kind])})"


def excess(worst: Worst) -> str:
    """Return by how much a limit is exceeded, and where."""
    whose = Flag.labeled(worst.kind).quantity_of(worst.motor)
    value, bound = apart(worst.value, worst.bound)
    relation = "below" if worst.value < worst.bound else "above"
    when = f"at t = {time_text(worst.time)}"
    return f"{whose} is {value} {worst.unit} {when}, {relation} its limit of {bound} {worst.unit}"


_SENTENCES = {
    "not_finite": _not_finite,
    "infeasible": _infeasible,
    "singular": _singular,
    "near_singular": _near_singular,
    "internal_instability": _unstable,
}
