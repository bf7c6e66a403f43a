"""Trajectory files with numbers that nobody would choose: read or refused, but no other exception."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from samples.trajectories import ROOT

from vsacli import InputError, Trajectory, load_robot, load_trajectory

pytestmark = pytest.mark.usefixtures("own_folder")

ROBOT = load_robot(ROOT / "robots" / "vsa_3r.yaml")
TEXTS = [
    (ROOT / "trajectories" / f"vsa_3r_{name}.yaml").read_text(encoding="utf-8")
    for name in ("via", "excitation", "pick_and_place")
]
NUMBER = re.compile(r"(?<![\w.])-?\d[\d.]*(?![\w.])")
ODD = ("0", "-1", "1e308", "-1e308", "1e-308", "1e150", "1e30", "1e-30", "1e-9", "7", "9", "null", "[1, 2]")


@st.composite
def with_odd_numbers(draw: st.DrawFn) -> str:
    """A shipped trajectory, one to three of whose numbers are replaced."""
    text = draw(st.sampled_from(TEXTS))
    for _ in range(draw(st.integers(1, 3))):
        number = draw(st.sampled_from(list(NUMBER.finditer(text))))
        text = text[: number.start()] + draw(st.sampled_from(ODD)) + text[number.end() :]
    return text


def loaded(name: str) -> Trajectory | None:
    try:
        return load_trajectory(name, ROBOT)
    except InputError as error:
        if any(problem.file != name for problem in error.problems):
            raise
        return None


@pytest.mark.slow
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(with_odd_numbers())
def test_any_numbers_are_read_or_refused_with_their_file(text):
    Path("odd.yaml").write_text(text)
    trajectory = loaded("odd.yaml")
    if trajectory is None:
        return
    motion = trajectory.at(np.linspace(*trajectory.times.span, 5))
    assert np.isfinite(motion.q).all()
    assert trajectory.stretched(2.0).duration == pytest.approx(2 * trajectory.duration)
    assert np.all(np.diff(trajectory.breakpoints) > 0)
