"""`vsacli plot`."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import click

from vsacli.cli.console import Talk, talk_options
from vsacli.cli.options import example, overwrite_option
from vsacli.cli.running import described


@click.command(
    "plot",
    short_help="Draw the figures of a result, or compare several.",
    epilog=example("vsacli plot result.h5 -o figures --format pdf"),
)
@click.argument("results", metavar="RESULT...", nargs=-1, required=True)
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
def plot(results: tuple[str, ...], folder: str, file_format: str, overwrite: bool, talk: Talk) -> None:
    """Draw the figures of a RESULT, or compare several.

    One result gives <stem>-motion, <stem>-motor-torque, <stem>-elastic-torque and <stem>-energy; two or
    more give one figure <stem>-<stem>-compare, with their motor torques overlaid joint by joint.
    """
    if len(results) == 1:
        draw_result(Path(results[0]), Path(folder), file_format, overwrite, talk)
    else:
        _draw_comparison([Path(result) for result in results], Path(folder), file_format, overwrite, talk)


def draw_result(path: Path, folder: Path, file_format: str, overwrite: bool, talk: Talk) -> None:
    """Draw the figures of one result file and say where they are."""
    from vsacli.plots import check_figures, drawable_figures, omitted_figures, plot_result, save_figures
    from vsacli.store.reader import open_result

    with open_result(path) as result:
        talk.detail(described(result))
        drawn = drawable_figures(result.variables, path)
        check_figures(drawn, folder, path.stem, file_format, overwrite=overwrite)
        for reason in omitted_figures(result.variables).values():
            talk.note(f"{path}: {reason}")
        saved = save_figures(plot_result(result), folder, path.stem, file_format, overwrite=overwrite)
    for figure in saved:
        talk.note(f"wrote {figure}")


def _draw_comparison(paths: list[Path], folder: Path, file_format: str, overwrite: bool, talk: Talk) -> None:
    from vsacli.plots import COMPARISON, check_figures, compare_results, save_figures
    from vsacli.store.reader import open_result

    stem = "-".join(path.stem for path in paths)
    check_figures([COMPARISON], folder, stem, file_format, overwrite=overwrite)
    with ExitStack() as stack:
        results = [stack.enter_context(open_result(path)) for path in paths]
        for result in results:
            talk.detail(described(result))
        figure = compare_results(results)
    for saved in save_figures({COMPARISON: figure}, folder, stem, file_format, overwrite=overwrite):
        talk.note(f"wrote {saved}")
