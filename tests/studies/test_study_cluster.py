"""Studies on a Dask cluster: scheduler and workers in processes of their own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
from samples.studies import DRAWN, GRID, content, study

from vsacli.studies.sweeps.rows import Computer, Job, answer
from vsacli.studies.sweeps.study import load_study

MANY = DRAWN.replace("samples: 6", "samples: 30")
PATIENCE = 60.0
"""Seconds that a scheduler or a worker may take to begin on a machine that is busy."""


class Cluster:
    """A scheduler and workers of one thread, at another place than the study."""

    def __init__(self, folder: Path, opened: ExitStack) -> None:
        self._folder, self._opened = folder, opened
        file = folder / "scheduler.json"
        options = ("--port", "0", "--host", "127.0.0.1", "--scheduler-file", str(file))
        self.scheduler = self._started(
            "scheduler", *options, DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="0"
        )
        until(file.exists)
        until(lambda: file.read_text().endswith("}"))
        self.address = str(json.loads(file.read_text())["address"])

    def worker(self, preload: str = "") -> subprocess.Popen[bytes]:
        """A worker that runs some lines first; without a nanny it is the process that computes."""
        (self._folder / "preload.py").write_text(preload)
        options = ("--nthreads", "1", "--no-nanny", "--preload", str(self._folder / "preload.py"))
        return self._started("worker", self.address, *options)

    def _started(self, what: str, *options: str, **environment: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", "--no-dashboard", *options]
        process = subprocess.Popen(
            command, cwd=self._folder, env=os.environ | environment, stderr=subprocess.DEVNULL
        )
        self._opened.callback(process.wait)
        self._opened.callback(process.kill)
        return process


@contextmanager
def cluster(folder: Path) -> Iterator[Cluster]:
    pytest.importorskip("distributed")
    folder.mkdir(exist_ok=True)
    with ExitStack() as opened:
        yield Cluster(folder, opened)


def until(done: Any) -> None:
    end = time.monotonic() + PATIENCE
    while not done():
        assert time.monotonic() < end
        time.sleep(0.02)


def started(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "vsacli", "study", "study.yaml", *arguments]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code, and what it said."""
    said = process.communicate(timeout=PATIENCE)[1]
    return process.returncode, said


@pytest.mark.slow
def test_workers_compute_the_rows_of_one_process(tmp_path: Path) -> None:
    """Those of a cluster and of a local one; also where runs fail, and when a worker is killed."""
    failing = MANY + "  joints.elbow.link.mass: {normal: 60 %}\n"
    study(tmp_path, failing)
    assert ended(started(tmp_path, "--processes", "1", "-o", "alone.h5"))[0] == 3
    assert ended(started(tmp_path, "--dask", "local", "--processes", "2", "-o", "local.h5"))[0] == 3
    assert content(tmp_path / "local.h5") == content(tmp_path / "alone.h5")
    with cluster(tmp_path / "elsewhere") as dask:
        killed, journal = dask.worker(), tmp_path / "study.h5.journal"
        running = started(tmp_path, "--dask", dask.address)
        until(lambda: journal.exists() and journal.read_bytes().count(b"\n") >= 3)
        dask.worker()
        killed.kill()
        code, said = ended(running)
    assert (code, "wrote study.h5" in said) == (3, True), said
    lost = [line for line in said.splitlines() if "lost with their processes" in line]
    if not lost:  # it was between two tasks
        assert content(tmp_path / "study.h5") == content(tmp_path / "alone.h5")


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize("ending", ["interrupt", "scheduler"])
def test_what_ends_it_costs_no_finished_row(tmp_path: Path, ending: str) -> None:
    study(tmp_path, MANY)
    journal = tmp_path / "study.h5.journal"
    with cluster(tmp_path / "elsewhere") as dask:
        dask.worker()
        running = started(tmp_path, "--dask", dask.address)
        until(lambda: journal.exists() and journal.read_bytes().count(b"\n") >= 3)
        if ending == "interrupt":
            running.send_signal(signal.SIGINT)
        else:
            dask.scheduler.kill()
        code, said = ended(running)
    sentence = {
        "interrupt": "interrupted",
        "scheduler": f"the connection to the scheduler {dask.address} was lost",
    }[ending]
    assert (code, said.splitlines()[-1]) == ({"interrupt": 130, "scheduler": 2}[ending], sentence)
    kept = journal.read_bytes().count(b"\n") - 1  # the first line is no row
    assert f"{kept} finished runs are kept in {journal.name}" in said
    assert f"{kept} of 30 runs are in {journal.name} already" in ended(started(tmp_path))[1]


LACKING = """
import sys
class Lacking:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "vsacli":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Lacking())
"""


@pytest.mark.cases(1)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("preload", "message"),
    [
        (LACKING, "all its workers need vsacli "),
        (
            "from vsacli.base import version\nversion.__version__ = '0.0'\n",
            "other rows would be computed here: vsacli is 0.0 instead of ",
        ),
        (
            "from vsacli.studies.sweeps.rows import Computer\nimport os\n"
            "Computer.rows = lambda *_: os._exit(1)\n",
            "runs lost with their processes: 6",
        ),
    ],
)
def test_workers_that_cannot_compute(tmp_path: Path, preload: str, message: str) -> None:
    study(tmp_path, GRID)
    with cluster(tmp_path / "elsewhere") as dask:
        workers = [dask.worker(preload) for _ in range(8 if "_exit" in preload else 1)]
        code, said = ended(started(tmp_path, "--dask", dask.address))
    assert (code, message in said) == (3 if "_exit" in preload else 2, True), (said, workers)


def test_a_worker_reads_the_study_again(tmp_path: Path) -> None:
    """Its rows are those of anybody else; it says why it cannot compute what it was asked for."""
    found = load_study(study(tmp_path, GRID))
    job = Job.of(found)
    rows = answer(job, [4, 1]).rows
    assert [row.values.tobytes() for row in rows] == [
        row.values.tobytes() for run in (4, 1) for row in Computer(found).rows([run])
    ]
    other = dict(job.computed_by) | {"NumPy": "1.0", "the C compiler": "gcc 2"}
    strange = answer(job._replace(computed_by=tuple(other.items())), [0]).problems[0]
    assert "other rows would be computed here: NumPy is " in strange.message
    assert strange.message.endswith("instead of 1.0, the C compiler is missing instead of gcc 2")
    absent = answer(job._replace(path=str(tmp_path / "nowhere" / "study.yaml")), [0]).problems[0]
    assert absent.message.startswith("no such file; there is no folder")
    (tmp_path / "study.yaml").write_text((tmp_path / "study.yaml").read_text().replace("1275", "1276"))
    edited = answer(Job.of(found), [0]).problems  # one that this worker has read
    assert not edited
    edited = answer(Job.of(found)._replace(fingerprint="of a study that it has not"), [0]).problems
    assert edited[0].message.startswith("a file of the study is another one here, or was changed meanwhile")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("address", "message"),
    [
        (
            "nonsense",
            "expected the address of a scheduler such as tcp://host:8786, or local, found 'nonsense'\n",
        ),
        ("", "is empty"),
    ],
)
def test_addresses_that_are_none(vsacli: Any, own_folder: Path, address: str, message: str) -> None:
    pytest.importorskip("distributed")
    study(own_folder, GRID)
    refused = vsacli("study", "study.yaml", "--dask", address)
    assert (refused.code, message in refused.err) == (2, True), refused.err
    assert "finished runs" not in refused.err
    assert not list(own_folder.glob("*.h5*"))


def test_without_dask_the_sentence_says_what_to_install(
    vsacli: Any, own_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    study(own_folder, GRID)
    refused = vsacli("study", "study.yaml", "--dask", "local")
    assert (refused.code, "pip install 'vsacli[dask]' gets it" in refused.err) == (2, True)
    both = vsacli("study", "study.yaml", "--dask", "tcp://host:8786", "--processes", "2")
    assert "--processes cannot be used with --dask ADDRESS" in both.err
