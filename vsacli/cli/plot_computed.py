"""Figures of results, simulations, studies and sensitivities, for `vsacli plot`."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import click

from vsacli.base import file_formats
from vsacli.base.variables import select_variables
from vsacli.cli.command_parts import result_line
from vsacli.cli.console import Talk
from vsacli.cli.drawings import RECORDING, draw_stored_figures, has_recording
from vsacli.cli.figure_options import EVERYTHING, PAGE, DrawnPart, FigurePlace
from vsacli.cli.input_errors import naming_option
from vsacli.cli.sensitivity import RANKING
from vsacli.results.charts.comparison import COMPARISON, comparison_names
from vsacli.results.charts.figures import chosen_figures
from vsacli.results.charts.ranking import Ranking
from vsacli.results.plots import compare_files, compared_studies, ranking_figure, study_figures
from vsacli.results.store.damage import reporting_damage
from vsacli.results.store.excerpt import Excerpt
from vsacli.results.store.reader import StoredResult, open_stored, stored_format
from vsacli.results.store.sensitivity_file import StoredSensitivity
from vsacli.results.store.study_table import StoredStudy


def draw_computed(paths: list[Path], part: DrawnPart, target: FigurePlace, talk: Talk) -> None:
    """Draw results, simulations, study tables or a sensitivity analysis."""
    kind = _common_format(paths)
    if kind in (file_formats.STUDY_TABLE, file_formats.SENSITIVITY) and part != EVERYTHING:
        files_text = "study tables" if kind == file_formats.STUDY_TABLE else "sensitivity files"
        raise click.UsageError(f"{part.option} cannot be used with {files_text}; leave it out")
    if kind == file_formats.SENSITIVITY:
        _draw_ranking(paths, target, talk)
    elif target.place.file_format == PAGE:
        if (part_without_span := part._replace(span=EVERYTHING.span)) != EVERYTHING:
            raise click.UsageError(
                f"{part_without_span.option} cannot be used with --format html; leave it out"
            )
        from vsacli.cli.plot_page import write_page  # a page loads the searches, 0.1 s

        write_page(paths, None if kind == file_formats.STUDY_TABLE else part.span, *target, talk)
    elif kind == file_formats.STUDY_TABLE:
        _draw_studies(paths, target)
    elif len(paths) == 1:
        _draw_file(paths[0], part, target, talk)
    else:
        _draw_comparison(paths, part, target, talk)


def _common_format(paths: list[Path]) -> str | None:
    """Return the format of the first file; study tables are only drawn among themselves.

    Raises:
        click.UsageError: some files are study tables, and others are not.
    """
    existing_paths = [path for path in paths if path.is_file()] or paths[
        :1
    ]  # others are missed when they are read
    formats = [stored_format(path) for path in existing_paths]
    is_table = [file_format == file_formats.STUDY_TABLE for file_format in formats]
    if any(is_table) and not all(is_table):
        table, other_path = existing_paths[is_table.index(True)], existing_paths[is_table.index(False)]
        raise click.UsageError(
            f"{table} is a study table, {other_path} is not; plot study tables by themselves"
        )
    return formats[0]


def _draw_ranking(paths: list[Path], target: FigurePlace, talk: Talk) -> None:
    """Draw the ranking of a sensitivity file."""
    if len(paths) > 1:
        raise click.UsageError("sensitivity analyses are drawn one at a time")
    if target.place.file_format == PAGE:
        raise click.UsageError("--format html is for results, simulations and studies; leave it out")
    with StoredSensitivity.open(paths[0]) as stored, reporting_damage(paths[0]):
        talk.detail(result_line(stored))
        ranking = Ranking.of(stored.report_json, stored.joint_names)
        if stored.report_json.get("band"):
            talk.note(f"{paths[0]}: no figure of the tolerance bands: `vsacli sensitivity --plot` draws it")
    target.figures([RANKING], paths[0].stem).save({RANKING: ranking_figure(ranking)})


def _draw_studies(paths: list[Path], target: FigurePlace) -> None:
    """Draw the figures of a study, or compare the distributions of margins of several studies."""
    stem = "-".join(path.stem for path in paths)
    with ExitStack() as stack:
        tables = [stack.enter_context(StoredStudy(path)) for path in paths]
        if len(tables) == 1:
            figures = study_figures(tables[0])
        else:
            figures = {COMPARISON: compared_studies(tables, [path.stem for path in paths])}
    target.figures(figures, stem).save(figures)


def _draw_file(path: Path, selection: DrawnPart, target: FigurePlace, talk: Talk) -> None:
    """Draw the figures of one file, and of the recording that it was computed from."""
    with open_stored(path) as stored:
        talk.detail(result_line(stored))
        excerpt = _excerpt(stored, selection)
        with naming_option("--variables"):
            names = chosen_figures(excerpt, selection.variables)
        with_recording = selection.variables is None and has_recording(stored, talk)
        figures = target.figures([*names, RECORDING] if with_recording else names, path.stem)
        draw_stored_figures(excerpt, path, figures, talk, selection.variables)
        if with_recording:
            from vsacli.cli.plot_recording import recording_figure  # both load the fits, half of all modules
            from vsacli.files.repetition import rebuilt

            robot, trajectory = rebuilt(stored)
            profiles = trajectory.estimates.values()
            figures.save(recording_figure(robot, profiles, path, selection.joints, selection.span))


def _draw_comparison(paths: list[Path], part: DrawnPart, target: FigurePlace, talk: Talk) -> None:
    stem = "-".join(path.stem for path in paths)
    files = target.figures(comparison_names(part.variables), stem)
    with ExitStack() as stack:
        results = [stack.enter_context(open_stored(path)) for path in paths]
        for result in results:
            talk.detail(result_line(result))
        with naming_option("--variables"):
            select_variables(part.variables or (), results[0].declared)
        files.save(compare_files([_excerpt(result, part) for result in results], part.variables))


def _excerpt(stored: StoredResult, part: DrawnPart) -> StoredResult:
    """Return the part of an open file to draw; the file itself if that is all of it."""
    is_everything = not part.joints and part.span == EVERYTHING.span
    return stored if is_everything else Excerpt(stored, part.joints, part.span)
