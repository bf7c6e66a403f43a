"""The command group, the program's entry point, and the exit codes of errors."""

from __future__ import annotations

import errno
import gc
import io
import os
import sys
import warnings
from collections.abc import Mapping, MutableMapping, Sequence
from typing import Any, NoReturn, cast

import click

from vsacli.base.errors import InputError, StorageError
from vsacli.base.interrupts import Interrupted, unwinding_when_ended
from vsacli.base.lazy import LazyRegistry
from vsacli.base.storage import reason
from vsacli.base.version import __version__
from vsacli.cli.command_parts import example
from vsacli.cli.console import Exit, OutputClosedError, flush_notes, reporting_stdout_errors, tell
from vsacli.cli.input_errors import file_kind_or_none, in_words

_EPILOG = example("vsacli invdyn robots/vsa_3r.yaml trajectories/rest_to_rest.yaml")
_EPILOG += """

\b
Exit codes (all: docs/cli.md):
  0  done                       1  bug or failed self-check
  2  usage or input error       3  completed with findings (see the report)
  4  cannot read or write       128 + n  ended by signal n"""


_SECTIONS = {
    "Computing": {
        "invdyn": "Compute the motor torques that execute a trajectory.",
        "check-feasibility": "Report whether a robot can execute a trajectory.",
        "simulate": "Simulate the robot's full dynamics under a controller.",
        "codegen": "Generate C code of a robot for its controller.",
        "sensitivity": "Rank robot parameters by their effect on a motion.",
        "identify": "Identify robot parameters from recordings.",
        "study": "Compute many runs with varied parameters or motions.",
        "optimize": "Optimize the stiffness or the timing of a motion.",
        "size": "Select motors, gears and springs for given motions.",
    },
    "Results": {
        "plot": "Plot robots, results, simulations and recordings.",
        "export": "Export results, or the robot, for other programs.",
        "compare": "Compare a result with a recording or another result.",
    },
    "Files": {
        "new": "Create a commented robot, trajectory or study file.",
        "examples": "List the bundled robots and trajectories, or copy them.",
        "import-urdf": "Convert a URDF to a robot file.",
        "validate": "Report every problem of files of any kind.",
        "info": "Describe a robot, trajectory, recording or result.",
        "schema": "Print the JSON Schema of a YAML format, for editors.",
    },
}
_SHORT_HELP = {name: text for section in _SECTIONS.values() for name, text in section.items()}


class Commands(LazyRegistry):
    """Commands by name, each imported at first use: command `a-b` is the function `a_b` of `cli/a_b.py`.

    The list of `vsacli --help` imports none of them.
    """

    def __init__(self) -> None:
        functions = {name: name.replace("-", "_") for name in _SHORT_HELP}
        super().__init__({name: f"vsacli.cli.{function}:{function}" for name, function in functions.items()})

    def __getitem__(self, name: str) -> click.Command:
        command: click.Command = super().__getitem__(name)
        command.short_help = _SHORT_HELP[name]
        return command


class SectionedGroup(click.Group):
    """A command group whose help lists the commands by `sections`, headings with names."""

    def __init__(self, *args: Any, sections: Mapping[str, Sequence[str]], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.sections = sections

    def list_commands(self, _context: click.Context) -> list[str]:
        """Return the names of all commands."""
        return [name for names in self.sections.values() for name in names]

    def resolve_command(
        self, context: click.Context, words: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """See `click.Group.resolve_command`."""
        if words[0] == "help":
            raise click.UsageError("No such command 'help'; did you mean --help?", context)
        return super().resolve_command(context, words)

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a list for each section, with aligned columns."""
        width = max(map(len, self.list_commands(context)))
        for heading, names in self.sections.items():
            with formatter.section(heading):
                formatter.write_dl([(name.ljust(width), _SHORT_HELP[name]) for name in names])


@click.group(
    cls=SectionedGroup,
    sections={heading: tuple(section) for heading, section in _SECTIONS.items()},
    commands=cast("MutableMapping[str, click.Command]", Commands()),  # click only looks commands up
    context_settings={"help_option_names": ["-h", "--help"]},
    short_help="Inverse dynamics of robots with variable stiffness actuators.",
    epilog=_EPILOG,
)
@click.version_option(__version__, message="%(prog)s %(version)s")
def vsacli() -> None:
    """Inverse dynamics of robots with variable stiffness actuators.

    From a robot and a trajectory, compute the motor torques that execute a motion and a stiffness profile,
    and report what is infeasible, where, by how much, and how to fix it.
    """


FIRST_FREE_DESCRIPTOR = 3
"""Lowest file descriptor that is not a standard stream."""


def main() -> NoReturn:
    """Run the command `vsacli` and exit."""
    _hold_closed_streams()
    if not sys.warnoptions:  # NumPy's warnings are for developers, who can set `python -W`
        warnings.simplefilter("ignore", RuntimeWarning)
        os.environ["PYTHONWARNINGS"] = "ignore::RuntimeWarning"  # for worker processes
    os.environ["MPLBACKEND"] = "agg"  # notebooks set a backend that may not be installed here
    if isinstance(sys.stdout, io.TextIOWrapper):  # names may have characters unknown to the terminal
        sys.stdout.reconfigure(errors="backslashreplace")
    with unwinding_when_ended():
        code = run(sys.argv[1:])
    flush_notes()
    gc.freeze()  # else Python collects garbage once more before it exits
    sys.exit(code)


def _hold_closed_streams() -> None:
    """Open standard streams that the caller closed, as by `>&-`.

    Otherwise an opened file gets the descriptor of such a stream, and a library may print into it.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) < FIRST_FREE_DESCRIPTOR:
        os.set_inheritable(number, True)
    os.close(number)


def run(arguments: Sequence[str]) -> int:
    """Run a command line; turn errors into messages on stderr and an exit code."""
    try:
        with reporting_stdout_errors():
            code = vsacli.main(args=list(arguments), prog_name="vsacli", standalone_mode=False)
    except click.ClickException as error:
        message = io.StringIO()
        _with_advice(error).show(message)
        return _fail(message.getvalue().rstrip("\n"), Exit.USAGE)
    except Interrupted as error:
        return _fail_interrupted(error)
    except (click.Abort, KeyboardInterrupt):
        return _fail("interrupted", Exit.INTERRUPTED)
    except InputError as error:
        return _fail(str(error), Exit.USAGE)
    except OutputClosedError:
        return Exit.CUT_OFF
    except StorageError as error:
        return _fail(str(error), Exit.STORAGE)
    except Exception as error:
        if isinstance(error.__cause__, Interrupted):  # Python 3.11 wraps errors raised in `__set_name__`
            return _fail_interrupted(error.__cause__)
        import traceback

        traceback_text = traceback.format_exc()
        if os.strerror(errno.EMFILE) in traceback_text:  # in any error of the chain, such as one of an import
            return _fail(f"the command cannot go on: {reason(OSError(errno.EMFILE, ''))}", Exit.STORAGE)
        return _fail(
            f"{traceback_text}vsacli: this is a bug; please report it with the lines above", Exit.BUG
        )
    return int(code or Exit.OK)


def _with_advice(error: click.ClickException) -> click.ClickException:
    """Return the error of a renamed option with its present name, of a missing input with what is there.

    Any other error is returned as it is.
    """
    if isinstance(error, click.NoSuchOption) and error.ctx:
        from vsacli.base.renamed import successor, usage  # loaded for error messages only

        options = [name for parameter in error.ctx.command.params for name in parameter.opts]
        if new_name := successor(error.option_name, options):
            return click.UsageError(
                f"{error.option_name} is now {usage(error.option_name) or new_name}", error.ctx
            )
        arguments = [each for each in error.ctx.command.params if isinstance(each, click.Argument)]
        if error.option_name.strip("-") in [each.name for each in arguments]:
            words = [error.ctx.command_path, *(each.make_metavar(error.ctx) for each in arguments)]
            return click.UsageError(f"{error.option_name} is no option: write {' '.join(words)}", error.ctx)
    if isinstance(error, click.MissingParameter) and error.ctx and (path := error.ctx.params.get("robot")):
        kind = file_kind_or_none(path)
        if kind in ("result", "simulation"):
            missing = error.format_message().rstrip(".")
            hint = f"{path} is {in_words(kind)}: vsacli info {path} shows its report"
            return click.UsageError(f"{missing}; {hint}", error.ctx)
    return error


def _fail_interrupted(interrupt: Interrupted) -> int:
    return _fail(str(interrupt), 128 + interrupt.number)  # shell convention for processes ended by a signal


def _fail(message: str, code: int) -> int:
    tell(message)
    return code
