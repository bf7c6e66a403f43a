"""Springs of several joints in a row: all that obey one law are evaluated at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from vsacli.actuators.laws.law import SpringLaw
from vsacli.actuators.laws.state import SpringState
from vsacli.base.arrays import FloatArray


class SpringRows:
    """Equally many springs at each joint; deflections and their functions are (..., joints, springs)."""

    def __init__(self, laws: Sequence[Sequence[SpringLaw]]) -> None:
        self._alike = list(_alike([law for of_joint in laws for law in of_joint]))

    def torque(self, phi: FloatArray) -> FloatArray:
        """Torque of each spring."""
        return self._each(phi, lambda law, part: (law.torque(part),))[0]

    def energy(self, phi: FloatArray) -> FloatArray:
        """Energy of each spring."""
        return self._each(phi, lambda law, part: (law.energy(part),))[0]

    def state(self, phi: FloatArray) -> SpringState:
        """State of each spring."""
        return SpringState(*self._each(phi, lambda law, part: law.state(part)))

    def _each(
        self, phi: FloatArray, values: Callable[[SpringLaw, FloatArray], Sequence[FloatArray]]
    ) -> Sequence[FloatArray]:
        """What each spring's law makes of its deflection."""
        if len(self._alike) == 1:
            return values(self._alike[0][0], phi)
        flat = phi.reshape(*phi.shape[:-2], -1)
        parts = [(members, values(law, flat[..., members])) for law, members in self._alike]
        merged = [np.empty_like(flat) for _ in parts[0][1]]
        for members, of_law in parts:
            for whole, part in zip(merged, of_law, strict=True):
                whole[..., members] = part
        return [whole.reshape(*phi.shape) for whole in merged]


def _alike(laws: list[SpringLaw]) -> Iterator[tuple[SpringLaw, list[int]]]:
    """Each distinct law, with the springs that obey it."""
    distinct: list[SpringLaw] = []
    for law in laws:
        if law not in distinct:
            distinct.append(law)
            yield law, [index for index, other in enumerate(laws) if other == law]
