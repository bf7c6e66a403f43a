"""What inverse dynamics along a whole trajectory returns."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from vsacli.analysis.report import Report
from vsacli.analysis.report_text import joint_rows
from vsacli.base.arrays import AnyArray
from vsacli.base.tables import aligned, html_table
from vsacli.base.variables import Block
from vsacli.robot.model import Robot
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    import xarray

    from vsacli.results.plots.drawings import Figures


class Shown:
    """How a result looks in a terminal and in a notebook: what was run, its verdict, a line a joint."""

    report: Report

    def __repr__(self) -> str:
        return "\n".join([self._title(), *aligned(joint_rows(self.report.joints))])

    def _repr_html_(self) -> str:
        return html_table(self._title(), joint_rows(self.report.joints))

    def _title(self) -> str:
        run = f"{self.report.robot}, {self.report.trajectory}"
        size = f"{self.report.samples} samples, {self.report.duration:g} s"
        return f"Result of {run}: {size}, {self.report.verdict}"


class Result(Shown, Block):
    """Every variable over the whole trajectory, and the report on it.

    Attributes:
        report: the verdict, and what led to it; `print` shows it as the commands do.
        robot, trajectory: what was computed.
    """

    def __init__(self, *, report: Report, robot: Robot, trajectory: Trajectory, **arrays: AnyArray) -> None:
        super().__init__(**arrays)
        self.report, self.robot, self.trajectory = report, robot, trajectory

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, base to tip."""
        return self.robot.joint_names

    def save(
        self, path: str | os.PathLike[str], *, overwrite: bool = False, precision: str = "double"
    ) -> None:
        """Write the result file that `vsacli invdyn` writes: the whole of it, or nothing.

        Args:
            path: the HDF5 file.
            overwrite: whether a file that exists may be replaced.
            precision: in which values are stored, "double" or "single"; times are always double.

        Raises:
            StorageError: the file exists and must not be replaced, cannot be written, or its disk is
                full; a value is too large for single precision.
            InputError: there is no such precision.
        """
        from vsacli.base.outputs import Outputs
        from vsacli.results.store.writer import ResultWriter

        with (
            Outputs(overwrite=overwrite) as outputs,
            ResultWriter(
                outputs.file(Path(path)), self.robot, self.trajectory, precision=precision
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
        """Draw the figures of `vsacli plot`, from a result file that exists no longer than it takes.

        Args:
            folder: where to save them as `<stem>-<name>.<file_format>`; they are not saved if None.
            stem: what the names of the files begin with.
            file_format: "png", "pdf" or "svg".
            overwrite: whether files that exist may be replaced.

        Returns:
            Matplotlib figures by name, such as "motion".

        Raises:
            StorageError: a file exists and must not be replaced, or the folder cannot be written.
        """
        from vsacli.base.storage import temporary_folder
        from vsacli.results.plots import plot_stored, save_figures
        from vsacli.results.store.reader import StoredResult

        with temporary_folder() as place:
            path = place / f"{stem}.h5"
            self.save(path)
            with StoredResult.open(path) as stored:
                figures = plot_stored(stored)
        if folder is not None:
            save_figures(figures, Path(folder), stem, file_format, overwrite=overwrite)
        return figures

    def to_xarray(self) -> xarray.Dataset:
        """The variables as an `xarray.Dataset`, with named dimensions, units and flags as in the file.

        Raises:
            ModuleNotFoundError: xarray is not installed; the sentence says how to get it.
        """
        from vsacli.results.labelled import labelled_dataset

        return labelled_dataset(self.arrays(), self.robot.joint_names, self.robot.joint_types)
