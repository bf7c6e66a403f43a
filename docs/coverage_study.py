"""How far off identified numbers are, in standard errors: the figure of docs/identification-method.md.

python docs/coverage_study.py    draws it, in about a minute
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from vsacli import Result, Trajectory, inverse_dynamics, load_robot
from vsacli.base.arrays import FloatArray
from vsacli.robot.model import Robot
from vsacli.studies.identification.conditioning import conditioned
from vsacli.studies.identification.fitted_system import fit_system
from vsacli.studies.identification.motor_equations import GROUPS, motor_systems

ROOT = Path(__file__).resolve().parents[1]
FIGURE = ROOT / "docs" / "images" / "identification-coverage.png"
RECORDS, DURATION, RATE, BANDWIDTH = 200, 24.0, 250.0, 3.0
NOISE = {"q": 2e-5, "theta": 2e-5, "tau_motor": 0.5}
DERIVATIVES = ("dq", "ddq", "d3q", "d4q", "stiffness", "dstiffness", "ddstiffness")
FREQUENCIES = {"q": (0.15, 0.4, 0.7), "stiffness": (0.2, 0.55)}
MIDDLE, REACH = {"q": 0.0, "stiffness": 1400.0}, {"q": 0.4, "stiffness": 300.0}
WORDS = {
    "inertia": "inertia of the motors",
    "damping": "damping",
    "coulomb": "Coulomb friction",
    "offset": "offset of friction",
    "k": "k",
    "k_c": "k_c",
}
COLORS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")


def joint() -> Robot:
    """The first joint of the paper's arm, with friction that can be told from none."""
    arm = load_robot(ROOT / "robots" / "vsa_3r.yaml").replace(
        {
            "joints.base.actuator.motor.friction": {"coulomb": 2, "offset": 0.5},
            "joints.base.actuator.motor.damping": 1,
        }
    )
    return dataclasses.replace(arm, joints=arm.joints[:1])


def sines(time: FloatArray, signal: str, orders: int, rng: np.random.Generator) -> list[FloatArray]:
    """A sum of sines of any phases with its derivatives, (samples, 1) each."""
    rates = 2 * np.pi * np.array(FREQUENCIES[signal])
    phases, sizes = rng.uniform(0, 2 * np.pi, len(rates)), rng.uniform(0.5, 1, len(rates)) / len(rates)
    angles = time[:, None] * rates + phases
    waves = [
        (REACH[signal] * sizes * rates**order * np.sin(angles + order * np.pi / 2)).sum(axis=1, keepdims=True)
        for order in range(orders)
    ]
    return [waves[0] + MIDDLE[signal], *waves[1:]]


def errors() -> Iterator[dict[str, float]]:
    """Of each record by the last word of its path what each number is off by, in standard errors."""
    robot, time = joint(), np.arange(round(DURATION * RATE) + 1) / RATE
    for seed in range(RECORDS):
        rng = np.random.default_rng(seed)
        q, stiffness = sines(time, "q", 5, rng), sines(time, "stiffness", 3, rng)
        derivatives: dict[str, Any] = dict(zip(DERIVATIVES, (*q[1:], *stiffness), strict=True))
        run = inverse_dynamics(robot, Trajectory.from_samples(time, q[0], **derivatives))
        q_read, theta, torque = (
            exact + NOISE[name] * rng.normal(size=exact.shape) for name, exact in measured(run).items()
        )
        signals = conditioned(time, q_read, theta, torque, BANDWIDTH)
        (system,) = motor_systems(robot, [0], GROUPS, [signals])
        fit = fit_system(system, [signals]).fit
        off = (fit.values - system.before) / fit.standard_errors
        yield {name.rpartition(".")[2]: float(each) for name, each in zip(system.names, off, strict=True)}


def measured(run: Result) -> dict[str, FloatArray]:
    """What sensors measure of a run."""
    return {name: getattr(run, name) for name in NOISE}


def draw(path: Path) -> None:
    """The share of records in which numbers are within so many standard errors of the truth."""
    from matplotlib.figure import Figure
    from scipy.special import erf

    found = list(errors())
    bounds = np.linspace(0, 4, 401)
    figure = Figure(figsize=(7.5, 4.2), layout="constrained")
    axes = figure.subplots()
    axes.plot(bounds, 100 * erf(bounds / np.sqrt(2)), color="0.75", linewidth=6, label="normal distribution")
    for (name, words), color in zip(WORDS.items(), COLORS, strict=True):
        size = np.abs([each[name] for each in found])
        share = 100 * np.mean(size[:, None] < bounds, axis=0)
        within = np.mean(size < 2)
        axes.plot(
            bounds, share, color=color, linewidth=1.2, label=f"{words}: {100 * within:.1f} % within two"
        )
    axes.axvline(2, color="0.6", linewidth=0.8, linestyle=":")
    axes.set(xlabel="standard errors", ylabel="numbers within, %", xlim=(0, 4), ylim=(0, 101))
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, loc="lower right")
    figure.savefig(path, dpi=150)


if __name__ == "__main__":
    draw(FIGURE)
