"""Names of files and folders on the command line, with shell completion.

The ending of a name determines what the file holds for other programs and later commands. An output whose
ending is that of another format is therefore refused.
"""

from __future__ import annotations

from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

from click.types import StringParamType

if TYPE_CHECKING:
    import click
    from click.shell_completion import CompletionItem


class NameType(StringParamType):
    """A name with shell completion; unlike `click.Path`, it leaves errors of the disk to commands."""

    def __init__(self, name: str, completion: str) -> None:
        self.name = name
        self.completion = completion

    def shell_complete(
        self, _context: click.Context, _parameter: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Delegate to the shell, which completes names of files and folders."""
        from click.shell_completion import CompletionItem  # needed only by shells

        return [CompletionItem(incomplete, type=self.completion)]


FIGURES = (".png", ".pdf", ".svg", ".html")

ENDINGS = {
    "HDF5": (".h5", ".hdf5", ".hdf"),
    "YAML": (".yaml", ".yml"),
    "CSV": (".csv",),
    "MATLAB": (".mat",),
    "Parquet": (".parquet",),
    "JSON": (".json",),
    "XML": (".xml", ".urdf", ".mjcf", ".sdf", ".srdf", ".xacro"),
    "figures": FIGURES,
    "programs": (".c", ".h", ".py", ".m"),
    "other data": (".npy", ".npz", ".xlsx", ".tsv"),
}
"""Endings of file names, by content."""

KNOWN_ENDINGS = frozenset(ending for endings in ENDINGS.values() for ending in endings)


def ending_of(name: str) -> str:
    """Return the ending of a name in lower case; "" without one, or for a number as in `run.2`."""
    ending = PurePath(name).suffix.lower()
    return ending if ending[1:2].isalpha() else ""


class OutputType(NameType):
    """An output file of one format; a name with the ending of another format is refused."""

    def __init__(self, form: str, advice: str = "") -> None:
        super().__init__("file", "file")
        self.form, self.advice = form, advice

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """See `click.ParamType.convert`."""
        name = super().convert(value, param, ctx)
        ending = ending_of(name)
        if ending and ending not in ENDINGS[self.form]:
            expected_ending, advice = ENDINGS[self.form][0], self.advice if ending == ".csv" else ""
            self.fail(
                f"{name!r} does not end in {expected_ending}: the output is {self.form}{advice}", param, ctx
            )
        return name


class FolderType(NameType):
    """A folder; a name with the ending of a file is refused, unless a folder of that name exists."""

    def __init__(self) -> None:
        super().__init__("folder", "dir")

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """See `click.ParamType.convert`."""
        name = super().convert(value, param, ctx)
        ending = ending_of(name)
        if ending and not Path(name).is_dir():
            option = param.opts[-1] if param is not None else ""
            has_format_option = ctx is not None and any(
                parameter.name == "file_format" for parameter in ctx.command.params
            )
            format_option = f" --format {ending[1:]}" if has_format_option and ending in FIGURES else ""
            advice = f"e.g. {option} {PurePath(name).with_suffix('')}{format_option}"
            self.fail(f"{name!r} looks like a file name, expected a folder; {advice}", param, ctx)
        return name


FILE = NameType("file", "file")
FOLDER = FolderType()
HDF5_FILE = OutputType("HDF5", "; `vsacli export` writes CSV from it")
YAML_FILE = OutputType("YAML")
