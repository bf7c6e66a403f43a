"""`vsacli plot`."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import click

from vsacli.cli.command_parts import example, overwrite_option, result_line
from vsacli.cli.console import Talk, talk_options


@click.command(
    "plot",
    short_help="Draw results and simulations, or compare several.",
    epilog=example("vsacli plot result.h5 -o figures --format pdf"),
)
@click.argument("files", metavar="FILE...", nargs=-1, required=True)
@click.option(
    "-o", "--output", "folder", metavar="FOLDER", default=".", help="Where to save; by default this folder."
)
@click.option(
    "--format",
    "file_format",
    type=click.Choice(["png", "pdf", "svg"]),
    default="png",
    show_default=True,
    help="Format of the figures.",
)
@overwrite_option
@talk_options
def plot(files: tuple[str, ...], folder: str, file_format: str, overwrite: bool, talk: Talk) -> None:
    """Draw the figures of a result or a simulation, or compare several of a kind.

    A result gives <stem>-motion, <stem>-motor-torque, <stem>-elastic-torque and <stem>-energy, a simulation
    <stem>-position-error, <stem>-stiffness-error and <stem>-motor-torque. Two or more FILEs give one figure
    <stem>-<stem>-compare: motor torques of results, or position errors of simulations, overlaid joint by
    joint.
    """
    if len(files) == 1:
        draw_file(Path(files[0]), Path(folder), file_format, overwrite, talk)
    else:
        _draw_comparison([Path(file) for file in files], Path(folder), file_format, overwrite, talk)


def draw_file(path: Path, folder: Path, file_format: str, overwrite: bool, talk: Talk) -> None:
    """Draw the figures of one file and say where they are."""
    from vsacli.results.plots import (
        check_figures,
        drawable_figures,
        drawings_of,
        omitted_figures,
        plot_stored,
        save_figures,
    )
    from vsacli.results.store.simulation import open_stored

    with open_stored(path) as stored:
        talk.detail(result_line(stored))
        drawings = drawings_of(stored)
        drawn = drawable_figures(drawings, stored.variables, path)
        check_figures(drawn, folder, path.stem, file_format, overwrite=overwrite)
        for reason in omitted_figures(drawings, stored.variables).values():
            talk.note(f"{path}: {reason}")
        saved = save_figures(plot_stored(stored), folder, path.stem, file_format, overwrite=overwrite)
    for figure in saved:
        talk.note(f"wrote {figure}")


def _draw_comparison(paths: list[Path], folder: Path, file_format: str, overwrite: bool, talk: Talk) -> None:
    from vsacli.results.plots import COMPARISON, check_figures, compare_files, save_figures
    from vsacli.results.store.simulation import open_stored

    stem = "-".join(path.stem for path in paths)
    check_figures([COMPARISON], folder, stem, file_format, overwrite=overwrite)
    with ExitStack() as stack:
        files = [stack.enter_context(open_stored(path)) for path in paths]
        for file in files:
            talk.detail(result_line(file))
        figure = compare_files(files)
    for saved in save_figures({COMPARISON: figure}, folder, stem, file_format, overwrite=overwrite):
        talk.note(f"wrote {saved}")
