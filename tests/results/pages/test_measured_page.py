"""Pages of what was measured: report, both curves and their difference, and nothing that acts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from samples.measured_pages import WICKED, wicked_page, without_words
from samples.pages import Page

from vsacli.results.charts.measured import MeasuredCurve
from vsacli.results.pages import measured_page

SINGLE = 2**-23
"""Spacing of single precision."""


def page_of(folder: Path, curves: dict[str, list[MeasuredCurve]]) -> Page:
    (folder / "page.html").write_text(measured_page(without_words(), curves), encoding="utf-8")
    return Page(folder / "page.html")


def test_every_signal_has_both_curves_and_their_difference(tmp_path: Path) -> None:
    time = np.linspace(1, 3, 50)
    early = MeasuredCurve("motor 1", "N m", 0.5, time, np.sin(time), np.cos(time))
    late = MeasuredCurve("motor 2", "N", 0.25, time + 1, time, 2 * time)
    page = page_of(tmp_path, {"first.csv": [early, late], "second.csv": [early]})
    assert page.data["span"] == [1, 4]
    assert [section["heading"] for section in page.data["sections"]] == ["first.csv", "second.csv"]
    assert [len(section["charts"]) for section in page.data["sections"]] == [4, 2]
    for curve, over, apart in zip((early, late, early), page.charts[::2], page.charts[1::2], strict=True):
        assert [over["title"], apart["title"]] == [curve.name, f"difference: {curve.name}"]
        assert over["unit"] == apart["unit"] == curve.unit
        series = [*over["series"], *apart["series"]]
        assert [each["label"] for each in series] == ["computed", "measured", "measured minus computed"]
        assert [each["rms"] for each in series] == [None, None, curve.rms]
        wanted = curve.computed, curve.measured, curve.measured - curve.computed
        for each, values in zip(series, wanted, strict=True):
            np.testing.assert_allclose(page.array(each["time"]), curve.time, rtol=SINGLE)
            np.testing.assert_allclose(page.array(each["values"]), values, rtol=SINGLE)


def test_long_records_are_reduced_and_no_peak_is_lost(tmp_path: Path) -> None:
    time = np.arange(1_000_000) / 1000
    measured = np.sin(time)
    measured[123_456] = 7.0
    curve = MeasuredCurve("motor 1", "N m", 0.007, time, np.sin(time), measured)
    page = page_of(tmp_path, {"long.csv": [curve]})
    for series in (each for chart in page.charts for each in chart["series"]):
        assert page.array(series["values"]).size <= 4 * 1200  # first, last, smallest, largest of intervals
    over, apart = page.charts
    assert page.array(over["series"][1]["values"]).max() == 7.0
    assert page.array(apart["series"][0]["values"]).max() == pytest.approx(7 - np.sin(123.456), rel=SINGLE)


def test_a_page_without_curves_has_its_report(tmp_path: Path) -> None:
    assert page_of(tmp_path, {}).data["sections"] == []


def test_texts_are_texts(tmp_path: Path) -> None:
    page = Page(wicked_page(tmp_path / "wicked.html"))
    tame = page_of(tmp_path, {})
    assert page.scripts == tame.scripts
    assert not {"img", "b"} & {tag for tag, _ in page.tags}
    assert page.text.count(WICKED) >= 4  # title, verdict, tables, lines
    assert [section["heading"] for section in page.data["sections"]] == [WICKED]
    assert page.charts[0]["title"] == WICKED
