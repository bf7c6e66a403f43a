"""Usage errors, output that cannot be written, and standard output that is full or closed."""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys

import click
import pytest
from samples.command_line import COMMAND, REST_TO_REST, ROBOT, contents, edited, installed
from samples.marks import slow, slow_but

from vsacli import __version__
from vsacli.cli.console import Exit
from vsacli.cli.main import vsacli as group


def test_version(tmp_path):
    done = installed("--version", folder=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"vsacli {__version__}\n", "")


def test_help_names_every_command_and_exit_code(vsacli):
    short, long = vsacli("-h"), vsacli("--help")
    assert short == long
    assert (short.code, short.err) == (0, "")
    for command in group.commands:
        assert re.search(rf"^  {command} +\w.*\.$", short.out, re.MULTILINE)  # a whole sentence, not cut off
    listed = short.out.partition("Exit codes (all: docs/cli.md):\n")[2].splitlines()
    assert len(listed) == 3
    numbers = [int(number) for number in re.findall(r"(?:^| )(\d)  \w", "\n".join(listed), re.MULTILINE)]
    assert sorted(numbers) == [code.value for code in Exit if code.value < 128]
    assert max(map(len, short.out.splitlines())) <= 80


def test_help_lists_commands_by_use(vsacli):
    listing = vsacli("--help").out.partition("\nComputing:\n")[2].partition("Example:")[0]
    assert re.findall(r"^  ([\w-]+) ", listing, re.MULTILINE) == list(group.commands)
    assert re.findall(r"^(\w+):$", listing, re.MULTILINE) == ["Results", "Files"]


@pytest.mark.parametrize("command", group.commands)
def test_help_of_a_command_explains_each_option_and_shows_an_example(vsacli, command):
    done = vsacli(command, "-h")
    assert (done.code, done.err) == (0, "")
    assert f"Example:\n    vsacli {command} " in done.out
    options = [each for each in group.commands[command].params if isinstance(each, click.Option)]
    assert all(each.help and each.help.endswith(".") for each in options)
    assert len(max(done.out.splitlines(), key=len)) <= 100


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "Usage: vsacli"),
        (["invdyn", str(ROBOT)], "Missing argument 'TRAJECTORY'"),
        (["invdin"], "No such command 'invdin'"),
        (["plot"], "Missing argument 'FILE...'"),
        (
            ["export", "r.h5", "--rate", "fast"],
            "'fast' is not a number; expected samples per second, e.g. 1000",
        ),
        (["check-feasibility", "--jason"], "No such option"),
        (
            ["new", "study", "--robot", "a.yaml"],
            "--robot is no option: write vsacli new study ROBOT TRAJECTORY",
        ),
    ],
    ids=lambda value: " ".join(value)[:30] if isinstance(value, list) else "",
)
def test_usage_error(vsacli, tmp_path, arguments, message):
    done = vsacli(*arguments)
    assert (done.code, done.out) == (2, "")
    assert message in done.err
    assert contents(tmp_path) == {}


@pytest.mark.parametrize(
    ("output", "message"),
    [
        ("absent/r.h5", "there is no folder"),
        (".", "is a folder"),
        ("move.yaml/r.h5", "there is no folder|Not a directory"),
        ("/dev/null", "is not a regular file"),
        (f"{'r' * 300}.h5", "name is too long"),
    ],
    ids=["no folder", "a folder", "below a file", "a device", "long name"],
)
def test_result_that_cannot_be_written(vsacli, tmp_path, motion, output, message):
    done = vsacli("invdyn", ROBOT, motion, "-o", output)
    assert (done.code, done.out) == (4, "")
    assert re.search(message, done.err)
    assert done.err.count("\n") == 1
    assert contents(tmp_path).keys() == {"move.yaml"}


@pytest.mark.parametrize("command", ["invdyn", "export", "plot"])
def test_folder_without_permission(vsacli, tmp_path, motion, feasible_result, command):
    (tmp_path / "locked").mkdir(mode=0o555)
    if os.access(tmp_path / "locked", os.W_OK):
        pytest.skip("this user may write everywhere")
    arguments = {
        "invdyn": (ROBOT, motion, "-o", "locked/r.h5"),
        "export": (feasible_result, "-o", "locked/t.csv"),
        "plot": (feasible_result, "-o", "locked"),
    }
    done = vsacli(command, *arguments[command])
    assert done.code == 4
    assert "no permission" in done.err


@pytest.mark.parametrize("command", ["invdyn", "export", slow("plot")])
def test_full_disk_leaves_the_old_file(tmp_path, motion, feasible_result, command):
    (tmp_path / "r.h5").write_bytes(b"old result")
    (tmp_path / "t.csv").write_bytes(b"old torques")
    (tmp_path / "result-motion.png").write_bytes(b"old figure")
    arguments = {
        "invdyn": (ROBOT, motion, "-o", "r.h5"),
        "export": (feasible_result, "--variables", "theta,tau_motor,tau_e", "-o", "t.csv"),
        "plot": (feasible_result,),
    }
    before = contents(tmp_path)
    done = installed(command, *arguments[command], "--overwrite", folder=tmp_path, largest_file=50_000)
    assert (done.returncode, done.stdout) == (4, "")
    assert re.fullmatch(
        r"\S+: cannot be written: the file would exceed the largest file size allowed here\n", done.stderr
    )
    assert contents(tmp_path) == before


TO_STDOUT = {
    "help": ("--help",),
    "help of a command": ("invdyn", "--help"),
    "version": ("--version",),
    "report": ("check-feasibility", ROBOT, "move.yaml"),
    "table": ("export", "result.h5"),
}


@pytest.fixture(params=["", slow("1")], ids=["buffered", "unbuffered"])
def printing(request, tmp_path, motion, feasible_result, monkeypatch):
    """A folder in which each of `TO_STDOUT` prints something, at once or when the buffer is full."""
    monkeypatch.setenv("PYTHONUNBUFFERED", request.param)
    (tmp_path / "result.h5").symlink_to(feasible_result)
    assert motion.parent == tmp_path
    return tmp_path


@pytest.mark.cases(2)
@pytest.mark.parametrize("printed", slow_but({"help", "report"}, TO_STDOUT))
def test_full_stdout_is_told(printing, printed):
    arguments = TO_STDOUT[printed]
    with open("/dev/full", "w") as full:
        done = installed(*arguments, folder=printing, stdout=full)
    assert done.returncode == 4
    assert done.stderr == "standard output: cannot be written: No space left on device\n"


@pytest.mark.cases(2)
@pytest.mark.parametrize("printed", slow_but({"version", "report"}, TO_STDOUT))
def test_reader_that_went_away_is_no_trouble_to_talk_about(printing, printed):
    arguments = TO_STDOUT[printed]
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = installed(*arguments, folder=printing, stdout=writing)
    finally:
        os.close(writing)
    code = 0 if arguments[0] == "check-feasibility" else 141  # the code says what the report does
    assert (done.returncode, done.stderr) == (code, "")


def shell(command, folder):
    """Run a shell command that needs a redirection or a pipe."""
    return subprocess.run(command, shell=True, cwd=folder, capture_output=True, text=True, check=False)


def test_head_of_a_table(printing):
    done = shell(f"{COMMAND} export result.h5 --variables q,dq,ddq,tau_motor,theta | head -1", printing)
    assert (done.returncode, done.stderr) == (0, "")  # the exit code is that of `head`
    assert done.stdout.startswith("time,base.q,shoulder.q,")
    assert done.stdout.count("\n") == 1


CLOSED = "standard output: cannot be written: it is closed\n"


@pytest.mark.slow
@pytest.mark.cases(2)
@pytest.mark.parametrize(
    "arguments",
    [
        "export result.h5",
        "info result.h5",
        "info result.h5 --json",
        "info result.h5 --field verdict",
        "validate result.h5",
        f"check-feasibility {ROBOT} move.yaml",
        "new robot --joints R",
        "schema robot",
        "examples",
        "--help",
        "--version",
        "plot --help",
    ],
)
def test_what_a_closed_standard_output_loses_is_told(printing, arguments):
    done = shell(f"{COMMAND} {arguments} >&-", printing)
    assert (done.returncode, done.stderr) == (4, CLOSED)


@pytest.mark.cases(1)
@pytest.mark.parametrize("arguments", ["export result.h5 -o t.csv -q", slow("plot result.h5 -q -o .")])
def test_a_command_that_prints_nothing_needs_no_standard_output(printing, arguments):
    done = shell(f"{COMMAND} {arguments} >&-", printing)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_a_result_is_whole_although_its_report_is_lost(tmp_path, motion):
    done = shell(f"{COMMAND} invdyn {ROBOT} {motion} -o r.h5 >&-", tmp_path)
    assert (done.returncode, done.stderr) == (4, CLOSED)
    assert shell(f"{COMMAND} validate r.h5", tmp_path).returncode == 0


@pytest.mark.slow
def test_what_a_library_prints_never_goes_into_a_file(tmp_path):
    """A file would get the number of the standard output that was closed."""
    code = (
        "import os, sys; sys.argv = ['vsacli', 'new', 'robot', '--joints', 'R', '-o', 'arm.yaml']\n"
        "from vsacli.base import outputs\n"
        "def sync(path, mode):\n"
        "    with open(path, 'rb') as file: assert file.fileno() > 2, file.fileno()\n"
        "outputs._sync = sync\n"
        "from vsacli.cli.main import main; main()"
    )
    done = shell(f'{sys.executable} -c "{code}" <&- >&-', tmp_path)
    following = "next: vsacli new trajectory --robot arm.yaml -o move.yaml\n"
    assert (done.returncode, done.stderr) == (0, f"wrote arm.yaml\n{following}")


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (("invdyn", ROBOT, "move.yaml", "-o", "r.h5"), 0),
        (("invdyn", "absent.yaml", "move.yaml"), 2),
        (("x",), 2),
    ],
    ids=["note", "error", "usage"],
)
def test_full_stderr_does_not_change_the_exit_code(tmp_path, motion, arguments, code):
    assert motion == tmp_path / "move.yaml"
    with open("/dev/full", "w") as full:
        assert installed(*arguments, folder=tmp_path, stderr=full).returncode == code


@pytest.mark.slow
def test_name_with_letters_that_the_terminal_has_not(tmp_path, motion):
    edited(ROBOT, tmp_path / "r.yaml", ("name: vsa-3r", "name: φ-arm"))
    environment = {**os.environ, "PYTHONIOENCODING": "latin-1"}
    done = installed("check-feasibility", "r.yaml", motion, folder=tmp_path, env=environment)
    assert done.returncode == 0
    assert done.stdout.startswith("OK  \\u03c6-arm, rest-to-rest: 401 samples")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            "plot r.h5 -o fig.csv",
            "'fig.csv': expected a folder, or the name of a figure (.png, .pdf, .svg, .html)",
        ),
        (
            "invdyn a b --plot fig.html",
            "'fig.html': expected a folder, or the name of a figure (.png, .pdf, .svg)",
        ),
        ("codegen a -o arm.c", "'arm.c' looks like a file name, expected a folder; e.g. --output arm"),
        (
            "info r.h5 --extract arm.yaml",
            "'arm.yaml' looks like a file name, expected a folder; e.g. --extract arm",
        ),
        ("examples --copy arm.yaml", "'arm.yaml' looks like a file name, expected a folder; e.g. --copy arm"),
        ("invdyn a b -o r.mat", "'r.mat' does not end in .h5: the output is HDF5"),
        ("study s -o s.yaml", "'s.yaml' does not end in .h5: the output is HDF5"),
        ("new robot --joints R -o arm.urdf", "'arm.urdf' does not end in .yaml: the output is YAML"),
        ("optimize a b -o best.h5", "'best.h5' does not end in .yaml: the output is YAML"),
    ],
)
def test_a_name_that_promises_something_else_is_refused(vsacli, tmp_path, arguments, message):
    done = vsacli(*arguments.split())
    assert (done.code, done.out, list(tmp_path.iterdir())) == (2, "", [])
    assert re.search(rf"{re.escape(message)}$", done.err, re.MULTILINE)


def test_a_folder_that_is_called_as_files_are_may_be_used(vsacli, tmp_path):
    (tmp_path / "v1.c").mkdir()
    assert vsacli("codegen", ROBOT, "-o", "v1.c", "-q").code == 0
    assert (tmp_path / "v1.c").is_dir()


@pytest.mark.parametrize("command", ["invdyn", "simulate"])
def test_a_csv_name_for_an_hdf5_file_is_refused(vsacli, tmp_path, command):
    done = vsacli(command, ROBOT, REST_TO_REST, "-o", "torques.csv")
    assert done.code == Exit.USAGE
    assert (
        "'torques.csv' does not end in .h5: the output is HDF5; `vsacli export` writes CSV from it"
        in done.err
    )
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.EMFILE, os.strerror(errno.EMFILE)),
        ImportError(f"fast.so: cannot open shared object file: {os.strerror(errno.EMFILE)}"),
    ],
)
def test_too_many_open_files_are_no_bug(vsacli, command_is, error):
    def fail() -> None:
        raise error

    command_is(fail)
    outcome = vsacli("schema")
    advice = "too many files are open; `ulimit -n 256` allows more"
    assert (outcome.code, outcome.err) == (4, f"the command cannot go on: {advice}\n")
