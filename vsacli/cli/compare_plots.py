"""Figures and page of a comparison, for `vsacli compare`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vsacli.base.outputs import Outputs
from vsacli.base.texts import one_line
from vsacli.base.version import __version__
from vsacli.cli.figure_options import FigureTarget
from vsacli.results.charts.measured import MeasuredCurve, measured_sheet
from vsacli.results.pages import measured_page
from vsacli.results.pages.document import InputText, PageTexts, printable, source_text
from vsacli.studies.measured import Comparison

LARGEST_DRAWN = 1e30
"""Magnitude to which drawn values are limited: beyond it, axes have no ticks, and single precision
overflows."""


def draw_comparison(comparison: Comparison, stem: str, target: FigureTarget, outputs: Outputs) -> None:
    """Draw a figure for each measured variable."""
    curves = _measured_curves(comparison)
    files = target.files(curves, stem, outputs)
    recording, result = (Path(path).stem for path in (comparison.recording, comparison.result))
    title = f"comparison of recording {recording} with {result}"
    files.save(
        {
            variable: measured_sheet(variable_curves, f"{title}: {variable}")
            for variable, variable_curves in curves.items()
        }
    )


def comparison_page(comparison: Comparison, inputs: Sequence[InputText]) -> str:
    """Return an HTML page with the report and all variables."""
    report = printable(comparison.as_text())
    texts = PageTexts(
        title=report.headline,
        label=one_line(f"{comparison.result}, {comparison.recording}"),
        verdict="",
        tone="",
        report=report,
        provenance=[("vsacli version", __version__), ("result", one_line(comparison.result))],
        inputs=[*inputs, *map(source_text, comparison.sources)],
    )
    return measured_page(texts, _measured_curves(comparison))


def _measured_curves(comparison: Comparison) -> dict[str, list[MeasuredCurve]]:
    """Return the compared signals, by variable."""
    curves: dict[str, list[MeasuredCurve]] = {}
    for signal in comparison.signals:
        if signal.samples:
            measured = np.clip(signal.measured, -LARGEST_DRAWN, LARGEST_DRAWN)
            curve = MeasuredCurve(
                signal.column, signal.unit, signal.rms, signal.time, signal.computed, measured
            )
            curves.setdefault(signal.variable, []).append(curve)
    return curves
