"""The page of what was measured: each signal over what was computed, and by how much they differ."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from vsacli.base.arrays import FloatArray
from vsacli.base.texts import one_line
from vsacli.results.curves import Curve
from vsacli.results.measured_curves import MeasuredCurve
from vsacli.results.pages.charts import Chart, Series
from vsacli.results.pages.document import Facts, rendered
from vsacli.results.pages.library import plotting_library
from vsacli.results.pages.packing import Packed

OPEN = 4
"""Sections that are open from the start, as many as those of a result."""


def measured_page(
    facts: Facts, curves: Mapping[str, Sequence[MeasuredCurve]], computed: str = "computed"
) -> str:
    """The page of measured signals, as HTML.

    Args:
        facts: what is said of them; the page is called as its label says.
        curves: by the headings of their sections; all share an axis of time.
        computed: what the curves beside the measured ones are called.

    Raises:
        InputError: what a page needs is not installed.
    """
    library, packed = plotting_library(), Packed()
    every = [curve for section in curves.values() for curve in section]
    data = {
        "kind": "over time",
        "joints": [],
        "files": [{"label": facts.label, "troubles": {}, "doubtful": [], "chain": None}],
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
                "charts": [chart for curve in section for chart in _charts(curve, computed, packed)],
            }
            for number, (heading, section) in enumerate(curves.items())
        ],
    }
    return rendered(library, facts.label, [facts], data, packed)


def _charts(curve: MeasuredCurve, computed: str, packed: Packed) -> Iterator[Chart]:
    """A plot of both curves, and one of measured minus computed."""

    def series(label: str, colour: int, role: str, values: FloatArray, rms: float | None = None) -> Series:
        seen = Curve.reduced(curve.time, values)
        arrays = packed.add(seen.time), packed.add(seen.values)
        return Series(label, colour, None, 0, role, *arrays, rms=rms)

    over = series(computed, 0, "computed", curve.computed), series("measured", 1, "measured", curve.measured)
    yield Chart(one_line(curve.name), "", curve.unit, over)
    apart = series(f"measured minus {computed}", 2, "computed", curve.measured - curve.computed, curve.rms)
    yield Chart(f"difference: {one_line(curve.name)}", "", curve.unit, (apart,))
