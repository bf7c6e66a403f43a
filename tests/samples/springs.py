"""Springs of every law, each with the formula of its torque that the oracle scans."""

from __future__ import annotations

import numpy as np
from oracles import spring_scan as scan

from vsacli import laws
from vsacli.documents.source import Source
from vsacli.documents.table import CsvTable

Spring = tuple[laws.SpringLaw, scan.Curve]


def measured(deflection: np.ndarray, torque: np.ndarray) -> laws.Table:
    """The spring of a table, as if read from a file."""
    rows = np.column_stack([deflection, torque])
    return laws.Table(file=CsvTable(("deflection", "torque"), rows, Source("spring.csv", "", None)))


def sampled(curve: scan.Curve, low: float, high: float, rows: int) -> Spring:
    """A table of exact torques; those of a polynomial up to phi^6 lie in the span of the fit."""
    deflection = np.linspace(low, high, rows)
    return measured(deflection, curve.torque(deflection)), scan.Curve(curve.torque, (low, high))


SPRINGS: dict[str, tuple[Spring, Spring]] = {
    "cubic": (
        (laws.Cubic(k=20, k_c=300), scan.polynomial(20, 300)),
        (laws.Cubic(k=45, k_c=150), scan.polynomial(45, 150)),
    ),
    "polynomial": (
        (laws.Polynomial(c1=15, c3=100, c5=900), scan.polynomial(15, 100, 900)),
        (laws.Polynomial(c1=30, c3=1, c9=9000), scan.polynomial(30, 1, 0, 0, 9000)),
    ),
    "sinh": (
        (laws.Sinh(k=1.5, a=8), scan.sinh(1.5, 8)),
        (laws.Sinh(k=3, a=5), scan.sinh(3, 5)),
    ),
    "exponential": (
        (laws.Exponential(c=0.8, a=6), scan.exponential(0.8, 6)),
        (laws.Exponential(c=2, a=4), scan.exponential(2, 4)),
    ),
    "quadratic": (
        (laws.Quadratic(k=90), scan.quadratic(90)),
        (laws.Quadratic(k=40), scan.quadratic(40)),
    ),
    "four_bar": (
        (laws.FourBar(k=40, ratio=2.2), scan.four_bar(40, 2.2)),
        (laws.FourBar(k=150, ratio=1.6), scan.four_bar(150, 1.6)),
    ),
    "table": (
        sampled(scan.polynomial(18, 200, 500), -0.6, 0.6, 41),
        sampled(scan.polynomial(30, 50, 900), -0.5, 0.6, 30),
    ),
    "table, pulling": (
        sampled(scan.polynomial(5, 60, 700), 0, 0.7, 30),
        sampled(scan.polynomial(0, 300, 300), 0, 0.7, 41),
    ),
}
"""Two springs of each law, of constants that differ; torques of some 10 N m at some 0.4 rad."""


def on_side_2(spring: Spring) -> Spring:
    """The spring as it acts on side 2."""
    law, curve = spring
    return law.as_second(), scan.turned(curve) if law.pulls_only else curve


def residuals(
    pair: tuple[laws.SpringLaw, laws.SpringLaw],
    found: laws.PairSolution,
    tau_e: np.ndarray,
    stiffness: np.ndarray,
) -> float:
    """Largest scaled residual of (14)."""
    phi = (found.phi_1, found.phi_2)
    tau_1, tau_2 = (law.torque(deflection) for law, deflection in zip(pair, phi, strict=True))
    sigma_1, sigma_2 = (law.stiffness(deflection) for law, deflection in zip(pair, phi, strict=True))
    torque = np.abs(tau_1 + tau_2 - tau_e) / (np.abs(tau_1) + np.abs(tau_2))
    return float(np.max([torque, np.abs(sigma_1 + sigma_2 - stiffness) / stiffness]))


def stiffness_under(spring: laws.Cubic, torque: np.ndarray) -> np.ndarray:
    """Stiffness of a cubic spring that carries a torque, by the formula for roots of cubics."""
    peak = np.sqrt(spring.k / (3 * spring.k_c))
    x = 2 * np.sinh(np.arcsinh(1.5 * torque / (spring.k * peak)) / 3)
    return spring.k * (1 + x * x)
