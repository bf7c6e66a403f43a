"""`vsacli identify --plot`: measured and predicted torques, as figures or as a page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from vsacli.base.texts import one_line
from vsacli.base.version import __version__
from vsacli.results.charts.measured import MeasuredCurve, measured_sheet
from vsacli.results.pages import measured_page
from vsacli.results.pages.document import PageTexts, printable, source_text, tone_of

if TYPE_CHECKING:
    from vsacli.base.outputs import Outputs
    from vsacli.cli.figure_options import FigureTarget
    from vsacli.studies.identification import Identification

PREDICTED = "predicted"
"""Label of the torques that follow from the identified parameters."""


def draw_figures(found: Identification, robot: str, target: FigureTarget, outputs: Outputs) -> None:
    """Draw a figure for each recording."""
    curves = _curves(found)
    names = {record: f"{number}-{Path(record).stem}" for number, record in enumerate(curves, 1)}
    files = target.files(names.values(), Path(robot).stem, outputs)
    files.save(
        {
            names[record]: measured_sheet(
                of_it, f"identification of {found.robot}: fit to {Path(record).stem}, filtered", PREDICTED
            )
            for record, of_it in curves.items()
        }
    )


def identification_page(found: Identification, columns: str | None) -> str:
    """Return an HTML page with the report and all recordings.

    Args:
        found: identification to show.
        columns: path of the file with the column mapping, if any.

    Raises:
        InputError: a library that pages need is not installed.
    """
    report = printable(found.as_text())
    provenance = [
        ("vsacli version", __version__),
        *([] if columns is None else [("columns", one_line(columns))]),
    ]
    facts = PageTexts(
        title=one_line(found.title),
        label=found.robot,
        verdict=found.verdict.replace("_", " "),
        tone=tone_of(found.verdict),
        report=report,
        provenance=provenance,
        inputs=[source_text(source) for source in found.sources],
    )
    return measured_page(facts, _curves(found), PREDICTED)


def _curves(found: Identification) -> dict[str, list[MeasuredCurve]]:
    """Return the torques of each recording, by its path."""
    curves: dict[str, list[MeasuredCurve]] = {}
    for each in found.torques:
        curve = MeasuredCurve(each.group, each.unit, each.residual, each.time, each.predicted, each.measured)
        curves.setdefault(each.record, []).append(curve)
    return curves
