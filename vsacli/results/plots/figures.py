"""Figures of stored files, drawn one by one, and saved reproducibly to the byte, all or none."""

from __future__ import annotations

import gc
import math
from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import TypeAlias

import numpy as np
from matplotlib import rcParams
from matplotlib.figure import Figure

from vsacli.base.outputs import Outputs
from vsacli.results.charts.chart import Sheet
from vsacli.results.charts.comparison import comparison_sheets
from vsacli.results.charts.figures import sheets_of
from vsacli.results.charts.look import current_look
from vsacli.results.plots.arm_figure import tool_path_figure
from vsacli.results.plots.sheets import draw_sheet
from vsacli.results.plots.styles import house_style
from vsacli.results.store.reader import StoredResult

Figures: TypeAlias = dict[str, Figure]
"""Figures by name, such as "motion"."""

LARGE = 150.0
"""Area (square inches) from which memory is collected before the next figure is drawn; 20 joints have less.
Its reference cycles delay its release, and the collector, which counts objects, does not notice the 100 MB of
its image."""

FORMATS = ("png", "pdf", "svg")

MOST_PIXELS = 24e6
"""Largest image, pixels: some 60 joints at the usual resolution; Matplotlib holds two copies of 4 B per
pixel."""

# Without dates, so that equal results give equal files.
_METADATA: dict[str, dict[str, str | None]] = {
    "png": {},
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
}


def draw_stored(stored: StoredResult, variables: Sequence[str] | None = None) -> Iterator[tuple[str, Figure]]:
    """Draw the figures of `plot_stored` lazily, since those of many joints are large."""
    for name, sheet in sheets_of(stored, variables):
        figure = draw_sheet(sheet) if isinstance(sheet, Sheet) else tool_path_figure(sheet)
        large = np.prod(figure.get_size_inches()) > LARGE
        yield name, figure
        del figure, sheet  # frees memory before the next one is drawn
        if large:
            gc.collect()


def plot_stored(stored: StoredResult, variables: Sequence[str] | None = None) -> Figures:
    """Draw all figures of a result or a simulation that its variables allow, by name.

    Args:
        stored: open file, or an excerpt.
        variables: names of variables to draw instead, each in a figure of its name.

    Raises:
        InputError: the file has nothing to draw, or a variable has no curve.
    """
    return dict(draw_stored(stored, variables))


def compare_files(files: Sequence[StoredResult], variables: Sequence[str] | None = None) -> Figures:
    """Draw results, or simulations, of the same joints on the same axes; see `comparison_sheets`."""
    return {name: draw_sheet(sheet) for name, sheet in comparison_sheets(files, variables)}


class FigureFiles:
    """The files of figures, staged before the first figure is drawn.

    Args:
        paths: paths by name of the figure, whose endings are the formats; folders are created.
        outputs: output files of the command.

    Raises:
        StorageError: as `Outputs.folder` and `Outputs.file`.
    """

    def __init__(self, paths: Mapping[str, Path], outputs: Outputs) -> None:
        for folder in dict.fromkeys(path.parent for path in paths.values()):
            outputs.folder(folder)
        self._files = {name: outputs.file(path) for name, path in paths.items()}

    def save(self, figures: Mapping[str, Figure | Sheet]) -> None:
        """Save figures by name; draw sheets first.

        Raises:
            StorageError: the disk is full or fails.
        """
        for name, figure in figures.items():
            drawn_figure = draw_sheet(figure) if isinstance(figure, Sheet) else figure
            file = self._files[name]
            file.write_bytes(rendered_figure(drawn_figure, file.path.suffix.removeprefix(".")))


def save_figures(
    figures: Mapping[str, Figure],
    folder: str | Path,
    stem: str,
    file_format: str = "png",
    *,
    overwrite: bool = False,
) -> tuple[Path, ...]:
    """Save figures by name into a folder, all of them or none; see `FigureFiles`.

    Returns:
        Paths in the order of the figures.

    Raises:
        StorageError: a file exists and `overwrite` is false, or the folder cannot be written to.
    """
    with Outputs(overwrite=overwrite) as outputs:
        paths = {name: Path(folder) / f"{stem}-{name}.{file_format}" for name in figures}
        FigureFiles(paths, outputs).save(figures)
    return outputs.paths


def rendered_figure(figure: Figure, file_format: str) -> bytes:
    """Return a figure as the content of a file of one of `FORMATS`."""
    buffer = BytesIO()
    with house_style():
        resolution = _resolution(figure)
        figure.savefig(buffer, format=file_format, dpi=resolution, metadata=_METADATA[file_format])
    return buffer.getvalue()


def _resolution(figure: Figure) -> float:
    """Return the resolution, dpi: that of the look or the usual one; less if there are too many pixels."""
    width, height = figure.get_size_inches()
    resolution = current_look().dpi or float(rcParams["savefig.dpi"])
    return min(resolution, math.sqrt(MOST_PIXELS / (width * height)))
