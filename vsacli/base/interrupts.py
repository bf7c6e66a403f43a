"""Signals that end a run, raised as exceptions so that cleanup removes unfinished files."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Any

ENDING_SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
"""Signals of Ctrl-C, of the end or preemption of a batch job, and of a closed terminal."""

RESEND_DELAY = 0.01
"""Delay (s) before a signal is sent again that arrived where an exception cannot propagate."""


class Interrupted(BaseException):
    """Interruption of the run by a signal."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number

    def __str__(self) -> str:
        name = signal.Signals(self.number).name
        return "interrupted" if self.number == signal.SIGINT else f"ended from outside by {name}"


@contextlib.contextmanager
def unwinding_when_ended() -> Iterator[None]:
    """Raise `Interrupted` within this context on signals that end a process; afterwards they end it at once.

    A signal that the parent process ignores, as with `nohup`, stays ignored, and so do signals that arrive
    after all output is written (`Deferred.disregard`).
    """
    for number in ENDING_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _raise_interrupted)
    previous_hook = sys.unraisablehook

    def unraisable(unraisable_error: sys.UnraisableHookArgs) -> None:
        if isinstance(
            unraisable_error.exc_value, Interrupted
        ):  # in a callback of the interpreter, as of an import lock
            ended = threading.Timer(RESEND_DELAY, os.kill, (os.getpid(), unraisable_error.exc_value.number))
            ended.daemon = True
            ended.start()
        else:
            previous_hook(unraisable_error)

    sys.unraisablehook = unraisable
    try:
        yield
    finally:
        sys.unraisablehook = previous_hook
        for number in ENDING_SIGNALS:
            if signal.getsignal(number) is _raise_interrupted:
                signal.signal(number, signal.SIG_DFL)


def leave_interrupts_to_others() -> None:
    """Ignore Ctrl-C in a worker process: the main process receives it too, and ends the worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextlib.contextmanager
def starting_worker() -> Iterator[None]:
    """Start a worker process within this context: Ctrl-C neither reaches it nor cuts off what it is sent.

    A process inherits blocked signals, and else would print a traceback before it can ignore them.
    """
    with interrupts_deferred():
        if not hasattr(signal, "pthread_sigmask"):
            yield
            return
        from multiprocessing import resource_tracker

        resource_tracker.ensure_running()  # it ends with unblocking Ctrl-C
        previous_mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, previous_mask)


def _raise_interrupted(number: int, _frame: object) -> None:
    raise Interrupted(number)


class Deferred:
    """Signals that are held back.

    Attributes:
        handlers: handlers to restore afterwards, by signal.
        arrived: signals that arrived meanwhile.
    """

    def __init__(self) -> None:
        handlers = {number: signal.getsignal(number) for number in ENDING_SIGNALS}
        self.handlers: dict[int, Any] = {
            each: handler for each, handler in handlers.items() if callable(handler)
        }
        self.arrived: list[int] = []

    def disregard(self) -> None:
        """Ignore signals that would interrupt the run, now and later: its work is done."""
        for number, handler in self.handlers.items():
            if handler is _raise_interrupted:
                self.handlers[number] = signal.SIG_IGN
                self.arrived = [signal_number for signal_number in self.arrived if signal_number != number]


@contextlib.contextmanager
def interrupts_deferred() -> Iterator[Deferred]:
    """Defer signals that would interrupt the enclosed statements until these are done.

    In a thread other than the main one, where signal handlers never run, this does nothing.
    """
    deferred = Deferred()
    if threading.current_thread() is not threading.main_thread():
        yield deferred
        return
    try:
        for number in deferred.handlers:
            signal.signal(number, lambda arrived_signal, _: deferred.arrived.append(arrived_signal))
        yield deferred
    finally:
        for number, handler in deferred.handlers.items():
            signal.signal(number, handler)
        if deferred.arrived:
            signal.raise_signal(deferred.arrived[0])
