"""The page of one result or simulation, or of several on the same axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from vsacli.base.progress import Bar, Progress, unseen
from vsacli.base.tables import ReportText
from vsacli.results.pages.chain_motion import chain_motion
from vsacli.results.pages.document import Facts, RemedyText, rendered
from vsacli.results.pages.facts import input_text, provenance_rows, tone_of
from vsacli.results.pages.library import plotting_library
from vsacli.results.pages.packing import Packed
from vsacli.results.pages.result_charts import ResultCharts
from vsacli.results.pages.sections import Section
from vsacli.results.pages.stretches import doubtful, troubles
from vsacli.results.several import check_comparable, distinct_labels
from vsacli.results.store.reader import StoredResult


def result_page(
    files: Sequence[StoredResult],
    reports: Sequence[ReportText],
    remedies: Sequence[RemedyText | None],
    progress: Progress = unseen,
) -> str:
    """The page of results, or of simulations, as HTML.

    Args:
        files: open; the differences are those to the first.
        reports: what each file says of itself.
        remedies: what would mend each, where something would be worth saying.
        progress: called with the number of variables that are drawn.

    Raises:
        InputError: the files do not belong on the same axes, hold nothing to draw, or are damaged; or what a
            page needs is not installed.
    """
    library = plotting_library()
    check_comparable(files)
    packed, labels = Packed(), distinct_labels(files)
    charts = ResultCharts(files, packed)
    with progress(sum(len(section.names) for section in charts.sections)) as bar:
        sections = [_drawn(section, charts, bar) for section in charts.sections]
    named = list(zip(files, labels, strict=True))
    data = {
        "kind": "over time",
        "joints": [
            {"name": name, "type": kind}
            for name, kind in zip(files[0].joint_names, files[0].joint_types, strict=True)
        ],
        "files": [_file(file, label, charts.start, packed) for file, label in named],
        "start": charts.start,
        "span": [0.0, max(float(file.time[-1]) for file in files) - charts.start],
        "sections": sections,
    }
    facts = [
        _facts(file, label, report)._replace(remedy=remedy)
        for (file, label), report, remedy in zip(named, reports, remedies, strict=True)
    ]
    return rendered(library, _title(files), facts, data, packed)


def _drawn(section: Section, charts: ResultCharts, bar: Bar) -> dict[str, Any]:
    """A section with its plots."""
    drawn = []
    for name in section.names:
        drawn += charts.of(name)
        bar.update(1)
    return {"heading": section.heading, "shown": section.shown, "charts": drawn}


def _title(files: Sequence[StoredResult]) -> str:
    names = [name for file in files for name in (file.robot_name, file.trajectory_name)]
    return ", ".join(dict.fromkeys(names))


def _file(file: StoredResult, label: str, start: float, packed: Packed) -> dict[str, Any]:
    """What scripts have to know of a file."""
    return {
        "label": label,
        "troubles": {
            kind: [_after(start, spans) for spans in joints] for kind, joints in troubles(file).items()
        },
        "doubtful": _after(start, doubtful(file)),
        "chain": chain_motion(file, start, packed),
    }


def _after(start: float, spans: Sequence[Sequence[float]]) -> list[list[float]]:
    return [[time - start for time in span] for span in spans]


def _facts(file: StoredResult, label: str, report: ReportText) -> Facts:
    ended = "" if file.complete else ", ended early"
    first, last = file.time[[0, -1]].tolist()
    steps = "1 step" if file.samples == 1 else f"{file.samples} steps"
    title = f"{file.robot_name}, {label}: {steps}, {first:g} to {last:g} s{ended}"
    inputs = [input_text(each) for each in file.inputs()]
    provenance = provenance_rows(file.provenance())
    return Facts(
        title, label, file.verdict.replace("_", " "), tone_of(file.verdict), report, provenance, inputs
    )
