"""A run that is ended from outside leaves the old complete file, or none."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import h5py
import pytest
from samples.command_line import (
    COMMAND,
    REST_TO_REST,
    ROBOT,
    SEVEN_JOINTS,
    contents,
    installed,
    seven_joint_motion,
)
from samples.disturbed import allow_interrupts
from samples.marks import slow

from vsacli.base.interrupts import Interrupted

PATIENCE = 60
"""Seconds until a run that should have started writing counts as broken."""


ENDINGS = {
    signal.SIGINT: (130, "interrupted"),
    signal.SIGTERM: (143, "ended from outside by SIGTERM"),
    signal.SIGHUP: (129, "ended from outside by SIGHUP"),
}
"""Exit code and message of a run that a signal ends; the codes are those of shells, 128 and the number."""


def started(*command, folder, before=allow_interrupts, **options):
    """A process in a folder, whose standard streams are read as text."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(list(command), cwd=folder, preexec_fn=before, **{**pipes, **options})


@pytest.fixture
def writing(tmp_path):
    """A run of a million samples that writes r.h5, and is in the middle of it."""
    seven_joint_motion(tmp_path / "long.yaml", rate=333_333)
    arguments = [SEVEN_JOINTS, "long.yaml", "-o", "r.h5", "--variables", "tau_motor,flags", "--overwrite"]
    with started(COMMAND, "invdyn", *arguments, folder=tmp_path) as process:
        deadline = time.monotonic() + PATIENCE
        while sum(path.stat().st_size for path in temporaries(tmp_path)) < 5_000_000:  # bytes, of 130 MB
            assert time.monotonic() < deadline, "nothing is written"
            assert process.poll() is None, process.communicate()
            time.sleep(0.02)
        yield process
        process.kill()


def temporaries(folder):
    return list(folder.glob(".vsacli-*.tmp"))


OLD = b"old and complete"


@pytest.fixture(params=[OLD, slow(None)], ids=["overwriting", "new"])
def target(request, tmp_path):
    """What stands at r.h5 before: a file or nothing."""
    if request.param is not None:
        (tmp_path / "r.h5").write_bytes(request.param)
    return {} if request.param is None else {"r.h5": request.param}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "target"),
    [(signal.SIGINT, OLD), (signal.SIGTERM, OLD), (signal.SIGHUP, None)],
    indirect=["target"],
)
def test_ended_run_leaves_the_target_and_nothing_else(tmp_path, target, writing, number):
    writing.send_signal(number)
    out, err = writing.communicate(timeout=PATIENCE)
    assert (writing.returncode, out, err) == (ENDINGS[number][0], "", f"{ENDINGS[number][1]}\n")
    left = contents(tmp_path)
    del left["long.yaml"]
    assert left == target


@pytest.mark.cases(1)
@pytest.mark.slow
def test_killed_run_leaves_the_target_and_does_not_disturb_the_next(tmp_path, target, writing, motion):
    writing.kill()
    out, err = writing.communicate(timeout=PATIENCE)
    assert (writing.returncode, out, err) == (-signal.SIGKILL, "", "")
    left = contents(tmp_path)
    assert {name: left[name] for name in left if not name.startswith(".") and name.endswith(".h5")} == target
    assert installed("invdyn", ROBOT, motion, "-o", "r.h5", "--overwrite", folder=tmp_path).returncode == 0
    with h5py.File(tmp_path / "r.h5") as file:
        assert file.attrs["complete"] == 1
    assert not temporaries(tmp_path)  # the next run has swept what was left


def test_interrupt_without_a_file(tmp_path):
    seven_joint_motion(tmp_path / "long.yaml", rate=3_333_333)
    command = [COMMAND, "check-feasibility", SEVEN_JOINTS, "long.yaml", "-v"]
    with started(*command, folder=tmp_path) as process:
        assert process.stderr.readline().startswith("lwr-7r-vsa: 7 joints;")  # the inputs are read
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, out, err.strip()) == (130, "", "interrupted")


@pytest.mark.slow
def test_signals_that_the_parent_ignores_stay_ignored(tmp_path, motion):
    """As under `nohup`: signals from 0.05 s on, past the start of Python, change nothing."""
    command = [COMMAND, "invdyn", ROBOT, motion, "-o", "r.h5"]
    nowhere = subprocess.DEVNULL
    with started(*command, folder=tmp_path, before=ignore_signals, stdout=nowhere) as process:
        while process.poll() is None:
            time.sleep(0.05)
            for number in ENDINGS:
                process.send_signal(number)
        assert (process.returncode, process.stderr.read()) == (0, "wrote r.h5\n")


def ignore_signals():
    for number in ENDINGS:
        signal.signal(number, signal.SIG_IGN)


@pytest.mark.parametrize("imported", ["click.core", "numpy.linalg"])
def test_interrupt_in_the_first_instants_is_quiet(tmp_path, motion, imported):
    """It comes as soon as a module has been imported, which Python is told to say."""
    command = [sys.executable, "-X", "importtime", "-m", "vsacli", "invdyn", ROBOT, motion, "-o", "r.h5"]
    with started(*command, folder=tmp_path, stdout=None) as process:
        while not process.stderr.readline().rstrip().endswith(f" {imported}"):
            assert process.poll() is None, "the module is not imported"
        process.send_signal(signal.SIGINT)
        said = [line for line in process.stderr if not line.startswith("import time:")]
    assert (process.returncode, said) in [(130, ["interrupted\n"]), (-signal.SIGINT, [])]
    assert not (tmp_path / "r.h5").exists()


HALFWAY = """\
import atexit, signal, sys
from vsacli.__main__ import main
register = atexit.register
def interrupted(function, *arguments):
    if function.__name__ == "unregister_converters":
        signal.raise_signal(signal.SIGINT)
    return register(function, *arguments)
atexit.register = interrupted
sys.argv[0] = "vsacli"
main()
"""
"""A command that Ctrl-C reaches when h5py is imported by half, into which HDF5 would call at the end."""


@pytest.mark.slow
def test_interrupt_while_h5py_is_imported(tmp_path, motion):
    command = [sys.executable, "-c", HALFWAY, "invdyn", str(ROBOT), str(motion), "-o", "r.h5"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (128 + signal.SIGINT, "interrupted\n")
    assert not (tmp_path / "r.h5").exists()


def test_a_signal_in_a_callback_of_python_comes_again() -> None:
    """There an exception is not passed on; nothing is printed about that either."""
    program = """
import os, signal, time, weakref
from vsacli.base.interrupts import Interrupted, unwinding_when_ended

class Thing:
    pass

with unwinding_when_ended():
    thing = Thing()
    kept = weakref.ref(thing, lambda _: os.kill(os.getpid(), signal.SIGTERM))
    try:
        del thing
        time.sleep(10)
    except Interrupted as error:
        print(error)
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=30, check=True
    )
    assert (done.stdout, done.stderr) == ("ended from outside by SIGTERM\n", "")


def test_a_signal_in_the_making_of_a_class_is_no_bug(vsacli, command_is) -> None:
    """Where a class is made, Python 3.11 passes an exception on as the cause of another one."""

    class Begins:
        def __set_name__(self, _owner: type, _name: str) -> None:
            raise Interrupted(signal.SIGTERM)

    command_is(lambda: type("Made", (), {"attribute": Begins()}))
    outcome = vsacli("schema")
    assert (outcome.code, outcome.err) == (143, "ended from outside by SIGTERM\n")


@pytest.mark.slow
def test_interrupt_while_workers_start_is_quiet(tmp_path):
    """It reaches all processes of the terminal, here when a worker has begun to import."""
    head = f"format: vsacli-study/1\nname: many\nrobot: {ROBOT}\ntrajectory: {REST_TO_REST}\n"
    (tmp_path / "study.yaml").write_text(f"{head}vary: {{rate: {[*range(10, 90)]}}}\n")
    command = [sys.executable, "-X", "importtime", "-m", "vsacli", "study", "study.yaml", "--processes", "2"]
    with started(*command, folder=tmp_path, start_new_session=True) as process:
        begun = 0
        while begun < 2:  # the module that starts workers, here and then in the first of them
            line = process.stderr.readline()
            assert line, "no worker has started"
            begun += line.rstrip().endswith(" multiprocessing.spawn")
        os.killpg(process.pid, signal.SIGINT)
        said = [line for line in process.stderr if not line.startswith("import time:")]
    assert (process.returncode, said[1:]) == (130, ["interrupted\n"])
    assert said[0].startswith("no run had finished")
