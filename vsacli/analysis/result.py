"""Results in Python: variables and report of a run in memory, and result files opened for reading."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vsacli.analysis.report import Report
from vsacli.analysis.report_text import joint_rows
from vsacli.base.arrays import AnyArray
from vsacli.base.errors import InputError, check_path
from vsacli.base.renamed import now_called
from vsacli.base.storage import temporary_folder
from vsacli.base.tables import aligned, html_table
from vsacli.base.variables import ALL, ON_REQUEST, VARIABLES, Block, split_axes, variables_by_tool
from vsacli.results.store.reader import StoredResult, open_one_of
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    import xarray

    from vsacli.results.plots.figures import Figures


class ResultDisplay:
    """Display of a result in a terminal or a notebook: run, verdict, a line for each joint."""

    report: Report

    def __repr__(self) -> str:
        return "\n".join([self._title(), *aligned(joint_rows(self.report.joints))])

    def _repr_html_(self) -> str:
        return html_table(self._title(), joint_rows(self.report.joints))

    def _title(self) -> str:
        run_text = f"{self.report.robot}, {self.report.trajectory}"
        size_text = f"{self.report.samples} samples, {self.report.duration:g} s"
        return f"Result of {run_text}: {size_text}, {self.report.verdict}"


class Result(ResultDisplay, Block):
    """All variables over the whole trajectory, with the report.

    Attributes:
        report: Verdict and findings; `print` shows them as the commands do.
        robot, trajectory: Inputs of the run.
    """

    def __init__(self, *, report: Report, robot: Robot, trajectory: Trajectory, **arrays: AnyArray) -> None:
        declared = variables_by_tool(VARIABLES, len(robot.tool_names))
        shaped_arrays = {
            name: split_axes(array, declared[name], robot.labels) for name, array in arrays.items()
        }
        super().__init__(**shaped_arrays)
        self.report, self.robot, self.trajectory = report, robot, trajectory

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the robot file."""
        return self.robot.joint_names

    def save(
        self, path: str | os.PathLike[str], *, overwrite: bool = False, precision: str = "double"
    ) -> None:
        """Write the result file that `vsacli invdyn` writes, completely or not at all.

        Args:
            path: HDF5 file.
            overwrite: Whether an existing file may be replaced.
            precision: Storage precision, "double" or "single"; times are always double.

        Raises:
            StorageError: The file exists and must not be replaced, cannot be written, or its disk is full; or
                a value is too large for single precision.
            InputError: The precision is unknown.
        """
        from vsacli.base.outputs import Outputs
        from vsacli.results.store.writer import ResultWriter

        with (
            Outputs(overwrite=overwrite) as outputs,
            ResultWriter(
                outputs.file(Path(path)),
                self.robot,
                self.trajectory,
                (ALL, *(name for name in ON_REQUEST if getattr(self, name) is not None)),
                precision=precision,
            ) as writer,
        ):
            writer.write(self)
            writer.finish(self.report.as_json())

    def plot(
        self,
        folder: str | os.PathLike[str] | None = None,
        *,
        stem: str = "result",
        file_format: str = "png",
        overwrite: bool = False,
    ) -> Figures:
        """Draw the figures of `vsacli plot`, by way of a temporary result file.

        Args:
            folder: Folder for the files `<stem>-<name>.<file_format>`; they are not saved if None.
            stem: Beginning of the file names.
            file_format: "png", "pdf" or "svg".
            overwrite: Whether existing files may be replaced.

        Returns:
            Matplotlib figures by name, such as "motion".

        Raises:
            StorageError: A file exists and must not be replaced, or the folder cannot be written.
        """
        from vsacli.results.plots import plot_stored, save_figures

        with temporary_folder() as folder_path:
            path = folder_path / f"{stem}.h5"
            self.save(path)
            with StoredResult.open(path) as stored:
                figures = plot_stored(stored)
        if folder is not None:
            save_figures(figures, Path(folder), stem, file_format, overwrite=overwrite)
        return figures

    def to_xarray(self) -> xarray.Dataset:
        """Return the variables as an `xarray.Dataset`, with named dimensions, units and flags as in the file.

        Raises:
            ModuleNotFoundError: Xarray is not installed; the message says how to install it.
        """
        from vsacli.results.exports.formats import labeled_dataset

        return labeled_dataset(self.arrays(), self.robot.labels, self.robot.joint_types)


class ResultFile(ResultDisplay, StoredResult):
    """A result file of `vsacli invdyn` or `Result.save`; a context manager that closes it.

    Each variable is an attribute as in `Result`, a NumPy array that is read at first access.

    Attributes:
        report: Verdict and findings.
        joint_names: Names of the joints, in the order of the robot file.
        variables: Names of the variables in the file.
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
            hint = now_called(name, VARIABLES)
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}{hint}")
        try:
            values = self.read(name)
        except InputError as error:
            if name in self.variables:
                raise  # the file is damaged
            raise AttributeError(str(error)) from None
        setattr(self, name, values)
        return values

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.variables})

    def arrays(self) -> Mapping[str, Any]:
        """Return all variables of the file by name, `time` first."""
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
            InputError: The file has no variables that can be drawn.
            StorageError: A file exists and must not be replaced, or the folder cannot be written.
        """
        from vsacli.results.plots import plot_stored, save_figures

        figures = plot_stored(self)
        if folder is not None:
            save_figures(figures, Path(folder), self.path.stem, file_format, overwrite=overwrite)
        return figures

    def to_xarray(self) -> xarray.Dataset:
        """Return all variables of the file as an `xarray.Dataset`; see `Result.to_xarray`."""
        from vsacli.results.exports.formats import labeled_dataset

        return labeled_dataset(self.arrays(), self.labels, self.joint_types)


def open_result(path: str | os.PathLike[str]) -> ResultFile:
    """Open a result file of `vsacli invdyn` or `Result.save`, as a context manager that closes it.

    Raises:
        InputError: The file does not exist, or is not a complete file of a format that this version reads.
        StorageError: The operating system refuses to read the file, or another program is writing it.
        TypeError: The path is of another type.
    """
    check_path(path, "open_result(path)")
    return open_one_of(Path(path), ResultFile)
