"""A mechanism of one's own: a spring at the end of an arm whose length motor 2 sets, in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsacli import mechanisms


@dataclass(frozen=True)
class AdjustableArm(mechanisms.Mechanism):
    """U = k s^2 phi^2/2: motor 1 turns the arm, motor 2 makes it longer."""

    k: float = mechanisms.number(
        mechanisms.STIFFNESS, "stiffness where theta_2 is 1", check=mechanisms.POSITIVE
    )
    range: tuple[float, float] = mechanisms.interval(
        mechanisms.POSITION, "theta_2 that the arm allows, above zero"
    )

    @classmethod
    def example(cls, joint_type: str) -> dict[str, object]:  # noqa: ARG003
        return {"k": 80, "range": [1, 10]}

    @property
    def setting_range(self) -> tuple[float, float]:
        return self.range

    def partials(self, phi: np.ndarray, s: np.ndarray) -> mechanisms.Partials:
        k, zero = self.k, np.zeros_like(phi)
        return mechanisms.Partials(
            energy=k / 2 * (s * phi) ** 2, setting_torque=k * s * phi**2, setting_stiffness=k * phi**2,
            T=k * s**2 * phi, T_p=k * s**2, T_s=2 * k * s * phi,
            T_pp=zero, T_ps=2 * k * s, T_ss=2 * k * phi,
            T_ppp=zero, T_pps=zero, T_pss=2 * k + zero,
        )  # fmt: skip

    def solve(self, tau_e: np.ndarray, stiffness: np.ndarray, _q: np.ndarray) -> mechanisms.PairSolution:
        low, high = (np.full_like(tau_e, self.k * end**2) for end in self.range)
        demand = np.clip(stiffness, low, high)
        never = np.zeros_like(tau_e, dtype=bool)
        phi, s = tau_e / demand, np.sqrt(demand / self.k)
        return mechanisms.PairSolution(low, high, never, never, never, phi_1=phi, phi_2=s)
