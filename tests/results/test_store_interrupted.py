"""A writer that is killed or interrupted, or whose disk is full, leaves the old file as it was."""

from __future__ import annotations

import contextlib
import signal
import subprocess
from concurrent.futures import ThreadPoolExecutor

import pytest
from samples.results import PlannedTrajectory, python, random_block, robot, write_result, writing

from vsacli import StorageError
from vsacli.base.interrupts import interrupts_deferred
from vsacli.results.store.reader import StoredResult

ENDLESS = """
import threading
from samples.results import PlannedTrajectory, random_block, robot, writing

from vsacli.results.store import new_file

new_file.DIRECT_BYTES = 2**20
block = random_block(2000, 2)
with writing("r.h5", robot(), PlannedTrajectory(10**7), overwrite=True) as writer:
    while threading.active_count() == 1:
        writer.write(block)
    print("writing", flush=True)
    while True:
        writer.write(block)
"""

LIMITED = """
import resource, sys
from samples.results import random_block, write_result
from vsacli import StorageError
from vsacli.base.interrupts import interrupts_deferred

from vsacli.results.store import new_file

block = random_block(20_000, 2)
limit, new_file.DIRECT_BYTES = map(int, sys.argv[1:])
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
try:
    write_result("r.h5", block, step=5000, overwrite=True)
except StorageError as error:
    print(error)
"""


def test_killed_in_the_middle_of_writing(tmp_path, old):
    process = python(ENDLESS, folder=tmp_path)
    assert process.stdout.readline() == "writing\n", process.communicate()[1]
    process.kill()
    process.communicate()
    assert (tmp_path / "r.h5").read_bytes() == old
    hidden = set(tmp_path.iterdir()) - {tmp_path / "r.h5"}
    assert all(path.name.startswith(".vsacli-") for path in hidden)


def interrupt(process, delay):
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(timeout=delay)
    process.send_signal(signal.SIGINT)


# several delays, because a signal may arrive inside HDF5, inside Python, or between
@pytest.mark.cases(2)
@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.0, 0.013, 0.031])
def test_interrupted_in_the_middle_of_writing(tmp_path, old, delay):
    process = python(ENDLESS, folder=tmp_path)
    assert process.stdout.readline() == "writing\n"
    interrupt(process, delay)
    _, errors = process.communicate()
    assert process.returncode == -signal.SIGINT  # as Python ends after an uncaught KeyboardInterrupt
    assert errors.rstrip().endswith("KeyboardInterrupt")
    assert "ignored" not in errors
    assert [path.name for path in tmp_path.iterdir()] == ["r.h5"]
    assert (tmp_path / "r.h5").read_bytes() == old


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.0, 0.002])
def test_interrupted_by_an_impatient_user(tmp_path, old, delay):
    process = python(ENDLESS, folder=tmp_path)
    assert process.stdout.readline() == "writing\n"
    interrupt(process, 0)
    interrupt(process, delay)
    process.communicate(timeout=60)  # would hang, or end by SIGSEGV, if HDF5 were interrupted while it closes
    assert process.returncode in (-signal.SIGINT, 1)  # 1 if the second one struck as Python was going down
    assert (tmp_path / "r.h5").read_bytes() == old
    hidden = set(tmp_path.iterdir()) - {tmp_path / "r.h5"}  # if the second one struck before the cleaning up
    assert all(path.name.startswith(".vsacli-") for path in hidden)


def test_an_interrupt_takes_effect_after_the_deferring_statements():
    done = []

    def work():
        with interrupts_deferred():
            signal.raise_signal(signal.SIGINT)
            done.append("all of it")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == ["all of it"]


def test_a_writer_works_in_any_thread(tmp_path, block):
    with ThreadPoolExecutor(1) as threads:
        path = threads.submit(write_result, tmp_path / "r.h5", block).result()
    with StoredResult.open(path) as result:
        assert result.samples == 50


# bytes: before the first write, in the layout, in the samples (4 MB), and in what closing the file adds
@pytest.mark.cases(3)
@pytest.mark.slow
@pytest.mark.parametrize("limit", [0, 3000, 2_000_000, 4_900_000])
@pytest.mark.parametrize("behind_from", [2**30, 2**20])
def test_disk_full(tmp_path, old, limit, behind_from):
    process = python(LIMITED, str(limit), str(behind_from), folder=tmp_path)
    output, errors = process.communicate()
    assert (process.returncode, errors) == (0, "")
    assert output == ("r.h5: cannot be written: the file would exceed the largest file size allowed here\n")
    assert [path.name for path in tmp_path.iterdir()] == ["r.h5"]
    assert (tmp_path / "r.h5").read_bytes() == old


def test_the_limits_of_the_disk_full_test_are_below_the_size_of_its_file(tmp_path):
    size = write_result(tmp_path / "r.h5", random_block(20_000, 2), step=5000).stat().st_size
    assert size > 4_900_000


def test_a_disk_that_is_too_small_is_refused_before_the_first_step(tmp_path):
    match = r"r\.h5: needs 11360000\d+ MB, but the disk has \d+ MB left; free some space, or store fewer"
    with (
        pytest.raises(StorageError, match=match),
        writing(tmp_path / "r.h5", robot(), PlannedTrajectory(10**12)),
    ):
        pytest.fail("the writer was opened")
    assert list(tmp_path.iterdir()) == []
