"""Figures of stored files, drawn one by one, and figures as files: reproducible to the byte, all or none."""

from __future__ import annotations

import gc
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
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
from vsacli.results.plots.sheets import drawn
from vsacli.results.plots.styles import house_style
from vsacli.results.store.reader import StoredResult

Figures: TypeAlias = dict[str, Figure]
"""Figures by name, such as "motion"."""

LARGE = 150.0
"""Square inches from which on a figure is cleared away before the next is drawn; 20 joints have fewer. It is
full of circles, and the collector, which counts objects, does not see that its picture has 100 MB."""

FORMATS = ("png", "pdf", "svg")

MOST_PIXELS = 24e6
"""Largest picture, pixels: some 60 joints at the usual resolution, held twice by Matplotlib (4 B each)."""

# Without dates, so that equal results give equal files.
_METADATA: dict[str, dict[str, str | None]] = {
    "png": {},
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
}


def draw_stored(stored: StoredResult, variables: Sequence[str] | None = None) -> Iterator[tuple[str, Figure]]:
    """Draw the figures of `plot_stored`, each when it is asked for: those of many joints are large."""
    for name, sheet in sheets_of(stored, variables):
        figure = drawn(sheet)
        large = np.prod(sheet.size) > LARGE
        yield name, figure
        del figure, sheet  # before the next one is drawn
        if large:
            gc.collect()


def plot_stored(stored: StoredResult, variables: Sequence[str] | None = None) -> Figures:
    """Draw the figures of a result or a simulation by name, all that its variables allow.

    Args:
        stored: the open file, or an excerpt.
        variables: names of those to draw instead, each in a figure that is called after it.

    Raises:
        InputError: the file has nothing to draw, or there is no curve of one of the variables.
    """
    return dict(draw_stored(stored, variables))


def compare_files(files: Sequence[StoredResult], variables: Sequence[str] | None = None) -> Figures:
    """Draw results, or simulations, of the same joints over each other; see `comparison_sheets`."""
    return {name: drawn(sheet) for name, sheet in comparison_sheets(files, variables)}


class FigureFiles:
    """The files of figures, staged before the first is drawn.

    Args:
        names: of the figures.
        folder: of the files; it is made if it does not exist.
        stem: beginning of their names.
        file_format: one of `FORMATS`.
        outputs: the files of the command.

    Raises:
        StorageError: as `Outputs.folder` and `Outputs.file`.
    """

    def __init__(
        self, names: Iterable[str], folder: str | Path, stem: str, file_format: str, outputs: Outputs
    ) -> None:
        outputs.folder(folder)
        self._format = file_format
        self._files = {name: outputs.file(Path(folder) / f"{stem}-{name}.{file_format}") for name in names}

    def save(self, figures: Mapping[str, Figure | Sheet]) -> None:
        """Save figures by name; sheets are drawn.

        Raises:
            StorageError: the disk is full or fails.
        """
        for name, figure in figures.items():
            shown = drawn(figure) if isinstance(figure, Sheet) else figure
            self._files[name].write_bytes(_rendered(shown, self._format))


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
        The paths, in the order of the figures.

    Raises:
        StorageError: a file exists and `overwrite` is false, or the folder cannot be written.
    """
    with Outputs(overwrite=overwrite) as outputs:
        FigureFiles(figures, folder, stem, file_format, outputs).save(figures)
    return outputs.paths


def _rendered(figure: Figure, file_format: str) -> bytes:
    buffer = BytesIO()
    with house_style():
        resolution = _resolution(figure)
        figure.savefig(buffer, format=file_format, dpi=resolution, metadata=_METADATA[file_format])
    return buffer.getvalue()


def _resolution(figure: Figure) -> float:
    """Return dots an inch: as usual, but fewer for a figure that would have too many pixels."""
    width, height = figure.get_size_inches()
    return min(float(rcParams["savefig.dpi"]), math.sqrt(MOST_PIXELS / (width * height)))
