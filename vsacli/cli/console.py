"""Output to the user: results on stdout, notes and progress on stderr, and exit codes."""

from __future__ import annotations

import enum
import errno
import io
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, redirect_stdout, suppress
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any, Protocol, Self, TextIO, cast

import click

from vsacli.base.errors import InputError, StorageError, VsacliError
from vsacli.base.fitted_text import fitted
from vsacli.base.progress import NoBar, unseen
from vsacli.base.texts import for_terminal, one_line, verdict_words

if TYPE_CHECKING:
    from vsacli.base.outputs import Outputs

PROGRESS_FROM = 100_000
"""Number of samples from which a run takes long enough for a progress bar."""

LOOKING_FROM = 20_000_000
"""Size (bytes) from which the analysis of a recording takes longer than a second."""

SECONDS_PER_LINE = 30.0
"""Time between two lines on progress where there is no terminal, s."""

WRITING_FROM = 2_000_000
"""Number of samples from which writing them as CSV takes longer than a second."""


class Exit(enum.IntEnum):
    """Exit codes, each with its meaning as printed in the help and in the documentation."""

    meaning: str

    OK = 0, "done; every sample feasible, regular and within limits"
    BUG = 1, "a bug, or a result whose self-check failed (written, with that verdict)"
    USAGE = 2, "usage or input error: one line for each problem; nothing written"
    VERDICT = 3, "completed with findings: see the report"
    STORAGE = 4, "a file cannot be read or written (disk full, permission); the target is untouched"
    HUNG_UP = 129, "ended by SIGHUP, as when a terminal is closed; the target is untouched"
    INTERRUPTED = 130, "interrupted (Ctrl-C); the target is untouched"
    CUT_OFF = 141, "standard output was closed by its reader, as `head` does"
    TERMINATED = 143, "ended by SIGTERM, as batch systems do; the target is untouched"

    def __new__(cls, code: int, meaning: str) -> Self:
        """Return a code with its meaning."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.meaning = meaning
        return member


GREEN, YELLOW, RED = ("\x1b[1;32m", "\x1b[1;33m", "\x1b[1;31m")
PLAIN = "\x1b[0m"
"""Escape sequence that ends a color. All colors are bold too, so that verdicts stand out without them."""

COLORS = {"ok": GREEN, **dict.fromkeys(("over_limit", "unreliable", "off_target", "unidentifiable"), YELLOW)}
"""Color of a verdict; every other is red."""

EXIT_OF_VERDICT = {
    "ok": Exit.OK,
    "over_limit": Exit.VERDICT,
    "singular": Exit.VERDICT,
    "infeasible": Exit.VERDICT,
    "unreliable": Exit.VERDICT,
    "poor_fit": Exit.VERDICT,
    "unidentifiable": Exit.VERDICT,
    "insufficient": Exit.VERDICT,
    "incomplete": Exit.VERDICT,
    "self_check_failed": Exit.BUG,
}
"""Exit code of a run for each verdict of its report."""


class OutputError(StorageError):
    """Failure to write to standard output."""


class OutputClosedError(OutputError):
    """Standard output whose reader has exited, as `head` does; there is nobody to report the error to."""


def tell(message: str) -> None:
    """Print a message on stderr; failure to print it does not fail the run."""
    with suppress(OSError):
        click.echo(for_terminal(message), err=True)


class Reported(Protocol):
    """The findings of a command: a text for people, and JSON values for programs."""

    def as_json(self) -> dict[str, Any]:
        """Return JSON values."""


def say(findings: Reported, as_json: bool, text: object = None) -> None:
    """Print the findings of a command, as JSON or as text."""
    if as_json:
        say_json(findings.as_json())
    else:
        say_text(str(findings if text is None else text), getattr(findings, "verdict", ""))


def say_json(content: Mapping[str, Any]) -> None:
    """Print JSON."""
    with _ignoring_closed_reader():
        click.echo(json.dumps(content, indent=1))


def say_text(text: str, verdict: str = "") -> None:
    """Print a text: on a terminal fitted to its width, the verdict at its beginning in color."""
    text = for_width(text)
    place = verdict_place(text, verdict)
    with _ignoring_closed_reader():
        if place is not None and isinstance(sys.stdout, _CheckedOutput) and _shows_color():
            sys.stdout.write_colored(text, place, COLORS.get(verdict, RED))
            sys.stdout.flush()
        else:
            click.echo(text)


def for_width(text: str) -> str:
    """Return a text fitted to the width of the terminal; unchanged if standard output is not a terminal."""
    width = _terminal_width(sys.stdout)
    if not width:
        return text
    return fitted(text, width)


@contextmanager
def _ignoring_closed_reader() -> Iterator[None]:
    """Ignore a closed reader of standard output within this context, so that the exit code is kept."""
    try:
        yield
    except OutputClosedError:
        _discard_buffer(sys.stdout)


def verdict_place(text: str, verdict: str) -> slice | None:
    """Return where the verdict stands at the beginning of a report; None without one."""
    words = verdict_words(verdict)
    return slice(0, len(words)) if verdict and text.startswith(words) else None


def _terminal_width(stream: TextIO | None) -> int:
    """Return the width (columns) of the terminal behind a stream; 0 if it is not a terminal."""
    try:
        if stream is None or not stream.isatty():
            return 0
        return os.get_terminal_size(stream.fileno()).columns
    except (OSError, ValueError):
        return 0


def _shows_color() -> bool:
    """Return whether standard output is a terminal whose user wants colors (no-color.org)."""
    wants_color = not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    return wants_color and sys.stdout.isatty()


class ProgressLines(NoBar):
    """A bar for a log file: a line on stderr every `SECONDS_PER_LINE`.

    Args:
        length: number of steps.
        label: what is going on.
    """

    def __init__(self, length: int, label: str) -> None:
        self._length, self._label = length, label
        self._start = self._last_line_time = time.monotonic()

    def update(self, steps: int, /) -> None:
        """Count steps that are done."""
        super().update(steps)
        time_now = time.monotonic()
        if time_now - self._last_line_time >= SECONDS_PER_LINE:
            self._last_line_time = time_now
            done_text = f"{self.pos} of {self._length} ({100 * self.pos / self._length:.0f} %)"
            tell(f"{self._label}: {done_text} after {time_now - self._start:.0f} s")


@dataclass(frozen=True)
class Talk:
    """Notes on stderr, filtered by `--quiet` and `--verbose`."""

    quiet: bool
    verbose: bool

    def note(self, message: str) -> None:
        """Print a message that most users want to read."""
        if not self.quiet:
            tell(message)

    def wrote(self, outputs: Outputs) -> None:
        """Print the names of the files that were written."""
        for path in outputs.paths:
            self.note(f"wrote {one_line(str(path))}")

    def detail(self, message: str) -> None:
        """Print a message only with `--verbose`."""
        if message and self.verbose and not self.quiet:
            tell(message)

    def progress(
        self, steps: int, *, shown_from: int = PROGRESS_FROM, label: str = "computing"
    ) -> AbstractContextManager[Any]:
        """Return a progress bar for long work on a terminal; elsewhere, lines now and then if verbose."""
        if self.quiet or steps < shown_from:
            return unseen(steps)
        if sys.stderr.isatty():
            return click.progressbar(length=steps, label=label, file=sys.stderr)
        return nullcontext(ProgressLines(steps, label)) if self.verbose else unseen(steps)

    def fitting(self, samples: int) -> AbstractContextManager[Any]:
        """Return a progress bar over the samples of all components to which splines are fitted."""
        return self.progress(samples, label="fitting")

    def looking(self, size: int) -> AbstractContextManager[Any]:
        """Return a progress bar over the bytes of a recording that is analyzed."""
        return self.progress(size, shown_from=LOOKING_FROM, label="looking")

    def writing(self, samples: int) -> AbstractContextManager[Any]:
        """Return a progress bar over the samples of all variables that are written."""
        return self.progress(samples, shown_from=WRITING_FROM, label="writing")


def talk_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add `--quiet` and `--verbose`, passed to the command as one argument `talk`; refuse empty arguments."""

    @click.option("-q", "--quiet", is_flag=True, help="Suppress notes and the progress bar on stderr.")
    @click.option("-v", "--verbose", is_flag=True, help="Print more notes on stderr.")
    @wraps(command)
    def talking(*args: Any, quiet: bool, verbose: bool, **kwargs: Any) -> Any:
        _refuse_empty_texts(click.get_current_context())
        if quiet and verbose:
            raise click.UsageError("--quiet and --verbose exclude each other; give one")
        talk = Talk(quiet, verbose)
        try:
            return command(*args, talk=talk, **kwargs)
        except InputError as error:
            talk.detail(_library_message(error))
            raise

    return talking


def _library_message(error: BaseException) -> str:
    """Return the message of a library that an error stems from, on one line; empty if there is none."""
    while isinstance(error, VsacliError) and error.__cause__ is not None:
        error = error.__cause__
    return "" if isinstance(error, VsacliError) else f"cause: {' '.join(str(error).split())}"


def _refuse_empty_texts(context: click.Context) -> None:
    """Refuse empty arguments: they come from shell variables that are not set.

    Raises:
        click.UsageError: an argument is empty.
    """
    for parameter in context.command.params:
        value = context.params.get(parameter.name or "")
        if value == "" or (isinstance(value, tuple) and "" in value):
            name = parameter.get_error_hint(context)
            raise click.UsageError(f"{name} is empty; is a shell variable in the command unset?")


@contextmanager
def reporting_stdout_errors() -> Iterator[None]:
    """Raise an OutputError within this context if standard output cannot be written to."""
    stream: Any = sys.stdout or _ClosedOutput()
    try:
        with redirect_stdout(cast("TextIO", _CheckedOutput(stream))):
            yield
    except OutputError:
        if sys.stdout is not None:
            _discard_buffer(stream)
        raise


class _ClosedOutput(io.TextIOBase):
    """Standard output that was closed before the start, as by `>&-`."""

    def write(self, _text: str) -> int:
        """Raise the error of a closed file descriptor."""
        raise OSError(errno.EBADF, "it is closed")


class _CheckedOutput:
    """Wrapper of standard output that raises OutputError, so that failures, even in click, are no bugs."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        with _raising_output_errors():
            return self._stream.write(for_terminal(text))

    def write_colored(self, text: str, place: slice, color: str) -> None:
        """Write a line with one part in color; all other control characters are escaped."""
        before_text, verdict_text, after_text = (
            for_terminal(part) for part in (text[: place.start], text[place], text[place.stop :])
        )
        with _raising_output_errors():
            self._stream.write(f"{before_text}{color}{verdict_text}{PLAIN}{after_text}\n")

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


def flush_notes() -> None:
    """Flush stderr, and discard what cannot be written: at its exit Python would fail with code 120."""
    try:
        if sys.stderr is not None:
            sys.stderr.flush()
    except OSError:
        _discard_buffer(sys.stderr)


def _discard_buffer(stream: TextIO) -> None:
    """Redirect a stream to the null device: its buffer would fail again when the interpreter exits."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)
