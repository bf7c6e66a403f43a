"""Labels of points, none on top of another."""

from __future__ import annotations

import math
from itertools import combinations

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from vsacli.results.plots.point_labels import SIDES_BELOW_LINE, label_points
from vsacli.results.plots.styles import house_style


def labeled(places: list[tuple[float, float]], labels: list[str], **options: object) -> list[str]:
    """Texts of the labels that were written, none of which overlaps another or leaves the panel."""
    with house_style():
        figure = Figure((3.0, 2.4), layout="constrained")
        axes = figure.add_subplot()
        axes.plot(
            *zip(*[*places, (0.0, 0.0), (1.0, 1.0)], strict=True), linestyle="", marker="o", markersize=3
        )
        axes.margins(0.08)
        label_points(axes, places, labels, **options)  # type: ignore[arg-type]
        renderer = FigureCanvasAgg(figure).get_renderer()
        figure.draw(renderer)
        boxes = [Text.get_window_extent(text, renderer) for text in axes.texts]  # without lines to points
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    for box in boxes:
        assert axes.bbox.x0 <= box.x0 < box.x1 <= axes.bbox.x1
        assert axes.bbox.y0 <= box.y0 < box.y1 <= axes.bbox.y1
    return [text.get_text() for text in axes.texts]


def test_labels_of_neighbors_are_apart() -> None:
    assert set(labeled([(0.5, 0.5), (0.52, 0.52), (0.5, 0.56)], ["10", "11", "12"])) >= {"10", "11"}


def test_points_at_one_place_share_a_label() -> None:
    assert labeled([(1.0, 0.5), (1.0, 0.501), (0.2, 0.2)], ["29", "32", "35"]) == ["29, 32", "35"]


@pytest.mark.parametrize("place", [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)])
def test_labels_stay_inside_at_corners(place: tuple[float, float]) -> None:
    assert labeled([place], ["123"]) == ["123"]


def test_the_most_important_labels_remain_where_there_is_no_space() -> None:
    crowd = [(0.5 + 0.03 * x, 0.5 + 0.03 * y) for x in range(4) for y in range(4)]
    written = labeled(crowd, [f"run {number}" for number in range(16)])
    assert "run 0" in written
    assert len(written) < 16


def test_labels_below_a_line_are_right_of_its_points() -> None:
    assert labeled([(0.2, 0.3), (0.6, 0.5)], ["run 1", "run 2"], sides=SIDES_BELOW_LINE) == ["run 1", "run 2"]


def test_labels_cover_no_other_points() -> None:
    """Not those that have no label; where they are on all sides, a line leads to a label farther away."""
    with house_style():
        figure = Figure((3.0, 2.4), layout="constrained")
        axes = figure.add_subplot()
        ring = [(0.5 + 0.1 * math.cos(angle), 0.5 + 0.12 * math.sin(angle)) for angle in range(7)]
        axes.plot(*zip((0.0, 0.0), (1.0, 1.0), (0.5, 0.5), *ring, strict=True), linestyle="", marker="o")
        label_points(axes, [(0.5, 0.5)], ["run 12"])
        renderer = FigureCanvasAgg(figure).get_renderer()
        figure.draw(renderer)
        [text] = axes.texts
        assert text.get_text() == "run 12"
        assert text.arrow_patch is not None
        box = Text.get_window_extent(text, renderer)  # without the line
        assert not any(box.contains(*axes.transData.transform(place)) for place in [(0.5, 0.5), *ring])
