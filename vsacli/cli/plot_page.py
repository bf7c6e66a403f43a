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
    page.write_text(_studies(paths) if span is None else _results(paths, span, talk))


def _results(paths: list[Path], span: tuple[float, float], talk: Talk) -> str:
    with ExitStack() as stack:
        whole = [stack.enter_context(open_stored(path)) for path in paths]
        for each in whole:
            talk.detail(result_line(each))
        files = [Excerpt(each, (), span) for each in whole]
        reports = [stored_report(each.kind, each.report_json) for each in files]
        fixes = _fixes(whole, talk)
        samples = sum(each.samples for each in files)

        def progress(variables: int) -> AbstractContextManager[ProgressBar]:
            shown_from = 0 if samples >= LONG_PAGE else variables + 1
            return talk.progress(variables, shown_from=shown_from, label="drawing")

        return result_page(files, reports, fixes, progress)


def _fixes(files: list[StoredResult], talk: Talk) -> list[FixText | None]:
    """Return the fixes of each file, None where none are needed; show the progress of the search."""
    failed = [each.kind == "result" and each.verdict in FIXABLE for each in files]
    fixes: list[FixText | None] = []
    with talk.progress(sum(failed), shown_from=1, label="looking for fixes") as bar:
        for each, fixable in zip(files, failed, strict=True):
            fixes.append(_fix(each, talk) if fixable else None)
            bar.update(int(fixable))
    return fixes


def _fix(result: StoredResult, talk: Talk) -> FixText | None:
    """Return the fixes of `check-feasibility --fixes` for a result's inputs, or print why not."""
    from vsacli.files.repetition import rebuilt  # a page without fixes loads a third less
    from vsacli.studies.search import fixes

    try:
        provenance = result.provenance()
        made_by, this = provenance["generated_by"], f"vsacli {__version__}"
        if made_by != this:  # which may have interpreted the same inputs differently
            reason = f"was computed by {made_by}, and this is {this}"
            raise InputError.one(f"{reason}; check-feasibility --fixes looks for them", result.path)
        min_margin = provenance["options"].get("min_margin", MIN_MARGIN)
        found = fixes(*rebuilt(result), min_margin)
    except (InputError, StorageError) as error:
        reason = str(error).removeprefix(f"{result.path}: ")
        talk.note(f"{result.path}: no fixes on its page: {reason}")
        return None
    lines = str(found).splitlines()
    if not found.fixes:
        return FixText(lines, "")
    announced, command = _command(result, found)
    return FixText([*lines, announced], command)


def _command(result: StoredResult, found: Fixes) -> tuple[str, str]:
    """Return announcement and command of the next step: write the first fix, or list all fixes again."""
    inputs = result.inputs()
    files = [_named(each.path) for role in ("robot", "trajectory") for each in inputs if each.role == role]
    parts = ["vsacli", "check-feasibility", *files]
    if found.min_margin != MIN_MARGIN:
        parts += ["--min-margin", f"{found.min_margin}"]
    changes = format_changes({path: value for each in inputs for path, value in each.changes.items()})
    parts += [part for change in changes for part in ("--set", change)]
    if changes:
        announced = "this lists them again; to have one written, change the files themselves as --set does:"
        parts += ["--fixes"]
    else:
        announced = "this writes the trajectory with the first fix; --write-fix takes the number of any:"
        parts += ["--write-fix", "1", "-o", "fixed.yaml"]
    return announced, one_line(shlex.join(parts))


def _named(path: str) -> str:
    """Return a path that is not mistaken for an option; "-", standard input, stays as it is."""
    return f"./{path}" if path.startswith("-") and path != "-" else path


def _studies(paths: list[Path]) -> str:
    from vsacli.studies.sweeps import StudySummary

    with ExitStack() as stack:
        tables = [stack.enter_context(StoredStudy(path)) for path in paths]
        return study_page(tables, [StudySummary.of(table).as_text() for table in tables])
