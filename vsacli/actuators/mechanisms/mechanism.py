"""What every mechanism of a serial actuator offers: its potential with derivatives, and the inverse."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import numpy as np

from vsacli.actuators.laws.pair import PairSolution
from vsacli.actuators.mechanisms.state import DeflectionState, MechanismState, Partials
from vsacli.actuators.spring_elements import LeverSpring, SpringElement
from vsacli.base.arrays import BoolArray, FloatArray
from vsacli.documents.fields import check_fields
from vsacli.documents.source import Source

Range: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class Mechanism(ABC):
    """Springs between motor 1, the link, and motor 2, which sets them; a frozen dataclass of declared fields.

    Equal mechanisms are the same for all that is computed. What depends on phi = theta_1 - q and the setting
    s = theta_2 alone gives `partials`; else it overrides `state`. Positions in rad (m), torques in N m (N).

    Attributes:
        joint_types: of the joints that it can drive; a lever that turns drives no prismatic one.
    """

    joint_types: ClassVar[tuple[str, ...]] = ("revolute", "prismatic")

    def __post_init__(self) -> None:
        check_fields(self)

    @classmethod
    @abstractmethod
    def example(cls, joint_type: str) -> dict[str, Any]:
        """Plausible values of its fields, as a new robot file shows them."""

    @property
    def deflection_range(self) -> tuple[float, float]:
        """Phi for which the mechanism works."""
        return (-math.inf, math.inf)

    @property
    @abstractmethod
    def setting_range(self) -> tuple[float, float]:
        """theta_2 for which it works."""

    @property
    def ranges(self) -> tuple[Range, Range]:
        """Where `ranged` must lie, two coordinates one after the other."""
        return self.deflection_range, self.setting_range

    def ranged(self, phi: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """What the mechanism's range is stated in: phi and the setting, unless overridden."""
        return phi, s

    @property
    def warnings(self) -> tuple[str, ...]:
        """How far it may be from the device it describes, one sentence each."""
        return ()

    @property
    def sources(self) -> tuple[Source, ...]:
        """Files that it was read from."""
        return ()

    @property
    def spring_elements(self) -> tuple[SpringElement, ...] | None:
        """See `Actuator.spring_elements`."""
        return None

    @property
    def lever_spring(self) -> LeverSpring | None:
        """See `Actuator.lever_spring`."""
        return None

    @abstractmethod
    def solve(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> PairSolution:
        """The corridor of the stiffness at an elastic torque, and where the demanded one is reached.

        Args:
            tau_e: elastic torque, (samples,), N m (N).
            stiffness: demanded joint stiffness, (samples,), N m/rad (N/m).
            q: position of the joint, (samples,); counts only if the potential depends on it beside phi.

        Returns:
            phi_1 is phi and phi_2 is theta_2, for the stiffness clipped into the corridor. An end is critical
            where A is singular; the torque's maximum and the ends of ranges are not.
        """

    @property
    def opposite_preload(self) -> str | None:
        """The other word that its field `preload` may hold; None if there is none."""
        return None

    def other_preload(self, tau_e: FloatArray, stiffness: FloatArray, q: FloatArray) -> BoolArray:  # noqa: ARG002
        """Where the other branch that the mechanism may be told to take would reach the stiffness."""
        return np.zeros(tau_e.shape, dtype=bool)

    def partials(self, phi: FloatArray, s: FloatArray) -> Partials:
        """The potential and its derivatives at deflections and settings, arrays of one shape."""
        raise NotImplementedError(f"{type(self).__name__} depends on more than phi and the setting")

    def state(self, coordinates: FloatArray) -> MechanismState:
        """The springs at coordinates (..., 3): phi, theta_2 and q."""
        return DeflectionState(self.partials(coordinates[..., 0], coordinates[..., 1]))
