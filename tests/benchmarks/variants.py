"""Variants of the arm with seven joints a second: batches of whole runs, and the rigid recursion of peers."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import casadi
import numpy as np
from casadi_peer import ORDERS, function_of
from jax_peer import mapped_torques
from samples.shipped import shipped_run
from timing import cpu_seconds, medians

from vsacli import Motion, Robot, Trajectory
from vsacli.analysis.batch import Batch
from vsacli.analysis.run import Run
from vsacli.base.signals import POSITION
from vsacli.compute.engine import Engine, choose_engine
from vsacli.documents.record_values import with_numbers
from vsacli.dynamics.elastic_torques import LinkTorques
from vsacli.dynamics.variants import Variants
from vsacli.robot.parameters import parameters
from vsacli.trajectory.times import UniformTimes

VARIANTS, SAMPLES = 300, 201
SINGLE = 10
"""Number of variants that are computed one by one."""

WHOLE, RECURSION = "whole runs", "link torques"


class VariantTime(NamedTuple):
    """A way to compute variants.

    Attributes:
        name: Name of the way.
        content: Results that it computes.
        rate: Variants a second of processor time.
    """

    name: str
    content: str
    rate: float


def compare(repeats: int) -> list[VariantTime]:
    """Time all ways in one run, each in one thread; compiling and starting count for none."""
    robot, whole = shipped_run("lwr_7r_vsa", "lwr_7r")
    trajectory = whole.sampled(UniformTimes(whole.duration, (SAMPLES - 1) / whole.duration))
    moving = trajectory.block(0, SAMPLES)
    masses = parameters(robot, ["joints.*.link.mass"])
    drawn = np.random.default_rng(0).normal(1, 0.02, (VARIANTS, len(masses)))
    values = drawn * [each.value for each in masses]
    variants = Variants(tuple(with_numbers(robot, masses, row) for row in values), robot, masses)
    inputs = _inputs(variants, moving)
    jax_torques, path = mapped_torques(robot), np.stack([moving.q, moving.dq, moving.ddq])
    ways = {
        ("vsacli, NumPy", WHOLE): lambda: _whole(variants, trajectory, "numpy"),
        ("vsacli, C", WHOLE): lambda: _whole(variants, trajectory, "c"),
        ("vsacli, C", RECURSION): _recursion(variants, inputs, "c"),
        ("CasADi, `Function.map`", RECURSION): _mapped(robot, inputs),
        ("JAX, `jit` of `vmap`, compiled", "torques of rigid links"): lambda: jax_torques(values, path),
        ("vsacli, NumPy, one by one", WHOLE): lambda: _single(variants, trajectory),
    }
    seconds = medians({str(key): cpu_seconds(way) for key, way in ways.items()}, repeats)
    return [
        VariantTime(*key, (SINGLE if "one by one" in key[0] else VARIANTS) / seconds[str(key)])
        for key in ways
    ]


def _inputs(variants: Variants, moving: Motion) -> list[np.ndarray]:
    """Rows of the motion, the same for each variant, and of the masses."""
    rows = [np.tile(row, VARIANTS) for name in POSITION.names for row in getattr(moving, name).T]
    numbers = variants.inputs(np.repeat(np.arange(VARIANTS), SAMPLES))
    return [*rows, *(row for rows_of_name in numbers.values() for row in rows_of_name)]


def _whole(variants: Variants, trajectory: Trajectory, engine: str) -> None:
    samples = 10 * VARIANTS * SAMPLES
    batch = Batch(variants, [trajectory] * VARIANTS, engine=engine, threads=1, kernel_samples=samples)
    for _ in batch:
        pass
    for variant in range(VARIANTS):
        assert batch.findings(variant).self_check.passed


def _single(variants: Variants, trajectory: Trajectory) -> None:
    for robot in variants.robots[:SINGLE]:
        run = Run(robot, trajectory)
        for _ in run:
            pass
        assert run.findings().self_check.passed


def _recursion(variants: Variants, inputs: list[np.ndarray], engine: str) -> Callable[[], object]:
    kernel = variants.kernel(LinkTorques(variants.base))
    chosen: Engine = choose_engine(engine, kernel, VARIANTS * SAMPLES, 1).engine
    return lambda: chosen.run(kernel, inputs)


def _mapped(robot: Robot, inputs: list[np.ndarray]) -> Callable[[], object]:
    """The torques with two derivatives by CasADi, whose masses are an argument."""
    masses = casadi.SX.sym("masses", len(robot.joints))
    chosen = parameters(robot, ["joints.*.link.mass"])
    symbolic = with_numbers(robot, chosen, casadi.vertsplit(masses))
    function = function_of(symbolic, masses).map(VARIANTS * SAMPLES)
    count = ORDERS * len(robot.joints)
    rows, numbers = casadi.DM(np.array(inputs[:count])), casadi.DM(np.array(inputs[count:]))
    return lambda: function(rows, numbers)
