"""Profiles whose values are uncertain by known covariances, as those of recorded signals are."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from vsacli.trajectory.curves.closed_form import ClosedForm


@dataclass(frozen=True)
class Blurred:
    """A formula that is uncertain as if it came from a record.

    Attributes:
        exact: the formula.
        covariances: (components, orders, orders), the same at all times.
    """

    exact: ClosedForm
    covariances: np.ndarray
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    unreliable: tuple[float, float] = (0.0, 0.0)
    known: bool = True
    fit: Any = field(init=False)

    def __post_init__(self) -> None:
        fit = SimpleNamespace(parts=(), components=self.components, unreliable=self.unreliable)
        object.__setattr__(self, "fit", fit)

    @property
    def components(self) -> int:
        return self.exact.components

    @property
    def known_between(self) -> bool:
        return True

    @property
    def breakpoints(self) -> np.ndarray:
        return self.exact.breakpoints

    @property
    def estimate(self) -> Blurred:
        return self

    @property
    def stated(self) -> np.ndarray:
        return np.full(self.components, self.known)

    @property
    def estimated(self) -> tuple[str, ...]:
        return self.exact.signal.names

    def summary(self) -> dict[str, Any]:
        return {}

    def at(self, time: np.ndarray) -> np.ndarray:
        return self.exact.at(time)

    def samples(self, _start: int, _stop: int, time: np.ndarray, /) -> np.ndarray:
        return self.exact.at(time)

    def covariance(self, time: np.ndarray) -> np.ndarray:
        return np.repeat(self.covariances[..., None], len(time), axis=-1)


def random_covariances(seed: int, components: int, sizes: np.ndarray) -> np.ndarray:
    """Covariances of correlated functions of these sizes, (components, orders, orders)."""
    rng = np.random.default_rng(seed)
    roots = rng.standard_normal((components, len(sizes), len(sizes))) * sizes[:, None] / np.sqrt(len(sizes))
    return roots @ np.swapaxes(roots, 1, 2)
