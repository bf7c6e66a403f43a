"""Options of commands that draw: where figures are written, their format, and their look."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import wraps
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from vsacli.cli.file_names import FIGURES, NameType, ending_of
from vsacli.cli.input_errors import naming_option
from vsacli.cli.option_types import Number, Words

if TYPE_CHECKING:
    from vsacli.base.outputs import Outputs, Staged
    from vsacli.results.charts.look import Look
    from vsacli.results.plots import FigureFiles

PAGE = "html"
"""Format of a page, which replaces figures."""

LENGTH, FONT, RESOLUTION = (
    Number("a length in cm, e.g. 8.9", positive=True),
    Number("a size in pt, e.g. 8", positive=True),
    Number("dots per inch, e.g. 300", positive=True),
)


LOOK_OPTIONS = ("style", "width", "height", "font_size", "dpi", "no_title")
"""Parameters of the look."""


class FigureTarget(NamedTuple):
    """The place where a command writes its figures, or its page.

    Attributes:
        folder: folder of the files.
        stem: beginning of the file names; None for that of the command.
        file_format: ending of the file names.
    """

    folder: Path
    stem: str | None
    file_format: str

    def paths(self, names: Iterable[str], stem: str) -> dict[str, Path]:
        """Return the paths of figures by name; a single figure of a given stem has just that name."""
        names = list(names)
        if self.stem is not None and len(names) == 1:
            return {names[0]: self.folder / f"{self.stem}.{self.file_format}"}
        return {name: self.folder / f"{self.stem or stem}-{name}.{self.file_format}" for name in names}

    def files(self, names: Iterable[str], stem: str, outputs: Outputs) -> FigureFiles:
        """Stage the files of figures.

        Raises:
            StorageError: as `Outputs.folder` and `Outputs.file`.
        """
        from vsacli.results.plots import FigureFiles

        return FigureFiles(self.paths(names, stem), outputs)

    def page(self, stem: str, outputs: Outputs) -> Staged | None:
        """Stage the file of a page, before anything is computed for it; None if figures were requested.

        Raises:
            InputError: a library that pages need is not installed.
            StorageError: as `Outputs.folder` and `Outputs.file`.
        """
        if self.file_format != PAGE:
            return None
        from vsacli.results.pages.document import plotting_library

        plotting_library()
        outputs.folder(self.folder)
        return outputs.file(self.folder / f"{self.stem or stem}.{PAGE}")


class PlaceType(NameType):
    """A folder for figures, or the name of a figure, whose ending is the format."""

    def __init__(self, formats: Iterable[str]) -> None:
        super().__init__("folder", "dir")
        self.endings = [f".{file_format}" for file_format in formats]

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """See `click.ParamType.convert`."""
        name = super().convert(value, param, ctx)
        ending = ending_of(name)
        if ending and ending not in self.endings and not Path(name).is_dir():
            endings = ", ".join(self.endings)
            self.fail(f"{name!r}: expected a folder, or the name of a figure ({endings})", param, ctx)
        return name


def figure_options(
    *flags: str, purpose: str, default: str | None = None, pages: bool = False
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that adds the options of figures to a command.

    The command receives them as one argument `figures`, a `FigureTarget` or None, and runs with the look.

    Args:
        flags: names of the option for the folder.
        purpose: help text of this option.
        default: default folder; None for a command that draws only on request.
        pages: whether the command can write a page.
    """
    formats = [ending.removeprefix(".") for ending in FIGURES if pages or ending != f".{PAGE}"]
    page = f"; {PAGE} writes everything to one page" if pages else ""

    def add(command: Callable[..., Any]) -> Callable[..., Any]:
        @click.option(
            *flags,
            "place",
            type=PlaceType(formats),
            metavar="FOLDER",
            default=default,
            show_default=True,
            help=f"{purpose} A name such as figures/run.pdf determines their format and names.",
        )
        @click.option(
            "--format",
            "file_format",
            type=Words(formats),
            help=f"Format of the figures, png unless their name has an ending{page}.",
        )
        @click.option(
            "--style",
            type=Words(["screen", "paper", "slide"]),
            default="screen",
            show_default=True,
            help="Style of the figures: paper is a column of 8.9 cm without title, slide is 16:9.",
        )
        @click.option("--width", metavar="CM", type=LENGTH, help="Width of the figures.")
        @click.option("--height", metavar="CM", type=LENGTH, help="Height of the figures.")
        @click.option("--font-size", metavar="PT", type=FONT, help="Font size of the figures.")
        @click.option(
            "--dpi",
            metavar="DPI",
            type=RESOLUTION,
            help="Resolution of png figures in dots per inch.",
            show_default="220",
        )
        @click.option("--no-title", is_flag=True, help="Draw figures without a title.")
        @wraps(command)
        def drawing(*args: Any, place: str | None, file_format: str | None, **kwargs: Any) -> Any:
            look_options = {name: kwargs.pop(name) for name in LOOK_OPTIONS}
            target = None if place is None else _figure_target(place, file_format)
            _check_unused(target, file_format, look_options)
            if target is None:
                return command(*args, figures=None, **kwargs)
            from vsacli.results.charts.look import drawing_with

            with drawing_with(_look(**look_options)):
                return command(*args, figures=target, **kwargs)

        return drawing

    return add


def _figure_target(place: str, file_format: str | None) -> FigureTarget:
    """Return where figures are written.

    Raises:
        click.UsageError: the ending of a name contradicts the format.
    """
    ending = ending_of(place).removeprefix(".")
    if not ending or Path(place).is_dir():
        return FigureTarget(Path(place), None, file_format or "png")
    if file_format not in (None, ending):
        raise click.UsageError(f"--format {file_format} contradicts the ending of {place}; leave one out")
    name = PurePath(place)
    return FigureTarget(Path(name.parent), name.stem, ending)


def _check_unused(target: FigureTarget | None, file_format: str | None, look_options: dict[str, Any]) -> None:
    """Refuse options that have no effect.

    Raises:
        click.UsageError: nothing is drawn, or a page, which has no such look.
    """
    given_options = [
        f"--{name.replace('_', '-')}" for name, value in look_options.items() if value and value != "screen"
    ]
    if target is None and (file_format or given_options):
        raise click.UsageError(f"{given_options[0] if given_options else '--format'} needs --plot")
    if target is not None and target.file_format == PAGE and given_options:
        raise click.UsageError(f"{given_options[0]} cannot be used with a page; leave it out")
    if target is not None and target.file_format != "png" and look_options["dpi"]:
        raise click.UsageError(f"--dpi is for png; {target.file_format} figures have no pixels, leave it out")


def _look(
    style: str,
    width: float | None,
    height: float | None,
    font_size: float | None,
    dpi: float | None,
    *,
    no_title: bool,
) -> Look:
    """Return the look that options choose.

    Raises:
        InputError: a size is out of range.
    """
    from vsacli.results.charts.look import STYLES

    look = STYLES[style]
    with naming_option("--width"):
        look = replace(look, width=width or look.width)
    with naming_option("--height"):
        look = replace(look, height=height or look.height)
    with naming_option("--font-size"):
        look = replace(look, font_size=font_size or look.font_size)
    with naming_option("--dpi"):
        look = replace(look, dpi=dpi)
    return replace(look, title=look.title and not no_title)


class FigurePlace(NamedTuple):
    """The place of the figures, and the output files of the command."""

    place: FigureTarget
    outputs: Outputs

    def figures(self, names: Iterable[str], stem: str) -> FigureFiles:
        """Stage the files of figures."""
        return self.place.files(names, stem, self.outputs)


class DrawnPart(NamedTuple):
    """The selection to draw: joints (all if empty), a time span, and variables (default figures if None)."""

    joints: tuple[str, ...]
    span: tuple[float, float]
    variables: tuple[str, ...] | None

    @property
    def option(self) -> str:
        """Name of an option that selects something; empty if everything is to be drawn."""
        has_first, has_last = (math.isfinite(end) for end in self.span)
        selections = {
            "--variables": self.variables is not None,
            "--joints": self.joints,
            "--from": has_first,
            "--to": has_last,
        }
        return next((option for option, is_selected in selections.items() if is_selected), "")


EVERYTHING = DrawnPart((), (-math.inf, math.inf), None)
