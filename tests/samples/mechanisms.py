"""One or more devices of each mechanism, with the potential of its springs as a formula of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy

from samples.full_model import Drive, Potential, springs_of
from samples.law_energies import SAMPLES, Energy
from vsacli import Motor, Serial, laws, mechanisms
from vsacli.documents.source import Source
from vsacli.documents.table import CsvTable

INERTIA, DAMPING = (0.3, 0.02), (0.1, 0.05)
"""Of motors 1 and 2."""

OnBranch = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Device:
    """A mechanism, and what the tests need to know about it.

    Attributes:
        mechanism: as vsacli has it.
        potential: U(q, theta_1, theta_2) in sympy's functions; written anew, not taken from the mechanism.
        stiffness: two that the device has under 30 N m, for a motion, N m/rad.
        deflections: phi from which states are drawn, rad.
        settings: theta_2 from which they are drawn.
        on_branch: which of the states with positive stiffness lie on the mechanism's branch; all by default.
        anchor: the end of the settings at which the branch begins, 0 the first or -1 the last.
        scanned: phi within which each setting carries a torque or has its largest; `deflections` if None.
        falls: whether only a piece on which the stiffness falls from the anchor on belongs to the branch.
        endless: whether it carries any torque at any stiffness.
        symmetric: whether U(-phi) = U(phi).
        rest: phi without load.
        scanned_settings: theta_2 to scan where no end bounds it.
    """

    mechanism: mechanisms.Mechanism
    potential: Potential
    stiffness: tuple[float, float]
    deflections: tuple[float, float]
    settings: tuple[float, float]
    on_branch: OnBranch = lambda phi, _: np.ones_like(phi, dtype=bool)
    anchor: int = -1
    scanned: tuple[float, float] | None = None
    falls: bool = False
    endless: bool = False
    symmetric: bool = True
    rest: float = 0.0
    scanned_settings: tuple[float, float] | None = None

    @property
    def actuator(self) -> Serial:
        """The mechanism between two motors."""
        first, second = (Motor(inertia=b, damping=d) for b, d in zip(INERTIA, DAMPING, strict=True))
        return Serial(motor=(first, second), mechanism=self.mechanism)

    @property
    def drive(self) -> Drive:
        """The same in the full model."""
        return Drive(np.diag(INERTIA), DAMPING, self.springs)

    @cached_property
    def springs(self) -> Callable[..., Any]:
        """The torques of the potential."""
        return springs_of(self.potential, 2)


def _awas(k: float, lead: float) -> Potential:
    return lambda q, theta_1, theta_2: k * (lead * theta_2) ** 2 * sympy.sin(theta_1 - q) ** 2


def _maccepa(k: float, b: float, c: float, r: float) -> Potential:
    def energy(q: Any, theta_1: Any, theta_2: Any) -> Any:
        distance = sympy.sqrt(b**2 + c**2 - 2 * b * c * sympy.cos(theta_1 - q))
        return k * (distance - abs(c - b) + r * theta_2) ** 2 / 2

    return energy


def _bowed(k: float, lead: float, bow: float) -> Potential:
    """A spring whose arm of the link changes with the position of the joint."""
    return lambda q, theta_1, theta_2: (
        k / 2 * (lead * theta_2) ** 2 * (theta_1 - q - bow * sympy.sin(2 * q)) ** 2
    )


def _two_springs(k: float, k_c: float) -> Potential:
    return lambda q, *theta: sum(k / 2 * (each - q) ** 2 + k_c / 4 * (each - q) ** 4 for each in theta)


def profile(phi: np.ndarray, lift: np.ndarray) -> CsvTable:
    """A table, as if read from a file."""
    return CsvTable(("deflection", "lift"), np.column_stack([phi, lift]), Source("profile.csv", "", None))


def _polynomial_cam(*coefficients: float, rest: float = 0.0) -> tuple[CsvTable, Potential]:
    """Lifts of a polynomial, from the second power on; up to the sixth it lies in the span of the fit."""

    def lift(phi: Any) -> Any:
        return sum(each * (phi - rest) ** power for power, each in enumerate(coefficients, 2))

    def energy(q: Any, theta_1: Any, theta_2: Any) -> Any:
        return CAM_K * (lift(theta_1 - q) + CAM_R * theta_2) ** 2 / 2

    phi = np.linspace(-0.8, 0.8, 41)
    return profile(phi, 0.01 + lift(phi)), energy


CAM_K, CAM_R = 150000.0, 0.01
_EVEN, _EVEN_POTENTIAL = _polynomial_cam(0.03, 0, 0.1)
_UNEVEN, _UNEVEN_POTENTIAL = _polynomial_cam(0.03, 0.02, 0.1, -0.05, 0.1, rest=0.05)


def _lever(k: float, length: float, lead: float) -> Potential:
    def energy(q: Any, theta_1: Any, theta_2: Any) -> Any:
        ratio = lead * theta_2 / (length - lead * theta_2)
        return k / 2 * (length * ratio * sympy.sin(theta_1 - q)) ** 2

    return energy


def _ratio(scale: Callable[[Any], Any], energy: Callable[[Any], Any]) -> Potential:
    return lambda q, theta_1, theta_2: scale(theta_2) * energy(theta_1 - q)


def scale_table(settings: np.ndarray, scale: Callable[[np.ndarray], np.ndarray]) -> CsvTable:
    """A table, as if read from a file."""
    return CsvTable(
        ("setting", "scale"), np.column_stack([settings, scale(settings)]), Source("scale.csv", "", None)
    )


def _four_bar(k: float, ratio: float) -> Callable[[Any], Any]:
    return lambda phi: k / 2 * (sympy.asin(ratio * sympy.sin(phi / 2)) - phi / 2) ** 2


def _shifted(energy: Energy) -> Potential:
    return lambda q, theta_1, theta_2: energy(theta_1 - q + theta_2) + energy(theta_1 - q - theta_2)


DEVICES = {
    "shifted_cams": Device(
        mechanism=mechanisms.ShiftedCams(spring=(SAMPLES["cubic"].law,) * 2),
        potential=_shifted(SAMPLES["cubic"].energy),
        stiffness=(290, 340),
        deflections=(-0.13, 0.13),
        settings=(0.02, 0.5),
        scanned=(-1.5, 1.5),
        scanned_settings=(-0.1, 1.0),
    ),
    "shifted_cams, the other branch": Device(
        mechanism=mechanisms.ShiftedCams(spring=(SAMPLES["sinh"].law,) * 2, branch="negative"),
        potential=_shifted(SAMPLES["sinh"].energy),
        stiffness=(150, 110),
        deflections=(-0.2, 0.2),
        settings=(-0.3, -0.02),
        anchor=0,
        scanned=(-0.8, 0.8),
        scanned_settings=(-0.5, 0.1),
    ),
    "awas": Device(
        mechanism=mechanisms.Awas(k=50000, arm=(0.02, 0.12), lead=0.01),
        potential=_awas(50000, 0.01),
        stiffness=(300, 700),
        deflections=(-0.78, 0.78),
        settings=(2, 12),
    ),
    "awas, lead against the motor": Device(
        mechanism=mechanisms.Awas(k=30000, arm=(0.03, 0.15), lead=-0.02),
        potential=_awas(30000, -0.02),
        stiffness=(600, 200),
        deflections=(-0.78, 0.78),
        settings=(-7.5, -1.5),
        anchor=0,
    ),
    "maccepa": Device(
        mechanism=mechanisms.Maccepa(k=150000, b=0.04, c=0.12, r=0.01, pretension=(0.005, 0.05)),
        potential=_maccepa(150000, 0.04, 0.12, 0.01),
        stiffness=(200, 350),
        deflections=(-0.2, 0.2),
        settings=(0.5, 5),
        scanned=(-1.6, 1.6),
    ),
    "maccepa, long lever, drum against the motor": Device(
        mechanism=mechanisms.Maccepa(k=100000, b=0.13, c=0.05, r=-0.02, pretension=(0.002, 0.05)),
        potential=_maccepa(100000, 0.13, 0.05, -0.02),
        stiffness=(300, 180),
        deflections=(-0.2, 0.2),
        settings=(-2.5, -0.5),
        anchor=0,
        scanned=(-1.6, 1.6),
    ),
    "potential": Device(
        mechanism=mechanisms.Potential(
            energy="k/2*(r*theta_2)^2 * (phi - bow*sin(2*q))^2",
            constants=(("k", 50000), ("r", 0.01), ("bow", 0.1)),
            start=mechanisms.BranchStart(theta_1=0, theta_2=10),
            range=mechanisms.PotentialRange(phi=(-0.8, 0.8), theta_2=(4, 20)),
        ),
        potential=_bowed(50000, 0.01, 0.1),
        stiffness=(300, 500),
        deflections=(-0.2, 0.2),
        settings=(5, 15),
    ),
    "potential, two springs": Device(
        mechanism=mechanisms.Potential(
            energy="k/2*((theta_1 - q)^2 + (theta_2 - q)^2) + k_c/4*((theta_1 - q)^4 + (theta_2 - q)^4)",
            constants=(("k", 50), ("k_c", 1000)),
            start=mechanisms.BranchStart(theta_1=0.2, theta_2=-0.2),
            range=mechanisms.PotentialRange(phi=(-1, 1), theta_2=(-5, 5)),
        ),
        potential=_two_springs(50, 1000),
        stiffness=(220, 300),
        deflections=(0.1, 0.3),
        settings=(-0.3, -0.1),
    ),
    "cam": Device(
        mechanism=mechanisms.Cam(k=CAM_K, r=CAM_R, pretension=(0.005, 0.05), profile=_EVEN),
        potential=_EVEN_POTENTIAL,
        stiffness=(200, 350),
        deflections=(-0.2, 0.2),
        settings=(1.5, 5),
        scanned=(-0.8, 0.8),
    ),
    "cam, not symmetric": Device(
        mechanism=mechanisms.Cam(k=CAM_K, r=CAM_R, pretension=(0.005, 0.05), profile=_UNEVEN),
        potential=_UNEVEN_POTENTIAL,
        stiffness=(350, 250),
        deflections=(-0.1, 0.2),
        settings=(2, 5),
        scanned=(-0.8, 0.8),
        symmetric=False,
        rest=0.05,
    ),
    "lever": Device(
        mechanism=mechanisms.Lever(k=20000, length=0.1, pivot=(0.03, 0.08), lead=0.01),
        potential=_lever(20000, 0.1, 0.01),
        stiffness=(600, 900),
        deflections=(-0.78, 0.78),
        settings=(3, 8),
    ),
    "lever, lead against the motor": Device(
        mechanism=mechanisms.Lever(k=50000, length=0.06, pivot=(0.01, 0.05), lead=-0.02),
        potential=_lever(50000, 0.06, -0.02),
        stiffness=(900, 600),
        deflections=(-0.78, 0.78),
        settings=(-2.5, -0.5),
        anchor=0,
    ),
    "variable_ratio": Device(  # a jack spring: fewer active coils with theta_2
        mechanism=mechanisms.VariableRatio(
            setting=(1, 9),
            scale=mechanisms.Power(exponent=-1, lead=-1, offset=12),
            torque=laws.Polynomial(c1=3000),
        ),
        potential=_ratio(lambda s: 1 / (12 - s), lambda phi: 1500 * phi**2),
        stiffness=(400, 700),
        deflections=(-0.2, 0.2),
        settings=(1, 9),
        scanned=(-1, 1),
        endless=True,
    ),
    "variable_ratio, leaf spring": Device(
        mechanism=mechanisms.VariableRatio(
            setting=(-6, 6),
            scale=mechanisms.Power(exponent=-3, lead=0.01, offset=0.1),
            torque=laws.Polynomial(c1=0.5),
        ),
        potential=_ratio(lambda s: (0.1 + 0.01 * s) ** -3, lambda phi: 0.25 * phi**2),
        stiffness=(900, 600),
        deflections=(-0.2, 0.2),
        settings=(-5, 5),
        scanned=(-30, 30),
        anchor=0,
        endless=True,
    ),
    "variable_ratio, sine": Device(
        mechanism=mechanisms.VariableRatio(
            setting=(0, 4),
            scale=mechanisms.PolynomialScale(c0=1, c1=0.3, c3=0.05),
            torque=mechanisms.Sine(k=300, ratio=3),
        ),
        potential=_ratio(lambda s: 1 + 0.3 * s + 0.05 * s**3, lambda phi: 300 / 9 * (1 - sympy.cos(3 * phi))),
        stiffness=(500, 900),
        deflections=(-0.52, 0.52),
        settings=(0, 4),
    ),
    "variable_ratio, measured scale": Device(  # a spline through the points of a cubic is that cubic
        mechanism=mechanisms.VariableRatio(
            setting=(0, 3),
            scale=mechanisms.MeasuredScale(
                file=scale_table(np.linspace(-0.1, 3.1, 7), lambda s: 3 - 0.5 * s - 0.02 * s**3)
            ),
            torque=laws.Cubic(k=300, k_c=500),
        ),
        potential=_ratio(lambda s: 3 - 0.5 * s - 0.02 * s**3, lambda phi: 150 * phi**2 + 125 * phi**4),
        stiffness=(800, 500),
        deflections=(-0.5, 0.5),
        settings=(0, 3),
        scanned=(-2, 2),
        anchor=0,
    ),
    "variable_ratio, torque that turns": Device(
        mechanism=mechanisms.VariableRatio(
            setting=(0.5, 2),
            scale=mechanisms.Power(exponent=1),
            torque=laws.Polynomial(c1=300, c9=300 / 0.4**8),
        ),
        potential=_ratio(lambda s: s, lambda phi: 150 * phi**2 + 30 / 0.4**8 * phi**10),
        stiffness=(350, 500),
        deflections=(-0.24, 0.24),  # g'^2 = g g'' at 0.2430 rad
        settings=(0.5, 2),
        scanned=(-1, 1),
        falls=True,
    ),
    "variable_ratio, four bar": Device(
        mechanism=mechanisms.VariableRatio(
            setting=(1, 4), scale=mechanisms.Power(exponent=2), torque=laws.FourBar(k=20, ratio=4)
        ),
        potential=_ratio(lambda s: s**2, _four_bar(20, 4)),
        stiffness=(300, 500),
        deflections=(-0.26, 0.26),  # g'^2 = g g'' at 0.2644 rad
        settings=(1, 4),
        scanned=(-0.5, 0.5),
        falls=True,
    ),
}
"""By the name of the mechanism, and what is special about the device."""
