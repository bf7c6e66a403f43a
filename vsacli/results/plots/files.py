"""Figures as files: reproducible to the byte, and complete or absent."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure

from vsacli.base.atomic_files import AtomicFile, check_target, reporting_storage_errors
from vsacli.base.errors import StorageError
from vsacli.results.plots.drawing import house_style

FORMATS = ("png", "pdf", "svg")

# Without dates, so that equal results give equal files.
_METADATA: dict[str, dict[str, str | None]] = {
    "png": {},
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
}


def check_figures(
    names: Iterable[str],
    directory: str | Path,
    stem: str,
    file_format: str = "png",
    *,
    overwrite: bool = False,
) -> list[Path]:
    """Where the figures of these names are saved, if they may be; nothing is written.

    Raises:
        StorageError: a file exists and `overwrite` is false, or `directory` is a file.
    """
    paths = [Path(directory) / f"{stem}-{name}.{file_format}" for name in names]
    if Path(directory).exists():
        if not Path(directory).is_dir():
            raise StorageError(directory, "is a file; name a folder for the figures")
        for path in paths:
            check_target(path, overwrite=overwrite)
    return paths


def save_figures(
    figures: Mapping[str, Figure],
    directory: str | Path,
    stem: str,
    file_format: str = "png",
    *,
    overwrite: bool = False,
) -> list[Path]:
    """Save figures by name into a directory, which is made if it does not exist.

    Every target is checked, and every figure rendered, before the first file is written.

    Args:
        figures: figures by name.
        directory: folder of the files.
        stem: what their names begin with.
        file_format: one of `FORMATS`.
        overwrite: whether existing files may be replaced.

    Returns:
        The paths, in the order of the figures.

    Raises:
        StorageError: a file exists and `overwrite` is false, or the folder cannot be written.
    """
    paths = check_figures(figures, directory, stem, file_format, overwrite=overwrite)
    rendered = [_rendered(figure, file_format) for figure in figures.values()]
    with reporting_storage_errors(directory):
        Path(directory).mkdir(parents=True, exist_ok=True)
    for path, content in zip(paths, rendered, strict=True):
        _write(path, content, overwrite)
    return paths


def _rendered(figure: Figure, file_format: str) -> bytes:
    buffer = BytesIO()
    with house_style():
        figure.savefig(buffer, format=file_format, metadata=_METADATA[file_format])
    return buffer.getvalue()


def _write(path: Path, content: bytes, overwrite: bool) -> None:
    with AtomicFile(path, overwrite=overwrite) as file:
        with reporting_storage_errors(path):
            file.temporary.write_bytes(content)
        file.publish()
