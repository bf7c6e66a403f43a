"""Numbers below 2.2e-308 are zero in kernels, whichever engine computes, and nowhere else."""

from __future__ import annotations

import platform
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from samples.marks import needs_compiler
from samples.robots import random_motion, vsa_3r

from vsacli import Robot, link_torques
from vsacli.compute.engine import NUMPY, choose_engine
from vsacli.compute.engine.engines import Engine, TracedEngine
from vsacli.compute.subnormals import subnormals_as_zero
from vsacli.dynamics.elastic_torques import LinkTorques

LEAST = np.finfo(np.float64).tiny
on_x86 = pytest.mark.skipif(
    (platform.machine(), platform.libc_ver()[0]) != ("x86_64", "glibc"), reason="elsewhere nothing is done"
)


def product_of_small_numbers() -> float:
    """1e-320 where there are numbers of less than full precision."""
    return float(np.prod(np.full(2, 1e-160)))


def engines() -> Any:
    compiled = pytest.param(
        lambda kernel: choose_engine("c", kernel, 1, 1).engine, marks=needs_compiler, id="c"
    )
    return [
        pytest.param(lambda _: NUMPY, id="numpy"),
        pytest.param(lambda _: TracedEngine(), id="traced"),
        compiled,
    ]


def motion_of_size(robot: Robot, size: float) -> list[np.ndarray]:
    """Any position; derivatives of this size."""
    position, *derivatives = random_motion(robot, 50, seed=3)
    return [position, *(size * derivative for derivative in derivatives)]


@on_x86
@pytest.mark.parametrize("engine_for", engines())
@pytest.mark.parametrize("size", [1e-155, 1e-200, 1e-308, 1e-315])
def test_small_motions_give_no_subnormal_torques_and_leave_no_trace(engine_for: Any, size: float) -> None:
    robot = vsa_3r()
    engine: Engine = engine_for(LinkTorques(robot))
    torques = link_torques(robot, *motion_of_size(robot, size), engine=engine)
    at_rest = link_torques(robot, *motion_of_size(robot, 0.0), engine=engine)
    for moving, resting in zip(torques, at_rest, strict=True):
        assert ((moving == 0) | (np.abs(moving) >= LEAST)).all()
        # The largest of the derivatives is 5, of the factors before them 300.
        np.testing.assert_allclose(moving, resting, rtol=0, atol=1e4 * size)
    assert 0 < product_of_small_numbers() < LEAST


@pytest.mark.parametrize("engine_for", engines())
def test_motions_whose_products_are_normal_are_scaled_exactly(engine_for: Any) -> None:
    """Without gravity, dq scaled by a power of two scales products of two by its square, to the last bit."""
    arm = vsa_3r()
    undamped = tuple(replace(joint, damping=0.0) for joint in arm.joints)
    robot = replace(arm, gravity=(0.0, 0.0, 0.0), joints=undamped)
    engine: Engine = engine_for(LinkTorques(robot))
    position, velocity, *_ = random_motion(robot, 50, seed=3)
    still = np.zeros_like(position)
    size = 2.0**-480  # so that its square is 2^62 times the least normal number
    usual = link_torques(robot, position, velocity, still, engine=engine).tau_e
    small = link_torques(robot, position, size * velocity, still, engine=engine).tau_e
    np.testing.assert_array_equal(small, size * size * usual)


@on_x86
def test_the_mode_ends_with_an_error() -> None:
    def fail() -> None:
        with subnormals_as_zero():
            assert product_of_small_numbers() == 0
            raise ValueError("enough")

    with pytest.raises(ValueError, match="enough"):
        fail()
    assert product_of_small_numbers() > 0


def test_limits_that_are_asked_for_within_are_right_and_give_no_warning() -> None:
    """In a process of its own, where NumPy, before 2.4, has not been asked yet."""
    code = """
import warnings; warnings.simplefilter("error")
import numpy as np
from vsacli.compute.subnormals import subnormals_as_zero
with subnormals_as_zero():
    limits = np.finfo(float), np.finfo(np.float32)
assert all(limit.smallest_subnormal > 0 for limit in limits)
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_elsewhere_nothing_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vsacli.compute.subnormals._math_library", lambda: None)
    with subnormals_as_zero():
        assert product_of_small_numbers() > 0
