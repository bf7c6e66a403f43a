"""The equations of motion of a closed loop, as their text has them."""

from __future__ import annotations

from collections.abc import Sequence

from vsacli.base.arrays import FloatArray
from vsacli.control.simulation.boundaries import Boundary
from vsacli.control.simulation.budget import Budget
from vsacli.control.simulation.closed_loop import ClosedLoop
from vsacli.control.simulation.ending import Ending
from vsacli.control.simulation.equations.stages import Stages


class Equations:
    """What is integrated, and where that ends.

    Args:
        loop: a robot under its controller.
        boundaries: at which a run ends.
        budget: of the run.
    """

    def __init__(self, loop: ClosedLoop, boundaries: Sequence[Boundary], budget: Budget) -> None:
        self.loop, self.boundaries, self.budget = loop, tuple(boundaries), budget

    @property
    def provenance(self) -> dict[str, str]:
        """What to remember of what computes: `engine`, as it may be asked for, `compiler`, `threads`."""
        return {"engine": "numpy", "compiler": "", "threads": "1"}

    def __call__(self, time: float, vectors: FloatArray) -> FloatArray:
        """Time derivatives of state vectors (..., entries) at a time; each state counts."""
        self.budget.used += vectors.size // vectors.shape[-1]
        return self.loop.derivative(time, vectors)

    def torques(self, time: float, vector: FloatArray) -> FloatArray:
        """What a controller that holds its torques asks for, (motors,), in a state that it takes for true."""
        return self.loop.controller_torque(time, vector)

    def stages(
        self, _time: float, _step: float, _vector: FloatArray, _which: Stages, _rates: FloatArray
    ) -> FloatArray | None:
        """Several stages of a step; see `CompiledLoop.stages`. None if they must be computed one by one."""
        return None

    def distance(self, vector: FloatArray) -> float:
        """From a state to the nearest boundary, at most 1."""
        return min((float(each.distance(vector)) for each in self.boundaries), default=1.0)


class Edge:
    """The event of `solve_ivp` at the first boundary.

    Args:
        equations: what is integrated.
    """

    terminal = True
    direction = -1.0

    def __init__(self, equations: Equations) -> None:
        self._equations = equations

    def __call__(self, _time: float, vector: FloatArray) -> float:
        """Distance to the nearest boundary."""
        return self._equations.distance(vector)

    def ending(self, time: float, vector: FloatArray) -> Ending:
        """The end of a run there."""
        reached = min(self._equations.boundaries, key=lambda each: float(each.distance(vector)))
        return reached.ending(time, vector)
