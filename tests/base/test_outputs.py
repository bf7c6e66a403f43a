"""What a command writes appears under its names all at once, or not at all."""

from __future__ import annotations

import errno
import os
import signal
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from samples.system_errors import fail_with

from vsacli import InputError, StorageError
from vsacli.base import storage
from vsacli.base.interrupts import ENDING_SIGNALS, Interrupted, unwinding_when_ended
from vsacli.base.outputs import Outputs, Staged
from vsacli.base.storage import reporting_storage_errors, temporary_folder


def contents(folder: Path) -> dict[str, str]:
    """Files by name, hidden ones too."""
    return {
        str(path.relative_to(folder)): path.read_text(encoding="utf-8")
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A folder with two of the three files that `write` writes."""
    for name in ("a", "b"):
        (tmp_path / name).write_text(f"old {name}", encoding="utf-8")
    return tmp_path


def write(folder: Path, **options: object) -> None:
    with Outputs(**options) as outputs:
        for name in ("a", "b", "c"):
            outputs.file(folder / name).write_text(f"new {name}")
        outputs.folder(folder / "further" / "below")
        outputs.file(folder / "further" / "below" / "d").write_text("new d")


def test_all_files_are_written(project: Path) -> None:
    write(project, overwrite=True)
    assert contents(project) == {"a": "new a", "b": "new b", "c": "new c", "further/below/d": "new d"}


def test_nothing_is_written_if_one_file_exists(project: Path) -> None:
    before = contents(project)
    with pytest.raises(StorageError, match="a: exists already"):
        write(project)
    assert contents(project) == before
    assert not (project / "further").exists()


@pytest.mark.parametrize("call", ["replace", "link", "rename", "fsync"])
@pytest.mark.parametrize("which", range(6))
def test_nothing_is_written_if_any_step_fails(
    project: Path, before_system_call: Any, call: str, which: int, links: bool
) -> None:
    """Whichever of the system's calls reports an error: all files are the old ones, or all the new."""
    before, numbers = contents(project), iter(range(1000))
    if links or call != "link":
        before_system_call(call, fail_with(errno.EIO, lambda *_: next(numbers) == which))
    message = ""
    try:
        write(project, overwrite=True)
    except StorageError as error:
        message = str(error)
    if message:
        assert "cannot be written: " in message
        assert contents(project) == before
        assert not (project / "further").exists()
    else:
        assert contents(project) == {"a": "new a", "b": "new b", "c": "new c", "further/below/d": "new d"}


def test_an_exception_of_the_caller_leaves_nothing(project: Path) -> None:
    before = contents(project)

    def run() -> None:
        with Outputs(overwrite=True) as outputs:
            outputs.file(project / "a").write_text("new a")
            outputs.folder(project / "new")
            outputs.file(project / "new" / "d")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run()
    assert contents(project) == before
    assert not (project / "new").exists()


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664, 0o755])
@pytest.mark.usefixtures("links")
def test_a_file_that_is_replaced_keeps_its_mode(project: Path, mode: int) -> None:
    (project / "a").chmod(mode)
    write(project, overwrite=True)
    assert (project / "a").read_text() == "new a"
    assert stat.S_IMODE((project / "a").stat().st_mode) == mode


@pytest.mark.parametrize("refused", [None, "group", "both"])
def test_a_file_that_is_replaced_keeps_its_owner_where_that_is_permitted(
    project: Path, monkeypatch: pytest.MonkeyPatch, refused: str | None
) -> None:
    """A group that is refused gets no rights that others have not: its members were not asked."""
    genuine, asked = Path.stat, []

    def foreign(path: Path, **options: bool) -> os.stat_result:
        found = genuine(path, **options)
        changes = {4: found.st_uid + 1, 5: found.st_gid + 1} if path.name == "a" else {}
        return os.stat_result([changes.get(place, value) for place, value in enumerate(found)])

    def chown(_path: Path, user: int, group: int) -> None:
        asked.append((user, group))
        if refused == "both" or (refused == "group" and group != -1):
            raise PermissionError(errno.EPERM, "Operation not permitted")

    (project / "a").chmod(0o674)
    owner = genuine(project / "a")
    with monkeypatch.context() as patch:
        patch.setattr(Path, "stat", foreign)
        patch.setattr(os, "chown", chown)
        write(project, overwrite=True)
    assert asked == [(-1, owner.st_gid + 1), (owner.st_uid + 1, -1)]
    assert stat.S_IMODE((project / "a").stat().st_mode) == (0o674 if refused is None else 0o644)


def test_a_file_of_several_names_is_not_replaced(project: Path) -> None:
    os.link(project / "a", project / "same")
    before = contents(project)
    with pytest.raises(StorageError, match=r"a: has 2 names \(hard links\), of which only this one would"):
        write(project, overwrite=True)
    assert contents(project) == before


def test_a_name_that_a_killed_run_gave_is_no_further_one(project: Path) -> None:
    """It keeps the old file under a second name while the new one gets the first."""
    script = "from vsacli.base.storage import staging_name; print(staging_name())"
    dead = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    os.link(project / "a", project / dead.stdout.strip())
    write(project, overwrite=True)
    assert contents(project) == {"a": "new a", "b": "new b", "c": "new c", "further/below/d": "new d"}


def test_inputs_are_never_replaced(project: Path) -> None:
    (project / "link").symlink_to("a")
    with (
        pytest.raises(
            InputError, match="link: is an input of this command; choose another name for the output"
        ),
        Outputs(overwrite=True, inputs=[project / "a"]) as outputs,
    ):
        outputs.file(project / "link")


def test_two_files_of_one_name_are_refused(project: Path) -> None:
    with Outputs() as outputs:
        outputs.file(project / "c")
        with pytest.raises(InputError, match="c: would be written twice"):
            outputs.file(project / "c")


def test_a_folder_where_a_file_stands_is_refused(project: Path) -> None:
    with pytest.raises(StorageError, match="a: is a file; name a folder"), Outputs() as outputs:
        outputs.folder(project / "a")


@pytest.mark.parametrize("overwrite", [False, True])
def test_content_is_on_the_disk_before_the_file_has_its_name(
    tmp_path: Path, before_system_call: Any, overwrite: bool
) -> None:
    target, synced = tmp_path / "r.txt", []

    def sync(descriptor: int) -> None:
        status = os.fstat(descriptor)
        synced.append(("folder" if stat.S_ISDIR(status.st_mode) else status.st_size, target.exists()))

    before_system_call("fsync", sync)
    with Outputs(overwrite=overwrite) as outputs:
        outputs.file(target).write_text("content")
    assert synced == [(len("content"), False), ("folder", True)]


def test_the_leavings_of_dead_processes_are_swept_and_no_others(tmp_path: Path) -> None:
    script = "from vsacli.base.storage import staging_name; print(staging_name())"
    dead = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    left = dead.stdout.strip()
    living = storage.staging_name()
    elsewhere = left.replace(left.split("-")[1], "0" * 12)
    used_again = "-".join([*living.split("-")[:3], "1", living.split("-")[4]])
    strange = [".vsacli-1.tmp", "vsacli.tmp", left + "x"]
    for name in (left, living, elsewhere, used_again, *strange):
        (tmp_path / name).write_text("half", encoding="utf-8")
    (tmp_path / left.replace(left[-20:-4], "0" * 16)).mkdir()
    owners = {each.path.name: each.owner for each in storage.unfinished(tmp_path)}
    assert owners[left] is storage.Owner.ENDED
    assert owners[living] is storage.Owner.RUNNING
    assert owners[elsewhere] is storage.Owner.ELSEWHERE
    assert len(owners) == 5
    with Outputs() as outputs:
        outputs.file(tmp_path / "a")
    kept = {living, elsewhere, *strange, "a"}
    if storage._process_start(os.getpid()) == storage.UNKNOWN_START:
        kept.add(used_again)  # a system that does not say when a process began
    assert {path.name for path in tmp_path.iterdir()} == kept


def fail(path: Path) -> None:
    """Report a full disk as one that a file is written to."""
    with reporting_storage_errors(path):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_full_folder_for_temporary_files_is_named_itself() -> None:
    match = "^folder for temporary files: cannot be used: the disk is full; name another one by .* TMPDIR$"
    with pytest.raises(StorageError, match=match), temporary_folder() as place:
        fail(Staged.unnamed(place / "result.h5").path)
    assert not place.exists()


def test_what_fails_elsewhere_is_not_the_fault_of_temporary_files(tmp_path: Path) -> None:
    match = r"r\.h5: cannot be written: the disk is full"
    with pytest.raises(StorageError, match=match), temporary_folder():
        fail(tmp_path / "r.h5")


def test_temporary_folders_of_killed_processes_are_removed(tmp_path: Path, temporary_files: Any) -> None:
    temporary_files(tmp_path)
    script = (
        "import os; from vsacli.base.storage import temporary_folder;"
        "context = temporary_folder(); print(context.__enter__()); os.kill(os.getpid(), 9)"
    )
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    subprocess.run([sys.executable, "-c", script], env=environment, check=False, capture_output=True)
    (left,) = tmp_path.iterdir()
    assert stat.S_IMODE(left.stat().st_mode) == 0o700
    (tmp_path / "elsewhere").mkdir()
    link = tmp_path / left.name.replace(left.name[-20:-4], "0" * 16)
    link.symlink_to("elsewhere")
    with temporary_folder() as place:
        assert set(tmp_path.iterdir()) == {place, tmp_path / "elsewhere"}


@pytest.mark.usefixtures("own_signals")
def test_a_signal_while_files_get_their_names_comes_too_late(tmp_path: Path, before_system_call: Any) -> None:
    """It would say that nothing was written; one before them is in time."""
    before_system_call("link", lambda *_: signal.raise_signal(signal.SIGTERM))
    with unwinding_when_ended():
        with pytest.raises(Interrupted):
            write_until_ended(tmp_path / "a")
        assert not list(tmp_path.iterdir())
        with Outputs() as outputs:
            outputs.file(tmp_path / "a").write_text("whole")
        signal.raise_signal(signal.SIGTERM)
    signal.raise_signal(signal.SIGTERM)
    assert contents(tmp_path) == {"a": "whole"}


def write_until_ended(path: Path) -> None:
    with Outputs() as outputs:
        outputs.file(path).write_text("not read by anybody")
        signal.raise_signal(signal.SIGTERM)


@pytest.fixture
def own_signals() -> Iterator[None]:
    """The test may set what signals do."""
    before = {number: signal.getsignal(number) for number in ENDING_SIGNALS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)
