"""Signals that end a run from outside unwind it, as an exception does, so that nothing half-made stays."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator

ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Ctrl-C, the end of a batch job or its preemption, a terminal that is closed."""


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

    A signal that the parent set to be ignored, as `nohup` does, stays ignored.
    """
    numbers = [number for number in ENDING if signal.getsignal(number) is not signal.SIG_IGN]
    for number in numbers:
        signal.signal(number, _unwind)
    try:
        yield
    finally:
        for number in numbers:
            signal.signal(number, signal.SIG_DFL)


def _unwind(number: int, _frame: object) -> None:
    raise Interrupted(number)


@contextlib.contextmanager
def interrupts_deferred() -> Iterator[None]:
    """Let signals that come during the enclosed statements, and would unwind them, take effect after them.

    In a thread other than the main one, where no signal handler ever runs, this does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []
    handlers = {number: signal.getsignal(number) for number in ENDING}
    deferred = {number: handler for number, handler in handlers.items() if callable(handler)}
    for number in deferred:
        signal.signal(number, lambda came, _: arrived.append(came))
    try:
        yield
    finally:
        for number, handler in deferred.items():
            signal.signal(number, handler)
        if arrived:
            signal.raise_signal(arrived[0])
