"""Figures as files: reproducible, complete or absent, never over another file unasked."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import matplotlib
import pytest
from matplotlib.figure import Figure
from samples.figures import rest_to_rest
from samples.results import random_block, write_result

from vsacli import StorageError
from vsacli.results.plots import FORMATS, compare_files, plot_stored, save_figures
from vsacli.results.store.reader import StoredResult


def motion() -> dict[str, Figure]:
    return {"motion": plot_stored(rest_to_rest())["motion"]}


@pytest.mark.slow
@pytest.mark.parametrize("file_format", FORMATS)
def test_equal_results_give_equal_files(file_format: str, tmp_path: Path) -> None:
    first = save_figures(motion(), tmp_path / "first", "run", file_format)
    with matplotlib.rc_context({"svg.hashsalt": "another", "lines.linewidth": 9, "axes.facecolor": "red"}):
        second = save_figures(motion(), tmp_path / "second", "run", file_format)
    assert first == (tmp_path / "first" / f"run-motion.{file_format}",)
    content = first[0].read_bytes()
    assert content == second[0].read_bytes()
    assert b"CreationDate" not in content
    assert b"<dc:date>" not in content


def test_a_file_that_exists_is_refused_before_any_is_written(tmp_path: Path) -> None:
    taken = tmp_path / "run-b.png"
    taken.write_text("mine")
    figures = {"a": Figure((1, 1)), "b": Figure((1, 1))}
    with pytest.raises(StorageError, match=r"run-b.png: exists already; .*--overwrite"):
        save_figures(figures, tmp_path, "run")
    assert os.listdir(tmp_path) == [taken.name]
    assert taken.read_text() == "mine"
    save_figures(figures, tmp_path, "run", overwrite=True)
    assert taken.read_bytes().startswith(b"\x89PNG")
    assert sorted(os.listdir(tmp_path)) == ["run-a.png", taken.name]


def test_a_folder_that_is_a_file_is_a_storage_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="file: is a file; name a folder"):
        save_figures({"a": Figure((1, 1))}, tmp_path / "file", "run")


@pytest.mark.slow
def test_a_stored_result_is_drawn(tmp_path: Path) -> None:
    with StoredResult.open(write_result(tmp_path / "run.h5", random_block(5000, 2))) as result:
        figures = plot_stored(result)
        comparison = compare_files([result, result])["compare"]
    assert list(figures) == ["motion", "motor-torque", "elastic-torque", "energy"]
    assert comparison.get_suptitle() == "comparison of 2 results of two: motor torques"
    titles = [axes.get_title(loc="left") for axes in comparison.axes]
    assert titles.count("equal to the first") == len(titles) / 2


@pytest.mark.slow
def test_no_display_is_needed() -> None:
    program = "import sys, vsacli.results.plots; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
