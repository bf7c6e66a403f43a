"""A result read back from its file, with the face of one in memory."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vsacli.analysis.report import Report
from vsacli.analysis.result import Shown
from vsacli.base.errors import InputError, check_path
from vsacli.base.variables import VARIABLES
from vsacli.results.store.reader import StoredResult, open_one_of

if TYPE_CHECKING:
    import xarray

    from vsacli.results.plots.drawings import Figures


class ResultFile(Shown, StoredResult):
    """A result file of `vsacli invdyn` or `Result.save`; a context manager that closes it.

    Each variable is an attribute, a NumPy array that is read when it is first asked for, as in `Result`.

    Attributes:
        report: the verdict, and what led to it.
        joint_names: base to tip.
        variables: names of the variables that the file holds.
    """

    def __init__(self, path: str | Path, file: Any) -> None:
        super().__init__(path, file)
        try:
            self.report = Report.from_json(self.report_json)
        except (LookupError, TypeError, AttributeError, ValueError):
            raise InputError.one("its report has another form than this version writes", path) from None

    def __getattr__(self, name: str) -> Any:
        """Read a variable, once."""
        if name not in VARIABLES:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        try:
            values = self.read(name)
        except InputError as error:
            if name in self.variables:
                raise  # it is damaged
            raise AttributeError(str(error)) from None
        setattr(self, name, values)
        return values

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.variables})

    def arrays(self) -> Mapping[str, Any]:
        """All variables of the file by name, `time` first."""
        return {name: getattr(self, name) for name in ("time", *self.variables)}

    def plot(
        self,
        folder: str | os.PathLike[str] | None = None,
        *,
        file_format: str = "png",
        overwrite: bool = False,
    ) -> Figures:
        """Draw the figures of `vsacli plot`, and save them if a folder is given; see `Result.plot`.

        Raises:
            InputError: nothing can be drawn from the variables of the file.
            StorageError: a file exists and must not be replaced, or the folder cannot be written.
        """
        from vsacli.results.plots import plot_stored, save_figures

        figures = plot_stored(self)
        if folder is not None:
            save_figures(figures, Path(folder), self.path.stem, file_format, overwrite=overwrite)
        return figures

    def to_xarray(self) -> xarray.Dataset:
        """All variables of the file as an `xarray.Dataset`; see `Result.to_xarray`."""
        from vsacli.results.labelled import labelled_dataset

        return labelled_dataset(self.arrays(), self.joint_names, self.joint_types)


def open_result(path: str | os.PathLike[str]) -> ResultFile:
    """Open a result file of `vsacli invdyn` or `Result.save`, as a context manager that closes it.

    Raises:
        InputError: there is no such file, or it is not a complete file of the format this version reads.
        StorageError: the operating system refuses to read it, or another program is writing it.
        TypeError: path is none.
    """
    check_path(path, "open_result(path)")
    return open_one_of(Path(path), ResultFile)
