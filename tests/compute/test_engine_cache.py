"""Compiled code in the user's cache folder: damaged, refused, full, shared."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.command_line import ROBOT
from samples.marks import needs_compiler
from samples.robots import random_motion, vsa_3r
from samples.system_errors import fail_with

from vsacli import link_torques
from vsacli.base.storage import staging_name
from vsacli.compute.engine import cache, choose_engine
from vsacli.compute.engine.cache import (
    CHECKSUM,
    LIBRARY,
    Cache,
    CacheError,
    open_cache,
)
from vsacli.compute.engine.libraries import _loaded_libraries
from vsacli.dynamics.elastic_torques import LinkTorques

KERNEL = LinkTorques(vsa_3r())
MOTION = random_motion(vsa_3r(), 50, seed=1)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The cache folder."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    _loaded_libraries.clear()
    return tmp_path / "cache" / "vsacli"


def warnings() -> tuple[str, ...]:
    """What is said on the way to right results, in a process that has loaded nothing yet."""
    _loaded_libraries.clear()
    said: list[str] = []
    chosen = choose_engine("c", KERNEL, 1, 1, said.append)
    found, expected = (link_torques(vsa_3r(), *MOTION, engine=engine) for engine in (chosen.engine, "numpy"))
    # Rounding of some thousand operations that the compiler may contract and reorder.
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    return tuple(said)


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*") if path.is_file())


@pytest.mark.slow
@needs_compiler
def test_library_is_kept_and_found(folder: Path):
    assert warnings() == ()
    assert files(folder) == [CHECKSUM, LIBRARY]
    (library,) = folder.rglob(LIBRARY)
    built = library.stat().st_mtime_ns
    assert warnings() == ()
    assert library.stat().st_mtime_ns == built
    assert folder.stat().st_mode & 0o777 == 0o700


@pytest.mark.cases(2)
@pytest.mark.slow
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


@pytest.mark.slow
@needs_compiler
def test_folder_that_cannot_be_made(tmp_path: Path):
    (tmp_path / "cache").write_text("a file")
    (warning,) = warnings()
    assert warning.startswith("there is no cache folder: ")
    assert warning.endswith("; compiled code is not kept")


@pytest.mark.slow
@needs_compiler
def test_folder_that_others_may_write_to_is_not_trusted(folder: Path):
    warnings()
    folder.chmod(0o777)
    expected = f"the cache folder {folder} can be written by others; `chmod go-w {folder}` fixes that"
    assert warnings() == (f"{expected}; compiled code is not kept",)


@pytest.mark.parametrize("mode", [0o720, 0o702], ids=["group", "others"])
def test_a_folder_that_only_one_of_group_and_others_may_write_to(folder: Path, mode: int):
    folder.mkdir(parents=True)
    folder.chmod(mode)
    with pytest.raises(CacheError, match=f"the cache folder {folder} can be written by others"):
        open_cache()


def test_folder_of_somebody_else_is_not_trusted(folder: Path):
    folder.parent.mkdir()
    if os.getuid():
        folder.symlink_to("/usr")
    else:
        folder.mkdir()
        os.chown(folder, 1, -1)
    with pytest.raises(CacheError, match=f"the cache folder {folder} belongs to somebody else"):
        open_cache()


def test_without_a_home_there_is_no_cache(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", "~")
    with pytest.raises(CacheError, match="Could not determine home directory"):
        open_cache()


@pytest.mark.slow
@needs_compiler
def test_full_disk_is_told_and_leaves_nothing(folder: Path, before_system_call: Any):
    before_system_call("rename", fail_with(errno.ENOSPC))
    told = f"the cache folder {folder} cannot be written: No space left on device; compiled code is not kept"
    assert warnings() == (told,)
    assert not list(folder.iterdir())


def test_what_a_killed_process_left_is_swept(tmp_path: Path):
    script = "from vsacli.base.storage import staging_name; print(staging_name())"
    dead = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    old, new = (tmp_path / name for name in (dead.stdout.strip(), staging_name()))
    for left in (old, new):
        left.mkdir()
        (left / LIBRARY).write_bytes(b"half")
    stored(tmp_path, "key", b"whole")
    library = Cache(tmp_path).find("key")
    assert library is not None
    assert library.read_bytes() == b"whole"
    assert not old.exists()
    assert new.exists()
    assert [entry.key for entry in Cache(tmp_path).entries()] == ["key"]


def stored(folder: Path, key: str, content: bytes, used: float | None = None) -> None:
    """Put a library into a cache, last used then."""
    built = folder.with_name("built.so")
    built.write_bytes(content)
    Cache(folder).store(key, built)
    if used is not None:
        os.utime(folder / key, (used, used))


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of at most 3 kB, with room for three libraries."""
    monkeypatch.setattr(cache, "MOST_BYTES", 3500)
    (tmp_path / "small").mkdir()
    return tmp_path / "small"


def test_what_was_not_used_for_the_longest_time_makes_room(small: Path):
    for number, key in enumerate(["a", "b", "c"]):
        stored(small, key, bytes(1000), used=1e9 + number)
    assert Cache(small).find("a") is not None  # by which it is the one used last
    stored(small, "d", bytes(1000))
    assert {path.name for path in small.iterdir()} == {"a", "c", "d"}
    stored(small, "large", bytes(10_000))
    assert [path.name for path in small.iterdir()] == ["large"]


def test_a_library_that_is_removed_meanwhile_is_none(small: Path, before_system_call: Any):
    stored(small, "a", bytes(1000))
    before_system_call("utime", lambda *_: Cache(small).clear())
    assert Cache(small).find("a") is None


CROWD = """
import sys
from pathlib import Path
from vsacli.compute.engine import cache

cache.MOST_BYTES = 3500
folder = Path(sys.argv[1])
library = folder.with_name(f"built-{sys.argv[2]}.so")
for number in range(60):
    key = f"{number * int(sys.argv[2]) % 17}"
    found = cache.Cache(folder).find(key)
    if found is None:
        library.write_bytes(key.encode() * 500)
        cache.Cache(folder).store(key, library)
    else:
        try:
            assert found.read_bytes() == key.encode() * 500
        except FileNotFoundError:
            pass  # removed since; the loader would compile it anew
    if number == 40:
        cache.Cache(folder).clear()
"""


@pytest.mark.slow
def test_processes_that_make_room_at_once(small: Path):
    command = [sys.executable, "-W", "error", "-c", CROWD, str(small)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    running = [subprocess.Popen([*command, str(seed)], **pipes) for seed in (3, 5, 7)]
    assert [process.communicate(timeout=60) for process in running] == [("", "")] * 3
    assert all(process.returncode == 0 for process in running)
    entries = Cache(small).entries()
    assert {path.name for path in small.iterdir()} == {entry.key for entry in entries}
    assert sum(entry.size for entry in entries) <= 3500 + 3 * 1100  # each keeps what it has just stored


def test_the_first_of_two_libraries_stays(tmp_path: Path):
    for content in (b"first", b"second"):
        stored(tmp_path, "key", content)
    library = Cache(tmp_path).find("key")
    assert library is not None
    assert library.read_bytes() == b"first"
    assert [path.name for path in tmp_path.iterdir()] == ["key"]


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
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) for _ in range(4)
    ]
    outputs = [process.communicate(timeout=120) for process in running]
    assert [process.returncode for process in running] == [0] * 4
    assert outputs == [(outputs[0][0], "")] * 4
    assert files(folder) == [CHECKSUM] * 2 + [LIBRARY] * 2  # of the recursion, and of the energy
    assert len(list(folder.iterdir())) == 2
