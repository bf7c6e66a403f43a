"""Which engine computes, and what the user learns about it."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.command_line import ROBOT
from samples.engines import program
from samples.marks import needs_compiler
from samples.robots import random_motion, vsa_3r
from samples.shipped import shipped_robot

from vsacli import InputError, Robot, link_torques
from vsacli.compute.engine import NUMPY, choice, choose_engine, compiler
from vsacli.compute.engine.cache import CHECKSUM, LIBRARY, open_cache
from vsacli.compute.engine.choice import LOOK_FROM, settle_engine, usual_block_samples
from vsacli.compute.engine.compiled_engine import CompiledEngine, kernel_code
from vsacli.compute.engine.compiler import CompilerError, system_compiler
from vsacli.compute.engine.engines import kernel_program
from vsacli.compute.engine.libraries import Code, _loaded_libraries, load
from vsacli.compute.engine.trial import Trial
from vsacli.compute.tracing import is_of_calls
from vsacli.dynamics.balances import BalancedDynamics
from vsacli.dynamics.elastic_torques import LinkTorques
from vsacli.dynamics.energy import IntervalEnergy
from vsacli.dynamics.inverse import InverseDynamics

KERNEL = LinkTorques(vsa_3r())


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("CC", raising=False)
    _loaded_libraries.clear()
    return tmp_path / "cache"


def test_unknown_engine_is_refused_with_the_nearest_one():
    with pytest.raises(InputError, match="unknown engine 'nunpy'; did you mean 'numpy'"):
        choose_engine("nunpy", KERNEL, 1)


@pytest.mark.parametrize("name", ["numpy", "auto"])
def test_few_samples_are_left_to_numpy_and_nothing_is_compiled(name: str, own_cache: Path):
    assert choose_engine(name, KERNEL, LOOK_FROM - 1).engine is NUMPY
    assert not own_cache.exists()


@pytest.mark.slow
@needs_compiler
def test_auto_compiles_for_many_samples_and_remembers_it_for_fewer():
    rarely, often = LOOK_FROM, 10_000_000
    assert (
        choose_engine("auto", KERNEL, rarely).reason
        == f"NumPy computes: {rarely} samples would not repay compiling"
    )
    assert choose_engine("auto", KERNEL, often, 2).reason == "C code computes, compiled now, in 2 threads"
    _loaded_libraries.clear()  # as in another process
    assert choose_engine("auto", KERNEL, rarely, 1).reason == "C code computes, compiled before, in 1 thread"


@pytest.mark.slow
@needs_compiler
@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system divides no processors")
def test_threads_are_as_many_as_processors_unless_given():
    usable = os.sched_getaffinity(0)
    for processors in ({min(usable)}, usable):
        os.sched_setaffinity(0, processors)
        assert f"in {len(processors)} thread" in choose_engine("c", KERNEL, 1).reason


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (None, "there is no C compiler 'nocc'"),
        ("echo 'disk on fire' >&2; exit 1", "the C compiler 'nocc' fails: disk on fire"),
        ("exit 3", "the C compiler 'nocc' fails: it ended with 3 and no message"),
        ('case "$*" in *-dM*) echo "#define A";; *) exit 4;; esac', "fails: it ended with 4 and no message"),
        ('case "$*" in *-dM*) echo "#define B";; esac', "the C compiler 'nocc' made no library"),
        (
            'case "$*" in *-dM*) echo "#define C";; *) eval echo no > ${9};; esac',
            "what the C compiler made cannot be loaded",
        ),
    ],
)
def test_compiler_that_does_not_work(
    text: str | None, reason: str, tmp_path: Path, own_cache: Path, monkeypatch: pytest.MonkeyPatch
):
    if text is not None:
        program(tmp_path, "nocc", text)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    monkeypatch.setenv("CC", "nocc")
    chosen = choose_engine("auto", KERNEL, 10_000_000)
    assert not isinstance(chosen.engine, CompiledEngine)
    assert chosen.reason.startswith("NumPy computes: ")
    assert reason in chosen.reason
    with pytest.raises(InputError, match="the engine numpy needs none") as raised:
        choose_engine("c", KERNEL, 1)
    assert reason in str(raised.value)
    assert not [path for path in own_cache.rglob("*") if path.is_file()]


def without_cc(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    monkeypatch.setitem(sys.modules, "ziglang", None)
    monkeypatch.setenv("PATH", str(folder))


def test_without_a_compiler_the_message_says_how_to_get_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    without_cc(monkeypatch, tmp_path)
    reason = "there is no C compiler 'cc' (pip install 'vsacli[compiler]' gets one)"
    assert choose_engine("auto", KERNEL, 10_000_000).reason == f"NumPy computes: {reason}"
    with pytest.raises(InputError) as raised:
        choose_engine("c", KERNEL, 1)
    assert str(raised.value) == f"{reason}; the engine numpy needs none"


@pytest.mark.slow
@needs_compiler
def test_the_compiler_of_a_package_is_found_where_the_system_has_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """One that passes on to the system's compiler stands for the genuine package, which `.ci/run` tries."""
    package = tmp_path / "ziglang"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "__main__.py").write_text(
        f"import os, sys\nassert sys.argv[1] == 'cc'\nos.environ['PATH'] = {os.environ['PATH']!r}\n"
        f"os.execv({shutil.which('cc')!r}, sys.argv[1:])\n"
    )
    without_cc(monkeypatch, tmp_path)
    monkeypatch.delitem(sys.modules, "ziglang")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    chosen = choose_engine("c", KERNEL, 1, 1)
    assert chosen.reason.startswith("C code computes, compiled now")
    assert re.fullmatch(r"python -m ziglang cc \S+", chosen.compiler)


def test_link_torques_refuse_an_unknown_engine():
    with pytest.raises(InputError, match="unknown engine"):
        link_torques(vsa_3r(), *random_motion(vsa_3r(), 2, seed=1), engine="fortran")


@pytest.mark.slow
@needs_compiler
def test_link_torques_take_an_engine_that_was_chosen_before():
    motion = random_motion(vsa_3r(), 20, seed=1)
    chosen = choose_engine("c", KERNEL, 1).engine
    np.testing.assert_array_equal(
        link_torques(vsa_3r(), *motion, engine=chosen), link_torques(vsa_3r(), *motion, engine="c")
    )


# The command line


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("command", ["invdyn", "check-feasibility"])
def test_report_is_the_same_and_verbose_says_what_computes(vsacli, motion, command: str):
    by_numpy = vsacli(command, ROBOT, motion, "--engine", "numpy", "-v")
    assert "NumPy computes, as requested" in by_numpy.err.splitlines()
    options = ["--overwrite"] if command == "invdyn" else []
    by_c = vsacli(command, ROBOT, motion, "--engine", "c", "--threads", "1", "-v", *options)
    assert by_c.code == by_numpy.code == 0
    # The self-check says how large rounding is.
    *report, check = by_c.out.splitlines()
    assert report == by_numpy.out.splitlines()[:-1]
    assert check.startswith("self-check passed")
    assert "C code computes, compiled now, in 1 thread" in by_c.err.splitlines()


def test_asking_for_c_without_a_compiler_is_a_mistake(vsacli, motion, monkeypatch, tmp_path):
    monkeypatch.setenv("CC", "nocc")
    refused = vsacli("invdyn", ROBOT, motion, "--engine", "c")
    assert refused.code == 2
    assert refused.err == "there is no C compiler 'nocc'; the engine numpy needs none\n"
    assert not list(tmp_path.glob("*.h5"))
    assert vsacli("invdyn", ROBOT, motion, "--engine", "auto").code == 0


def test_no_threads_are_refused(vsacli, motion):
    assert vsacli("invdyn", ROBOT, motion, "--threads", "0").code == 2


def test_long_chains_are_worth_a_look_with_fewer_samples():
    """NumPy takes short blocks of them, in which its calls count, so a sample takes longer for each joint."""
    few, many = (usual_block_samples(10_000, 5 * joints) for joints in (3, 1000))
    assert few == 10_000
    assert LOOK_FROM < many < 50 * few


def test_compiling_repays_neither_for_little_work_nor_for_long_code():
    short, arm, long = (Code("", sum(functions), functions) for functions in ((200,), (4_500,), (100_000,)))
    assert [choice._repays_compiling(code, 1_000_000) for code in (short, arm, long)] == [False, True, False]
    assert choice._repays_compiling(Code("", 100_000, (500,) * 200), 1_000_000)


@pytest.mark.slow
@needs_compiler
def test_measured_springs_are_left_to_numpy_until_tracing_repays():
    """48,000 to 96,000 samples take NumPy 0.1 to 0.2 s, and tracing alone 0.2 s, compiled before or not."""
    kernel = BalancedDynamics(InverseDynamics(shipped_robot("measured_1r")))
    assert choose_engine("c", kernel, 1).reason.startswith("C code computes, compiled now")
    for samples in (48_000, 96_000):
        assert choose_engine("auto", kernel, samples).engine is NUMPY
    assert choose_engine("auto", kernel, 200_000).reason.startswith("C code computes")


@pytest.mark.slow
def test_what_rarely_runs_counts_little():
    """Fallbacks of the iterations are five sixths of the operations, and take a tenth of the time."""
    code = kernel_code(BalancedDynamics(InverseDynamics(shipped_robot("measured_1r"))))
    assert not code.straight
    assert code.operations < sum(code.functions) / 4
    # NumPy takes 1.3 us a sample, and the compiler 4 s
    assert not choice._repays_compiling(code, 1_000_000)
    assert choice._repays_compiling(code, 10_000_000)


@needs_compiler
def test_the_choice_is_the_same_again():
    kernel = BalancedDynamics(InverseDynamics(shipped_robot("vsa_3r")))
    chosen = [settle_engine("auto", kernel, samples) for samples in (200_000, 900_000, 5_000_000)]
    kernel_code.cache_clear()
    assert [settle_engine("auto", kernel, samples) for samples in (200_000, 900_000, 5_000_000)] == chosen
    assert [each.name for each in chosen] == ["numpy", "numpy", "c"]


@pytest.mark.parametrize(("joints", "shares"), [(10, False), (100, True)])
def test_long_chains_of_branches_share_functions(joints: int, shares: bool):
    """Written out, 100 joints took the compiler 13 s."""
    kernel = IntervalEnergy(_chain(shipped_robot("tendon_1r"), joints), with_friction=False)
    assert is_of_calls(kernel_program(kernel)) is shares
    assert kernel_code(kernel).compiling_seconds < 4


@pytest.mark.slow
@pytest.mark.parametrize(("joints", "shares"), [(1, False), (3, True)])
def test_chains_of_loops_share_functions(joints: int, shares: bool):
    """Written out, seven joints with measured springs took the compiler 33 s."""
    kernel = BalancedDynamics(InverseDynamics(_chain(shipped_robot("measured_1r"), joints)))
    assert is_of_calls(kernel_program(kernel)) is shares
    assert kernel_code(kernel).compiling_seconds < 4


def _chain(robot: Robot, joints: int) -> Robot:
    (joint,) = robot.joints
    numbered = (dataclasses.replace(joint, name=f"{joint.name}{number}") for number in range(joints))
    return dataclasses.replace(robot, joints=tuple(numbered))


# Environments in which "auto" computes with NumPy, and "c" says why it cannot


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ("'", r"the environment variable CC is not a command: \"'\" \(No closing quotation\)"),
        pytest.param("cc -ffast-math", "'cc -ffast-math' enables -ffast-math or", marks=needs_compiler),
        pytest.param("cc -Ofast", "'cc -Ofast' enables", marks=needs_compiler),
        pytest.param("cc -ffinite-math-only", "'cc -ffinite-math-only' enables", marks=needs_compiler),
    ],
)
def test_compiler_that_is_not_taken(command: str, reason: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("CC", command)
    assert re.search(reason, choose_engine("auto", KERNEL, 10_000_000).reason)
    with pytest.raises(InputError, match=reason):
        choose_engine("c", KERNEL, 1)


@needs_compiler
@pytest.mark.parametrize("folder", ["/nonexistent", "/dev/full"])
def test_without_a_folder_for_temporary_files(folder: str, temporary_files: Any):
    temporary_files(folder)
    reason = "folder for temporary files: cannot be used: "
    assert reason in choose_engine("auto", KERNEL, 10_000_000).reason
    with pytest.raises(InputError, match=reason):
        choose_engine("c", KERNEL, 1)


@pytest.mark.slow
@needs_compiler
def test_a_cached_library_that_cannot_be_loaded_is_compiled_anew(own_cache: Path):
    """As from a folder from which nothing may be run."""
    choose_engine("c", KERNEL, 1)
    (library,) = own_cache.rglob(LIBRARY)
    library.unlink()  # this process has loaded it: another file takes its place
    library.write_bytes(b"no program")
    library.with_name(CHECKSUM).write_text(hashlib.sha256(b"no program").hexdigest())
    _loaded_libraries.clear()
    said: list[str] = []
    assert choose_engine("c", KERNEL, 1, tell=said.append).reason.startswith("C code computes, compiled now")
    (sentence,) = said
    assert "cannot be loaded: " in sentence
    assert sentence.endswith("; it is compiled anew")


@needs_compiler
def test_what_takes_long_is_announced_and_what_takes_too_long_refused():
    def compile_functions(*operations: int) -> list[str]:
        said: list[str] = []
        text = f"void one(double *result) {{ *result = 1; }} // {operations}"
        trial = Trial("one", [(8,)], np.ones((1, 1)))
        code = Code(text, sum(operations), operations)
        load(code, lambda path: path.name, system_compiler(), said.append, lambda: trial)
        return said

    assert compile_functions(1000) == []
    (sentence,) = compile_functions(20_000)
    assert re.fullmatch(r"compiling takes about \d+ s, this once \(at most 120 s\)", sentence)
    refused = r"compiling 200000 operations would take about \d+ s, more than 120 s"
    with pytest.raises(CompilerError, match=refused):
        compile_functions(100_000, 100_000)


@needs_compiler
def test_a_compiler_that_hangs_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    program(tmp_path, "slowcc", "exec sleep 60")
    monkeypatch.setenv("CC", str(tmp_path / "slowcc"))
    monkeypatch.setattr(compiler, "TIMEOUT", 0.2)
    assert choose_engine("auto", KERNEL, 10_000_000).reason.endswith("took more than 0.2 s")


def test_a_relative_cache_folder_does_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "cache")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert open_cache().folder == tmp_path / ".cache" / "vsacli"
