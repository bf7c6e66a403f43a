"""Studies in several processes, and what a kill costs."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from itertools import islice
from pathlib import Path
from typing import NoReturn

import pytest
from samples.studies import DRAWN, GRID, content, study

from vsacli import run_study
from vsacli.studies.sweeps.executors import Processes
from vsacli.studies.sweeps.journal import Journal
from vsacli.studies.sweeps.rows import Computer, lost
from vsacli.studies.sweeps.run_study import gather
from vsacli.studies.sweeps.study import load_study

COMMAND = (sys.executable, "-m", "vsacli", "study", "study.yaml")


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *arguments], cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_the_table_is_the_same_for_any_number_of_processes(tmp_path: Path) -> None:
    study(tmp_path, DRAWN)
    for count in (1, 2):
        assert run(tmp_path, "--processes", f"{count}", "-o", f"{count}.h5").returncode == 0
    assert content(tmp_path / "1.h5") == content(tmp_path / "2.h5")


def test_an_interruption_before_any_run_is_finished_is_said(tmp_path: Path) -> None:
    def interrupted(_total: int) -> NoReturn:
        raise KeyboardInterrupt

    said: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        run_study(study(tmp_path, GRID), tmp_path / "t.h5", progress=interrupted, tell=said.append)
    assert re.fullmatch(
        r"no run had finished, so none is kept; they are computed up to \d+ at a time", said[-1]
    )
    assert not list(tmp_path.glob("t.h5*"))


@pytest.mark.slow
def test_a_worker_that_is_killed_again_costs_its_run(tmp_path: Path) -> None:
    """The runs of a lost batch are computed again, one by one; the row of one that is lost then says so."""
    found = load_study(study(tmp_path, GRID))
    with Processes(found, 1) as workers:
        rows = workers.rows(range(6))
        computed = [next(rows), next(rows)]
        for following in (1, 0):
            os.kill(workers.workers[0].process.pid or 0, signal.SIGKILL)
            computed += islice(rows, following)
        computed += rows
    assert [row.error for row in computed if row.lost] == [
        "the process that computed it was ended by SIGKILL"
    ]
    values = {row.run: row.values.tobytes() for row in Computer(found).rows(range(6))}
    assert sorted(row.run for row in computed) == list(range(6))
    assert all(values[row.run] == row.values.tobytes() for row in computed if not row.error)


def test_rows_that_were_lost_are_tried_again(tmp_path: Path) -> None:
    found = load_study(study(tmp_path, GRID))
    rows = [*Computer(found).rows([0]), lost(found, 1, "was ended by SIGKILL")]
    with Journal(tmp_path / "rows.journal") as journal:
        assert gather(rows, journal, lambda _: None) == {1: rows[1]}
        assert rows[0].key in journal
        assert rows[1].key not in journal


@pytest.mark.slow
def test_a_study_that_is_killed_goes_on_to_the_same_table(tmp_path: Path) -> None:
    """Twice, at any moment, with all its processes."""
    study(tmp_path, DRAWN.replace("samples: 6", "samples: 20"))
    assert run(tmp_path, "-o", "whole.h5", "--processes", "1").returncode == 0
    journal, kept = tmp_path / "study.h5.journal", 0
    for _ in range(2):
        started = subprocess.Popen([*COMMAND, "--processes", "2"], cwd=tmp_path, start_new_session=True)
        while not (journal.exists() and journal.read_bytes().count(b"\n") >= kept + 4):
            time.sleep(0.01)
        os.killpg(started.pid, signal.SIGKILL)
        started.wait()
        kept = journal.read_bytes().count(b"\n") - 1  # the first line is no row
        assert not (tmp_path / "study.h5").exists()
    done = run(tmp_path)
    assert f"{kept} of 20 runs are in {journal.name} already" in done.stderr
    assert done.returncode == 0
    assert content(tmp_path / "study.h5") == content(tmp_path / "whole.h5")
    assert sorted(path.name for path in tmp_path.glob(".*")) == []
