"""Every how manyeth stored sample makes a rate that is asked for."""

from __future__ import annotations

import math

import numpy as np

from vsacli.base.errors import InputError
from vsacli.base.units import time_text
from vsacli.results.store.reader import StoredResult

RATE_TOLERANCE = 1e-6
"""Relative error of a rate typed with at least six digits, such as 333.3333."""
STEP_TOLERANCE = 1e-3
"""Error of stored times, in steps: twice that of times at 1 kHz printed with six decimals."""


def stride_of(result: StoredResult, rate: float) -> int:
    """Number of stored steps to one of a rate, Hz.

    Raises:
        InputError: the stored rate is no whole multiple of it, or there is none.
    """
    check_rate(rate)
    stored = _stored_rate(result)
    ratio = stored / rate
    stride = round(ratio)
    if ratio < 1 - RATE_TOLERANCE:
        message = f"the rate {rate:.9g} Hz exceeds the stored {stored:.9g} Hz; samples are not interpolated"
        raise InputError.one(message, result.path)
    if abs(ratio - stride) > RATE_TOLERANCE * ratio:
        nearest = f"{stored / math.ceil(ratio):.9g} and {stored / math.floor(ratio):.9g} Hz"
        message = (
            f"the stored {stored:.9g} Hz are no whole multiple of {rate:.9g} Hz; the nearest are {nearest}"
        )
        raise InputError.one(message, result.path)
    return stride


def check_rate(rate: float) -> None:
    """Raise InputError unless a rate, Hz, is finite and positive."""
    if not (rate > 0 and math.isfinite(rate)):
        raise InputError.one(f"the rate must be positive, not {rate:g} Hz")


def _stored_rate(result: StoredResult) -> float:
    """Samples per second of a file with equal steps."""
    time, steps = result.time, result.samples - 1
    if steps < 1:
        raise InputError.one(
            "holds fewer than two samples and so no rate; export without --rate", result.path
        )
    step = float(time[-1] - time[0]) / steps
    error = np.abs(time - (time[0] + step * np.arange(result.samples)))
    if error.max() > STEP_TOLERANCE * step:
        place = f"near t = {time_text(float(time[error.argmax()]))}"
        message = (
            f"the stored times are not equally spaced ({place}); set rate: {_round(1 / step):g} in the"
            f" trajectory file and run {result.command} again, or export without --rate"
        )
        raise InputError.one(message, result.path)
    return 1 / step


def _round(rate: float) -> float:
    """A rate to three digits, as somebody would choose it."""
    return float(f"{rate:.3g}")
