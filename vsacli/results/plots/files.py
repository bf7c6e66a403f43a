"""Figures as files: reproducible to the byte, and complete or absent."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from io import BytesIO
from pathlib import Path

from matplotlib import rcParams
from matplotlib.figure import Figure

from vsacli.base.outputs import Outputs
from vsacli.results.plots.styles import house_style

FORMATS = ("png", "pdf", "svg")

MOST_PIXELS = 24e6
"""Of a picture: some 60 joints at the usual resolution. Matplotlib holds it twice, with 4 bytes each."""

# Without dates, so that equal results give equal files.
_METADATA: dict[str, dict[str, str | None]] = {
    "png": {},
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
}


class FigureFiles:
    """Where figures are saved: staged before the first is drawn.

    Args:
        names: of the figures.
        folder: of the files; it is made if it does not exist.
        stem: what their names begin with.
        file_format: one of `FORMATS`.
        outputs: what they belong to.

    Raises:
        StorageError: as `Outputs.folder` and `Outputs.file`.
    """

    def __init__(
        self, names: Iterable[str], folder: str | Path, stem: str, file_format: str, outputs: Outputs
    ) -> None:
        outputs.folder(folder)
        self._format = file_format
        self._files = {name: outputs.file(Path(folder) / f"{stem}-{name}.{file_format}") for name in names}

    def save(self, figures: Mapping[str, Figure]) -> None:
        """Save figures by name.

        Raises:
            StorageError: the disk is full or fails.
        """
        for name, figure in figures.items():
            self._files[name].write_bytes(_rendered(figure, self._format))


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
    """Dots an inch: as usual, but fewer of a figure that would have too many pixels."""
    width, height = figure.get_size_inches()
    return min(float(rcParams["savefig.dpi"]), math.sqrt(MOST_PIXELS / (width * height)))
