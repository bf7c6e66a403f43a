"""Samples in chunks: whatever the blocks, the file holds what assigning them to its datasets would give."""

from __future__ import annotations

import errno
import threading
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import h5py
import numpy as np
import pytest
from h5py._objects import phil
from samples.marks import slow
from samples.results import (
    REPORT,
    STORED,
    PlannedTrajectory,
    random_block,
    robot,
    write_result,
    writing,
)
from samples.system_errors import fail_with

from vsacli import StorageError
from vsacli.base.outputs import Staged
from vsacli.base.variables import Block
from vsacli.results.store import new_file
from vsacli.results.store.new_file import ChunkFiller, NewFile
from vsacli.results.store.reader import StoredResult

ROWS = 32
"""Samples in a chunk of what two joints with two motors each have, in these tests."""


@pytest.fixture
def small_chunks(chunks: Callable[[int], None]) -> None:
    """Several chunks in a few samples."""
    chunks(ROWS * 2 * 2 * 8)


@pytest.fixture
def write_behind(monkeypatch: pytest.MonkeyPatch) -> Callable[[int, int], None]:
    """Have short files, too, written in a thread, and stored by another; set the bytes that may wait."""

    def wait_for(writing: int, storing: int) -> None:
        for name, size in (("DIRECT_BYTES", 0), ("MAX_PENDING_BYTES", writing), ("SYNC_BYTES", storing)):
            monkeypatch.setattr(new_file, name, size)

    return wait_for


@pytest.fixture
def in_a_thread(write_behind: Callable[[int, int], None]) -> None:
    """Samples are written in a thread."""
    write_behind(5000, 3000)


def threads() -> list[str]:
    return [each.name for each in threading.enumerate() if each.name.startswith("vsacli-")]


NAMES = ["q", "theta", "flags"]


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("samples", [1, 2, ROWS - 1, ROWS, ROWS + 1, 3 * ROWS + 1])
@pytest.mark.parametrize("step", [7, slow(1), slow(ROWS), slow(10**6)])
def test_any_blocks(tmp_path: Path, samples: int, step: int) -> None:
    block = random_block(samples, 2)
    check(write_result(tmp_path / "r.h5", block, step=step, variables=NAMES), block, NAMES)


@pytest.mark.usefixtures("small_chunks", "in_a_thread")
@pytest.mark.parametrize("step", [7, 10**6])
def test_blocks_that_a_thread_writes(tmp_path: Path, step: int) -> None:
    block = random_block(10 * ROWS + 1, 2)
    check(write_result(tmp_path / "r.h5", block, step=step), block, STORED)
    assert not threads()


def check(path: Path, block: Block, names: Iterable[str]) -> None:
    """The chunks hold the block."""
    with h5py.File(path) as file:
        for name in names:
            np.testing.assert_array_equal(file[name][...], getattr(block, name), strict=True)
            assert file[name].chunks[0] <= 8 * ROWS  # two bytes a joint


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("written", [1, ROWS - 1, ROWS, slow(ROWS + 1), 2 * ROWS + 5])
@pytest.mark.parametrize("behind", [False, slow(True)])
def test_a_run_that_ends_early(
    tmp_path: Path, request: pytest.FixtureRequest, written: int, behind: bool
) -> None:
    if behind:
        request.getfixturevalue("in_a_thread")
    block = random_block(written, 2)
    path = write_result(tmp_path / "r.h5", block, step=20, planned=10 * ROWS, variables=NAMES)
    with StoredResult.open(path) as result:
        assert result.samples == written
        for name in result.variables:
            np.testing.assert_array_equal(result.read(name), getattr(block, name), strict=True)


@pytest.mark.cases(1)
@pytest.mark.parametrize("samples", [slow(33), slow(704)])
def test_a_thousand_joints(tmp_path: Path, samples: int) -> None:
    block = random_block(samples, 1000)
    names = ["q", "tau_motor", "flags"]
    path = write_result(tmp_path / "r.h5", block, "R" * 1000, step=327, variables=names)
    with h5py.File(path) as file:
        for name in names:
            np.testing.assert_array_equal(file[name][...], getattr(block, name), strict=True)
        assert file["tau_motor"].chunks == (17 if samples == 33 else 32, 1000, 2)  # 16 kB a row


def test_all_chunks_are_about_equally_full(tmp_path: Path) -> None:
    rows = new_file.CHUNK_BYTES // (2 * 2 * 8)
    one_more = write_result(tmp_path / "r.h5", random_block(rows + 1, 2), variables=["phi"], step=rows)
    assert one_more.stat().st_size < 1.3 * (rows + 1) * (8 + 2 * 2 * 8)  # 2 if the second chunk were as large


@pytest.mark.parametrize("flags", [np.zeros((100, 3), "<u4"), np.arange(300, dtype="<u4").reshape(100, 3)])
def test_compressed_chunks_are_those_of_the_library(tmp_path: Path, flags: np.ndarray) -> None:
    kind = {"shape": flags.shape, "dtype": flags.dtype, "chunks": (40, 3), "compression": 4}
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file.create_dataset("theirs", **kind)[...] = flags
        filler = ChunkFiller(file.create_dataset("ours", **kind), lambda task, _: task())
        filler.append(flags)
        filler.finish()
        np.testing.assert_array_equal(file["ours"][...], flags)
        for start in (0, 40, 80):
            ours, theirs = (file[name].id.read_direct_chunk((start, 0)) for name in ("ours", "theirs"))
            assert ours == theirs


def test_no_other_thread_uses_hdf5_while_a_chunk_is_written() -> None:
    free: list[bool] = []

    def try_lock() -> None:
        free.append(phil.acquire(False))
        if free[-1]:
            phil.release()

    def write_direct_chunk(_start: tuple[int, ...], _values: np.ndarray) -> None:
        other = threading.Thread(target=try_lock)
        other.start()
        other.join()

    low_level = SimpleNamespace(write_direct_chunk=write_direct_chunk)
    dataset = SimpleNamespace(id=low_level, chunks=(4,), dtype="f8", compression_opts=None)
    ChunkFiller(cast(h5py.Dataset, dataset), lambda task, _: task()).append(np.ones(4))
    assert free == [False]


@pytest.mark.usefixtures("small_chunks", "in_a_thread")
def test_a_block_may_change_once_it_is_written(tmp_path: Path) -> None:
    block = random_block(3 * ROWS, 2)
    theta = block.theta.copy()
    with writing(tmp_path / "r.h5", robot(), PlannedTrajectory(3 * ROWS)) as writer:
        writer.write(block)
        block.theta[...] = 0
        writer.finish(REPORT)
    with StoredResult.open(tmp_path / "r.h5") as result:
        np.testing.assert_array_equal(result.read("theta"), theta)


@pytest.mark.usefixtures("small_chunks", "in_a_thread")
def test_an_exception_of_the_caller_ends_the_thread(tmp_path: Path) -> None:
    def run() -> None:
        with writing(tmp_path / "r.h5", robot(), PlannedTrajectory(10**5)) as writer:
            writer.write(random_block(3 * ROWS, 2))
            assert threads()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run()
    assert not threads()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("small_chunks", "in_a_thread")
def test_a_disk_that_fails_meanwhile(tmp_path: Path, before_system_call: Any) -> None:
    """Whatever the disk says to the thread is said of the file, which gets no name."""
    in_thread = fail_with(errno.EIO, lambda _: threading.current_thread().name == "vsacli-syncing")
    before_system_call("fsync", in_thread)
    with pytest.raises(StorageError, match=r"r\.h5.*Input/output error"):
        write_result(tmp_path / "r.h5", random_block(10 * ROWS, 2))
    assert list(tmp_path.iterdir()) == []
    assert not threads()


@pytest.fixture
def behind(write_behind: Callable[[int, int], None], tmp_path: Path) -> Iterator[NewFile]:
    """A file all of whose tasks are done in a thread; 10 bytes may wait."""
    write_behind(10, new_file.SYNC_BYTES)
    file = NewFile(Staged.unnamed(tmp_path / "r.h5"))
    yield file
    file.discard()
    assert not threads()


def test_what_waits_is_bounded(behind: NewFile) -> None:
    """Nothing is done before `go`, and the caller waits once more than 10 bytes wait."""
    go, done = threading.Event(), []

    def task(number: int):
        return lambda: (go.wait(), done.append(number))

    for number in range(5):
        behind.schedule_write(task(number), 2)
    timer = threading.Timer(0.05, lambda: (done.append("go"), go.set()))
    timer.start()
    behind.schedule_write(task(5), 2)
    assert done[:2] == ["go", 0]
    behind.wait()
    assert done == ["go", 0, 1, 2, 3, 4, 5]


def test_what_goes_wrong_in_the_thread_is_raised_once_by_the_caller(behind: NewFile) -> None:
    done = []
    behind.schedule_write(lambda: 1 / 0, 5)
    behind.schedule_write(lambda: done.append(1), 5)
    with pytest.raises(ZeroDivisionError):
        behind.wait()
