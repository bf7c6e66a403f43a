"""Findings of a run as sentences: what fails, when, by how much, how uncertain it is, and what to do.

`failing_joints_line` is for the first line of a report, `finding_lines` for the lines below it, the most
critical first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from vsacli.analysis.joint_report import DETERMINED, JUDGED, JointReport, JointUncertainty, Spread
from vsacli.analysis.report_text import (
    actuator_kind,
    list_by_joint,
    short_number,
    short_percent,
    values_of_motors,
    wrap_joint_entries,
)
from vsacli.analysis.tool_report import ToolReport
from vsacli.base.flags import labeled_flag
from vsacli.base.texts import counted, significant
from vsacli.base.units import time_text
from vsacli.dynamics.limits import OFF_TARGET, Finding

DIFFERENT_PEAK = 1.1
"""Ratio of a peak at the ends of a recording to the peak inside, above which its place is reported."""

NOT_DETERMINED = "is not determined by the record"
"""Words of warnings of fits on derivatives that a recording leaves undetermined."""

MAX_SENTENCES_PER_KIND = 3
"""Joints with a full sentence on a kind of problem, where more than one more have it."""

MOST_SENTENCES = 12
"""Full sentences of a report; where there would be more, only the worst joint of each kind has one."""

MOST_LISTS = 8
"""Kinds of problems of a report whose lists of joints have values; where there are more, only names."""

FAILURES = {
    "infeasible": "infeasible",
    "singular": "singular",
    "over_limit": "over a limit",
    "unreliable": "unreliable",
}
"""Verdicts that joints are counted for in the first line of a report, and their words there."""

GRAVEST_KINDS = (
    "not_finite",
    "infeasible",
    "internal_instability",
    "static_instability",
    "singular",
    OFF_TARGET,
)
"""Kinds of problems that come first; limits follow, and warnings come last."""

COUNTED_AS = {
    "not_finite": "infeasible",
    "internal_instability": "singular",
    "static_instability": "singular",
}
"""Kinds of problems whose samples are counted under another name."""


def uncertainty_lines(joints: Sequence[JointReport]) -> Iterator[str]:
    """Yield what the uncertainty of recorded motions leaves undetermined or undecided."""
    for joint in joints:
        if joint.uncertainty is not None:
            yield from (
                f"{joint.name}: {sentence}" for sentence in _uncertainty_sentences(joint, joint.uncertainty)
            )


def spread_lines(joints: Sequence[JointReport]) -> Iterator[str]:
    """Yield the standard deviations of motor torques of recorded motions."""
    uncertain = [(joint.name, joint.uncertainty) for joint in joints if joint.uncertainty is not None]
    torques = [
        (name, uncertainty.variables[JUDGED])
        for name, uncertainty in uncertain
        if JUDGED in uncertainty.variables
    ]
    if torques:
        yield wrap_joint_entries(
            "standard deviation of motor torque, random noise only: ",
            [_spread_text(name, spread) for name, spread in torques],
        )


def little_effect(joints: Sequence[JointReport]) -> Iterator[str]:
    """Yield that motor torques hardly depend on undetermined derivatives, if they are determined."""
    torques = [joint.uncertainty.variables.get(JUDGED) for joint in joints if joint.uncertainty is not None]
    if torques and all(spread is not None and spread.determined for spread in torques):
        largest = max(spread.bound for spread in torques if spread is not None)
        yield (
            f"motor torques depend little on it: their error may reach {short_percent(largest)} of their "
            f"root mean square; {100 * DETERMINED:.0f} % is allowed"
        )


def _uncertainty_sentences(joint: JointReport, uncertainty: JointUncertainty) -> Iterator[str]:
    yield from map(undetermined_text, uncertainty.undetermined)
    for kind, samples in uncertainty.samples.items():
        if samples:
            flagged_text = counted(joint.samples[kind], "sample")
            yield f"{samples} of {flagged_text} that are {kind} may not be: uncertainty decides"
    for finding in uncertainty.limits.values():
        yield f"{finding.text}, but by less than its uncertainty, so it does not count"
    if JUDGED in uncertainty.variables:
        yield from _peak_at_an_end(joint, uncertainty.variables[JUDGED])


def _peak_at_an_end(joint: JointReport, spread: Spread) -> Iterator[str]:
    largest = max(values_of_motors(joint, joint.peak_tau_motor))
    if largest > DIFFERENT_PEAK * spread.peak:
        outside, inside = (f"{short_number(peak)} {spread.unit}" for peak in (largest, spread.peak))
        yield f"its peak motor torque {outside} is at an unreliable end of the recording; inside {inside}"


def _spread_text(name: str, spread: Spread) -> str:
    if not math.isnan(spread.rms):
        return f"{name} +- {spread.rms:.2g} {spread.unit} ({short_percent(spread.share)})"
    bound_text = "" if math.isnan(spread.bound) else f", wrong by at most {short_percent(spread.bound)}"
    return f"{name} +- unknown{bound_text}"


def undetermined_text(spread: Spread) -> str:
    """Return that a recording does not determine a variable, and its possible error."""
    subject = f"{spread.name} is not determined by the recording"
    if math.isnan(spread.bound):
        return f"{subject}, since a signal that it depends on is not"
    error = f"its error may reach {short_percent(spread.bound)} of its root mean square"
    if not math.isnan(spread.rms):
        error += f", twice its standard deviation of {spread.rms:.2g} {spread.unit}"
    return f"{subject}: {error}; {100 * DETERMINED:.0f} % is allowed"


def failing_joints_line(joints: Sequence[JointReport], tools: Sequence[ToolReport] = ()) -> str:
    """Return how many joints and tools fail which requirement; empty if none does, or there is only one."""
    sentences = []
    for members, reports in (("joints", joints), ("tools", tools)):
        failing = {
            words: sum(report.shows(verdict) for report in reports) for verdict, words in FAILURES.items()
        }
        sentences.append(of_all_joints(failing, len(reports), members))
    return ", ".join(filter(None, sentences))


def of_all_joints(failing: Mapping[str, int], total: int, members: str = "joints") -> str:
    """Return numbers of joints and what they fail; empty if none does, or there is only one joint."""
    failure_counts = [(words, count) for words, count in failing.items() if count]
    if total == 1 or not failure_counts:
        return ""
    (words, first_count), *further_counts = failure_counts
    return ", ".join(
        [
            f"{first_count} of {total} {members} {words}",
            *(f"{count_of_words} {words}" for words, count_of_words in further_counts),
        ]
    )


def finding_lines(reports: Sequence[JointReport | ToolReport], samples: int) -> Iterator[str]:
    """Yield the problems of a run, the most critical first.

    Args:
        reports: reports of the joints, in the order of the robot file, and of the tools.
        samples: number of samples of the run.
    """
    worst_findings = [
        (number, worst) for number, report in enumerate(reports) for worst in report.worst.values()
    ]
    names = [report.name for report in reports]
    yield from group_findings(
        worst_findings, names, lambda index, worst: _finding_texts(reports[index], worst, samples)
    )


Words = Callable[[int, Finding], tuple[str, str, int]]
"""Words for a finding of a joint by index: a sentence, a few words for a list, and the number of samples."""


def group_findings(
    findings: Iterable[tuple[int, Finding]],
    names: Sequence[str],
    words: Words = lambda _, finding: (finding.text, finding.brief, 0),
) -> Iterator[str]:
    """Yield a sentence for each kind of finding of a joint, the most critical first.

    Where many joints have a kind, those beyond the first few follow in a few words each. The report of seven
    joints that fail in every way stays on one page: it then has fewer sentences, and lists of names alone.

    Args:
        findings: findings of all joints, each with the index of its joint, in any order.
        names: names of the joints, in the order of the robot file.
        words: words for each of them; of equally bad ones, the finding at more samples comes first.
    """
    findings_by_kind: dict[str, list[tuple[int, Finding]]] = {}
    for index, finding in findings:
        findings_by_kind.setdefault(finding.kind, []).append((index, finding))
    sentence_counts = {
        kind: len(kind_findings)
        if len(kind_findings) <= MAX_SENTENCES_PER_KIND + 1
        else MAX_SENTENCES_PER_KIND
        for kind, kind_findings in findings_by_kind.items()
    }
    if sum(sentence_counts.values()) > MOST_SENTENCES:
        sentence_counts = dict.fromkeys(findings_by_kind, 1)
    for kind in sorted(findings_by_kind, key=_rank):
        kind_findings = [
            (finding.share, *words(index, finding), index, finding)
            for index, finding in findings_by_kind[kind]
        ]
        kind_findings.sort(key=lambda entry: (entry[0], entry[3]), reverse=True)
        yield from (
            f"{names[index]}: {sentence}"
            for _, sentence, _, _, index, _ in kind_findings[: sentence_counts[kind]]
        )
        listed = {
            index: (brief, finding)
            for _, _, brief, _, index, finding in kind_findings[sentence_counts[kind] :]
        }
        if listed and len(findings_by_kind) > MOST_LISTS:
            yield f"also {_kind_text(kind)}: {', '.join(names[index] for index in sorted(listed))}"
        elif listed:
            yield _further_joints_line(kind, dict(sorted(listed.items())), names)


def _further_joints_line(kind: str, briefs: Mapping[int, tuple[str, Finding]], names: Sequence[str]) -> str:
    """Return findings of one kind in a list, with their unit once if it is the same."""
    has_values = kind.endswith("_limit") or kind == OFF_TARGET
    units = {finding.unit if has_values else "" for _, finding in briefs.values()}
    unit = "".join(f" ({unit})" for unit in units if unit) if len(units) == 1 else ""
    texts = {
        index: brief if len(units) == 1 else f"{brief} {finding.unit}"
        for index, (brief, finding) in briefs.items()
    }
    return list_by_joint(f"also {_kind_text(kind)}{unit}: ", texts, names)


def _finding_texts(joint: JointReport | ToolReport, worst: Finding, samples: int) -> tuple[str, str, int]:
    """Return the words of a finding of a run of so many samples."""
    counted_as = COUNTED_AS.get(worst.kind, worst.kind)
    if counted_as not in joint.samples:
        return f"{worst.text} (first at {time_text(joint.first_time[worst.kind])})", worst.brief, 0
    sentence = _SENTENCE_OF_KIND[worst.kind](joint, worst, samples)
    return sentence, f"({_occurrence_text(joint, counted_as, samples)})", joint.samples[counted_as]


def _rank(kind: str) -> tuple[int, int]:
    """Return the place of a kind of problem in a report; limits in the order of their flags."""
    if kind in GRAVEST_KINDS:
        return 0, GRAVEST_KINDS.index(kind)
    flag = labeled_flag(kind)
    return (2, 0) if flag is None or kind == "near_singular" else (1, flag.value)


def _kind_text(kind: str) -> str:
    words = kind.replace("_", " ")
    return f"beyond the {words}" if kind.endswith("limit") else words


def _occurrence_text(joint: JointReport | ToolReport, kind: str, samples: int) -> str:
    """Return in how many samples a joint has a kind of problem, and from when on."""
    sample_count = joint.samples[kind]
    if sample_count == samples:
        return "all samples"
    count_text = counted(sample_count, "sample")
    return count_text if sample_count == 1 else f"{count_text}, from {time_text(joint.first_time[kind])}"


def _infeasible_text(joint: JointReport, worst: Finding, samples: int) -> str:
    when, hints = (
        worst.when(closed=True),
        f"({_occurrence_text(joint, 'infeasible', samples)}){_infeasible_hints(joint)}",
    )
    if math.isnan(worst.bound):
        return f"the springs cannot carry the elastic torque {when} at any stiffness; reduce the load {hints}"
    value, bound = worst.numbers
    relation = "below the minimum" if worst.below else "above the maximum"
    if "stiffness" not in actuator_kind(joint).commanded:
        load = f"elastic torque {value} {worst.unit} {when} is {relation} of {bound} {worst.unit}"
        return f"{load} that its spring carries; reduce the load {hints}"
    return (
        f"stiffness {value} {worst.unit} {when} is {relation} of {bound} {worst.unit} at this load; "
        f"{'increase' if worst.below else 'decrease'} it {hints}"
    )


def _infeasible_hints(joint: JointReport) -> str:
    slack_count = joint.samples["slack"]
    slack_text = f"; a tendon goes slack at {counted(slack_count, 'sample')}" if slack_count else ""
    return slack_text + ("; the opposite branch reaches it" if joint.other_branch else "")


def _singular_text(joint: JointReport, worst: Finding, samples: int) -> str:
    occurrence = _occurrence_text(joint, "singular", samples)
    if math.isnan(worst.bound):
        return f"the spring is slack {worst.when()}, so that motor torques are undefined ({occurrence})"
    advice = "decrease" if worst.bound == joint.attainable[1] else "increase"
    return (
        f"stiffness {significant(worst.value)} {worst.unit} {worst.when(closed=True)} is singular: motor "
        f"torques are undefined at the end of the attainable range; {advice} it ({occurrence})"
    )


def _near_singular_text(joint: JointReport, worst: Finding, samples: int) -> str:
    gap_ratio, occurrence = (
        worst.excess / worst.value,
        _occurrence_text(joint, "near_singular", samples),
    )
    return (
        f"warning: stiffness {significant(worst.value)} {worst.unit} {worst.when(closed=True)} is "
        f"{100 * gap_ratio:.2g} % from the singularity, where motor torques grow without bound ({occurrence})"
    )


def _not_finite_text(joint: JointReport, worst: Finding, samples: int) -> str:
    return (
        f"a motor variable is not finite {worst.when()}: motion, stiffness or load are too large or not "
        f"numbers (infeasible: {_occurrence_text(joint, 'infeasible', samples)})"
    )


def _unstable_text(joint: JointReport, worst: Finding, samples: int) -> str:
    return (
        f"the motion inside its damped transmission is unstable from t = {time_text(worst.time)} on: its "
        f"damper carries {short_number(worst.value)} {worst.unit} that the springs cannot; increase the "
        f"stiffness ({_occurrence_text(joint, 'singular', samples)})"
    )


def _buckling_text(tool: ToolReport, worst: Finding, samples: int) -> str:
    return (
        f"{worst.text}; increase the stiffness of the joints that move the tool or are carried by one of "
        f"them ({_occurrence_text(tool, 'singular', samples)})"
    )


_SENTENCE_OF_KIND: Mapping[str, Callable[[Any, Finding, int], str]] = {
    "not_finite": _not_finite_text,
    "infeasible": _infeasible_text,
    "singular": _singular_text,
    "near_singular": _near_singular_text,
    "internal_instability": _unstable_text,
    "static_instability": _buckling_text,
}
