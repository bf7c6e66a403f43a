"""Pages of curves over time: results or simulations on the same axes, and measured signals.

Variables are grouped in sections. Samples that cannot be executed, and the ends of recordings, are shaded in
all plots, and the links of the robot are animated.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vsacli.base.arrays import FLAG_TYPE, evenly
from vsacli.base.errors import InputError
from vsacli.base.flags import FLAG_BITS, LIMITS, Flag, has_flag
from vsacli.base.progress import Progress, unseen
from vsacli.base.simulation_variables import ERRORS, SIMULATED_NAMES, error
from vsacli.base.tables import ReportText
from vsacli.base.texts import counted, one_line
from vsacli.base.variables import TIP_COMPLIANCE, deviation
from vsacli.results.charts.comparison import check_comparable, distinct_labels
from vsacli.results.charts.figures import result_title
from vsacli.results.charts.measured import MeasuredCurve
from vsacli.results.charts.reduction import marked_spans
from vsacli.results.charts.stored import STIFFNESS_BOUNDS, StoredCharts
from vsacli.results.pages.document import (
    FixText,
    PageTexts,
    input_text,
    plotting_library,
    provenance_rows,
    render_page,
    tone_of,
)
from vsacli.results.pages.packing import Packed, arm_values
from vsacli.results.store.damage import reporting_damage
from vsacli.results.store.reader import StoredResult

MOST_FRAMES = 1000
"""Maximum number of instants of the animated robot; the page interpolates between them at 60 frames a
second."""

OPEN_SECTIONS = 4
"""Number of sections of measured signals that are open initially, as many as for a result."""

TROUBLES = {
    "infeasible": Flag.INFEASIBLE,
    "singular": Flag.SINGULAR,
    "near-singular": Flag.NEAR_SINGULAR,
    "over a limit": LIMITS,
}
"""Findings about a sample, with the bits of `flags` that denote them."""


class Section(NamedTuple):
    """Variables under one heading.

    Attributes:
        heading: heading of the section.
        names: names of the variables; for simulations the simulated ones.
        shown: whether the section is open initially, like the figures of `plot`.
    """

    heading: str
    names: tuple[str, ...]
    shown: bool = False


SECTIONS = (
    Section("Tracking errors", tuple(map(error, ERRORS)), shown=True),
    Section("Position and stiffness", ("q", "stiffness"), shown=True),
    Section("Stiffness of tools", (TIP_COMPLIANCE,), shown=True),
    Section("Motor torque", ("tau_motor",), shown=True),
    Section("Elastic torque", ("tau_e",), shown=True),
    Section("Springs", ("phi", "tau_transmission", "elastic_energy", "det_A")),
    Section("Motion of the motors", ("theta", "dtheta", "ddtheta", "dphi")),
    Section("Power, work and losses", ("motor_power", "motor_energy", "dissipated_power", "copper_loss")),
    Section("Current and voltage", ("current", "voltage")),
    Section("Damping", ("damping", "tau_damper", "ddamping", "dddamping")),
    Section("Wrench", ("wrench", "dwrench", "ddwrench")),
    Section("Derivatives", ("dq", "ddq", "d3q", "d4q", "dstiffness", "ddstiffness", "dtau_e", "ddtau_e")),
)
"""Sections of a page; further variables follow at the end."""


def result_page(
    files: Sequence[StoredResult],
    reports: Sequence[ReportText],
    fixes: Sequence[FixText | None],
    progress: Progress = unseen,
) -> str:
    """Return the page of results, or of simulations, as HTML.

    Args:
        files: open files; differences are relative to the first.
        reports: report of each file.
        fixes: fixes of each file, or None.
        progress: called with the number of variables to draw.

    Raises:
        InputError: the files cannot share axes, have nothing to draw, or are damaged; or a library that pages
            need is not installed.
    """
    library = plotting_library()
    check_comparable(files)
    packed, labels, charts = Packed(), distinct_labels(files), StoredCharts(files)
    start = min(float(file.time[0]) for file in files)
    open_sections = list(sections_of(charts.common))
    if not open_sections:
        lack = "hold no variable in common" if len(files) > 1 else "holds no variable"
        raise InputError.one(f"nothing can be plotted: {lack} that has a plot", files[0].path)
    sections = []
    with progress(sum(len(section.names) for section in open_sections)) as bar:
        for section in open_sections:
            packed_charts: list[Any] = []
            for name in section.names:
                packed_charts += [packed.chart(chart, start) for chart in charts.charts_of(name)]
                bar.update(1)
            if packed_charts:
                sections.append({"heading": section.heading, "shown": section.shown, "charts": packed_charts})
    joints = zip(files[0].joint_names, files[0].joint_types, strict=True)
    data = {
        "kind": "over time",
        "joints": [{"name": name, "type": joint_type} for name, joint_type in joints],
        "files": [
            _file_values(file, label, start, packed) for file, label in zip(files, labels, strict=True)
        ],
        "start": start,
        "span": [0.0, max(float(file.time[-1]) for file in files) - start],
        "sections": sections,
    }
    texts = [_page_texts(*page) for page in zip(files, labels, reports, fixes, strict=True)]
    titles = [result_title(file, label) for file, label in zip(files, labels, strict=True)]
    return render_page(library, " / ".join(titles), texts, data, packed)


def sections_of(variables: Collection[str]) -> Iterator[Section]:
    """Yield the sections for these variables, each with the variables that have their own plots.

    Standard deviations and bounds of the stiffness are drawn with their variable, flags as time intervals.
    """
    without_plot = {*FLAG_BITS, *STIFFNESS_BOUNDS, *map(deviation, variables)}
    plotted = dict.fromkeys(SIMULATED_NAMES.get(name, name) for name in variables if name not in without_plot)
    for section in SECTIONS:
        names = tuple(name for name in section.names if name in plotted)
        if names:
            yield section._replace(names=names)
    remaining = tuple(name for name in plotted if not any(name in section.names for section in SECTIONS))
    if remaining:
        yield Section("Further variables", remaining)


def _file_values(file: StoredResult, label: str, start: float, packed: Packed) -> dict[str, Any]:
    """Return the values of a file for the scripts."""

    def since_start(spans: Sequence[Sequence[float]]) -> list[list[float]]:
        return [[time - start for time in span] for span in spans]

    return {
        "label": label,
        "troubles": {kind: list(map(since_start, joints)) for kind, joints in troubles(file).items()},
        "unreliable": since_start(unreliable(file)),
        "arm": arm_motion(file, start, packed),
    }


def _page_texts(file: StoredResult, label: str, report: ReportText, fix: FixText | None) -> PageTexts:
    first, last = file.time[[0, -1]].tolist()
    extent_text = f"{counted(file.samples, 'sample')}, {first:.4g} to {last:.4g} s"
    return PageTexts(
        title=f"{result_title(file, label)}; {extent_text}",
        label=label,
        verdict=file.verdict.replace("_", " "),
        tone=tone_of(file.verdict),
        report=report,
        provenance=provenance_rows(file.provenance()),
        inputs=[input_text(stored_input) for stored_input in file.inputs()],
        fix=fix,
    )


def troubles(result: StoredResult) -> dict[str, list[list[list[float]]]]:
    """Return the time intervals (s) of each kind of trouble present, for each joint."""
    if "flags" not in result.variables:
        return {}
    flags = np.asarray(result.read("flags"), dtype=FLAG_TYPE)
    masks = {kind: has_flag(flags, bits) for kind, bits in TROUBLES.items()}
    return {
        kind: [marked_spans(result.time, joint_mask).tolist() for joint_mask in mask.T]
        for kind, mask in masks.items()
        if mask.any()
    }


def unreliable(result: StoredResult) -> list[list[float]]:
    """Return the intervals (s) at the ends of a recording where derivatives of its splines are unreliable.

    Raises:
        InputError: the report is damaged.
    """
    with reporting_damage(result.path, "report"):
        columns = [column for fit in result.report_json.get("fits", ()) for column in fit["columns"]]
        ends = [column["unreliable"] for column in columns if "unreliable" in column]
        start, end = (max((float(each[side]) for each in ends), default=0.0) for side in ("start", "end"))
    if not start and not end:
        return []
    first, last = result.whole_span()
    visible_span = float(result.time[0]), float(result.time[-1])
    spans = (first, first + start), (last - end, last)
    clipped_spans = [[max(ends[0], visible_span[0]), min(ends[1], visible_span[1])] for ends in spans]
    return [span for span in clipped_spans if span[0] < span[1]]


def arm_motion(result: StoredResult, start: float, packed: Packed) -> dict[str, Any] | None:
    """Return the robot and its motion, for the animation; None if positions are not stored.

    Args:
        result: result or simulation file.
        start: time origin of the page, s.
        packed: store of the arrays.

    Returns:
        `arm_values`, with the numbers of the arrays of its `motion`: `time`, (instants,), s after the start
        of the page, and the positions `q` at these instants, (instants, joints).
    """
    if "q" not in result.variables:
        return None
    sample_indices = evenly(result.samples, MOST_FRAMES)
    motion = {
        "time": packed.add(result.time[sample_indices] - start),
        "q": packed.add(np.asarray(result.read("q"), dtype=np.float64)[sample_indices]),
    }
    return {**arm_values(result.geometry(), result.gravity(), result.tool_names), "motion": motion}


def measured_page(
    texts: PageTexts, curves: Mapping[str, Sequence[MeasuredCurve]], computed: str = "computed"
) -> str:
    """Return the page of measured signals, as HTML.

    Args:
        texts: texts of the page; the label is its title.
        curves: curves by heading of their section; all share a time axis.
        computed: label of the curves compared with the measured ones.

    Raises:
        InputError: a library that pages need is not installed.
    """
    library, packed = plotting_library(), Packed()
    all_curves = [curve for section in curves.values() for curve in section]
    data = {
        "kind": "over time",
        "joints": [],
        "files": [{"label": texts.label, "troubles": {}, "unreliable": [], "arm": None}],
        "start": 0.0,
        "span": [
            min((float(curve.time[0]) for curve in all_curves), default=0.0),
            max((float(curve.time[-1]) for curve in all_curves), default=0.0),
        ],
        "sections": [
            {
                "heading": one_line(heading),
                "shown": number < OPEN_SECTIONS,
                "paired": True,
                "charts": [chart for curve in section for chart in _measured_charts(curve, computed, packed)],
            }
            for number, (heading, section) in enumerate(curves.items())
        ],
    }
    return render_page(library, texts.label, [texts], data, packed)


def _measured_charts(curve: MeasuredCurve, computed: str, packed: Packed) -> Iterator[dict[str, Any]]:
    """Yield a plot of both curves, and one of measured minus computed values."""
    overlay, difference = curve.charts(computed)
    name = one_line(curve.name)
    yield packed.chart(replace(overlay, title=name), 0.0)
    yield packed.chart(replace(difference, title=f"difference: {name}"), 0.0)
