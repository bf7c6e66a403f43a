"""Signals that end a run from outside unwind it, as an exception does, so that nothing half-made stays."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Any

ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Ctrl-C, the end of a batch job or its preemption, a terminal that is closed."""

AGAIN = 0.01
"""After which a signal comes again that came where nothing can be unwound, s."""


class Interrupted(BaseException):
    """A signal asked the run to end."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number

    def __str__(self) -> str:
        name = signal.Signals(self.number).name
        return "interrupted" if self.number == signal.SIGINT else f"ended from outside by {name}"


@contextlib.contextmanager
def unwinding_when_ended() -> Iterator[None]:
    """Within this context signals that end a process raise `Interrupted`; after it they end it at once.

    A signal that the parent set to be ignored, as `nohup` does, stays ignored, and so do those that come once
    all is written (`Deferred.disregard`).
    """
    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _unwind)
    otherwise = sys.unraisablehook

    def unraisable(what: sys.UnraisableHookArgs) -> None:
        if isinstance(what.exc_value, Interrupted):  # in a callback of Python's own, as of an import's lock
            ended = threading.Timer(AGAIN, os.kill, (os.getpid(), what.exc_value.number))
            ended.daemon = True
            ended.start()
        else:
            otherwise(what)

    sys.unraisablehook = unraisable
    try:
        yield
    finally:
        sys.unraisablehook = otherwise
        for number in ENDING:
            if signal.getsignal(number) is _unwind:
                signal.signal(number, signal.SIG_DFL)


def leave_interrupts_to_others() -> None:
    """Ignore Ctrl-C in a process that computes for another one: it reaches all, and that one ends this."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _unwind(number: int, _frame: object) -> None:
    raise Interrupted(number)


class Deferred:
    """Signals that wait.

    Attributes:
        handlers: actions afterwards, by signal.
        arrived: those that came meanwhile.
    """

    def __init__(self) -> None:
        handlers = {number: signal.getsignal(number) for number in ENDING}
        self.handlers: dict[int, Any] = {each: how for each, how in handlers.items() if callable(how)}
        self.arrived: list[int] = []

    def disregard(self) -> None:
        """Ignore signals that would unwind the run, now and later: its work is done."""
        for number, handler in self.handlers.items():
            if handler is _unwind:
                self.handlers[number] = signal.SIG_IGN
                self.arrived = [each for each in self.arrived if each != number]


@contextlib.contextmanager
def interrupts_deferred() -> Iterator[Deferred]:
    """Let signals that come during the enclosed statements, and would unwind them, take effect after them.

    In a thread other than the main one, where no signal handler ever runs, this does nothing.
    """
    deferred = Deferred()
    if threading.current_thread() is not threading.main_thread():
        yield deferred
        return
    try:
        for number in deferred.handlers:
            signal.signal(number, lambda came, _: deferred.arrived.append(came))
        yield deferred
    finally:
        for number, handler in deferred.handlers.items():
            signal.signal(number, handler)
        if deferred.arrived:
            signal.raise_signal(deferred.arrived[0])
