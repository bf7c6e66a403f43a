"""Pages of `--format html`, which replace figures."""

from __future__ import annotations

import shlex
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from vsacli.base.errors import InputError, StorageError
from vsacli.base.flags import MIN_MARGIN
from vsacli.base.outputs import Outputs
from vsacli.base.progress import ProgressBar
from vsacli.base.texts import one_line
from vsacli.base.version import __version__
from vsacli.cli.command_parts import FIXABLE, result_line
from vsacli.cli.console import Talk
from vsacli.documents.reading import format_changes
from vsacli.files.info.result_info import stored_report
from vsacli.results.pages import FixText, result_page, study_page
from vsacli.results.store.excerpt import Excerpt
from vsacli.results.store.reader import StoredResult, open_stored
from vsacli.results.store.study_table import StoredStudy

if TYPE_CHECKING:
    from vsacli.cli.figure_options import FigureTarget
    from vsacli.studies.search import Fixes

LONG_PAGE = 2_000_000
"""Number of samples, over all files, from which the progress of a page is shown."""


def write_page(
    paths: list[Path], span: tuple[float, float] | None, target: FigureTarget, outputs: Outputs, talk: Talk
) -> None:
    """Write the page of results or simulations over a time span; without a span, the page of studies.

    Raises:
        InputError: nothing in these files can be drawn, they do not belong together, or a library that pages
            need is not installed.
        StorageError: the page cannot be written.
    """
    page = target.page("-".join(path.stem for path in paths), outputs)
    assert page is not None, "as of a target for a page"
    page.write_text(_studies_page(paths) if span is None else _results_page(paths, span, talk))


def _results_page(paths: list[Path], span: tuple[float, float], talk: Talk) -> str:
    with ExitStack() as stack:
        results = [stack.enter_context(open_stored(path)) for path in paths]
        for result in results:
            talk.detail(result_line(result))
        files = [Excerpt(result, (), span) for result in results]
        reports = [stored_report(result.kind, result.report_json) for result in files]
        fixes = _fix_texts(results, talk)
        sample_count = sum(result.samples for result in files)

        def progress(variables: int) -> AbstractContextManager[ProgressBar]:
            shown_from = 0 if sample_count >= LONG_PAGE else variables + 1
            return talk.progress(variables, shown_from=shown_from, label="drawing")

        return result_page(files, reports, fixes, progress)


def _fix_texts(files: list[StoredResult], talk: Talk) -> list[FixText | None]:
    """Return the fixes of each file, None where none are needed; show the progress of the search."""
    is_fixable = [result.kind == "result" and result.verdict in FIXABLE for result in files]
    fixes: list[FixText | None] = []
    with talk.progress(sum(is_fixable), shown_from=1, label="looking for fixes") as bar:
        for result, fixable in zip(files, is_fixable, strict=True):
            fixes.append(_fix_text(result, talk) if fixable else None)
            bar.update(int(fixable))
    return fixes


def _fix_text(result: StoredResult, talk: Talk) -> FixText | None:
    """Return the fixes of `check-feasibility --fixes` for a result's inputs, or print why not."""
    from vsacli.files.repetition import rebuilt  # a page without fixes loads a third less
    from vsacli.studies.search import fixes

    try:
        provenance = result.provenance()
        made_by, this_version = provenance["generated_by"], f"vsacli {__version__}"
        if made_by != this_version:  # which may have interpreted the same inputs differently
            reason = f"was computed by {made_by}, and this is {this_version}"
            raise InputError.one(f"{reason}; check-feasibility --fixes looks for them", result.path)
        min_margin = provenance["options"].get("min_margin", MIN_MARGIN)
        found_fixes = fixes(*rebuilt(result), min_margin)
    except (InputError, StorageError) as error:
        reason = str(error).removeprefix(f"{result.path}: ")
        talk.note(f"{result.path}: no fixes on its page: {reason}")
        return None
    lines = str(found_fixes).splitlines()
    if not found_fixes.fixes:
        return FixText(lines, "")
    announcement, command = _next_command(result, found_fixes)
    return FixText([*lines, announcement], command)


def _next_command(result: StoredResult, found_fixes: Fixes) -> tuple[str, str]:
    """Return announcement and command of the next step: write the first fix, or list all fixes again."""
    inputs = result.inputs()
    files = [
        _unambiguous_path(stored_input.path)
        for role in ("robot", "trajectory")
        for stored_input in inputs
        if stored_input.role == role
    ]
    parts = ["vsacli", "check-feasibility", *files]
    if found_fixes.min_margin != MIN_MARGIN:
        parts += ["--min-margin", f"{found_fixes.min_margin}"]
    changes = format_changes(
        {path: value for stored_input in inputs for path, value in stored_input.changes.items()}
    )
    parts += [part for change in changes for part in ("--set", change)]
    if changes:
        announcement = (
            "this lists them again; to have one written, change the files themselves as --set does:"
        )
        parts += ["--fixes"]
    else:
        announcement = "this writes the trajectory with the first fix; --write-fix takes the number of any:"
        parts += ["--write-fix", "1", "-o", "fixed.yaml"]
    return announcement, one_line(shlex.join(parts))


def _unambiguous_path(path: str) -> str:
    """Return a path that is not mistaken for an option; "-", standard input, stays as it is."""
    return f"./{path}" if path.startswith("-") and path != "-" else path


def _studies_page(paths: list[Path]) -> str:
    from vsacli.studies.sweeps import StudySummary

    with ExitStack() as stack:
        tables = [stack.enter_context(StoredStudy(path)) for path in paths]
        return study_page(tables, [StudySummary.of(table).as_text() for table in tables])
