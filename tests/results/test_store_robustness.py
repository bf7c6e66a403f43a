"""Whatever happens while a file is written, its name holds the old complete file, the new one, or nothing."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import stat
import subprocess
from concurrent.futures import ThreadPoolExecutor

import h5py
import pytest
from samples.results import REPORT, PlannedTrajectory, python, random_block, robot, write_result

from vsacli.base.atomic_files import AtomicFile
from vsacli.base.errors import InputError, StorageError
from vsacli.results.store.interrupts import interrupts_deferred
from vsacli.results.store.reader import open_result
from vsacli.results.store.writer import ResultWriter

ENDLESS = """
import sys
from samples.results import PlannedTrajectory, random_block, robot
from vsacli.results.store.writer import ResultWriter

block = random_block(2000, 2)
with ResultWriter("r.h5", robot(), PlannedTrajectory(10**7), overwrite=True) as writer:
    writer.write(block)
    print("writing", flush=True)
    while True:
        writer.write(block)
"""

LIMITED = """
import resource, sys
from samples.results import random_block, write_result
from vsacli.base.errors import StorageError

block = random_block(20_000, 2)
limit = int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
try:
    write_result("r.h5", block, step=5000, overwrite=True)
except StorageError as error:
    print(error)
"""


@pytest.fixture
def block():
    return random_block(50, 2)


@pytest.fixture
def old(tmp_path):
    """The bytes of a file that stands at r.h5."""
    (tmp_path / "r.h5").write_bytes(b"old")
    return b"old"


def test_killed_in_the_middle_of_writing(tmp_path, old):
    process = python(ENDLESS, folder=tmp_path)
    assert process.stdout.readline() == "writing\n"
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
    with open_result(path) as result:
        assert result.samples == 50


# bytes: before the first write, in the layout, in the samples (4 MB), and in what closing the file adds
@pytest.mark.parametrize("limit", [0, 3000, 2_000_000, 4_900_000])
def test_disk_full(tmp_path, old, limit):
    process = python(LIMITED, str(limit), folder=tmp_path)
    output, errors = process.communicate()
    assert (process.returncode, errors) == (0, "")
    assert output == (
        "r.h5: cannot be written: the file would exceed the largest file size allowed here; "
        "nothing was changed there\n"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["r.h5"]
    assert (tmp_path / "r.h5").read_bytes() == old


def test_the_limits_of_the_disk_full_test_are_below_the_size_of_its_file(tmp_path):
    size = write_result(tmp_path / "r.h5", random_block(20_000, 2), step=5000).stat().st_size
    assert size > 4_900_000


def test_a_disk_that_is_too_small_is_refused_before_the_first_step(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10**9, 10**9 - 5000, 5000))
    match = r"r\.h5: needs 684 MB, but the disk has 0 MB left; free some space, or store fewer"
    with (
        pytest.raises(StorageError, match=match),
        ResultWriter(tmp_path / "r.h5", robot(), PlannedTrajectory(10**6)),
    ):
        pytest.fail("the writer was opened")
    assert list(tmp_path.iterdir()) == []


def test_an_exception_of_the_caller_passes_through_and_leaves_nothing(tmp_path, block):
    def run():
        with ResultWriter(tmp_path / "r.h5", robot(), PlannedTrajectory(99)) as writer:
            writer.write(block)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run()
    assert list(tmp_path.iterdir()) == []


def test_leaving_without_finish_leaves_nothing(tmp_path, block):
    with ResultWriter(tmp_path / "r.h5", robot(), PlannedTrajectory(50)) as writer:
        writer.write(block)
    assert list(tmp_path.iterdir()) == []


def test_the_name_is_free_until_finish(tmp_path, block):
    with ResultWriter(tmp_path / "r.h5", robot(), PlannedTrajectory(50)) as writer:
        writer.write(block)
        assert not (tmp_path / "r.h5").exists()
        writer.finish(REPORT)
        assert (tmp_path / "r.h5").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["r.h5"]


def test_an_existing_file_is_refused_before_the_first_step(tmp_path, old):
    writer = ResultWriter(tmp_path / "r.h5", robot(), PlannedTrajectory(50))
    with pytest.raises(StorageError, match=r"r\.h5: exists already; .*--overwrite"), writer:
        pytest.fail("the writer was opened")
    assert (tmp_path / "r.h5").read_bytes() == old


@pytest.mark.usefixtures("old")
def test_an_existing_file_is_replaced_on_request(tmp_path, block):
    with open_result(write_result(tmp_path / "r.h5", block, overwrite=True)) as result:
        assert result.samples == 50
    assert [path.name for path in tmp_path.iterdir()] == ["r.h5"]


@pytest.mark.parametrize("links", [True, False])
def test_a_file_that_appears_during_the_run_is_not_replaced(tmp_path, block, monkeypatch, links):
    if not links:
        monkeypatch.setattr(os, "link", no_links)
    with ResultWriter(tmp_path / "r.h5", robot(), PlannedTrajectory(50)) as writer:
        writer.write(block)
        (tmp_path / "r.h5").write_bytes(b"another run")
        with pytest.raises(StorageError, match="exists already"):
            writer.finish(REPORT)
    assert (tmp_path / "r.h5").read_bytes() == b"another run"
    assert [path.name for path in tmp_path.iterdir()] == ["r.h5"]


def no_links(*_, **__):
    raise PermissionError(1, "Operation not permitted")


def test_file_systems_without_hard_links(tmp_path, block, monkeypatch):
    monkeypatch.setattr(os, "link", no_links)
    with open_result(write_result(tmp_path / "r.h5", block)) as result:
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
    with open_result(tmp_path / "real" / "r.h5") as result:
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
    with pytest.raises(StorageError, match=match), AtomicFile(tmp_path / name, overwrite=True):
        pytest.fail("the file was opened")
    assert [path.name for path in tmp_path.iterdir()] == ["fifo"]


@contextlib.contextmanager
def ordinary_user():
    """Give up the rights of root, to whom no folder is closed."""
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(user)


def test_a_folder_that_may_not_be_written(tmp_path):
    tmp_path.chmod(0o500)
    with (
        ordinary_user(),
        pytest.raises(StorageError, match="cannot be written: no permission to write into this folder"),
        AtomicFile(tmp_path / "r.h5"),
    ):
        pytest.fail("the file was opened")


def foreign(path):
    with h5py.File(path, "w") as file:
        file["data"] = [1]


def newer(path):
    with h5py.File(path, "r+") as file:
        file.attrs["format"] = "vsacli-result/2"


def without_report(path):
    with h5py.File(path, "r+") as file:
        del file["report"]


def truncated(path):
    os.truncate(path, path.stat().st_size // 2)


def missing(path):
    path.unlink()


def folder(path):
    path.unlink()
    path.mkdir()


@pytest.mark.parametrize(
    ("spoil", "match"),
    [
        (missing, "there is no such file; expected a result file"),
        (folder, "is a folder; expected a result file"),
        (lambda path: path.write_bytes(b""), "is empty; expected a result file"),
        (lambda path: path.write_bytes(b"format: x"), "is not an HDF5 file; expected a result file"),
        (foreign, "no result file: it has no attribute format = 'vsacli-result/1'"),
        (newer, "has the format vsacli-result/2, but this version reads vsacli-result/1; run invdyn again"),
        (truncated, r"is damaged or truncated \(.*truncated file.*\); compute it again"),
        (without_report, r"is damaged or truncated \(.*not found.*\); compute it again"),
    ],
)
def test_files_that_are_no_result(tmp_path, block, spoil, match):
    path = write_result(tmp_path / "r.h5", block)
    spoil(path)
    with pytest.raises(InputError, match=r"r\.h5: .*" + match):
        open_result(path)


def test_every_truncation_is_noticed(tmp_path, block):
    whole = write_result(tmp_path / "r.h5", block).read_bytes()
    for size in range(1, len(whole), len(whole) // 40):
        (tmp_path / "part.h5").write_bytes(whole[:size])
        with pytest.raises(InputError, match=r"part\.h5: is"):
            open_result(tmp_path / "part.h5")


def test_a_file_that_may_not_be_read(tmp_path, block):
    path = write_result(tmp_path / "r.h5", block)
    path.chmod(0)
    with ordinary_user(), pytest.raises(StorageError, match="cannot be read: Permission denied"):
        open_result(path)


def test_a_file_that_another_program_is_writing(tmp_path, block):
    path = write_result(tmp_path / "r.h5", block)
    holder = "import h5py; file = h5py.File('r.h5', 'r+'); print('open', flush=True); input()"
    process = python(holder, folder=tmp_path, stdin=subprocess.PIPE)
    try:
        assert process.stdout.readline() == "open\n"
        with pytest.raises(StorageError, match="another program has it open for writing"):
            open_result(path)
    finally:
        process.communicate("\n")


def test_a_variable_that_was_not_stored(tmp_path, block):
    with open_result(write_result(tmp_path / "r.h5", block, variables=["theta"])) as result:
        assert result.variables == ("theta",)
        with pytest.raises(
            InputError, match=r"r\.h5: holds no phi; run invdyn again without --variables, or with phi"
        ):
            result.read("phi")
        with pytest.raises(InputError, match="no variable is called 'thetta'; did you mean 'theta'"):
            result.read("thetta")
