"""Steps of SciPy's DOP853 whose stages are computed together."""

from __future__ import annotations

from functools import cache
from types import FunctionType, MethodType
from typing import Any, NamedTuple

import numpy as np

from vsacli.base.arrays import FloatArray


class Stages(NamedTuple):
    """Stages of an explicit Runge-Kutta method.

    Attributes:
        first, last: those to compute.
        weights: of the rates at the stages before each stage, (stages, stages).
        times: of the stages in shares of the step, (stages,).
    """

    first: int
    last: int
    weights: FloatArray
    times: FloatArray


@cache
def dop853_with_stages() -> Any:
    """SciPy's DOP853, its control of steps and errors, where stages are computed by one call.

    An instance takes a further argument, `stages`, a function as `Equations.stages`: where that gives None,
    SciPy evaluates one stage after the other. SciPy has no hook for that, so its text of a step is carried
    out with another `rk_step` among its names; were there none of that name, nothing but time would be lost.
    """
    from scipy.integrate import DOP853

    scipy: Any = DOP853  # whose stubs leave out what it takes to derive a method
    weights, times = _tableau(scipy)
    end = scipy.n_stages
    step, dense = Stages(1, end, weights, times), Stages(end + 1, len(times) - 1, weights, times)
    text = scipy._step_impl
    one_by_one = text.__globals__.get("rk_step")

    class WithStages(scipy):  # type: ignore[misc]
        def __init__(self, *arguments: Any, stages: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            self._stages = stages
            names = {**text.__globals__, "rk_step": self._rk_step}
            self._step_impl = MethodType(FunctionType(text.__code__, names), self)

        def _rk_step(self, fun: Any, t: Any, y: Any, f: Any, h: Any, *tableau: Any) -> Any:
            """The state at the end of a trial step, and its rates; those at the stages are left in K."""
            self.K[0] = f
            state = self._stages(t, h, y, step, self.K_extended)
            return one_by_one(fun, t, y, f, h, *tableau) if state is None else (state, self.K[-1].copy())

        def _dense_output_impl(self) -> Any:
            found = self._stages(self.t_old, self.h_previous, self.y_old, dense, self.K_extended)
            self.A_EXTRA = scipy.A_EXTRA if found is None else scipy.A_EXTRA[:0]  # what is left to SciPy
            return super()._dense_output_impl()

    return WithStages


def _tableau(method: Any) -> tuple[FloatArray, FloatArray]:
    """Weights and times of all stages: of the step, of its end, and of dense output."""
    end = method.n_stages
    weights = np.zeros((end + 1 + len(method.A_EXTRA),) * 2)
    weights[:end, :end], weights[end, :end], weights[end + 1 :] = method.A, method.B, method.A_EXTRA
    return weights, np.array([*method.C, 1.0, *method.C_EXTRA])
