"""Results whose times are damaged: every command that reads them says so, and nothing is written."""

from __future__ import annotations

import shutil

import h5py
import numpy as np
import pytest

from vsacli import InputError, open_result

DAMAGE = {
    "sample 3 is at nan s": lambda time: time.__setitem__(3, np.nan),
    "sample 0 is at -inf s": lambda time: time.__setitem__(0, -np.inf),
    "0.02 s follows 0.02 s, at sample 3": lambda time: time.__setitem__(3, time[2]),
    "3.99 s follows 4 s, at sample 1": lambda time: time.__setitem__(slice(None), time[::-1].copy()),
    "they go from 0 to 1e.308 s": lambda time: time.__setitem__(-1, 1e308),
    "they go from -1e.308 to": lambda time: time.__setitem__(0, -1e308),
}

COMMANDS = {
    "validate": ["validate", "r.h5"],
    "info": ["info", "r.h5"],
    "compare": ["compare", "r.h5", "m.csv"],
    "plot": ["plot", "r.h5", "--variables", "q", "-o", "figures"],
    "page": ["plot", "r.h5", "--format", "html", "-o", "pages"],
    "stretch": ["plot", "r.h5", "--from", "0.1", "-o", "figures"],
    "csv": ["export", "r.h5"],
    "rate": ["export", "r.h5", "--rate", "100"],
    "message": ["export", "r.h5", "--format", "joint-trajectory", "-o", "m.yaml"],
    "mat": ["export", "r.h5", "--format", "mat", "-o", "m.mat"],
}


@pytest.fixture
def damaged(feasible_result, tmp_path):
    def damage(spoil):
        shutil.copy(feasible_result, tmp_path / "r.h5")
        with h5py.File(tmp_path / "r.h5", "r+") as file:
            time = file["time"][...]
            spoil(time)
            file["time"][...] = time

    return damage


@pytest.mark.parametrize("sentence", DAMAGE)
def test_the_reader_refuses_times_that_no_run_has(damaged, tmp_path, sentence):
    damaged(DAMAGE[sentence])
    with (
        open_result(tmp_path / "r.h5") as result,
        pytest.raises(InputError, match=rf"r\.h5: variable time is damaged or truncated \({sentence}"),
    ):
        result.read("time")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_relies_on_the_reader(vsacli, damaged, tmp_path, command):
    if command == "page":
        pytest.importorskip("bokeh")
    damaged(DAMAGE["3.99 s follows 4 s, at sample 1"])
    (tmp_path / "m.csv").write_text("time,base.q\n0,1\n1,2\n2,3\n3,3\n4,5\n")
    before = {path.name for path in tmp_path.iterdir()}
    done = vsacli(*COMMANDS[command])
    assert done.code == 2
    assert "r.h5: variable time is damaged or truncated (" in done.out + done.err
    assert {path.name for path in tmp_path.iterdir()} == before
