"""Compilers whose code crashes or computes something else: it is neither used nor kept."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from samples.marks import needs_compiler, slow_but
from samples.robots import random_motion, vsa_3r
from samples.simulated import short_motion

from vsacli import InputError, link_torques, simulate
from vsacli.compute.engine import choose_engine
from vsacli.compute.engine.cache import LIBRARY
from vsacli.compute.engine.libraries import _loaded_libraries
from vsacli.dynamics.elastic_torques import LinkTorques

pytestmark = needs_compiler

ARM = replace(vsa_3r(), joints=vsa_3r().joints[:1])
KERNEL = LinkTorques(ARM)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The cache folder."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    _loaded_libraries.clear()
    return tmp_path / "cache" / "vsacli"


FAULTS = {
    "crashes": ("__builtin_trap();", r"crashes \(SIG(ILL|TRAP|ABRT)\)"),
    "writes elsewhere": ("*(volatile double *)8 = 1;", r"crashes \(SIGSEGV\)"),
    "returns nothing": ("return;", "computes something else than NumPy does"),
    "ends the process": ("extern void exit(int); exit(0);", "cannot be loaded: it returns nothing"),
}
"""Statements with which a function begins, and what is said about it."""


def faulty_compiler(tmp_path: Path, function: str, statement: str) -> str:
    """A compiler that calls cc, with a statement of its own at the begin of a function of the source."""
    script = tmp_path / "faultycc"
    begin = f"sed -i '/^void {function}(/,/^{{/s/^{{/{{ {statement}/' \"$a\""
    loop = f'for a in "$@"; do case "$a" in *program.c) {begin};; esac; done'
    script.write_text(f'#!/bin/sh\n{loop}\nexec cc "$@"\n')
    script.chmod(0o755)
    return str(script)


@pytest.mark.slow
@pytest.mark.parametrize("fault", slow_but({"writes elsewhere"}, FAULTS))
def test_faulty_code_is_neither_used_nor_kept(
    fault: str, tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
):
    statement, message = FAULTS[fault]
    monkeypatch.setenv("CC", faulty_compiler(tmp_path, "run", statement))
    with pytest.raises(InputError, match=f"what the C compiler made {message}; the engine numpy needs none"):
        choose_engine("c", KERNEL, 1)
    assert not list(folder.rglob(LIBRARY))
    assert choose_engine("auto", KERNEL, 1_000_000_000).reason.startswith(
        "NumPy computes: what the C compiler made"
    )
    monkeypatch.delenv("CC")
    motion = random_motion(ARM, 50, seed=1)
    found, expected = (link_torques(ARM, *motion, engine=each) for each in ("c", "numpy"))
    # Rounding of some thousand operations that the compiler may contract and reorder.
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("fault", slow_but({"returns nothing"}, ["writes elsewhere", "returns nothing"]))
def test_a_simulation_does_not_use_faulty_code(
    fault: str, tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
):
    statement, message = FAULTS[fault]
    monkeypatch.setenv("CC", faulty_compiler(tmp_path, "derivatives", statement))
    with pytest.raises(InputError, match=f"what the C compiler made {message}"):
        simulate(ARM, short_motion(1, duration=0.05), engine="c")
    assert not list(folder.rglob(LIBRARY))


@pytest.mark.slow
def test_the_key_names_the_compiler(tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch):
    """A script has the version of the compiler that it calls, whatever it does to the code."""
    script = tmp_path / "wrapped"
    for text in ("", "# changed\n"):
        script.write_text(f'#!/bin/sh\n{text}exec cc "$@"\n')
        script.chmod(0o755)
        monkeypatch.setenv("CC", str(script))
        monkeypatch.setenv("PATH", f"{tmp_path}{len(text)}", prepend=":")  # as in another process
        assert choose_engine("c", KERNEL, 1).reason.startswith("C code computes, compiled now")
    monkeypatch.delenv("CC")
    assert choose_engine("c", KERNEL, 1).reason.startswith("C code computes, compiled now")
    assert len(list(folder.rglob(LIBRARY))) == 3
    _loaded_libraries.clear()
    assert choose_engine("c", KERNEL, 1).reason.startswith("C code computes, compiled before")
