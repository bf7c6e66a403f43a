"""The name that a result gets: free until the file is whole, never that of another run."""

from __future__ import annotations

import os
import stat

import pytest
from samples.results import (
    REPORT,
    PlannedTrajectory,
    ordinary_user,
    robot,
    write_result,
    writing,
)

from vsacli import StorageError
from vsacli.base.outputs import Outputs
from vsacli.results.store.reader import StoredResult


def test_an_exception_of_the_caller_passes_through_and_leaves_nothing(tmp_path, block):
    def run():
        with writing(tmp_path / "r.h5", robot(), PlannedTrajectory(99)) as writer:
            writer.write(block)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run()
    assert list(tmp_path.iterdir()) == []


def test_leaving_without_finish_leaves_nothing(tmp_path, block):
    def run():
        with writing(tmp_path / "r.h5", robot(), PlannedTrajectory(50)) as writer:
            writer.write(block)

    with pytest.raises(RuntimeError, match="without `finish`"):
        run()
    assert list(tmp_path.iterdir()) == []


def test_the_name_is_free_until_the_file_is_finished(tmp_path, block):
    with writing(tmp_path / "r.h5", robot(), PlannedTrajectory(50)) as writer:
        writer.write(block)
        writer.finish(REPORT)
        assert not (tmp_path / "r.h5").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["r.h5"]


def test_an_existing_file_is_refused_before_the_first_step(tmp_path, old):
    writer = writing(tmp_path / "r.h5", robot(), PlannedTrajectory(50))
    with pytest.raises(StorageError, match=r"r\.h5: exists already; .*--overwrite"), writer:
        pytest.fail("the writer was opened")
    assert (tmp_path / "r.h5").read_bytes() == old


def test_the_whole_file_is_on_the_disk_before_it_has_its_name(tmp_path, block, before_system_call):
    path, synced = tmp_path / "r.h5", []
    before_system_call("fsync", lambda file: synced.append((os.fstat(file).st_size, path.exists())))
    write_result(path, block)
    assert synced[0] == (path.stat().st_size, False)


@pytest.mark.usefixtures("old")
def test_an_existing_file_is_replaced_on_request(tmp_path, block):
    with StoredResult.open(write_result(tmp_path / "r.h5", block, overwrite=True)) as result:
        assert result.samples == 50
    assert [path.name for path in tmp_path.iterdir()] == ["r.h5"]


@pytest.mark.usefixtures("links")
def test_a_file_that_appears_during_the_run_is_not_replaced(tmp_path, block):
    def run():
        with writing(tmp_path / "r.h5", robot(), PlannedTrajectory(50)) as writer:
            writer.write(block)
            writer.finish(REPORT)
            (tmp_path / "r.h5").write_bytes(b"another run")

    with pytest.raises(StorageError, match="exists already"):
        run()
    assert (tmp_path / "r.h5").read_bytes() == b"another run"
    assert [path.name for path in tmp_path.iterdir()] == ["r.h5"]


@pytest.mark.usefixtures("no_hard_links")
def test_file_systems_without_hard_links(tmp_path, block):
    with StoredResult.open(write_result(tmp_path / "r.h5", block)) as result:
        assert result.samples == 50


def test_the_file_obeys_the_umask(tmp_path, block):
    before = os.umask(0o027)
    try:
        path = write_result(tmp_path / "r.h5", block)
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_link_goes_on_pointing_to_the_file(tmp_path, block):
    (tmp_path / "real").mkdir()
    (tmp_path / "real" / "r.h5").write_bytes(b"old")
    (tmp_path / "link.h5").symlink_to("real/r.h5")
    write_result(tmp_path / "link.h5", block, overwrite=True)
    assert (tmp_path / "link.h5").is_symlink()
    with StoredResult.open(tmp_path / "real" / "r.h5") as result:
        assert result.samples == 50


@pytest.mark.parametrize(
    ("name", "match"),
    [
        ("", "is a folder; give the name of a file"),
        ("missing/r.h5", r"there is no folder .*missing; create it"),
        ("fifo", "is not a regular file and cannot be replaced"),
        ("x" * 300, "cannot be written: the file name is too long"),
    ],
)
def test_targets_that_cannot_be(tmp_path, name, match):
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(StorageError, match=match), Outputs(overwrite=True) as outputs:
        outputs.file(tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == ["fifo"]


def test_a_folder_that_may_not_be_written(tmp_path):
    tmp_path.chmod(0o500)
    with (
        ordinary_user(),
        pytest.raises(StorageError, match="cannot be written: no permission to write into this folder"),
        Outputs() as outputs,
    ):
        outputs.file(tmp_path / "r.h5")
