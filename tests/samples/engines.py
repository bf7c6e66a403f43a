"""Steps of all kinds for comparing engines, and the comparison."""

from __future__ import annotations

import stat
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from samples.robots import random_motion
from samples.signals import by_name
from vsacli import Flag, Motion, Robot, Wrench, motor_torques
from vsacli.base.variables import Block
from vsacli.dynamics.inverse import COMPUTED

AGREEMENT = 1e-12
"""Relative to a variable's peak, where the margin exceeds `CLEAR`: rounding of 1e-16 over that margin."""

CLEAR = 1e-3

MOTION_SCALE = np.array([1, 1, 0.1, 0.02, 0.01])[:, None, None]
"""Of the motions of `random_motion`: demands on the springs beside those of gravity, not far beyond."""


def demands(robot: Robot, samples: int, seed: int = 1, wrench: Wrench | None = None) -> Motion:
    """Random motion; a stiffness that is reachable, too small, or at the edge of its range."""
    rng = np.random.default_rng(seed)
    motion = MOTION_SCALE * np.array(random_motion(robot, samples, seed))
    rates = rng.uniform(-500, 500, (2, *motion[0].shape))
    time = np.arange(float(samples))
    reach = motor_torques(
        robot, Motion(time, *motion, by_name(np.ones_like(motion[0]), *rates), wrench=wrench)
    )
    lower = np.nan_to_num(reach.stiffness_min, nan=1.0)
    upper = np.minimum(np.nan_to_num(reach.stiffness_max, nan=2.0), 5 * lower)
    share = rng.choice([0.2, 0.5, 0.9, 0.0, -0.1, 1e-6], lower.shape, p=[0.3, 0.3, 0.1, 0.1, 0.1, 0.1])
    return Motion(time, *motion, by_name(lower + share * (upper - lower), *rates), wrench=wrench)


def random_wrench(samples: int, frame: str) -> Wrench:
    return Wrench(*np.random.default_rng(5).uniform(-20, 20, (3, samples, 6)), frame=frame)


def assert_agree(found: Block, expected: Block, tolerances: Mapping[str, float] | None = None) -> None:
    """Every variable within `AGREEMENT`, NaN and infinity at the same places, and the same flags."""
    allowed = {**dict.fromkeys(COMPUTED, AGREEMENT), **(tolerances or {})}
    np.testing.assert_array_equal(found.flags, expected.flags)
    margin = np.minimum(
        expected.stiffness - expected.stiffness_min, expected.stiffness_max - expected.stiffness
    )
    clear = ~(margin < CLEAR * expected.stiffness)  # NaN, of a joint without a margin, counts
    for name in COMPUTED:
        ours, theirs = np.asarray(getattr(found, name), float), np.asarray(getattr(expected, name), float)
        finite = np.isfinite(theirs)
        np.testing.assert_array_equal(np.isfinite(ours), finite, err_msg=name)
        np.testing.assert_array_equal(ours[~finite], theirs[~finite], err_msg=name)
        compared = finite & (clear if theirs.ndim == 2 else clear[..., None])
        if compared.any():
            error = np.abs(ours - theirs)[compared].max() / max(np.abs(theirs[compared]).max(), 1e-300)
            assert error <= allowed[name], (name, error)


def kinds_of_steps(block: Block) -> dict[Flag, int]:
    """How many joints' steps have each of the flags."""
    return {flag: int(np.count_nonzero(block.flags & flag)) for flag in Flag}


def program(folder: Path, name: str, text: str) -> Path:
    """Write a shell script to a folder, to be called as a command."""
    path = folder / name
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path
