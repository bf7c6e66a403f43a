"""Compiled code in the user's cache folder: damaged, refused, full, shared."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from samples.command_line import ROBOT
from samples.marks import needs_compiler
from samples.robots import random_motion, vsa_3r

from vsacli.compute.engine import cache, choose
from vsacli.compute.engine.cache import (
    ABANDONED_AFTER,
    CHECKSUM,
    LIBRARY,
    UNFINISHED,
    Cache,
    CacheError,
    open_cache,
)
from vsacli.compute.engine.compiled_engine import _loaded
from vsacli.dynamics.elastic_torques import LinkTorques, link_torques

KERNEL = LinkTorques(vsa_3r())
MOTION = random_motion(vsa_3r(), 50, seed=1)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The cache folder."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    _loaded.clear()
    return tmp_path / "cache" / "vsacli"


def warnings() -> tuple[str, ...]:
    """What is said on the way to right results, in a process that has loaded nothing yet."""
    _loaded.clear()
    said: list[str] = []
    chosen = choose("c", KERNEL, 1, 1, said.append)
    found, expected = (link_torques(vsa_3r(), *MOTION, engine=engine) for engine in (chosen.engine, "numpy"))
    # Rounding of some thousand operations that the compiler may contract and reorder.
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    return tuple(said)


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*") if path.is_file())


@needs_compiler
def test_library_is_kept_and_found(folder: Path):
    assert warnings() == ()
    assert files(folder) == [CHECKSUM, LIBRARY]
    (entry,) = folder.iterdir()
    built = entry.stat().st_mtime_ns
    assert warnings() == ()
    assert entry.stat().st_mtime_ns == built
    assert folder.stat().st_mode & 0o777 == 0o700


@needs_compiler
@pytest.mark.parametrize("damage", ["changed", "truncated", "without checksum", "without library"])
def test_damaged_library_is_never_loaded(folder: Path, damage: str):
    warnings()
    (library,) = folder.rglob(LIBRARY)
    content = library.read_bytes()
    library.unlink()  # this process has loaded it: another file takes its place
    match damage:
        case "changed":
            library.write_bytes(content[:5000] + bytes([content[5000] ^ 1]) + content[5001:])
        case "truncated":
            library.write_bytes(content[: len(content) // 2])
        case "without checksum":
            library.write_bytes(content)
            library.with_name(CHECKSUM).unlink()
    assert warnings() == (f"{library} was damaged; it is removed",)
    assert library.read_bytes() == content
    assert files(folder) == [CHECKSUM, LIBRARY]
    assert warnings() == ()


@needs_compiler
def test_folder_that_cannot_be_made(tmp_path: Path):
    (tmp_path / "cache").write_text("a file")
    (warning,) = warnings()
    assert warning.startswith("there is no cache folder: ")
    assert warning.endswith("; compiled code is not kept")


@needs_compiler
def test_folder_that_others_may_write_to_is_not_trusted(folder: Path):
    warnings()
    folder.chmod(0o777)
    expected = f"the cache folder {folder} can be written by others; `chmod go-w {folder}` mends that"
    assert warnings() == (f"{expected}; compiled code is not kept",)


@pytest.mark.parametrize("mode", [0o720, 0o702], ids=["group", "others"])
def test_a_folder_that_only_one_of_group_and_others_may_write_to(folder: Path, mode: int):
    folder.mkdir(parents=True)
    folder.chmod(mode)
    with pytest.raises(CacheError, match=f"the cache folder {folder} can be written by others"):
        open_cache()


def test_folder_of_somebody_else_is_not_trusted(folder: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(os, "getuid", lambda: -1)
    with pytest.raises(CacheError, match=f"the cache folder {folder} belongs to somebody else"):
        open_cache()


def test_without_a_home_there_is_no_cache(monkeypatch: pytest.MonkeyPatch):
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", homeless)
    with pytest.raises(CacheError, match="Could not determine home directory"):
        open_cache()


@needs_compiler
def test_full_disk_is_told_and_leaves_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch):
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(cache.shutil, "copyfile", full)
    told = f"the cache folder {folder} cannot be written: No space left on device; compiled code is not kept"
    assert warnings() == (told,)
    assert not list(folder.iterdir())


def test_what_a_killed_process_left_is_swept(tmp_path: Path):
    old, new = (tmp_path / f"{UNFINISHED}{name}" for name in ("old", "new"))
    for left in (old, new):
        left.mkdir()
        (left / LIBRARY).write_bytes(b"half")
    then = old.stat().st_mtime - 2 * ABANDONED_AFTER
    os.utime(old, (then, then))
    library = tmp_path / "built.so"
    library.write_bytes(b"whole")
    Cache(tmp_path).store("key", library)
    stored = Cache(tmp_path).find("key")
    assert stored is not None
    assert stored.read_bytes() == b"whole"
    assert not old.exists()
    assert new.exists()


def test_the_first_of_two_libraries_stays(tmp_path: Path):
    for content in (b"first", b"second"):
        (tmp_path / "built.so").write_bytes(content)
        Cache(tmp_path).store("key", tmp_path / "built.so")
    library = Cache(tmp_path).find("key")
    assert library is not None
    assert library.read_bytes() == b"first"
    assert not list(tmp_path.glob(f"{UNFINISHED}*"))


@pytest.mark.slow
@needs_compiler
def test_processes_at_once_do_not_meet_half_a_library(folder: Path):
    code = (
        "import sys; from vsacli.cli.main import run;"
        "sys.exit(run(['check-feasibility', *sys.argv[1:], '--engine', 'c']))"
    )
    motion = Path(ROBOT).parents[1] / "trajectories" / "rest_to_rest.yaml"
    command = [sys.executable, "-W", "error", "-c", code, str(ROBOT), str(motion)]
    running = [
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) for _ in range(3)
    ]
    outputs = [process.communicate(timeout=120) for process in running]
    assert [process.returncode for process in running] == [0, 0, 0]
    assert outputs == [(outputs[0][0], "")] * 3
    assert files(folder) == [CHECKSUM, LIBRARY]
    assert len(list(folder.iterdir())) == 1
