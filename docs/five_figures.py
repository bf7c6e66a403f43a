"""The figures of docs/five_figures.md: the shoulder of the paper's arm, drawn from its own numbers.

Motor 1 is blue, motor 2 red, their sum black.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vsacli import Antagonistic, Result, inverse_dynamics, load_robot, load_trajectory
from vsacli.actuators.laws import SpringLaw
from vsacli.base.arrays import FloatArray
from vsacli.results.plots.styles import SETTINGS

ROOT = Path(__file__).resolve().parent.parent
BLUE, RED, BLACK, SHADE = "#1f4fd8", "#d8261c", "black", "#d3e5f6"
SHOULDER = 1
HEAVIEST = 0.93
"""Time in s at which the shoulder carries most."""

ASKED = 790
"""Constant stiffness in N m/rad that the motion cannot have."""


class Instant(NamedTuple):
    """The shoulder at one step: positions and deflections in rad, torques in N m, stiffness in N m/rad."""

    q: float
    theta: FloatArray
    phi: FloatArray
    tau: FloatArray
    tau_e: float
    stiffness: float


def run() -> Result:
    """The arm's first motion."""
    robot = load_robot(ROOT / "robots" / "vsa_3r.yaml")
    return inverse_dynamics(robot, load_trajectory(ROOT / "trajectories" / "rest_to_rest.yaml", robot))


def at_heaviest(result: Result) -> Instant:
    """The shoulder when it carries most."""
    step = int(np.argmin(np.abs(result.time - HEAVIEST)))
    names = ("q", "theta", "phi", "tau_transmission", "tau_e", "stiffness")
    return Instant(*(getattr(result, name)[step, SHOULDER] for name in names))


def spring_of(result: Result) -> SpringLaw:
    """Of the shoulder, the same on both sides."""
    actuator = result.robot.joints[SHOULDER].actuator
    assert isinstance(actuator, Antagonistic)
    return actuator.spring[0]


def draw(folder: Path) -> None:
    """Draw the five figures as PNG files of a folder."""
    result = run()
    drawings = (_two_motors, _sign, _who_pulls, _corridor, _singularity)
    with matplotlib.rc_context(SETTINGS):
        for number, drawing in enumerate(drawings, 1):
            figure = Figure(figsize=(7.5, 3.6), layout="constrained")
            drawing(figure, result)
            figure.savefig(folder / f"five-{number}.png", dpi=150)


def _two_motors(figure: Figure, result: Result) -> None:
    now = at_heaviest(result)
    axes = figure.subplots()
    for theta, color, number in zip(now.theta, (BLUE, RED), (1, 2), strict=True):
        axes.plot(*_coil(now.q, theta), color=color, linewidth=1.6)
        axes.plot(theta, 0, "s", color=color, markersize=17)
        axes.annotate(f"{number}", (theta, 0), color="white", ha="center", va="center", weight="bold")
        axes.annotate(
            f"motor {number}\nθ{_low(number)} = {theta:.4f} rad",
            (theta, -0.3),
            color=color,
            ha="center",
            va="top",
        )
    axes.plot(now.q, 0, "o", color=BLACK, markersize=26, zorder=3)
    axes.annotate(f"link\nq = {now.q:.4f} rad", (now.q, -0.3), ha="center", va="top")
    pulls = zip((0.95, 0.65, 1.3), (*now.tau, now.tau_e), (BLUE, RED, BLACK), ("τ₁", "τ₂", "τₑ"), strict=True)
    for height, torque, color, name in pulls:
        _pull(axes, now.q, height, torque, color, f"{name} = {torque:+.1f} N m")
    axes.set(xlabel="angle [rad]", ylim=(-0.85, 1.6), xlim=(-0.05, 0.21), yticks=[])
    axes.spines["left"].set_visible(False)
    axes.grid(visible=False)


def _low(number: int) -> str:
    return "₁₂"[number - 1]


def _coil(start: float, end: float) -> tuple[FloatArray, FloatArray]:
    """A spring drawn from one angle to another."""
    along = np.linspace(0, 1, 400)
    turns = np.where(np.abs(along - 0.5) < 0.38, np.sin(2 * np.pi * 9 * along), 0)
    return start + (end - start) * along, 0.16 * turns


def _pull(axes: Axes, q: float, height: float, torque: float, color: str, text: str) -> None:
    """An arrow from the link in the direction of a torque, 1 mrad for each N m."""
    tip = q + torque / 1000
    axes.annotate("", (tip, height), (q, height), arrowprops={"arrowstyle": "-|>", "color": color, "lw": 2.2})
    gap = 0.003 if torque > 0 else -0.003
    axes.annotate(text, (tip + gap, height), color=color, va="center", ha="left" if torque > 0 else "right")
    axes.plot([q, q], [0, height], color="0.8", linewidth=0.8, zorder=0)


def _sign(figure: Figure, result: Result) -> None:
    now, spring = at_heaviest(result), spring_of(result)
    axes = figure.subplots()
    phi = np.linspace(-0.17, 0.17, 400)
    axes.plot(phi, spring.torque(phi), color="0.6", label="τ(φ) = K φ + Kc φ³, both springs")
    axes.axhline(0, color="0.4", linewidth=0.8)
    axes.axvline(0, color="0.4", linewidth=0.8)
    near = np.array([-0.03, 0.03])
    for each, torque, color, number in zip(now.phi, now.tau, (BLUE, RED), (1, 2), strict=True):
        slope = spring.stiffness(each)
        axes.plot(each + near, torque + slope * near, color=color, linewidth=2.4)
        axes.plot(each, torque, "o", color=color, markersize=8)
        where = f"motor {number}\nφ = {each:+.3f} rad, τ = {torque:+.1f} N m"
        offset, side = ((-14, 14), "right") if number == 1 else ((14, -18), "left")
        axes.annotate(
            f"{where}\nslope σ{_low(number)} = {slope:.0f} N m/rad",
            (each, torque),
            offset,
            color=color,
            textcoords="offset points",
            ha=side,
            va="center",
        )
    axes.set(xlabel="deflection φ = θ - q [rad]", ylabel="torque on the link [N m]", ylim=(-75, 85))
    axes.legend(loc="lower right")


def _who_pulls(figure: Figure, result: Result) -> None:
    axes = figure.subplots()
    springs = result.tau_transmission[:, SHOULDER]
    axes.axhline(0, color="0.4", linewidth=0.8)
    axes.plot(result.time, springs[:, 0], color=BLUE)
    axes.plot(result.time, springs[:, 1], color=RED)
    axes.plot(result.time, result.tau_e[:, SHOULDER], color=BLACK)
    for values, color, text, gap in (
        (springs[:, 0], BLUE, "τ₁: motor 1 pulls up", 18),
        (springs[:, 1], RED, "τ₂: motor 2 pulls down", -34),
        (result.tau_e[:, SHOULDER], BLACK, "τₑ = τ₁ + τ₂: what the link needs", 8),
    ):
        axes.annotate(text, (2.2, values[2200]), (0, gap), color=color, textcoords="offset points")
    axes.set(xlabel="time [s]", ylabel="torque on the link [N m]", ylim=(-105, 125))


def _corridor(figure: Figure, result: Result) -> None:
    axes = figure.subplots()
    spring = spring_of(result)
    pair = spring.closed_pair(spring)
    assert pair is not None
    load = np.linspace(-150, 150, 600)
    lower = pair.solve(load, np.full_like(load, 1e4)).lower
    axes.fill_between(load, lower, 1600, color=SHADE, label="reachable: the corridor")
    axes.plot(load, lower, color=BLUE, linewidth=1.2)
    axes.plot(result.tau_e[:, SHOULDER], result.stiffness[:, SHOULDER], color=BLACK)
    start, end = ((result.tau_e[step, SHOULDER], result.stiffness[step, SHOULDER]) for step in (0, -1))
    axes.plot(*start, "o", color=BLACK)
    axes.annotate("start", start, (-8, 0), ha="right", textcoords="offset points")
    axes.annotate("end: stiffer, further apart", end, (6, 4), textcoords="offset points")
    axes.annotate(f"asked for: {ASKED} N m/rad", (-148, 10 + ASKED), color=RED, va="bottom")
    axes.axhline(ASKED, color=RED, linestyle="--")
    axes.annotate("INFEASIBLE", (60, 715), color=RED, weight="bold")
    axes.set(xlabel="what the joint carries, τₑ [N m]", ylabel="stiffness σ [N m/rad]", ylim=(650, 1600))
    axes.legend(loc="upper left")


def _singularity(figure: Figure, result: Result) -> None:
    """Along a constant load: the stiffness, and how much the motors have to move for a change of it."""
    left, right = figure.subplots(1, 2)
    now, spring = at_heaviest(result), spring_of(result)
    phi_1 = np.linspace(-0.05, 0.16, 4000)
    phi_2 = spring.deflection(now.tau_e - spring.torque(phi_1))
    sigmas = spring.stiffness(phi_1), spring.stiffness(phi_2)
    stiffness, apart = np.add(*sigmas), phi_1 - phi_2
    left.plot(apart, stiffness, color=BLACK)
    there = now.phi[0] - now.phi[1], now.stiffness
    left.plot(*there, "o", color=BLUE)
    left.annotate("at this step", there, (-8, 4), ha="right", textcoords="offset points")
    left.plot(0, stiffness.min(), "X", color=RED, markersize=9)
    left.annotate(
        "singular", (0, stiffness.min()), (0, -14), color=RED, ha="center", textcoords="offset points"
    )
    left.set(xlabel="pulled apart, φ₁ - φ₂ [rad]", ylabel="stiffness σ [N m/rad]", ylim=(780, 1060))
    left.set_title(f"τₑ stays {now.tau_e:.1f} N m")
    branch = apart > 0.01
    determinant = sigmas[0] * spring.slope(phi_2) - sigmas[1] * spring.slope(phi_1)
    margin = 100 * (1 - stiffness.min() / stiffness)
    right.plot(margin[branch], 1000 * (sigmas[1] / np.abs(determinant))[branch], color=BLACK)
    right.axvspan(margin[branch].min(), 1, color=RED, alpha=0.12, label="near-singular: warned of")
    right.set(xlabel="margin to the end of the corridor [%]", xscale="log", yscale="log")
    right.set(ylabel="dφ₁/dσ [mrad per N m/rad]")
    right.legend(loc="upper right")


if __name__ == "__main__":
    draw(ROOT / "docs" / "images")
