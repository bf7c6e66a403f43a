"""A study and its table, figures as they are drawn, and commands that fail or do something else."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NoReturn

import pytest
from matplotlib.figure import Figure
from samples.studies import study

from vsacli.cli.main import run
from vsacli.cli.main import vsacli as group
from vsacli.results.charts.chart import Sheet
from vsacli.results.plots import FigureFiles, draw_sheet


@pytest.fixture
def computing_fails(monkeypatch: pytest.MonkeyPatch) -> Callable[[BaseException], None]:
    """Have dynamics, followed deflections and fits of recordings raise an exception where they begin."""

    def fail_with(error: BaseException) -> None:
        def begin(*_: object, **__: object) -> NoReturn:
            raise error

        for place in (
            "analysis.run_dynamics.block_of",
            "dynamics.integrated_deflections.integrate_deflections",
            "trajectory.recorded.samples.fit_samples",
        ):
            monkeypatch.setattr(f"vsacli.{place}", begin)

    return fail_with


@pytest.fixture
def no_computing(computing_fails: Callable[[BaseException], None]) -> None:
    """Fail the test if anything is computed."""
    computing_fails(pytest.fail.Exception("has begun to compute"))


@pytest.fixture
def command_is(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[..., object]], None]:
    """Set what any command does."""
    return lambda function: monkeypatch.setattr(group, "main", lambda **_: function())


@pytest.fixture
def drawn_figures(monkeypatch: pytest.MonkeyPatch) -> dict[str, Figure]:
    """Figures that commands save, by name."""
    figures: dict[str, Figure] = {}

    def save(_files: FigureFiles, drawings: Mapping[str, Figure | Sheet]) -> None:
        figures.update(
            (name, draw_sheet(each) if isinstance(each, Sheet) else each) for name, each in drawings.items()
        )

    monkeypatch.setattr(FigureFiles, "save", save)
    return figures


@pytest.fixture(scope="module")
def grid_table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The table of `grid_study`, undisturbed."""
    folder = tmp_path_factory.mktemp("undisturbed")
    study(folder)
    with contextlib.chdir(folder):
        assert run(["study", "study.yaml", "-q"]) == 0
    return folder / "study.h5"


@pytest.fixture
def grid_study(own_folder: Path) -> str:
    """A study file in the working folder."""
    study(own_folder)
    return "study.yaml"
