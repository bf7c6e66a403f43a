"""Talking to the user: results to stdout, notes and progress to stderr, and the exit code."""

from __future__ import annotations

import enum
import errno
import io
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, redirect_stdout, suppress
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any, Protocol, Self, TextIO, cast

import click

from vsacli.base.errors import StorageError
from vsacli.base.progress import unseen
from vsacli.base.tables import verdict_words
from vsacli.base.texts import for_terminal

if TYPE_CHECKING:
    from vsacli.base.outputs import Outputs

PROGRESS_FROM = 100_000
"""Steps from which on a run is long enough for a progress bar."""

LOOKING_FROM = 20_000_000
"""Bytes of a recording from which on looking at them takes longer than a second."""

WRITING_FROM = 2_000_000
"""Samples from which on writing them takes longer than a second, as CSV."""


class Exit(enum.IntEnum):
    """Exit codes, each with its meaning: its line in the help and in the documentation."""

    meaning: str

    OK = 0, "done; every sample feasible, regular and within limits"
    BUG = 1, "a bug, or a result whose self-check failed (written, with that verdict)"
    USAGE = 2, "usage or input error: one line for each problem; nothing written"
    VERDICT = 3, "completed with findings: see the report"
    STORAGE = 4, "a file cannot be read or written (disk full, permission); the target is untouched"
    HUNG_UP = 129, "ended by SIGHUP, as when a terminal is closed; the target is untouched"
    INTERRUPTED = 130, "interrupted (Ctrl-C); the target is untouched"
    CUT_OFF = 141, "data on standard output was cut off: its reader has gone, as `head` does"
    TERMINATED = 143, "ended by SIGTERM, as batch systems do; the target is untouched"

    def __new__(cls, code: int, meaning: str) -> Self:
        """Return a code with its meaning."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.meaning = meaning
        return member


GREEN, YELLOW, RED = ("\x1b[1;32m", "\x1b[1;33m", "\x1b[1;31m")
PLAIN = "\x1b[0m"
"""Escape sequence that ends colors; each color is bold, too, to be seen without them."""

COLORS = {"ok": GREEN, **dict.fromkeys(("over_limit", "doubtful", "strayed", "untold"), YELLOW)}
"""Color of a verdict; every other is red."""

EXIT_OF_VERDICT = {
    "ok": Exit.OK,
    "over_limit": Exit.VERDICT,
    "singular": Exit.VERDICT,
    "infeasible": Exit.VERDICT,
    "doubtful": Exit.VERDICT,
    "misfit": Exit.VERDICT,
    "untold": Exit.VERDICT,
    "insufficient": Exit.VERDICT,
    "incomplete": Exit.VERDICT,
    "self_check_failed": Exit.BUG,
}
"""Exit code of a run by the verdict of its report."""


class OutputError(StorageError):
    """Standard output cannot be written."""


class OutputClosedError(OutputError):
    """The reader of standard output has gone, as `head` does; nobody is left to be told."""


def tell(message: str) -> None:
    """Print a message on stderr; a run does not fail because nobody can read it."""
    with suppress(OSError):
        click.echo(for_terminal(message), err=True)


class Reported(Protocol):
    """A finding of a command: a text for people, and JSON values for programs."""

    def as_json(self) -> dict[str, Any]:
        """Return JSON values."""


def say(found: Reported, as_json: bool) -> None:
    """Print the findings of a command, as JSON or as a text."""
    if as_json:
        say_json(found.as_json())
    else:
        say_text(str(found), getattr(found, "verdict", ""))


def say_json(content: Mapping[str, Any]) -> None:
    """Print JSON, whatever reads it."""
    with _read_enough():
        click.echo(json.dumps(content, indent=1))


def say_text(text: str, verdict: str = "") -> None:
    """Print a text: on a terminal fitted to its width, the verdict at its beginning in color."""
    text = for_width(text)
    place = verdict_place(text, verdict)
    with _read_enough():
        if place is not None and isinstance(sys.stdout, _CheckedOutput) and _colored():
            sys.stdout.write_colored(text, place, COLORS.get(verdict, RED))
            sys.stdout.flush()
        else:
            click.echo(text)


def for_width(text: str) -> str:
    """Return a text as it fits the terminal that standard output is; as it is where that is none."""
    width = _terminal_width(sys.stdout)
    if not width:
        return text
    from vsacli.base.fitted_text import fitted

    return fitted(text, width)


@contextmanager
def _read_enough() -> Iterator[None]:
    """Treat a reader that has gone as one that has read enough, within this context; keep the exit code."""
    try:
        yield
    except OutputClosedError:
        _discard_buffer(sys.stdout)


def verdict_place(text: str, verdict: str) -> slice | None:
    """Return where the verdict stands at the beginning of a report; None without one."""
    words = verdict_words(verdict)
    return slice(0, len(words)) if verdict and text.startswith(words) else None


def _terminal_width(stream: TextIO | None) -> int:
    """Columns of the terminal that a stream goes to; 0 if it goes elsewhere."""
    try:
        if stream is None or not stream.isatty():
            return 0
        return os.get_terminal_size(stream.fileno()).columns
    except (OSError, ValueError):
        return 0


def _colored() -> bool:
    """Return whether standard output is a terminal whose user wants colors (no-color.org)."""
    wanted = not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    return wanted and sys.stdout.isatty()


@dataclass(frozen=True)
class Talk:
    """Notes on stderr, as loud as the user wants them."""

    quiet: bool
    verbose: bool

    def note(self, message: str) -> None:
        """Something most users want to know."""
        if not self.quiet:
            tell(message)

    def wrote(self, outputs: Outputs) -> None:
        """Print the files that were written."""
        for path in outputs.paths:
            self.note(f"wrote {path}")

    def detail(self, message: str) -> None:
        """Something to know when looking closely."""
        if self.verbose and not self.quiet:
            tell(message)

    def progress(
        self, steps: int, *, shown_from: int = PROGRESS_FROM, label: str = "computing"
    ) -> AbstractContextManager[Any]:
        """Return a progress bar over steps, shown only for long work on a terminal."""
        if self.quiet or steps < shown_from or not sys.stderr.isatty():
            return unseen(steps)
        return click.progressbar(length=steps, label=label, file=sys.stderr)

    def fitting(self, samples: int) -> AbstractContextManager[Any]:
        """Return the same over the samples of all components that splines are fitted to."""
        return self.progress(samples, label="fitting")

    def looking(self, size: int) -> AbstractContextManager[Any]:
        """Return the same over the bytes of a recording that is looked at."""
        return self.progress(size, shown_from=LOOKING_FROM, label="looking")

    def writing(self, samples: int) -> AbstractContextManager[Any]:
        """Return the same over the samples of all variables that are written."""
        return self.progress(samples, shown_from=WRITING_FROM, label="writing")


def talk_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--quiet` and `--verbose`; the command receives them as one argument `talk`, and no empty text."""

    @click.option("-q", "--quiet", is_flag=True, help="No notes and no progress bar on stderr.")
    @click.option("-v", "--verbose", is_flag=True, help="More notes on stderr.")
    @wraps(command)
    def talking(*args: Any, quiet: bool, verbose: bool, **kwargs: Any) -> Any:
        _refuse_empty_texts(click.get_current_context())
        return command(*args, talk=Talk(quiet, verbose), **kwargs)

    return talking


def _refuse_empty_texts(context: click.Context) -> None:
    """An argument of no letters is a variable of the shell that was not set, and never meant.

    Raises:
        click.BadParameter: there is one.
    """
    for parameter in context.command.params:
        value = context.params.get(parameter.name or "")
        if value == "" or (isinstance(value, tuple) and "" in value):
            raise click.BadParameter("is empty; say what is meant", context, parameter)


@contextmanager
def reporting_stdout_errors() -> Iterator[None]:
    """Raise an OutputError, within this context, if standard output cannot be written."""
    stream: Any = sys.stdout or _ClosedOutput()
    try:
        with redirect_stdout(cast("TextIO", _CheckedOutput(stream))):
            yield
    except OutputError:
        if sys.stdout is not None:
            _discard_buffer(stream)
        raise


class _ClosedOutput(io.TextIOBase):
    """Standard output that was closed before the start, as by `>&-`: everything written to it is lost."""

    def write(self, _text: str) -> int:
        """Refuse it, as the system does."""
        raise OSError(errno.EBADF, "it is closed")


class _CheckedOutput:
    """Standard output whose failure is told from a bug: anything may print to it, click's help included."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        with _raising_output_errors():
            return self._stream.write(for_terminal(text))

    def write_colored(self, text: str, place: slice, color: str) -> None:
        """Write a text and the end of its line, a place in it in a colour; nothing else of it may act."""
        before, words, after = (
            for_terminal(part) for part in (text[: place.start], text[place], text[place.stop :])
        )
        with _raising_output_errors():
            self._stream.write(f"{before}{color}{words}{PLAIN}{after}\n")

    def flush(self) -> None:
        with _raising_output_errors():
            self._stream.flush()


@contextmanager
def _raising_output_errors() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError as error:
        raise OutputClosedError("standard output", "is closed") from error
    except OSError as error:
        raise OutputError("standard output", f"cannot be written: {error.strerror}") from error


def _discard_buffer(stream: TextIO) -> None:
    """Lead a stream nowhere: its buffer would fail once more when the interpreter ends."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)
