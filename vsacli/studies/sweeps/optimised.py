"""What a study optimises in each run: stiffness or timing of its trajectory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vsacli.base import units
from vsacli.base.arrays import FloatArray
from vsacli.base.errors import FieldProblem
from vsacli.base.flags import NEAR_SINGULAR_MARGIN, SINGULAR_MARGIN
from vsacli.base.units import Quantity
from vsacli.documents.fields import Check, check_fields, choice, integer, value
from vsacli.documents.kinds.shares import Share
from vsacli.robot.model import Robot
from vsacli.studies.sweeps.kept import JOINT
from vsacli.trajectory.trajectory import Trajectory

if TYPE_CHECKING:
    from vsacli.studies.optimisation.optimum import JointOptimum, Optimum, TimingOptimum

TIME, STIFFNESS, TIMING = "time", "stiffness", "timing"
MINIMIZED = ("torque", "energy", "copper", "peak", TIME)
VARIED = (STIFFNESS, TIMING, "both")
"""The words of `vsacli optimize`; with the optimisation itself they would take long to load."""

_MARGIN = Check(
    lambda share: SINGULAR_MARGIN < share < 1,
    "above 0 and below 1",
    {"exclusiveMinimum": 0, "exclusiveMaximum": 1},
)
_SEED = Check(lambda number: number >= 0, "zero or more", {"minimum": 0})


class Cost(NamedTuple):
    """A cost of each run: name in the table, dimensions after `run`, unit, a few words, and where it is."""

    name: str
    dims: tuple[str, ...]
    quantity: Quantity
    long_name: str
    of: Callable[[JointOptimum | TimingOptimum], float]

    def shape(self, joints: int) -> tuple[int, ...]:
        """Of its values in one run."""
        return (joints,)[: len(self.dims)]

    def values(self, optimum: Optimum) -> FloatArray:
        """Its values in a run; NaN of joints for which nothing is chosen."""
        if optimum.timing is not None:
            return np.array([self.of(optimum.timing)])
        found = map(optimum.joints.get, optimum.robot.joint_names)
        return np.array([np.nan if joint is None else self.of(joint) for joint in found])


@dataclass(frozen=True)
class Optimised:
    """What is optimised, by names and defaults of the options of `vsacli optimize`."""

    minimize: str = choice(
        MINIMIZED,
        "rms of the motor torques, energy that the motors spend, heat of their windings, largest of the "
        "motor torques, or duration",
        default="torque",
    )
    vary: str | None = choice(
        VARIED, "what may change: by default the stiffness, for time the timing", default=None
    )
    margin: float = value(
        Share(),
        "relative margin that every step shall keep to the ends of its corridor",
        check=_MARGIN,
        default=NEAR_SINGULAR_MARGIN,
    )
    seed: int = integer("of the starts that are drawn", check=_SEED, default=0)

    def __post_init__(self) -> None:
        check_fields(self, *self._problems())

    def _problems(self) -> list[FieldProblem]:
        if (self.minimize, self.vary) == (TIME, STIFFNESS):
            return [FieldProblem(("vary",), "for the sake of time it is `timing` or `both` that varies")]
        return []

    @property
    def varied(self) -> str:
        """What varies."""
        return self.vary or (TIMING if self.minimize == TIME else STIFFNESS)

    def optimum(self, robot: Robot, trajectory: Trajectory) -> Optimum:
        """That of a run.

        Raises:
            InputError: what is asked cannot be asked of this robot and trajectory.
        """
        from vsacli.studies.optimisation import optimize

        return optimize(robot, trajectory, self.minimize, self.varied, margin=self.margin, seed=self.seed)

    @property
    def costs(self) -> tuple[Cost, Cost]:
        """What the table says of it."""
        dims, quantity, words = self._cost
        return (
            Cost("cost_before", dims, quantity, f"{words} as commanded", lambda found: found.before),
            Cost("cost_after", dims, quantity, f"{words} of the optimum", lambda found: found.after),
        )

    @property
    def _cost(self) -> tuple[tuple[str, ...], Quantity, str]:
        """Dimensions after `run`, unit and words of what is minimised."""
        if self.minimize == TIME:
            return (), units.TIME, "duration"
        from vsacli.studies.optimisation.criteria import CRITERIA

        return JOINT, CRITERIA[self.minimize].quantity, CRITERIA[self.minimize].words
