"""`vsacli study`: what goes wrong, and what is kept whatever happens."""

from __future__ import annotations

import errno
import json
import os
import resource
import subprocess
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.marks import slow
from samples.studies import GRID, HEAD, column, content, study

from vsacli import StorageError
from vsacli.studies.sweeps import journal as journal_module
from vsacli.studies.sweeps.journal import Journal
from vsacli.studies.sweeps.rows import Computer
from vsacli.studies.sweeps.run_study import gather
from vsacli.studies.sweeps.study import load_study


def test_a_run_that_fails_is_a_row(vsacli: Any, own_folder: Path) -> None:
    """A mass that is drawn below zero makes no robot; the others are computed."""
    text = "method: random\nsamples: 4\nvary:\n  joints.elbow.link.mass: {normal: 100 %}\n"
    done = vsacli("study", study(own_folder, text))
    masses, verdicts = column("study.h5", "joints.elbow.link.mass"), column("study.h5", "verdict")
    assert done.code == 3
    assert 0 < (masses < 0).sum() < 4
    np.testing.assert_array_equal(verdicts == "failed", masses < 0)
    assert all("must be zero or positive" in error for error in column("study.h5", "error")[masses < 0])
    np.testing.assert_array_equal(np.isnan(column("study.h5", "margin")).all(axis=1), masses < 0)
    assert "failed: joints.elbow.link.mass: must be zero or positive" in done.out


@pytest.mark.slow
def test_an_interrupted_study_goes_on(vsacli: Any, grid_study: str, grid_table: Path) -> None:
    """From the rows in the journal, of which the last was cut off."""
    journal = Path("study.h5.journal")
    with Journal(journal) as rows:
        gather(Computer(load_study(grid_study)).rows(range(5)), rows, lambda _: None)
    journal.write_bytes(journal.read_bytes()[:-9])
    done = vsacli("study", grid_study)
    assert done.err.splitlines() == [f"4 of 6 runs are in {journal} already", "wrote study.h5"]
    assert content("study.h5") == content(grid_table)
    assert not journal.exists()


def kept(path: Path, study_file: str) -> bytes:
    """A journal of all six rows, and what is in it."""
    with Journal(path) as rows:
        gather(Computer(load_study(study_file)).rows(range(6)), rows, lambda _: None)
    return path.read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("where", [slow("checksum"), "row", slow("break")])
def test_a_damaged_row_costs_no_other_one(vsacli: Any, grid_study: str, grid_table: Path, where: str) -> None:
    """A bit that is wrong in the third row, or in the break behind it."""
    journal = Path("study.h5.journal")
    lines = kept(journal, grid_study).splitlines(keepends=True)
    place = {"checksum": 3, "row": len(lines[3]) // 2, "break": -1}[where]
    spoiled = bytearray(lines[3])
    spoiled[place] ^= 1
    journal.write_bytes(b"".join([*lines[:3], bytes(spoiled), *lines[4:]]))
    done = vsacli("study", grid_study)
    assert done.err.splitlines() == [
        f"{journal}: line 4 is damaged; its run is computed again",
        f"5 of 6 runs are in {journal} already",
        "wrote study.h5",
    ]
    assert content("study.h5") == content(grid_table)


@pytest.mark.slow
def test_whichever_bit_of_a_journal_is_wrong(tmp_path: Path, grid_study: str) -> None:
    """All rows but one are there, or all if it is the blank behind a checksum; or the file is refused."""
    whole, spoiled = kept(tmp_path / "whole", grid_study), tmp_path / "spoiled"
    first = whole.index(b"\n") + 1
    for place in range(0, len(whole), 7):
        content_now = bytearray(whole)
        content_now[place] ^= 1 << place % 8
        spoiled.write_bytes(content_now)
        if place < first:
            with pytest.raises(StorageError, match="is not the journal of a study"), Journal(spoiled):
                pass
            assert spoiled.read_bytes() == content_now
            continue
        with Journal(spoiled) as rows:
            assert len(rows) >= 5


@pytest.mark.parametrize(
    "content_then", [b"", b"notes\n1 2 3\n", b"\x89HDF\r\n\x1a\n", b"vsacli-study-journal/9\n"]
)
def test_a_file_of_somebody_else_is_no_journal(vsacli: Any, grid_study: str, content_then: bytes) -> None:
    journal = Path("study.h5.journal")
    journal.write_bytes(content_then)
    done = vsacli("study", grid_study)
    assert (done.code, Path("study.h5").exists()) == (4, False)
    assert done.err == (
        f"{journal}: is not the journal of a study, but has the name of the file in which this one keeps its "
        "finished runs; move it, or name another table with -o\n"
    )
    assert journal.read_bytes() == content_then


@pytest.mark.parametrize("kind", ["link", "link to nothing", "pipe"])
def test_a_journal_is_a_file_of_its_own(vsacli: Any, grid_study: str, kind: str) -> None:
    """A link is not followed, and what it leads to stays as it is."""
    journal, elsewhere = Path("study.h5.journal"), Path("elsewhere")
    if kind == "pipe":
        os.mkfifo(journal)
    else:
        journal.symlink_to(elsewhere)
    if kind == "link":
        elsewhere.write_bytes(journal_module.FIRST_LINE)
    refused = vsacli("study", grid_study)
    assert (refused.code, Path("study.h5").exists()) == (4, False)
    assert refused.err.startswith(f"{journal}: is not the journal of a study, but has the name of the file")
    assert elsewhere.exists() == (kind == "link")
    assert os.path.lexists(journal)


VALUES = '"values": "", "curves": ""'


@pytest.mark.parametrize(
    "text",
    [
        *("[]", "{}", "no JSON", "7", '"key"', "[" * 100_000, '{"key": "k"}', f'{{"key": ["k"], {VALUES}}}'),
        f'{{"key": {{}}, "verdict": "ok", "error": "", {VALUES}}}',
        f'{{"key": "k", "verdict": null, "error": "", {VALUES}}}',
        '{"key": "k", "verdict": "ok", "error": "", "values": "QQ==", "curves": ""}',
        '{"key": "k", "verdict": "ok", "error": "", "values": "%", "curves": 1}',
    ],
    ids=range(12),
)
def test_a_line_with_a_valid_checksum_and_other_content_is_damaged(own_folder: Path, text: str) -> None:
    path, line = own_folder / "study.h5.journal", text.encode()
    path.write_bytes(journal_module.FIRST_LINE + b"%08x %s\n" % (zlib.crc32(line), line))
    with Journal(path) as journal:
        assert (journal.damaged, len(journal)) == ([2], 0)


@pytest.mark.slow
def test_a_damaged_line_is_said(vsacli: Any, grid_study: str) -> None:
    journal = Path("study.h5.journal")
    journal.write_bytes(journal_module.FIRST_LINE + b"%08x []\n" % zlib.crc32(b"[]"))
    done = vsacli("study", grid_study)
    assert done.err.splitlines() == [
        f"{journal}: line 2 is damaged; its run is computed again",
        "wrote study.h5",
    ]


@pytest.mark.slow
def test_a_journal_that_was_cut_off_in_its_first_line_is_begun_anew(
    vsacli: Any, grid_study: str, grid_table: Path
) -> None:
    journal = Path("study.h5.journal")
    journal.write_bytes(journal_module.FIRST_LINE[:7])
    assert vsacli("study", grid_study).err == "wrote study.h5\n"
    assert content("study.h5") == content(grid_table)
    assert not journal.exists()


@pytest.mark.slow
def test_a_full_disk_costs_no_finished_row(
    vsacli: Any, grid_study: str, grid_table: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    room = [3]  # the first line, a row, and a part of the next

    def write(file: int, data: memoryview) -> int:
        room[0] -= 1
        if room[0] < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return original(file, data if room[0] else data[:40])  # the disk becomes full there

    original = os.write
    with monkeypatch.context() as patch:
        patch.setattr(journal_module.os, "write", write)
        full = vsacli("study", grid_study)
    assert full.code == 4
    assert "the disk is full; the row in it stays" in full.err
    assert not Path("study.h5").exists()
    assert vsacli("study", grid_study).err.startswith("1 of 6 runs are in ")
    assert content("study.h5") == content(grid_table)


@pytest.mark.slow
def test_a_study_that_is_edited_before_it_goes_on_computes_what_is_new(vsacli: Any, grid_study: str) -> None:
    """Rows whose values are still asked for stay; a robot that is edited leaves none."""
    journal = Path("study.h5.journal")
    with Journal(journal) as rows:
        gather(Computer(load_study(grid_study)).rows(range(6)), rows, lambda _: None)
    Path(grid_study).write_text(Path(grid_study).read_text().replace("[1000, 1275]", "[1000, 1300]"))
    kept = journal.read_bytes()
    assert vsacli("study", grid_study).err.startswith("3 of 6 runs are in ")
    whole = content("study.h5")
    assert vsacli("study", grid_study, "-o", "anew.h5", "-q").code == 0
    assert content("anew.h5") == whole
    journal.write_bytes(kept)
    Path("arm.yaml").write_text(Path("arm.yaml").read_text() + "# as measured\n")
    assert " runs are in " not in vsacli("study", grid_study, "--overwrite").err


@pytest.mark.parametrize(("old", "new"), [("end: 1275", "end: 1274"), ("degree: 7", "degree: 2")])
def test_a_file_that_changes_meanwhile_ends_the_study(
    vsacli: Any, own_folder: Path, monkeypatch: pytest.MonkeyPatch, old: str, new: str
) -> None:
    """No row of what it says now is kept under the key of what it said; the batches before stay."""
    monkeypatch.setattr("vsacli.studies.sweeps.study.BATCH_SAMPLES", 1)
    study(own_folder, "vary: {duration: [2, 3, 4]}\n")
    move = own_folder / "move.yaml"
    text, original = move.read_text(), Journal.add

    def add(journal: Journal, row: Any) -> None:
        original(journal, row)
        move.write_text(text.replace(old, new))

    with monkeypatch.context() as patch:
        patch.setattr(Journal, "add", add)
        ended = vsacli("study", "study.yaml")
    assert (ended.code, Path("study.h5").exists()) == (2, False)
    assert "move.yaml: was changed while the study was computed; run it again" in ended.err
    assert "1 finished runs are kept in study.h5.journal; the same command goes on from there" in ended.err
    move.write_text(text)
    assert vsacli("study", "study.yaml").err.startswith("1 of 3 runs are in ")


@pytest.mark.slow
def test_a_table_that_cannot_be_written_costs_no_row(vsacli: Any, grid_study: str, grid_table: Path) -> None:
    """Files may be as large as the journal, which the table exceeds."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (grid_table.stat().st_size - 1, limits[1]))
    try:
        full = vsacli("study", grid_study)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert (full.code, Path("study.h5").exists(), list(Path().glob(".*"))) == (4, False, [])
    assert "6 finished runs are kept in study.h5.journal" in full.err
    assert vsacli("study", grid_study).err.startswith("6 of 6 runs are in ")
    assert content("study.h5") == content(grid_table)


def test_two_do_not_compute_the_same_study(vsacli: Any, grid_study: str) -> None:
    with Journal(Path("study.h5.journal")):
        done = vsacli("study", grid_study)
    assert (done.code, "another process computes this study" in done.err) == (4, True)


SPRING = "joints.*.actuator.spring.k"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"vary: {{{SPRING}x: [1]}}", f"study.yaml:5: {SPRING}x: joints.base.actuator.spring has no 'kx'"),
        (f"vary: {{{SPRING}: [400, -1]}}", f"study.yaml:5: {SPRING}: must be positive, not -1 N m/rad\n"),
        (f"method: random\nsamples: 2\nvary: {{{SPRING}: {{normal: 300 %}}}}", "must be at most 100 %, not"),
        (f"vary: {{{SPRING}: []}}", f"study.yaml:5: {SPRING}: expected a list of values, "),
        (f"vary: {{{SPRING}: {{linspace: [1, 2, 0]}}}}", "linspace: expected a count from 1 to 1,000,000"),
        (f"vary: {{{SPRING}: {{linspce: [1, 2, 3]}}}}", "did you mean 'linspace'?"),
        (f"vary: {{{SPRING}: {{normal: 5 %}}}}", f"study.yaml:5: {SPRING}: has a distribution, which"),
        ("vary: {foo.k: [1]}", "study.yaml:5: foo.k: neither robot nor trajectory has 'foo'"),
        ("vary: {name: [a, b]}", "study.yaml:5: name: the name of a file cannot be changed here"),
        ("vary: {duration: [1, 2], rate: {linked: durations}}", "no path above it that varies independently"),
        ("method: random\nvary: {duration: [1]}", "missing key 'samples': the number of runs that the"),
        ("method: random\nsamples: 3", "missing key 'vary': the values that the method random draws"),
        ("method: random\nsamples: 3\nvary: {joints.*.link.com: {normal: 5 %}}", "is zero, of which a share"),
        ("keep: [margins]", "keep: unknown word 'margins'; did you mean 'margin'?"),
        ("trajectry: x", "unknown key 'trajectry'"),
        (
            "vary:\n" + "".join(f"  joints.{i}.link.mass: {{linspace: [1, 2, 1000]}}\n" for i in range(3)),
            "study.yaml: 1,000,000,000 runs (1 x 1,000 x 1,000 x 1,000) are more than 1,000,000",
        ),
    ],
)  # fmt: skip
def test_a_study_that_cannot_be_computed(vsacli: Any, own_folder: Path, text: str, message: str) -> None:
    study(own_folder, text)
    done = vsacli("study", "study.yaml")
    assert (done.code, done.out) == (2, "")
    assert message in done.err
    assert not list(own_folder.glob("*.h5*"))


def test_command_lines_that_make_no_sense(vsacli: Any, grid_study: str) -> None:
    assert "a study is read by several processes" in vsacli("study", "-").err
    assert (
        "expected one STUDY, found 2; to merge tables of shards give --merge"
        in vsacli("study", grid_study, grid_study).err
    )
    assert "expected K/N with K from 1 to N" in vsacli("study", grid_study, "--shard", "4/3").err
    assert "--merge needs -o FILE" in vsacli("study", "--merge", grid_study).err
    assert (
        "is a study, but STUDY must be a study table (HDF5)"
        in vsacli("study", "--merge", grid_study, "-o", "x.h5").err
    )


def test_no_file_is_replaced_or_read_for_nothing(vsacli: Any, own_folder: Path) -> None:
    study(own_folder, GRID, HEAD.replace("move.yaml", "moves/*.yaml"))
    none = vsacli("study", "study.yaml")
    assert (none.code, none.err) == (2, "study.yaml:4: trajectory: no file fits 'moves/*.yaml'\n")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("arm.", "arm_.", "study.yaml:3: robot: arm_.yaml: no such file; did you mean 'arm.yaml'?\n"),
        ("move.", "mov.", "study.yaml:4: trajectory: mov.yaml: no such file; did you mean 'move.yaml'?\n"),
        ("move.yaml", "mov?.yml", "study.yaml:4: trajectory: no file fits 'mov?.yml'\n"),
    ],
)
def test_a_file_that_is_missing_is_named_as_in_the_study(
    vsacli: Any, own_folder: Path, old: str, new: str, message: str
) -> None:
    study(own_folder, "vary: {rate: [50, 100]}")
    path = own_folder / "study.yaml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    refused = vsacli("study", "study.yaml")
    assert refused.code == 2
    assert refused.err == message


def test_a_study_in_which_nothing_varies_is_questioned(vsacli: Any, own_folder: Path) -> None:
    study(own_folder, "")
    done = vsacli("study", "study.yaml", "--processes", "1")
    assert (done.code, done.out.splitlines()[1]) == (0, "warning: nothing varies; add vary:")
    assert json.loads(vsacli("info", "study.h5", "--json").out)["warnings"] == ["nothing varies; add vary:"]


@pytest.mark.slow
@pytest.mark.parametrize("files", [10, 12])
def test_few_open_files_are_allowed(grid_study: str, files: int) -> None:
    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_NOFILE, (files, files))

    command = [sys.executable, "-m", "vsacli", "study", grid_study, "--processes", "2"]
    done = subprocess.run(command, preexec_fn=limit, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (4, "")
    assert done.stderr.endswith("too many files are open; `ulimit -n 256` allows more\n")
    assert len(done.stderr.splitlines()) == 1
