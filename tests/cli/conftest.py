"""A study, and its table."""

from __future__ import annotations

import contextlib
from pathlib import Path

import pytest
from samples.studies import study

from vsacli.cli.main import run


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
