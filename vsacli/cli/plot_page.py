"""`vsacli plot --format html`: a page in place of figures."""

from __future__ import annotations

from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from vsacli.cli.command_parts import result_line
from vsacli.cli.console import Talk

if TYPE_CHECKING:
    from vsacli.base.outputs import Outputs
    from vsacli.base.progress import Bar

LONG_PAGE = 2_000_000
"""Samples, of all files together, from which on a page takes so long that its progress is shown."""


def write_page(
    paths: list[Path], span: tuple[float, float] | None, folder: Path, outputs: Outputs, talk: Talk
) -> None:
    """Write the page of results, or of simulations, over a stretch of time; of studies if there is none.

    Raises:
        InputError: nothing can be drawn from these files, they do not belong together, or what a page needs
            is not installed.
        StorageError: the page cannot be written.
    """
    outputs.folder(folder)
    page = outputs.file(folder / f"{'-'.join(path.stem for path in paths)}.html")
    page.write_text(_studies(paths) if span is None else _results(paths, span, talk))


def _results(paths: list[Path], span: tuple[float, float], talk: Talk) -> str:
    from vsacli.files.stored_reports import stored_report
    from vsacli.results.pages import result_page
    from vsacli.results.store.excerpt import Excerpt
    from vsacli.results.store.simulation import open_stored

    with ExitStack() as stack:
        whole = [stack.enter_context(open_stored(path)) for path in paths]
        for each in whole:
            talk.detail(result_line(each))
        files = [Excerpt(each, (), span) for each in whole]
        reports = [stored_report(each.kind, each.report_json) for each in files]
        samples = sum(each.samples for each in files)

        def progress(variables: int) -> AbstractContextManager[Bar]:
            shown_from = 0 if samples >= LONG_PAGE else variables + 1
            return talk.progress(variables, shown_from=shown_from, label="drawing")

        return result_page(files, reports, progress)


def _studies(paths: list[Path]) -> str:
    from vsacli.base.tables import ReportText
    from vsacli.results.pages import study_page
    from vsacli.results.store.stored_study import StoredStudy
    from vsacli.studies.sweeps import StudySummary

    with ExitStack() as stack:
        tables = [stack.enter_context(StoredStudy(path)) for path in paths]
        summaries = [str(StudySummary.of(table)).splitlines() for table in tables]
        return study_page(tables, [ReportText(first, [], rest) for first, *rest in summaries])
