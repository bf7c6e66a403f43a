"""Pages of measured signals."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vsacli.base.tables import ReportText
from vsacli.results.charts.measured import MeasuredCurve
from vsacli.results.pages import measured_page
from vsacli.results.pages.document import InputText, PageTexts

WICKED = "<img src=x onerror=alert(1)><script>alert(2)</script></script><b>$$x$$\"'"


def without_words() -> PageTexts:
    """Nothing to say."""
    return PageTexts("title", "label", "", "", ReportText(""), [], [])


def wicked_page(file: Path) -> Path:
    """A page whose texts would act if they were no texts."""
    time = np.linspace(0, 2, 101)
    curves = [MeasuredCurve(WICKED, "N m", 0.1, time, np.sin(time), np.sin(time) + 0.1)]
    report = ReportText(WICKED, [WICKED], [[("a", WICKED), (WICKED, "b")], [(WICKED,), (WICKED,)]], [WICKED])
    inputs = [InputText(WICKED, "0" * 64, WICKED, WICKED), InputText(WICKED, "0" * 64, None, WICKED)]
    facts = PageTexts(WICKED, WICKED, WICKED, "bad", report, [(WICKED, WICKED)], inputs)
    file.write_text(measured_page(facts, {WICKED: curves}, WICKED), encoding="utf-8")
    return file
