"""Files that are no result, or a damaged one, and what is said of them."""

from __future__ import annotations

import os
import subprocess

import h5py
import pytest
from samples.results import (
    ordinary_user,
    python,
    write_result,
)

from vsacli import InputError, StorageError
from vsacli.results.store.reader import StoredResult


def foreign(path):
    with h5py.File(path, "w") as file:
        file["data"] = [1]


def newer(path):
    with h5py.File(path, "r+") as file:
        file.attrs["format"] = "vsacli-result/4"


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
        (missing, "no such file; expected a result file"),
        (folder, "is a folder; expected a result file"),
        (lambda path: path.write_bytes(b""), "is empty; expected a result file"),
        (lambda path: path.write_bytes(b"format: x"), "is not an HDF5 file; expected a result file"),
        (foreign, "is an HDF5 file that vsacli has not written, expected a result"),
        (
            newer,
            "has the format vsacli-result/4, but this version reads vsacli-result/2 and vsacli-result/3; "
            "run invdyn again",
        ),
        (truncated, "is damaged or truncated; compute it again"),
        (without_report, r"is damaged or truncated \(report not found\); compute it again"),
    ],
)
def test_files_that_are_no_result(tmp_path, block, spoil, match):
    path = write_result(tmp_path / "r.h5", block)
    spoil(path)
    with pytest.raises(InputError, match=r"r\.h5: .*" + match):
        StoredResult.open(path)


def test_every_truncation_is_noticed(tmp_path, block):
    whole = write_result(tmp_path / "r.h5", block).read_bytes()
    for size in range(1, len(whole), len(whole) // 40):
        (tmp_path / "part.h5").write_bytes(whole[:size])
        with pytest.raises(InputError, match=r"part\.h5: is"):
            StoredResult.open(tmp_path / "part.h5")


def test_a_file_that_may_not_be_read(tmp_path, block):
    path = write_result(tmp_path / "r.h5", block)
    path.chmod(0)
    with ordinary_user(), pytest.raises(StorageError, match="cannot be read: Permission denied"):
        StoredResult.open(path)


def test_a_file_that_another_program_is_writing(tmp_path, block):
    path = write_result(tmp_path / "r.h5", block)
    holder = "import h5py; file = h5py.File('r.h5', 'r+'); print('open', flush=True); input()"
    process = python(holder, folder=tmp_path, stdin=subprocess.PIPE)
    try:
        assert process.stdout.readline() == "open\n"
        with pytest.raises(StorageError, match="another program has it open for writing"):
            StoredResult.open(path)
    finally:
        process.communicate("\n")


def test_a_variable_that_was_not_stored(tmp_path, block):
    with StoredResult.open(write_result(tmp_path / "r.h5", block, variables=["theta"])) as result:
        assert result.variables == ("theta",)
        with pytest.raises(
            InputError, match=r"r\.h5: holds no phi; run invdyn again without --variables, or with phi"
        ):
            result.read("phi")
        with pytest.raises(InputError, match="no variable is called 'thetta'; did you mean 'theta'"):
            result.read("thetta")
