"""Conditioning of records: derivatives, and a filter that biases no column of an equation."""

from __future__ import annotations

import numpy as np
import pytest

from vsacli.studies.identification.conditioning import conditioned

OMEGA = 2 * np.pi * np.array([0.3, 0.7, 1.1])
AMPLITUDE = np.array([0.5, 0.3, 0.2])


def motion(time: np.ndarray, order: int) -> np.ndarray:
    """A sum of sines, or its second derivative."""
    values: np.ndarray = (AMPLITUDE * (-(OMEGA**2)) ** (order // 2) * np.sin(OMEGA * time[:, None])).sum(
        axis=1
    )
    return values


@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_accelerations_pass_the_filter_like_torques_that_follow_from_them(rate: float) -> None:
    time = np.arange(int(20 * rate)) / rate
    none = np.full((len(time), 1, 2), np.nan)
    torque = none.copy()
    torque[:, 0, 0] = 3.2 * motion(time, 2) + 100 * motion(time, 0) ** 3
    signals = conditioned(time, motion(time, 0)[:, None], none, torque, 2.0)
    predicted = signals.filter.applied(3.2 * signals.ddq[:, 0] + 100 * signals.q[:, 0] ** 3)
    measured = signals.filter.applied(signals.tau_motor[:, 0, 0])
    # what rings at the ends, and the flank of the filter of positions, made 5e-5
    assert np.max(np.abs(predicted - measured)) < 3e-4 * np.max(np.abs(measured))
    assert np.isnan(signals.theta).all()
    assert len(measured) == pytest.approx(4 * len(signals.time) / rate, rel=0.02)  # rows at twice 2 Hz
