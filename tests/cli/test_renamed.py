"""Names that changed before 0.1: an old one is refused, and the error names the new one."""

from __future__ import annotations

import shutil

import h5py
import pytest
from samples.command_line import REST_TO_REST, ROBOT

from vsacli.base import did_you_mean as module
from vsacli.base import file_formats, renamed
from vsacli.base.did_you_mean import did_you_mean
from vsacli.base.renamed import RENAMINGS, Renaming


@pytest.fixture(autouse=True)
def _one_renaming(monkeypatch):
    monkeypatch.setattr(renamed, "RENAMINGS", (Renaming("option", "--softly", "--quiet", "everywhere"),))


def test_an_old_name_is_refused_with_its_successor_where_that_is_valid():
    assert did_you_mean("--softly", ["--quiet", "--verbose"]) == "; it is now '--quiet'"
    assert "now" not in did_you_mean("--softly", ["--verbose"])
    assert module.nearest("--softly", ["--quiet"]) is None


def test_an_old_option_is_refused_with_its_successor(vsacli):
    outcome = vsacli("validate", "--softly", ROBOT)
    assert outcome.code == 2
    assert "--softly is now --quiet\n" in outcome.err


def test_no_old_name_is_new_at_the_same_place():  # RENAMINGS as imported, not as replaced
    olds = {(each.kind, each.old, each.place) for each in RENAMINGS}
    assert not olds & {(each.kind, each.new, each.place) for each in RENAMINGS}
    assert len(olds) == len(RENAMINGS)


@pytest.mark.parametrize("command", [("plot",), ("info",), ("export",)])
def test_a_result_of_an_older_format_is_refused_and_its_inputs_come_out(vsacli, own_folder, command):
    assert vsacli("invdyn", ROBOT, REST_TO_REST, "-o", "now.h5").code == 0
    shutil.copy("now.h5", "before.h5")
    with h5py.File("before.h5", "r+") as file:
        file.attrs["format"] = "vsacli-result/1"
    outcome = vsacli(*command, "before.h5")
    assert outcome.code == 2
    formats = f"{file_formats.RESULT} and {file_formats.TREE_FORMATS[file_formats.RESULT]}"
    reads = f"but this version reads {formats}; run invdyn again"
    expected = f"before.h5: has the format vsacli-result/1, {reads}"
    assert expected in outcome.err
    assert vsacli("info", "before.h5", "--extract", "inputs").code == 0
    files = sorted(path.name for path in (own_folder / "inputs").rglob("*.yaml"))
    assert files == ["rest_to_rest.yaml", "vsa_3r.yaml"]
