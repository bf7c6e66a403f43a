"""Pages of curves over time: of results or simulations on the same axes, and of measured signals.

Variables stand in sections. Samples that cannot be executed, and the ends of recordings, are shaded in all
plots, and the robot moves as a chain.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vsacli.base.arrays import evenly
from vsacli.base.errors import InputError
from vsacli.base.flags import LIMITS, Flag, has
from vsacli.base.progress import Progress, unseen
from vsacli.base.simulation_variables import ERRORS, SIMULATED_NAMES, error
from vsacli.base.tables import ReportText
from vsacli.base.texts import one_line
from vsacli.base.variables import deviation
from vsacli.results.charts.comparison import check_comparable, distinct_labels
from vsacli.results.charts.measured import MeasuredCurve
from vsacli.results.charts.reduction import marked_spans
from vsacli.results.charts.stored import BOUNDS, StoredCharts
from vsacli.results.pages.document import (
    PageTexts,
    RemedyText,
    input_text,
    plotting_library,
    provenance_rows,
    rendered,
    tone_of,
)
from vsacli.results.pages.packing import Packed
from vsacli.results.store.damage import reporting_damage
from vsacli.results.store.reader import StoredResult
from vsacli.robot.kinematics import frames_in_base

MOST_FRAMES = 1000
"""Instants of the robot that a page holds; a screen shows 60 a second, and between them it interpolates."""

OPEN = 4
"""Sections of measured signals that are open from the start, as many as those of a result."""

TROUBLES = {
    "infeasible": Flag.INFEASIBLE,
    "singular": Flag.SINGULAR,
    "near-singular": Flag.NEAR_SINGULAR,
    "over a limit": LIMITS,
}
"""Findings about a sample by the bits of its flags."""


class Section(NamedTuple):
    """Variables below one heading.

    Attributes:
        heading: of the section.
        names: of the variables; of simulations the simulated ones.
        shown: whether their plots are there from the start, as those of `plot` are.
    """

    heading: str
    names: tuple[str, ...]
    shown: bool = False


SECTIONS = (
    Section("Tracking errors", tuple(map(error, ERRORS)), shown=True),
    Section("Position and stiffness", ("q", "stiffness"), shown=True),
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
"""Sections of a page; other variables follow at its end."""


def result_page(
    files: Sequence[StoredResult],
    reports: Sequence[ReportText],
    remedies: Sequence[RemedyText | None],
    progress: Progress = unseen,
) -> str:
    """Return the page of results, or of simulations, as HTML.

    Args:
        files: open; the differences are those to the first.
        reports: of each file.
        remedies: the fix of each, where something would be worth saying.
        progress: called with the number of variables that are drawn.

    Raises:
        InputError: the files do not belong on the same axes, hold nothing to draw, or are damaged; or what a
            page needs is not installed.
    """
    library = plotting_library()
    check_comparable(files)
    packed, labels, charts = Packed(), distinct_labels(files), StoredCharts(files)
    start = min(float(file.time[0]) for file in files)
    wanted = list(sections_of(charts.common))
    if not wanted:
        what = "hold no variable in common" if len(files) > 1 else "holds no variable"
        raise InputError.one(f"nothing can be plotted: {what} that has a plot", files[0].path)
    sections = []
    with progress(sum(len(section.names) for section in wanted)) as bar:
        for section in wanted:
            drawn: list[Any] = []
            for name in section.names:
                drawn += [packed.chart(chart, start) for chart in charts.charts_of(name)]
                bar.update(1)
            sections.append({"heading": section.heading, "shown": section.shown, "charts": drawn})
    joints = zip(files[0].joint_names, files[0].joint_types, strict=True)
    data = {
        "kind": "over time",
        "joints": [{"name": name, "type": joint_type} for name, joint_type in joints],
        "files": [_file(file, label, start, packed) for file, label in zip(files, labels, strict=True)],
        "start": start,
        "span": [0.0, max(float(file.time[-1]) for file in files) - start],
        "sections": sections,
    }
    texts = [_texts(*each) for each in zip(files, labels, reports, remedies, strict=True)]
    names = [name for file in files for name in (file.robot_name, file.trajectory_name)]
    return rendered(library, ", ".join(dict.fromkeys(names)), texts, data, packed)


def sections_of(variables: Collection[str]) -> Iterator[Section]:
    """Yield the sections of a file with these variables, each with those that have plots of their own.

    Standard deviations and the bounds of stiffness are drawn with their variable, flags as stretches.
    """
    with_others = {"flags", *BOUNDS, *map(deviation, variables)}
    own = dict.fromkeys(SIMULATED_NAMES.get(name, name) for name in variables if name not in with_others)
    for section in SECTIONS:
        names = tuple(name for name in section.names if name in own)
        if names:
            yield section._replace(names=names)
    rest = tuple(name for name in own if not any(name in section.names for section in SECTIONS))
    if rest:
        yield Section("Further variables", rest)


def _file(file: StoredResult, label: str, start: float, packed: Packed) -> dict[str, Any]:
    """Return the values of a file that scripts need."""

    def after(spans: Sequence[Sequence[float]]) -> list[list[float]]:
        return [[time - start for time in span] for span in spans]

    return {
        "label": label,
        "troubles": {kind: list(map(after, joints)) for kind, joints in troubles(file).items()},
        "doubtful": after(doubtful(file)),
        "chain": chain_motion(file, start, packed),
    }


def _texts(file: StoredResult, label: str, report: ReportText, remedy: RemedyText | None) -> PageTexts:
    ended = "" if file.complete else ", ended early"
    first, last = file.time[[0, -1]].tolist()
    steps = "1 step" if file.samples == 1 else f"{file.samples} steps"
    return PageTexts(
        title=f"{file.robot_name}, {label}: {steps}, {first:g} to {last:g} s{ended}",
        label=label,
        verdict=file.verdict.replace("_", " "),
        tone=tone_of(file.verdict),
        report=report,
        provenance=provenance_rows(file.provenance()),
        inputs=[input_text(each) for each in file.inputs()],
        remedy=remedy,
    )


def troubles(result: StoredResult) -> dict[str, list[list[list[float]]]]:
    """Return the stretches of each kind of trouble, for each joint, s; only kinds that there are."""
    if "flags" not in result.variables:
        return {}
    flags = np.asarray(result.read("flags"), dtype=np.uint32)
    marked = {kind: has(flags, bits) for kind, bits in TROUBLES.items()}
    return {
        kind: [marked_spans(result.time, of_joint).tolist() for of_joint in where.T]
        for kind, where in marked.items()
        if where.any()
    }


def doubtful(result: StoredResult) -> list[list[float]]:
    """Return the stretches at both ends of a recording, s, where derivatives of its splines are unreliable.

    Raises:
        InputError: the report is damaged.
    """
    with reporting_damage(result.path, "report"):
        columns = [column for fit in result.report_json.get("fits", ()) for column in fit["columns"]]
        ends = [column["doubtful"] for column in columns if "doubtful" in column]
        start, end = (max((float(each[side]) for each in ends), default=0.0) for side in ("start", "end"))
    if not start and not end:
        return []
    first, last = result.whole_span()
    shown = float(result.time[0]), float(result.time[-1])
    spans = (first, first + start), (last - end, last)
    clipped = [[max(ends[0], shown[0]), min(ends[1], shown[1])] for ends in spans]
    return [span for span in clipped if span[0] < span[1]]


def chain_motion(result: StoredResult, start: float, packed: Packed) -> dict[str, int] | None:
    """Return how the chain of a file moves, as far as its positions are known; None if they are not.

    Args:
        result: the file.
        start: time from which the page counts, s.
        packed: holds the arrays.

    Returns:
        Numbers of arrays in the base frame, m:
        `time`, (instants,), s after the start of the page;
        `origins` of DH frames 0 to N and of the end effector, (instants, joints + 2, 3);
        `elbows`, where the common normal of two axes meets the first, (instants, joints, 3): from the frame
        before, along its z axis, to there reaches the offset d, and from there to the next frame a;
        `axes`, unit vectors along the axes of the joints, (instants, joints, 3).
    """
    if "q" not in result.variables:
        return None
    steps = evenly(result.samples, MOST_FRAMES)
    geometry = result.geometry()
    positions = np.asarray(result.read("q"), dtype=np.float64)[steps]
    with np.errstate(over="ignore", invalid="ignore"):  # of a simulation that diverged
        frames = list(frames_in_base(geometry, positions))
    origins = np.stack([frame.origin for frame in frames], axis=1)
    lengths = np.array([joint.dh.a for joint in geometry.joints])
    normals = np.stack([frame.axes[..., 0] for frame in frames[1:-1]], axis=1)
    axes = np.stack([frame.axes[..., 2] for frame in frames[:-2]], axis=1)
    return {
        "time": packed.add(result.time[steps] - start),
        "origins": packed.add(origins),
        "elbows": packed.add(origins[:, 1:-1] - lengths[:, None] * normals),
        "axes": packed.add(axes),
    }


def measured_page(
    texts: PageTexts, curves: Mapping[str, Sequence[MeasuredCurve]], computed: str = "computed"
) -> str:
    """Return the page of measured signals, as HTML.

    Args:
        texts: texts on them; the label is the title of the page.
        curves: by the headings of their sections; all share an axis of time.
        computed: name of the curves compared with the measured ones.

    Raises:
        InputError: a library that pages need is not installed.
    """
    library, packed = plotting_library(), Packed()
    every = [curve for section in curves.values() for curve in section]
    data = {
        "kind": "over time",
        "joints": [],
        "files": [{"label": texts.label, "troubles": {}, "doubtful": [], "chain": None}],
        "start": 0.0,
        "span": [
            min((float(curve.time[0]) for curve in every), default=0.0),
            max((float(curve.time[-1]) for curve in every), default=0.0),
        ],
        "sections": [
            {
                "heading": one_line(heading),
                "shown": number < OPEN,
                "paired": True,
                "charts": [chart for curve in section for chart in _measured(curve, computed, packed)],
            }
            for number, (heading, section) in enumerate(curves.items())
        ],
    }
    return rendered(library, texts.label, [texts], data, packed)


def _measured(curve: MeasuredCurve, computed: str, packed: Packed) -> Iterator[dict[str, Any]]:
    """Yield a plot of both curves, and one of measured minus computed."""
    over, apart = curve.charts(computed)
    name = one_line(curve.name)
    yield packed.chart(replace(over, title=name), 0.0)
    yield packed.chart(replace(apart, title=f"difference: {name}"), 0.0)
